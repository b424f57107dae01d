"""Everything that is unknown of a case, each with its prior.

Parameters of the question: equally likely between their bounds in the scale in which a
back-analysis fits them (strengths and densities as logarithms), or with their prior, which is cut
at the bounds. Nuisances: every sensitivity of the question that has a standard deviation, as a
standard score z ~ N(0, 1), cut at `FARTHEST`. Sensitivities that are other ways to simulate have no
distribution; they enter as errors (`inversion.posterior.runs.CaseModel.other_ways`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from geometry.dimensions.family import Dimension
from inversion.back_analysis.asked import Asked
from inversion.back_analysis.deviations import Uncertain, deviating
from inversion.estimation.forward import SectionSetup, Setup
from inversion.problem.question import (
    LOGARITHMIC,
    RESIDUAL_STRENGTH,
    STRENGTH_RATIO,
    UNITS,
    FixedProperty,
    ParameterSpec,
    UnknownDimension,
    WaterLevel,
    ZoneBoundary,
)
from pipeline.cli import InputError

#: Scores of nuisances beyond this are not considered: one in 370.
FARTHEST = 3.0
#: To which the score is found beyond which a section does not hold together.
RESOLUTION = 0.02


@dataclass(frozen=True)
class Unknown:
    """One unknown and its prior.

    The prior is uniform or normal in t, which is the value or its logarithm, between two bounds.

    Attributes:
        name: as in the question.
        label: in words.
        unit: of the value; "std" where it is a standard score.
        logarithmic: t = ln(value).
        low: of t.
        high: of t.
        normal: mean and standard deviation of t; None: uniform.
        source: where the prior comes from, in words; empty: from the question.
    """

    name: str
    label: str
    unit: str
    logarithmic: bool
    low: float
    high: float
    normal: tuple[float, float] | None = None
    source: str = ""

    @property
    def strength(self) -> bool:
        """A strength or a strength ratio, which the size of the cells moves."""
        return self.unit in (UNITS[RESIDUAL_STRENGTH], UNITS[STRENGTH_RATIO])

    def at(self, share: np.ndarray) -> np.ndarray:
        """Values at shares of the prior probability, any shape: the inverse of `share_below`."""
        share = np.asarray(share, dtype=float)
        if self.normal is None:
            t = self.low + share * (self.high - self.low)
        else:
            (mean, std), (below, above) = self.normal, self._cut
            t = mean + std * ndtri(below + share * (above - below))
        return self._value(np.clip(t, self.low, self.high))

    def share_below(self, values: np.ndarray) -> np.ndarray:
        """Prior probability below values, any shape."""
        t = self.transformed(values)
        if self.normal is None:
            return np.clip((t - self.low) / (self.high - self.low), 0.0, 1.0)
        (mean, std), (below, above) = self.normal, self._cut
        return np.clip((ndtr((t - mean) / std) - below) / (above - below), 0.0, 1.0)

    def density(self, values: np.ndarray) -> np.ndarray:
        """Prior density per unit of the value, any shape."""
        t = self.transformed(values)
        if self.normal is None:
            found = np.full(np.shape(t), 1.0 / (self.high - self.low))
        else:
            (mean, std), (below, above) = self.normal, self._cut
            score = (t - mean) / std
            found = np.exp(-0.5 * score**2) / (np.sqrt(2 * np.pi) * std * (above - below))
        found = np.where((t >= self.low) & (t <= self.high), found, 0.0)
        return found / values if self.logarithmic else found

    def scaled(self, values: np.ndarray) -> np.ndarray:
        """Values as an emulator takes them: about -1 to 1 over the likely range, any shape."""
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        if self.normal is not None:
            middle, half = self.normal[0], min(2.0 * self.normal[1], half)
        return (self.transformed(values) - middle) / half

    @property
    def _cut(self) -> tuple[float, float]:
        """Probability of a normal prior below either bound."""
        if self.normal is None:
            return 0.0, 1.0
        mean, std = self.normal
        low, high = ((bound - mean) / std for bound in (self.low, self.high))
        return float(ndtr(low)), float(ndtr(high))

    def transformed(self, values: np.ndarray) -> np.ndarray:
        """T of values, any shape."""
        values = np.asarray(values, dtype=float)
        return np.log(values) if self.logarithmic else values

    def _value(self, t: np.ndarray) -> np.ndarray:
        return np.exp(t) if self.logarithmic else t


def unknown_parameter(spec: ParameterSpec) -> Unknown:
    """A parameter of the question as an unknown."""
    logarithmic = spec.property in LOGARITHMIC
    low, high = np.log((spec.low, spec.high)) if logarithmic else (spec.low, spec.high)
    normal, prior = None, spec.prior
    if prior is not None and prior.mean is not None and prior.std is not None:
        normal = (prior.mean, prior.std)
        if logarithmic:
            normal = (float(np.log(prior.mean)), prior.std / prior.mean)
    return Unknown(spec.name, spec.words, spec.unit, logarithmic, float(low), float(high), normal)


@dataclass(frozen=True)
class VariedCase:
    """A case as a function of its unknowns.

    Attributes:
        case: its priors are known.
        nuisances: sensitivities with a standard deviation.
        unknowns: parameters, then nuisances, (q,).
        remarks: what was left out or cut, a line each.
    """

    case: Asked
    nuisances: tuple[Uncertain, ...]
    unknowns: tuple[Unknown, ...]
    remarks: tuple[str, ...] = ()

    @property
    def parameters(self) -> int:
        """How many of the unknowns are parameters."""
        return len(self.unknowns) - len(self.nuisances)

    @property
    def boundaries(self) -> np.ndarray:
        """(q,) bool: boundaries of a section."""
        boundary = [isinstance(nuisance, ZoneBoundary) for nuisance in self.nuisances]
        return np.array([False] * self.parameters + boundary)

    def dimension_of(self, place: int) -> str:
        """Key of a dimension among the unknowns; empty: another nuisance."""
        nuisance = self.nuisances[place - self.parameters]
        return nuisance.dimension if isinstance(nuisance, UnknownDimension) else ""

    def _score(self, nuisance: Uncertain, value: float) -> float:
        """Standard score of a nuisance; a dimension is known by its value."""
        if isinstance(nuisance, UnknownDimension):
            return _dimension(self.case, nuisance).score(float(value))
        return float(value)

    def setup(self, values: np.ndarray) -> Setup:
        """The question with the nuisances among values (q,) put into its scene.

        Raises:
            InputError: the scene does not hold together there.
        """
        scores = [
            self._score(nuisance, value)
            for nuisance, value in zip(self.nuisances, values[self.parameters :], strict=True)
        ]
        return deviating(self.case.setup, self.nuisances, scores, self.case.source)


def unknown_dimension(name: str, dimension: Dimension) -> Unknown:
    """A dimension of a section that nobody drew as an unknown, in its own unit."""
    low, high, normal = dimension.low, dimension.high, dimension.normal
    if normal is not None:
        low, high, normal = math.log(low), math.log(high), (math.log(normal[0]), normal[1])
    return Unknown(
        name,
        dimension.label,
        dimension.unit,
        normal is not None,
        low,
        high,
        normal,
        dimension.source,
    )


def _dimension(case: Asked, sensitivity: UnknownDimension) -> Dimension:
    assert isinstance(case.setup, SectionSetup) and case.setup.family is not None
    return case.setup.family[sensitivity.dimension]


def varied_case(case: Asked, refused: Callable[[Setup], str] = lambda setup: "") -> VariedCase:
    """What is unknown of a case; sensitivities that it does not allow are left out.

    Args:
        case: with its question.
        refused: why a setup cannot be simulated; empty: it can.
    """
    kept: list[Uncertain] = []
    unknowns = [unknown_parameter(spec) for spec in case.parameters.specs]
    available, remarks = case.sensitivities_of(refused)
    for sensitivity, _ in available:
        if not isinstance(sensitivity, Uncertain):
            continue
        if isinstance(sensitivity, UnknownDimension):
            kept.append(sensitivity)
            dimension = _dimension(case, sensitivity)
            unknowns.append(unknown_dimension(sensitivity.name, dimension))
            continue
        low, high = (-FARTHEST, FARTHEST)
        if isinstance(sensitivity, ZoneBoundary):
            low, high = (FARTHEST * f(0.0, *sensitivity.senses) for f in (min, max))
        ends = _reach(case, sensitivity, low), _reach(case, sensitivity, high)
        if ends != (low, high):
            remarks = [
                *remarks,
                f"{sensitivity.name}: the section holds together from {ends[0]:.2g} to "
                f"{ends[1]:.2g} standard deviations; its prior is cut there",
            ]
        kept.append(sensitivity)
        unknowns.append(
            Unknown(sensitivity.name, _words(sensitivity), "std", False, *ends, (0.0, 1.0))
        )
    return VariedCase(case, tuple(kept), tuple(unknowns), tuple(remarks))


def _reach(case: Asked, nuisance: Uncertain, end: float) -> float:
    """The score farthest towards `end` at which the section holds together, by bisection."""

    def holds(score: float) -> bool:
        try:
            deviating(case.setup, [nuisance], [score], case.source)
        except InputError:
            return False
        return True

    if end == 0.0 or holds(end):
        return end
    inside, outside = 0.0, end
    while abs(outside - inside) > RESOLUTION:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside


def _words(sensitivity: Uncertain) -> str:
    match sensitivity:
        case ZoneBoundary():
            far = max(float(np.hypot(*vertex.move)) for vertex in sensitivity.vertices)
            return f"{sensitivity.name} (up to {far:.2g} m)"
        case WaterLevel():
            return f"{sensitivity.name} ({sensitivity.std_m:g} m)"
        case UnknownDimension():
            return sensitivity.name
        case FixedProperty():
            return f"{sensitivity.name} ({sensitivity.std:g} {UNITS[sensitivity.property]})"
