"""The unknowns of one model: its parameters and the amplitudes of the effects it has.

x = [theta, a / unit]: parameters as `inversion.problem.parameters` fits them (strengths as
logarithms, each divided by what was known of it beforehand), then amplitudes in units of a middle
rung of their ladder. Priors are rows P x = P0, each of standard deviation 1: those of the
back-analysis (`inversion.estimation.objective`: priors, angles within their bounds, ratios of
several free strengths) and the amplitudes' own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from diagnosis.hypotheses.model import Candidate, State, state
from inversion.estimation.objective import Objective
from inversion.problem.parameters import Parameters
from inversion.problem.predictions import Targets

#: Standard deviation of an amplitude of which nothing else is known, in top rungs of its ladder.
WIDE = 2.0
#: Least share of a prior within its bounds: one that lies wholly outside is an error of its author.
LEAST_WITHIN = 1e-6


@dataclass(frozen=True)
class Amplitude:
    """One effect of a model as an unknown.

    Attributes:
        name: of the effect.
        low: lower bound of the amplitude.
        high: upper bound of the amplitude.
        unit: amplitude that counts as 1 in x.
        mean: most likely amplitude beforehand; None: any between the bounds.
        std: its standard deviation; None with `mean`.
    """

    name: str
    low: float
    high: float
    unit: float
    mean: float | None = None
    std: float | None = None

    @property
    def ln_prior_width(self) -> float:
        """Logarithm of the prior's volume: ln prior density = -this - (x - x0)^2 / 2.

        A Gaussian that is cut off at the bounds has the volume that lies within them.
        """
        if self.std is not None:
            low, high = ((bound - self.mean) / self.std for bound in (self.low, self.high))
            within = max(float(ndtr(high) - ndtr(low)), LEAST_WITHIN)
            return math.log(math.sqrt(2.0 * math.pi) * within * self.std / self.unit)
        return math.log((self.high - self.low) / self.unit)


def amplitude_of(candidate: Candidate, prior: tuple[float, float] | None = None) -> Amplitude:
    """The amplitude of a candidate; `prior` (mean, std) replaces its own.

    Of one without a prior the ladder says what is small and what is large: a Gaussian around none,
    `WIDE` times the top rung wide, cut off at the bounds. Bounds alone would not do: they are what
    the solver can bear, and an effect would gain or lose evidence by how far that is.
    """
    mean, std = prior if prior is not None else (candidate.prior_mean, candidate.prior_std)
    rungs = sorted(abs(rung) for rung in candidate.ladder)
    middle = rungs[len(rungs) // 2]
    if std is None:
        mean, std = 0.0, WIDE * rungs[-1]
    return Amplitude(candidate.name, candidate.low, candidate.high, middle, mean, std)


@dataclass(frozen=True)
class Space:
    """The unknowns x (q,) of a model with some effects.

    Attributes:
        parameters: what is calibrated, p of them.
        targets: the measurements, for the priors of the back-analysis.
        effects: amplitudes that are unknown, q - p of them.
        fixed: parameters that stay where they are, by place; their column is left out of a fit.
    """

    parameters: Parameters
    targets: Targets
    effects: tuple[Amplitude, ...] = ()
    fixed: tuple[int, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameters.specs)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.p + len(self.effects)

    @cached_property
    def low(self) -> np.ndarray:
        """Lower bounds of x, (q,)."""
        amplitudes = [effect.low / effect.unit for effect in self.effects]
        return np.concatenate([self.parameters.fitted_low, amplitudes])

    @cached_property
    def high(self) -> np.ndarray:
        """Upper bounds of x, (q,)."""
        amplitudes = [effect.high / effect.unit for effect in self.effects]
        return np.concatenate([self.parameters.fitted_high, amplitudes])

    @cached_property
    def free(self) -> np.ndarray:
        """(q,) bool: may change in a fit."""
        free = np.ones(self.size, dtype=bool)
        free[list(self.fixed)] = False
        return free

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (r, q) and constants (r,): rows @ x - constants is noise of variance 1."""
        rows, constants = Objective(
            self.parameters, self.targets, "misfit", tolerance=1.0
        ).regularisation
        # Deviations from a mean are one row too many; an equal set has as many rows as its rank.
        left, size, right = np.linalg.svd(rows, full_matrices=False)
        kept = size > 1e-9
        rows, constants = size[kept, None] * right[kept], left.T[kept] @ constants
        blocks = [np.hstack([rows, np.zeros((len(rows), len(self.effects)))])]
        totals = [constants]
        for place, effect in enumerate(self.effects):
            if effect.std is not None:
                row = np.zeros((1, self.size))
                row[0, self.p + place] = effect.unit / effect.std
                blocks.append(row)
                totals.append(np.array([effect.mean / effect.std]))
        return np.concatenate(blocks), np.concatenate(totals)

    @property
    def ln_prior_width(self) -> float:
        """Logarithm of the volume of the amplitudes' priors, in x."""
        return float(sum(effect.ln_prior_width for effect in self.effects))

    def values(self, x: np.ndarray) -> np.ndarray:
        """Parameters in outside units, (p,)."""
        return self.parameters.to_values(x[: self.p])

    def amplitudes(self, x: np.ndarray) -> dict[str, float]:
        """Amplitudes by name."""
        return {
            effect.name: float(share * effect.unit)
            for effect, share in zip(self.effects, x[self.p :], strict=True)
        }

    def state(self, x: np.ndarray, *, seed: int = 0) -> State:
        """The forward run at x."""
        return state(self.values(x), self.amplitudes(x), seed=seed)

    def clipped(self, x: np.ndarray) -> np.ndarray:
        """Unknowns x moved into the bounds."""
        return np.clip(x, self.low, self.high)

    def per_unit(self, x: np.ndarray) -> np.ndarray:
        """Derivative of values and amplitudes by x, (q,): turns a std of x into outside units."""
        slopes = self.parameters.value_per_fitted(self.values(x))
        return np.concatenate([slopes, [effect.unit for effect in self.effects]])

    def with_effects(self, effects: Sequence[Amplitude]) -> Space:
        """The same parameters with these effects in place of its own."""
        return Space(self.parameters, self.targets, tuple(effects), self.fixed)
