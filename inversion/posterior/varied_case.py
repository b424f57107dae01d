"""A case as a function of everything that is unknown of it.

Parameters of the question: equally likely between their bounds in the scale in which a
back-analysis fits them (strengths and densities as logarithms), or with their prior, which is cut
at the bounds. Nuisances: every sensitivity of the question that has a standard deviation, as a
standard score z ~ N(0, 1), cut at `FARTHEST`. Sensitivities that are other ways to simulate have no
distribution; they enter as errors (`inversion.posterior.runs.CaseModel.other_ways`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from geometry.dimensions.family import Dimension
from inversion.back_analysis.asked import Asked
from inversion.back_analysis.deviations import Uncertain, deviating
from inversion.estimation.forward import SectionSetup, Setup
from inversion.problem.question import (
    UNITS,
    FixedProperty,
    UnknownDimension,
    WaterLevel,
    ZoneBoundary,
)
from inversion.problem.unknown import Scale, Unknown, unknown_parameter
from pipeline.cli import InputError

#: Scores of nuisances beyond this are not considered: one in 370.
FARTHEST = 3.0
#: To which the score is found beyond which a section does not hold together.
RESOLUTION = 0.02


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
    scale, normal = Scale(), None
    if dimension.normal is not None:
        median, std = dimension.normal
        scale = Scale(form="logarithm")
        normal = (scale.count(median), std)
    return Unknown(
        name,
        dimension.low,
        dimension.high,
        scale,
        normal,
        label=dimension.label,
        unit=dimension.unit,
        source=dimension.source,
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
            Unknown(
                sensitivity.name, *ends, normal=(0.0, 1.0), label=_words(sensitivity), unit="std"
            )
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
