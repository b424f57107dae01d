"""Data of the report of a back-analysis: its folder and the case that it answers.

In: a folder with `result.json` and perhaps `sections.npz` and `run.h5`; the case folder with its
measurements. Out: a `BackAnalysisData`; what is missing is None and its part of the report is left
out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geometry.case import Case, load_case
from geometry.survey.measured import Measured
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS
from inversion.back_analysis.asked import Asked
from inversion.back_analysis.result import MeasurementAnswer, ParameterAnswer, Result, load_result
from inversion.back_analysis.result_files import RUN, SECTIONS, with_neighbours
from inversion.engines.content_store import DAMAGE
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO
from mpm_taichi.trajectory import Run, read_run
from pipeline.cli import InputError
from pipeline.places import CASES, resolve
from pipeline.ties import ranked

MANY = 40
"""Fitted numbers from which on they are those of a map, which are not named one by one."""


@dataclass(frozen=True)
class Sections:
    """Positions of the points after each evaluation: K evaluations, N points, p parameters.

    Attributes:
        initial: before the slide (N, 2) [m].
        final: after it (K, N, 2) [m]; NaN where a run has no such points.
        iteration: number of the iteration (K,).
        accepted: the step was kept (K,).
        loss: (K,); not finite where a run failed.
        values: of the parameters (K, p).
        answer: the evaluation that is the answer.
    """

    initial: np.ndarray
    final: np.ndarray
    iteration: np.ndarray
    accepted: np.ndarray
    loss: np.ndarray
    values: np.ndarray
    answer: int


@dataclass(frozen=True)
class Series:
    """The numbers of one measurement that have the same role: a profile may be held out in part."""

    name: str
    lines: list[MeasurementAnswer]

    @property
    def role(self) -> str:
        """Of all of them."""
        return self.lines[0].role


@dataclass(frozen=True)
class BackAnalysisData:
    """Everything that a report shows.

    Attributes:
        folder: of the back-analysis; pictures and page are written there.
        result: its `result.json`.
        run: trajectory of the answer; None: no file.
        case: section with the answer's strengths, and the measurements; None: no case folder.
        sections: of the iterations; None: no file.
    """

    folder: Path
    result: Result
    run: Run | None = None
    case: Case | None = None
    sections: Sections | None = None

    @property
    def toes(self) -> list[Measured]:
        """The measured toes; none where the case is unknown."""
        if self.case is None:
            return []
        return [m for m in self.case.measured if m.toe_side is not None]

    @property
    def strengths(self) -> list[ParameterAnswer]:
        """The residual strengths among the parameters."""
        # In older results the property of an S_r is cohesion_kpa; it has its ratio all the same.
        return [
            p
            for p in self.result.answer.parameters
            if p.property == RESIDUAL_STRENGTH
            or (p.ratio is not None and p.property != STRENGTH_RATIO)
        ]

    @property
    def ratios(self) -> list[ParameterAnswer]:
        """The strength ratios among the parameters."""
        return [p for p in self.result.answer.parameters if p.property == STRENGTH_RATIO]

    @property
    def answers(self) -> list[ParameterAnswer]:
        """What was asked: strengths and strength ratios, or all parameters where there are none."""
        return [*self.strengths, *self.ratios] or self.result.answer.parameters

    @property
    def fitted(self) -> list[MeasurementAnswer]:
        """The measurements that were fitted."""
        return [m for m in self.result.measurements if m.role == "fitted"]

    def few_fitted(self, most: int) -> list[MeasurementAnswer]:
        """Fitted measurements that have a column or a line of their own, `most` at most.

        Of a map those places that the slide has changed most.
        """
        fitted = self.fitted
        if len(fitted) > MANY:
            fitted = ranked(
                fitted,
                lambda m: abs((m.measured or 0.0) - m.predicted_at_start) / (m.std or 1),
            )
        return fitted[:most]

    @property
    def series(self) -> list[Series]:
        """Measurements with a measured value, in order of the file.

        All numbers of one together, but for those of another role.
        """
        found: dict[tuple[str, str], list[MeasurementAnswer]] = {}
        for m in self.result.measurements:
            if m.measured is not None and m.difference_in_std is not None:
                found.setdefault((m.group, m.role), []).append(m)
        return [Series(name, lines) for (name, _), lines in found.items()]

    @property
    def with_water(self) -> bool | None:
        """The section has a reservoir or groundwater; None: unknown."""
        return None if self.run is None else self.run.scene.has_water

    def prior_mean(self, parameter: ParameterAnswer) -> float | None:
        """Mean of the prior; None: every value between the bounds is equally likely."""
        spec = next(s for s in self.result.question.parameters if s.name == parameter.name)
        return None if spec.prior is None else spec.prior.mean

    def side(self, parameter: ParameterAnswer) -> str:
        """The side to which a parameter's zones slid, left or right: that of the measured toes.

        With toes on both sides, or on none: the side of the crest on which the zones lie.
        """
        if self.case is None:
            return "left"
        sides = {toe.toe_side for toe in self.toes}
        if len(sides) == 1:
            return sides.pop()
        corners = [np.asarray(zone.polygon) for zone in self.case.scene.zones]
        everything = np.concatenate(corners)
        crest = self.case.measurements.initial.crest_x_m
        if crest is None:
            crest = everything[np.argmax(everything[:, 1]), 0]
        middle = [
            corner[:, 0].mean()
            for corner, zone in zip(corners, self.case.scene.zones, strict=True)
            if zone.name in parameter.zones
        ]
        return "left" if np.mean(middle) <= crest else "right"

    def toe_place(self, side: str, runout: float) -> float:
        """X of a toe [m] at a runout from the foot of the section [m]."""
        foot = self.case.feet[side]
        return foot - runout if side == "left" else foot + runout


def load_back_analysis(
    folder: str | Path,
    case: Asked | Case | str | Path | None = None,
    result: Result | None = None,
) -> BackAnalysisData:
    """Everything that the report of a back-analysis shows.

    Args:
        folder: of the back-analysis.
        case: that it answers, or its folder; None: the one of that name that ships, if any.
        result: of the back-analysis; None: it is read, with what other methods have found since.

    Raises:
        InputError: no result, a damaged file, or a case without its measurements; one line.
    """
    folder = Path(folder)
    if result is None:
        result = with_neighbours(load_result(folder), folder)
    run = _run(folder / RUN)
    found = case if isinstance(case, Case) else None
    if run is not None and (case is None or isinstance(case, str | Path)):
        found = _case(case, result.case)
    if found is not None and run is not None:
        found = replace(found.with_set(result.measurement_set), scene=run.scene)
    else:
        found = None
    return BackAnalysisData(folder, result, run, found, _sections(folder / SECTIONS))


def _case(place: str | Path | None, name: str) -> Case | None:
    """The case at a place or of a name; where none is given, that of the result if it is there.

    Raises:
        InputError: the one that is given has no measurements.
    """
    found = resolve(name if place is None else place, CASES)
    if (found / MEASUREMENTS).is_file():
        return load_case(found)
    if place is not None:
        raise InputError(f"{found}: has no {MEASUREMENTS}, so it is not the case of this result")
    return None


def _run(path: Path) -> Run | None:
    """The trajectory of the answer, if there is one with anything to show."""
    if not path.is_file():
        return None
    run = read_run(path, 0)
    return run if run.frames and run.points else None


def _sections(path: Path) -> Sections | None:
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as file:
            return Sections(
                **{
                    name: file[name]
                    for name in ("initial", "final", "iteration", "accepted", "loss", "values")
                },
                answer=int(file["answer"]),
            )
    except DAMAGE as error:
        raise InputError(
            f"{path}: cannot be read ({error}); delete it or run the analysis again"
        ) from None
