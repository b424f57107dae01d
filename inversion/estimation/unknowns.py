"""The unknowns of a fit: parameters and amplitudes of effects, and what is known beforehand.

Strengths and densities are fitted as logarithms, friction angles as they are. Every fitted number
is then divided by what was known of it beforehand, so that a step of one means the same for each:
the prior's standard deviation, or the width of the bounds / sqrt(12) (all values between them
equally likely) where no prior is given. Amplitudes are counted in units of a middle rung of their
ladder, or in decades (`inversion.problem.unknown.Scale`):

    x = [fitted parameters, amplitude / unit].

What is known beforehand are rows P x = P0, each with an error of standard deviation 1:

- *priors*: (value - mean) / std, of the logarithm for strengths; of amplitudes as they are.
- *preferences*, which choose among answers that fit equally well and do nothing else: friction
  angles without a prior stay near their first guess (std: width of the bounds / sqrt(12)); several
  strengths without a prior keep the ratios of their first guesses (to a factor of e), whatever
  their level. A single strength without a prior has none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import helmert

from geometry.scenes.scene import Scene
from inversion.problem.question import STRENGTH_RATIO, STRENGTHS, ParameterSpec
from inversion.problem.scene_changes import pool_at, with_properties
from inversion.problem.state import State, simulated, state
from inversion.problem.unknown import Unknown, unknown_parameter

#: Spread of the logarithm of strength ratios that the preference for the first guesses allows.
RATIO_STD = 1.0


@dataclass(frozen=True)
class Parameters:
    """The parameters to find, p of them, and their transform.

    `values` are in outside units, (p,); `fitted` are the scaled numbers of the fit, (p,).
    """

    specs: list[ParameterSpec]

    @property
    def names(self) -> list[str]:
        """Names in the question's order."""
        return [spec.name for spec in self.specs]

    @cached_property
    def unknowns(self) -> list[Unknown]:
        """Each with its scale and its prior, (p,)."""
        return [unknown_parameter(spec) for spec in self.specs]

    @cached_property
    def logarithmic(self) -> np.ndarray:
        """(p,) bool: fitted as logarithms."""
        return np.array([one.logarithmic for one in self.unknowns], dtype=bool)

    @property
    def strengths(self) -> np.ndarray:
        """(p,) bool: residual strengths, strength ratios and cohesions."""
        return np.array([spec.property in STRENGTHS for spec in self.specs])

    def per_ratio(self, sigma_v0_kpa: np.ndarray) -> np.ndarray:
        """What a value is divided by to be a ratio S_r / sigma'_v0, (p,): [kPa], or 1 of a ratio.

        Args:
            sigma_v0_kpa: mean vertical effective stress before failure of each parameter's zones,
                (p,) [kPa]; NaN where it is no strength.
        """
        own = np.array([spec.property == STRENGTH_RATIO for spec in self.specs])
        return np.where(own & np.isfinite(sigma_v0_kpa), 1.0, sigma_v0_kpa)

    @property
    def has_prior(self) -> np.ndarray:
        """(p,) bool: the question gives a prior."""
        return np.array([one.normal is not None for one in self.unknowns], dtype=bool)

    @property
    def start(self) -> np.ndarray:
        """First guess, values (p,)."""
        return np.array([spec.start for spec in self.specs])

    @property
    def low(self) -> np.ndarray:
        """Lower bounds, values (p,)."""
        return np.array([spec.low for spec in self.specs])

    @property
    def high(self) -> np.ndarray:
        """Upper bounds, values (p,)."""
        return np.array([spec.high for spec in self.specs])

    @cached_property
    def prior_std(self) -> np.ndarray:
        """Standard deviation before the data, in the logarithm or the unit of the fit, (p,)."""
        return np.array([one.std for one in self.unknowns])

    @property
    def prior_mean(self) -> np.ndarray:
        """Most likely values before the data (p,): of the prior, else the first guess."""
        priors = (spec.prior for spec in self.specs)
        means = [None if prior is None else prior.mean for prior in priors]
        return np.array(
            [start if mean is None else mean for start, mean in zip(self.start, means, strict=True)]
        )

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (r, p) and constants (r,): rows @ fitted - constants is noise of variance 1."""
        p = len(self.specs)
        free = self.logarithmic & ~self.has_prior
        mean = self.to_fitted(self.prior_mean)
        rows, constants = [np.eye(p)[~free]], [mean[~free]]
        if free.sum() >= 2:
            # Deviations of ln(value / first guess) from their mean, one row fewer than values.
            weight = np.zeros((int(free.sum()) - 1, p))
            weight[:, free] = helmert(int(free.sum())) * self.prior_std[free] / RATIO_STD
            rows.append(weight)
            constants.append(weight @ self.to_fitted(self.start))
        return np.concatenate(rows), np.concatenate(constants)

    @property
    def fitted_low(self) -> np.ndarray:
        """Lower bounds, fitted (p,)."""
        return self.to_fitted(self.low)

    @property
    def fitted_high(self) -> np.ndarray:
        """Upper bounds, fitted (p,)."""
        return self.to_fitted(self.high)

    def to_fitted(self, values: np.ndarray) -> np.ndarray:
        """Fitted numbers (p,) of values (p,)."""
        return self._plain(np.asarray(values, dtype=float)) / self.prior_std

    def to_values(self, fitted: np.ndarray) -> np.ndarray:
        """Values (p,) of fitted numbers (p,), kept within the bounds against rounding."""
        plain = np.asarray(fitted, dtype=float) * self.prior_std
        with np.errstate(over="ignore"):
            values = np.where(self.logarithmic, np.exp(np.minimum(plain, 700.0)), plain)
        return np.clip(values, self.low, self.high)

    def value_per_fitted(self, values: np.ndarray) -> np.ndarray:
        """Derivative of the values by the fitted numbers, at `values`, (p,)."""
        return self.prior_std * np.where(self.logarithmic, values, 1.0)

    def clipped(self, values: np.ndarray) -> np.ndarray:
        """Values (p,) moved into the bounds."""
        return np.clip(np.asarray(values, dtype=float), self.low, self.high)

    def at_bound(self, values: np.ndarray, share: float = 1e-3) -> list[str | None]:
        """For each parameter "low", "high" or None: nearer to it than `share` of the width."""
        fitted, low, high = self.to_fitted(values), self.fitted_low, self.fitted_high
        near = share * (high - low)
        return [
            "low" if at - bottom <= room else "high" if top - at <= room else None
            for at, bottom, top, room in zip(fitted, low, high, near, strict=True)
        ]

    def as_mapping(self, values: np.ndarray) -> dict[str, float]:
        """Values by name."""
        return {name: float(value) for name, value in zip(self.names, values, strict=True)}

    def scene(self, base: Scene, values: np.ndarray) -> Scene:
        """The scene with the values put in, of 8 digits; see `with_properties` and `pool_at`."""
        for spec, value in zip(self.specs, values, strict=True):
            if spec.property == "water_level":
                base = Scene.model_validate(pool_at(base, simulated(value)))
        changes = [
            change
            for spec, value in zip(self.specs, values, strict=True)
            for change in spec.changes(simulated(value))
        ]
        return with_properties(base, changes)

    def _plain(self, values: np.ndarray) -> np.ndarray:
        """Logarithm where it is fitted as one; values (p,) must be positive there."""
        positive = np.where(self.logarithmic, values, 1.0)
        return np.where(self.logarithmic, np.log(positive), values)


@dataclass(frozen=True)
class Unknowns:
    """The unknowns x (q,) of a fit: parameters, and amplitudes of the effects that act.

    Attributes:
        parameters: what is calibrated, p of them.
        effects: amplitudes that are unknown, q - p of them.
        fixed: parameters that stay where they are, by place; their column is left out of a fit.
    """

    parameters: Parameters
    effects: tuple[Unknown, ...] = ()
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
        amplitudes = [effect.bounds[0] for effect in self.effects]
        return np.concatenate([self.parameters.fitted_low, amplitudes])

    @cached_property
    def high(self) -> np.ndarray:
        """Upper bounds of x, (q,)."""
        amplitudes = [effect.bounds[1] for effect in self.effects]
        return np.concatenate([self.parameters.fitted_high, amplitudes])

    @cached_property
    def free(self) -> np.ndarray:
        """(q,) bool: may change in a fit."""
        free = np.ones(self.size, dtype=bool)
        free[list(self.fixed)] = False
        free[self.p :] = [not effect.held for effect in self.effects]
        return free

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (r, q) and constants (r,): rows @ x - constants is noise of variance 1."""
        rows, constants = self.parameters.prior
        blocks = [np.hstack([rows, np.zeros((len(rows), len(self.effects)))])]
        totals = [constants]
        for place, effect in enumerate(self.effects):
            if effect.normal is not None:
                mean, std = effect.normal
                row = np.zeros((1, self.size))
                row[0, self.p + place] = 1.0 / std
                blocks.append(row)
                totals.append(np.array([mean / std]))
        return np.concatenate(blocks), np.concatenate(totals)

    @property
    def ln_prior_width(self) -> float:
        """Logarithm of the volume of the amplitudes' priors, in x, all their choices counted."""
        return float(sum(one.ln_prior_width + math.log(one.choices) for one in self.effects))

    def values(self, x: np.ndarray) -> np.ndarray:
        """Parameters in outside units, (p,)."""
        return self.parameters.to_values(x[: self.p])

    def amplitudes(self, x: np.ndarray) -> dict[str, float]:
        """Amplitudes by name."""
        return {
            effect.name: float(effect.scale.value(count))
            for effect, count in zip(self.effects, x[self.p :], strict=True)
        }

    def state(self, x: np.ndarray, *, seed: int = 0) -> State:
        """The forward run at x."""
        return state(self.values(x).tolist(), self.amplitudes(x), seed=seed)

    def at_bound(self, x: np.ndarray, share: float = 1e-3) -> list[str]:
        """Parameters and amplitudes that rest on a bound: within `share` of the width from it.

        A switch has no bounds to rest on.
        """
        ends = self.parameters.at_bound(self.values(x), share)
        found = [name for name, end in zip(self.parameters.names, ends, strict=True) if end]
        for effect, at, low, high in zip(
            self.effects, x[self.p :], self.low[self.p :], self.high[self.p :], strict=True
        ):
            if not effect.held and min(at - low, high - at) <= share * (high - low):
                found.append(effect.name)
        return found

    def clipped(self, x: np.ndarray) -> np.ndarray:
        """Unknowns x moved into the bounds."""
        return np.clip(x, self.low, self.high)

    def per_unit(self, x: np.ndarray) -> np.ndarray:
        """Derivative of values and amplitudes by x, (q,): turns a std of x into outside units."""
        slopes = self.parameters.value_per_fitted(self.values(x))
        amplitudes = [
            one.scale.slope(count) for one, count in zip(self.effects, x[self.p :], strict=True)
        ]
        return np.concatenate([slopes, amplitudes])

    def with_effects(self, effects: Sequence[Unknown]) -> Unknowns:
        """The same parameters with these effects in place of its own."""
        return replace(self, effects=tuple(effects))
