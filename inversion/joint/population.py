"""The hierarchical model: the ratios of slides scatter about one relation.

    ln r_i ~ normal(mu + b (N_i - N_mean), tau),

r the ratio S_r / sigma'_v0, N the blow count N1,60. A slide enters by its likelihood
(`evidence.py`), so what is unknown of r_i is integrated in closed form. Priors: mu uniform between
the logarithms of `RATIOS`, tau half-normal with `TAU_STD`, b normal with `SLOPE_STD` about 0.

Two or three unknowns are integrated on a grid here: leaving out, comparing and calibrating take
hundreds of posteriors. `infer.py` draws by nested sampling; a test holds both together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import erf, ndtri

from inversion.joint.evidence import SlideEvidence

#: Ratios between which the median of the relation lies: beyond the lowest and highest that any
#: flow slide or relation has.
RATIOS = (0.02, 1.0)
#: Of the half-normal prior of the scatter: a factor 1.65.
TAU_STD = 0.5
#: Prior of the slope per blow: published relations have 0.06 to 0.11.
SLOPE_STD = 0.1
#: Standard deviation of a blow count that is not at hand, about the mean of the others [blows].
UNKNOWN_COUNT_STD = 5.0
MU_CELLS, TAU_CELLS, SLOPE_CELLS = 81, 48, 41
#: Largest tau and slope of the grid, in standard deviations of the priors.
FARTHEST = 4.0


@dataclass(frozen=True)
class Hyperparameters:
    """Values of the unknowns; arrays of one shape, or numbers.

    Attributes:
        mu: ln of the median ratio, at the mean blow count.
        tau: standard deviation of ln r between slides.
        slope: change of ln r per blow; None: the relation has none.
    """

    mu: np.ndarray
    tau: np.ndarray
    slope: np.ndarray | None = None


def mean_count(slides: Sequence[SlideEvidence]) -> float | None:
    """Mean blow count of the slides that have one that was read; None: none has."""
    counts = [one.blow_count.value for one in slides if one.blow_count and asked_of(one)]
    return float(np.mean(counts)) if counts else None


def asked_of(slide: SlideEvidence) -> bool:
    """The slide can tell of a slope: its strength is known, and its blow count was read."""
    count = slide.blow_count
    return slide.tells and count is not None and not count.recalled


def log_likelihoods(slides: Sequence[SlideEvidence], relation: Hyperparameters) -> np.ndarray:
    """Ln of the likelihood of each slide, (n, ...) with the shape of the relation's values."""
    middle = mean_count(slides)
    rows = []
    for slide in slides:
        mean, std = relation.mu, relation.tau
        if relation.slope is not None:
            offset, count_std = 0.0, UNKNOWN_COUNT_STD
            if asked_of(slide) and slide.blow_count is not None and middle is not None:
                offset, count_std = slide.blow_count.value - middle, slide.blow_count.std
            mean = mean + relation.slope * offset
            std = np.hypot(std, relation.slope * count_std)
        rows.append(np.log(np.maximum(slide.likelihood(mean, std), 1e-300)))
    return np.array(rows).reshape((len(slides), *np.shape(relation.mu)))


def at_shares(shares: np.ndarray) -> Hyperparameters:
    """The relation at a point of the unit cube of the prior, (2,) or with a slope (3,)."""
    low, high = np.log(RATIOS)
    slope = SLOPE_STD * ndtri(shares[2]) if len(shares) > 2 else None
    return Hyperparameters(
        mu=low + (high - low) * shares[0], tau=TAU_STD * ndtri(0.5 + 0.5 * shares[1]), slope=slope
    )


@dataclass(frozen=True)
class PriorGrid:
    """Cells of the prior: equal steps of mu, tau and slope, the prior's mass in each."""

    slope: bool = False

    @cached_property
    def axes(self) -> list[np.ndarray]:
        """Middles of the cells of mu, tau and, where it is asked, the slope."""
        return [0.5 * (edges[1:] + edges[:-1]) for edges in self._edges]

    @cached_property
    def relation(self) -> Hyperparameters:
        """The unknowns on the grid."""
        found = np.meshgrid(*self.axes, indexing="ij")
        return Hyperparameters(found[0], found[1], found[2] if self.slope else None)

    @cached_property
    def log_prior(self) -> np.ndarray:
        """Ln of the prior's mass of each cell; their sum is 1."""
        mu, tau, *rest = self._edges
        masses = [np.diff(mu) / (mu[-1] - mu[0]), np.diff(erf(tau / TAU_STD / np.sqrt(2.0)))]
        masses += [np.diff(erf(edges / SLOPE_STD / np.sqrt(2.0))) for edges in rest]
        found = np.log(masses[0] / masses[0].sum())
        for mass in masses[1:]:
            found = np.add.outer(found, np.log(mass / mass.sum()))
        return found

    @cached_property
    def _edges(self) -> list[np.ndarray]:
        low, high = np.log(RATIOS)
        edges = [
            np.linspace(low, high, MU_CELLS + 1),
            # Finer near 0, where the likelihood of slides that agree has its peak.
            FARTHEST * TAU_STD * np.linspace(0.0, 1.0, TAU_CELLS + 1) ** 1.5,
        ]
        if self.slope:
            end = FARTHEST * SLOPE_STD
            edges.append(np.linspace(-end, end, SLOPE_CELLS + 1))
        return edges

    def posterior(self, slides: Sequence[SlideEvidence]) -> GridPosterior:
        """The posterior by these slides."""
        return self.weighed(log_likelihoods(slides, self.relation).sum(axis=0))

    def weighed(self, log_likelihood: np.ndarray) -> GridPosterior:
        """The posterior with this ln likelihood on the grid."""
        joint = self.log_prior + log_likelihood
        top = float(joint.max())
        mass = np.exp(joint - top)
        return GridPosterior(self, mass / mass.sum(), top + float(np.log(mass.sum())))


@dataclass(frozen=True)
class GridPosterior:
    """A posterior on a grid.

    Attributes:
        grid: its cells.
        mass: probability of each cell.
        log_evidence: ln of the probability density of the slides.
    """

    grid: PriorGrid
    mass: np.ndarray
    log_evidence: float

    def quantiles(self, axis: int, shares: Sequence[float] | np.ndarray) -> np.ndarray:
        """Quantiles of mu (0), tau (1) or the slope (2)."""
        edges = self.grid._edges[axis]
        return np.interp(shares, self._cumulated(axis), edges)

    def share_below(self, axis: int, value: float) -> float:
        """Probability that mu (0), tau (1) or the slope (2) is less than a value."""
        return float(np.interp(value, self.grid._edges[axis], self._cumulated(axis)))

    def mean(self, values: np.ndarray) -> float:
        """Expectation of values on the grid."""
        return float(np.sum(self.mass * values))

    def _cumulated(self, axis: int) -> np.ndarray:
        others = tuple(k for k in range(self.mass.ndim) if k != axis)
        return np.concatenate([[0.0], np.cumsum(self.mass.sum(axis=others))])


def predicted_probability(
    slide: SlideEvidence, others: Sequence[SlideEvidence], grid: PriorGrid | None = None
) -> float:
    """Density of a slide's evidence by the relation of the others; of a bound that it stands."""
    chosen = grid or PriorGrid()
    found = chosen.posterior(others)
    return found.mean(np.exp(log_likelihoods([slide], chosen.relation)[0]))
