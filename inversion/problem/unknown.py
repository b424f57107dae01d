"""One unknown, whatever it is of: a parameter, the amplitude of an effect, a nuisance.

It is counted on a scale on which its prior is flat or normal. Strengths and densities count as
logarithms, angles and levels as they are, amplitudes in units of a middle rung of their ladder or
in decades. A fit takes many at once (`inversion.estimation.unknowns`), a posterior draws them at
shares of their prior (`inversion.posterior`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, overload

import numpy as np
from scipy.special import ndtr, ndtri

from inversion.problem.question import (
    LOGARITHMIC,
    RESIDUAL_STRENGTH,
    STRENGTH_RATIO,
    UNITS,
    ParameterSpec,
)

#: Least share of a normal prior within its bounds: one that lies wholly outside is an error of its
#: author.
LEAST_WITHIN = 1e-6


@dataclass(frozen=True)
class Scale:
    """How an unknown is counted.

    Attributes:
        unit: what counts as 1: of a logarithm a change of it, in decades a value.
        form: plain; logarithm; decades: each count beyond 1 is ten times the value before, and 0
            is none.
    """

    unit: float = 1.0
    form: Literal["plain", "logarithm", "decades"] = "plain"

    @overload
    def count(self, value: float) -> float: ...
    @overload
    def count(self, value: np.ndarray) -> np.ndarray: ...
    def count(self, value: float | np.ndarray) -> float | np.ndarray:
        """Count of a value, or of each of many; in decades none below a tenth of the unit."""
        if self.form == "plain":
            return value / self.unit
        if self.form == "logarithm":
            return np.log(value) / self.unit
        share = np.maximum(np.asarray(value) / self.unit, 0.1)
        found = 1.0 + np.log10(share)
        return found if found.ndim else float(found)

    @overload
    def value(self, count: float) -> float: ...
    @overload
    def value(self, count: np.ndarray) -> np.ndarray: ...
    def value(self, count: float | np.ndarray) -> float | np.ndarray:
        """Value of a count, or of each of many."""
        if self.form == "plain":
            return count * self.unit
        if self.form == "logarithm":
            return np.exp(count * self.unit)
        found = np.where(np.asarray(count) > 0.0, self.unit * 10.0 ** (np.asarray(count) - 1.0), 0)
        return found if found.ndim else float(found)

    def slope(self, count: float) -> float:
        """Derivative of the value by its count."""
        if self.form == "plain":
            return self.unit
        return self.value(count) * (self.unit if self.form == "logarithm" else math.log(10.0))

    def spread(self, mean: float, std: float) -> float:
        """Standard deviation (in counts) of a value with a mean and a standard deviation."""
        if self.form == "logarithm":
            return std / mean / self.unit
        return std / self.slope(self.count(mean))


@dataclass(frozen=True)
class Unknown:
    """One unknown and its prior.

    Where both bounds are one value it is held there: an effect that is a switch and is on takes no
    degree of freedom.

    Attributes:
        name: as in the question, or of the effect.
        low: lower bound of the value.
        high: upper bound of the value.
        scale: how it is counted.
        normal: mean and standard deviation of the count beforehand; None: all counts between the
            bounds are alike.
        choices: equally likely forms of it, of which this is one.
        label: in words.
        unit: of the value; "std" where it is a standard score.
        source: where the prior comes from, in words; empty: from the question.
    """

    name: str
    low: float
    high: float
    scale: Scale = Scale()
    normal: tuple[float, float] | None = None
    choices: int = 1
    label: str = ""
    unit: str = ""
    source: str = ""

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """Bounds of the count."""
        return self.scale.count(self.low), self.scale.count(self.high)

    @property
    def std(self) -> float:
        """Standard deviation of the count beforehand; of a range its width / sqrt(12)."""
        low, high = self.bounds
        return (high - low) / math.sqrt(12.0) if self.normal is None else self.normal[1]

    @property
    def held(self) -> bool:
        """There is nothing to find."""
        return self.low == self.high

    @property
    def logarithmic(self) -> bool:
        """It counts as its logarithm."""
        return self.scale.form == "logarithm"

    @property
    def strength(self) -> bool:
        """A strength or a strength ratio, which the size of the cells moves."""
        return self.unit in (UNITS[RESIDUAL_STRENGTH], UNITS[STRENGTH_RATIO])

    @property
    def ln_prior_width(self) -> float:
        """Logarithm of the prior's volume: ln prior density = -this - (count - mean)^2 / 2 std^2.

        A normal prior that is cut off at the bounds has the volume that lies within them.
        """
        if self.held:
            return 0.0
        low, high = self.bounds
        if self.normal is None:
            return math.log(high - low)
        below, above = self._cut
        within = max(above - below, LEAST_WITHIN)
        return math.log(math.sqrt(2.0 * math.pi) * within * self.normal[1])

    def at(self, share: np.ndarray) -> np.ndarray:
        """Values at shares of the prior probability, any shape: the inverse of `share_below`."""
        share, (low, high) = np.asarray(share, dtype=float), self.bounds
        if self.normal is None:
            count = low + share * (high - low)
        else:
            (mean, std), (below, above) = self.normal, self._cut
            count = mean + std * ndtri(below + share * (above - below))
        return self.scale.value(np.clip(count, low, high))

    def share_below(self, values: np.ndarray) -> np.ndarray:
        """Prior probability below values, any shape."""
        count, (low, high) = self.counts(values), self.bounds
        if self.normal is None:
            return np.clip((count - low) / (high - low), 0.0, 1.0)
        (mean, std), (below, above) = self.normal, self._cut
        return np.clip((ndtr((count - mean) / std) - below) / (above - below), 0.0, 1.0)

    def density(self, values: np.ndarray) -> np.ndarray:
        """Prior density per unit of the value, any shape; of what is plain or a logarithm."""
        count, (low, high) = self.counts(values), self.bounds
        if self.normal is None:
            found = np.full(np.shape(count), 1.0 / (high - low))
        else:
            (mean, std), (below, above) = self.normal, self._cut
            score = (count - mean) / std
            found = np.exp(-0.5 * score**2) / (np.sqrt(2 * np.pi) * std * (above - below))
        found = np.where((count >= low) & (count <= high), found, 0.0) / self.scale.unit
        return found / values if self.logarithmic else found

    def scaled(self, values: np.ndarray) -> np.ndarray:
        """Values as an emulator takes them: about -1 to 1 over the likely range, any shape."""
        low, high = self.bounds
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        if self.normal is not None:
            middle, half = self.normal[0], min(2.0 * self.normal[1], half)
        return (self.counts(values) - middle) / half

    def counts(self, values: np.ndarray) -> np.ndarray:
        """Counts of values, any shape."""
        return self.scale.count(np.asarray(values, dtype=float))

    @cached_property
    def _cut(self) -> tuple[float, float]:
        """Probability of a normal prior below either bound."""
        if self.normal is None:
            return 0.0, 1.0
        mean, std = self.normal
        low, high = ((bound - mean) / std for bound in self.bounds)
        return float(ndtr(low)), float(ndtr(high))


def unknown_parameter(spec: ParameterSpec) -> Unknown:
    """A parameter of the question as an unknown."""
    scale = Scale(form="logarithm" if spec.property in LOGARITHMIC else "plain")
    normal, prior = None, spec.prior
    if prior is not None and prior.mean is not None and prior.std is not None:
        normal = (scale.count(prior.mean), scale.spread(prior.mean, prior.std))
    return Unknown(spec.name, spec.low, spec.high, scale, normal, label=spec.words, unit=spec.unit)
