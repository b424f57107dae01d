"""What one slide says about the ratio S_r / sigma'_v0: a likelihood of its logarithm.

A slide that ran gives draws of its posterior, each weighed by one over its prior density, or the
Gaussian of a back-analysis. A slope that stood gives a bound: the probability that it stands at a
ratio r is Phi((ln r - ln c) / s), c the least ratio at which nothing runs. Either is widened until
it is as wide as the range that the verdict on the model has been worth. Of several strengths of one
slide the geometric mean counts, since what differs within a slide is no scatter between slides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import ndtr

from inversion.back_analysis.result import FILE_NAME as RESULT
from inversion.back_analysis.result import (
    MeasurementAnswer,
    ParameterAnswer,
    Result,
    load_result,
)
from inversion.joint.document import Kind
from inversion.posterior.document import FILE_NAME as POSTERIOR
from inversion.posterior.document import (
    PosteriorDocument,
    PredictedNumber,
    UnknownAnswer,
    load_posterior,
)
from inversion.posterior.draws import Draws, key, load_draws
from inversion.posterior.runs import stress_name
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO
from pipeline.cli import InputError

STRENGTHS = (RESIDUAL_STRENGTH, STRENGTH_RATIO)
#: Draws of a posterior that are kept; a smooth density needs no more.
KERNELS = 200
#: Relations whose likelihood is computed at a time: what a processor holds close by.
BLOCK = 2048
#: Standard deviations of a normal distribution on either side of the middle, of 90 %.
NINE_OF_TEN = 1.645
#: Least share of the largest prior density that a draw is divided by: beyond, the prior's tails
#: would decide.
LEAST_DENSITY = 0.02


@dataclass(frozen=True)
class BlowCountOfSlide:
    """Blow count of the zones that liquefied.

    Attributes:
        value: mean over the zones.
        std: standard deviation between the zones, at least that of one boring.
        recalled: some of it is known from memory alone: it enters no regression.
    """

    value: float
    std: float
    recalled: bool


@dataclass(frozen=True)
class SlideEvidence:
    """A likelihood of ln r, r the ratio S_r / sigma'_v0 of one slide.

    Attributes:
        case: name of the case.
        title: of it, in words.
        kind: slide: it ran; bound: it stood; undetermined: the data say nothing of its strength;
            recalled: it rests on numbers that are known from memory alone, and does not enter.
        centres: of the Gaussians that make up the likelihood, ln r, (k,); of a bound ln c, (1,).
        weights: of them, (k,), sum 1.
        std: standard deviation of each Gaussian, or of the bound, in ln r.
        formal_std: that of the slide's own interval, before the error of the model, in ln r.
        source: file that it was read from.
        zones: of the scene whose strength it is.
        sigma_v0_kpa: mean vertical effective stress before failure of these zones [kPa].
        blow_count: None: none is at hand.
        weight: quality, 1 or less: the variance of the evidence is divided by it.
        verdict: on the model of the slide; empty: no diagnosis was made.
        factor: within which the strength lay in nine of ten slides with that verdict.
        doubt: of a bound: probability that the zone that liquefied is another, so that it says
            nothing.
        drawn: its section was drawn; else it is known by a few numbers.
        fitted: names of the measurements that it was fitted to.
        recalled: names of numbers it rests on that are known from memory alone.
    """

    case: str
    title: str
    kind: Kind
    centres: np.ndarray
    weights: np.ndarray
    std: float
    formal_std: float
    source: str
    zones: tuple[str, ...]
    sigma_v0_kpa: float
    blow_count: BlowCountOfSlide | None = None
    weight: float = 1.0
    verdict: str = ""
    factor: float = 1.0
    doubt: float = 0.0
    drawn: bool = True
    fitted: tuple[str, ...] = ()
    recalled: tuple[str, ...] = ()

    @property
    def tells(self) -> bool:
        """It says something of the relation."""
        return self.kind in ("slide", "bound")

    @property
    def mean(self) -> float:
        """Mean of ln r; of a bound ln c."""
        return float(self.weights @ self.centres)

    @property
    def log_std(self) -> float:
        """Standard deviation of ln r as it enters."""
        spread = self.weights @ (self.centres - self.mean) ** 2
        return float(np.sqrt(spread + self.std**2))

    def widened(self, factor: float, verdict: str = "") -> SlideEvidence:
        """With the error of the model: nine of ten strengths lay within `factor`, 1 or more."""
        range_std = np.log(factor) / NINE_OF_TEN
        added = max(range_std**2 - self.log_std**2, 0.0)
        std = float(np.sqrt(self.std**2 + added))
        return replace(self, std=std, factor=factor, verdict=verdict)

    def weighed(self, weight: float) -> SlideEvidence:
        """With a quality weight, in (0, 1]: its variance is divided by it."""
        root = np.sqrt(weight)
        centres = self.mean + (self.centres - self.mean) / root
        return replace(self, centres=centres, std=float(self.std / root), weight=weight)

    def likelihood(self, mean: np.ndarray, std: np.ndarray) -> np.ndarray:
        """Probability density of the evidence where ln r is normal.

        Args:
            mean: of ln r, any shape.
            std: of ln r, broadcast with `mean`.

        Returns:
            in the common shape; 1 where the slide says nothing.
        """
        mean, std = np.broadcast_arrays(np.asarray(mean, float), np.asarray(std, float))
        if not self.tells:
            return np.ones(mean.shape)
        width = np.hypot(std, self.std)
        if self.kind == "bound":
            return self.doubt + (1.0 - self.doubt) * ndtr((mean - self.centres[0]) / width)
        found, means, widths = np.empty(mean.size), mean.ravel()[:, None], width.ravel()[:, None]
        for start in range(0, mean.size, BLOCK):
            block = slice(start, start + BLOCK)
            scores = (self.centres - means[block]) / widths[block]
            found[block] = np.exp(-0.5 * scores**2) @ self.weights
        return found.reshape(mean.shape) / (np.sqrt(2.0 * np.pi) * width)

    def quantiles(self, shares: Sequence[float]) -> np.ndarray:
        """Of the ratio by this slide alone, all ln ratios alike before, (n,)."""
        ends = self.centres.min() - 5.0 * self.std, self.centres.max() + 5.0 * self.std
        places = np.linspace(*ends, 4001)
        below = ndtr((places[:, None] - self.centres) / self.std) @ self.weights
        return np.exp(np.interp(shares, below, places))


def evidence_of(folder: str | Path, command: str, *, drawn: bool = True) -> SlideEvidence:
    """What the results of a case say.

    Args:
        folder: of its results, with `posterior/` or `inversion/`. A bound is read from the latter.
        command: that makes them, for the message.
        drawn: the section was drawn; else the posterior counts alone, as a back-analysis knows
            the median section only.

    Raises:
        InputError: neither is there, or one that cannot be used; one line.
    """
    fit, posterior = Path(folder) / "inversion", Path(folder) / "posterior"
    if drawn and (fit / RESULT).is_file():
        result = load_result(fit)
        bounds = [p for p in result.answer.parameters if p.ratio_lower_bound_95 is not None]
        if bounds or not (posterior / POSTERIOR).is_file():
            return from_result(result, str(fit / RESULT))
    if not (posterior / POSTERIOR).is_file():
        raise InputError(f"{folder}: holds no answer; `{command}` makes one")
    document = load_posterior(posterior)
    fitted = [one for one in document.numbers if one.role == "fitted"]
    if fitted and all(one.censored for one in fitted):
        raise InputError(
            f"{posterior}: nothing ran, and a bound is read from a back-analysis; "
            f"`{command}` makes it"
        )
    found = from_draws(document, load_draws(posterior), str(posterior / POSTERIOR))
    return replace(found, drawn=drawn)


def from_result(result: Result, source: str) -> SlideEvidence:
    """The Gaussian of a back-analysis, or a bound.

    Args:
        result: of a back-analysis.
        source: its file.

    Raises:
        InputError: no strength with a ratio, or one with a prior, which would count twice.
    """
    strengths = [p for p in result.answer.parameters if p.property in STRENGTHS and p.ratio]
    if not strengths:
        raise InputError(f"{source}: no residual strength with a stress to be divided by")
    for one in strengths:
        if one.has_prior:
            raise InputError(
                f"{source}: {one.name} has a prior, which would count twice; `flowslide posterior "
                f"{result.case}` gives draws from which it is divided out"
            )
    bounds = [one for one in strengths if one.ratio_lower_bound_95 is not None]
    known = bounds or [one for one in strengths if one.determined and one.at_bound is None]
    kind: Kind = "bound" if bounds else "slide" if known else "undetermined"
    mean, std = _together(known or strengths, _correlation(result, known or strengths))
    stress = float(np.mean([one.sigma_v0_kpa or np.nan for one in known or strengths]))
    return SlideEvidence(
        result.case,
        result.title,
        kind,
        np.array([mean]),
        np.ones(1),
        std,
        std,
        source,
        _zones(known or strengths),
        stress,
        fitted=_fitted(result.measurements),
    )


def from_draws(document: PosteriorDocument, draws: Draws, source: str) -> SlideEvidence:
    """The draws of a posterior, each weighed by one over its prior density.

    Raises:
        InputError: no strength with a stress to be divided by.
    """
    strengths = [one for one in document.parameters if one.property in STRENGTHS and one.ratio]
    if not strengths:
        raise InputError(f"{source}: no residual strength with a stress to be divided by")
    after = np.mean([_log_draws(draws, one, prior=False) for one in strengths], axis=0)
    before = np.mean([_log_draws(draws, one, prior=True) for one in strengths], axis=0)
    kernels = np.quantile(after, (np.arange(KERNELS) + 0.5) / KERNELS)
    density = _density(before, kernels)
    weights = 1.0 / np.maximum(density, LEAST_DENSITY * density.max())
    weights /= weights.sum()
    mean = weights @ kernels
    formal = float(np.sqrt(weights @ (kernels - mean) ** 2))
    # The width of Silverman (1986) for so many draws as count.
    effective = 1.0 / np.sum(weights**2)
    std = 0.9 * formal * effective**-0.2
    return SlideEvidence(
        document.case,
        document.title,
        "slide",
        kernels,
        weights,
        std,
        formal,
        source,
        _zones(strengths),
        float(np.mean([_stress(one) for one in strengths])),
        fitted=_fitted(document.numbers),
    )


def _density(draws: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Density of draws (s,) at places (k,), mirrored at their ends: a prior may stop at a bound."""
    from scipy.stats import gaussian_kde  # takes half a second to import

    smooth = gaussian_kde(draws)
    return smooth(places) + smooth(2.0 * draws.min() - places) + smooth(2.0 * draws.max() - places)


def _zones(strengths: Sequence[ParameterAnswer] | Sequence[UnknownAnswer]) -> tuple[str, ...]:
    return tuple(zone for one in strengths for zone in one.zones)


def _fitted(numbers: Sequence[MeasurementAnswer] | Sequence[PredictedNumber]) -> tuple[str, ...]:
    """Names of the measurements that were fitted."""
    found = (one.group or one.name for one in numbers if one.role == "fitted")
    return tuple(dict.fromkeys(found))


def _stress(one: UnknownAnswer) -> float:
    """sigma'_v0 [kPa], by the medians of the strength and of the ratio."""
    strength = one.after if one.strength_kpa is None else one.strength_kpa
    return float("nan") if one.ratio is None else strength.median / one.ratio.median


def _together(strengths: Sequence[ParameterAnswer], correlation: np.ndarray) -> tuple[float, float]:
    """Mean of ln ratio over strengths and its standard deviation.

    Args:
        strengths: p of them.
        correlation: of the survey's errors, (p, p). All other errors, such as those of the section,
            are taken to move all strengths together, which is on the safe side.
    """
    share = np.full(len(strengths), 1.0 / len(strengths))
    logs, totals, surveys = np.array([_logs(one) for one in strengths]).T
    surveys = np.minimum(surveys, totals)
    others = np.sqrt(totals**2 - surveys**2)
    variance = share @ (correlation * np.outer(surveys, surveys)) @ share + (share @ others) ** 2
    return float(share @ logs), float(np.sqrt(variance))


def _logs(one: ParameterAnswer) -> tuple[float, float, float]:
    """Logarithm of the ratio, its standard deviation, the part of the survey's errors in it."""
    if one.ratio is None or one.ratio_std is None:
        raise ValueError(f"{one.name}: has no ratio")
    return float(np.log(one.ratio)), one.ratio_std / one.ratio, one.std_data / one.value


def _correlation(result: Result, chosen: Sequence[ParameterAnswer]) -> np.ndarray:
    names = result.answer.correlation.names
    places = [names.index(one.name) for one in chosen]
    return np.array(result.answer.correlation.matrix)[np.ix_(places, places)]


def _log_draws(draws: Draws, one: UnknownAnswer, *, prior: bool) -> np.ndarray:
    """Ln of the ratio, (s,)."""
    values = (draws.prior if prior else draws.posterior)[:, draws.unknowns.index(key(one.name))]
    if one.property == STRENGTH_RATIO:
        return np.log(values)
    numbers = draws.prior_predictive if prior else draws.posterior_predictive
    return np.log(values / numbers[:, draws.numbers.index(key(stress_name(one.name)))])
