"""What a report is made from: the folder of a back-analysis and the case it belongs to.

In: a folder with `result.json` and, where they are there, `sections.npz` and `run.h5`; the case
folder with its measurements. Out: a `ReportData`; what is missing is None and its part of the
report is left out.
"""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geometry.case import Case, load_case
from geometry.survey.measured import Measured
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from inversion.back_analysis.engine_choice import side_by_side
from inversion.back_analysis.result import ParameterAnswer, Result, load_result
from inversion.back_analysis.result_files import RUN, SECTIONS, classical_beside
from inversion.problem.question import RESIDUAL_STRENGTH
from mpm_taichi.trajectory import Run, read_run
from pipeline.cli import InputError
from pipeline.places import CASES, resolve


@dataclass(frozen=True)
class Sections:
    """Where the points lie after each look at the engine: K looks, N points, p parameters.

    Attributes:
        initial: before the slide (N, 2) [m].
        final: after it (K, N, 2) [m]; NaN where a run has no such points.
        iteration: number of the iteration (K,).
        accepted: the step was kept (K,).
        loss: (K,); not finite where a run failed.
        values: of the parameters (K, p).
        answer: the look that is the answer.
    """

    initial: np.ndarray
    final: np.ndarray
    iteration: np.ndarray
    accepted: np.ndarray
    loss: np.ndarray
    values: np.ndarray
    answer: int


@dataclass(frozen=True)
class ReportData:
    """All that a report shows.

    Attributes:
        folder: of the back-analysis; pictures and page are written there.
        result: its `result.json`.
        run: trajectory of the answer; None: there is none.
        case: section with the answer's strengths, and the measurements; None: no case folder.
        sections: of the iterations; None: there are none.
    """

    folder: Path
    result: Result
    run: Run | None = None
    case: Case | None = None
    sections: Sections | None = None

    @property
    def toes(self) -> list[Measured]:
        """The measured toes; none where the case is not at hand."""
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
            if p.property == RESIDUAL_STRENGTH or p.ratio is not None
        ]

    @property
    def with_water(self) -> bool | None:
        """The answer is for a section with a reservoir or groundwater; None: not known."""
        return None if self.run is None else self.run.scene.has_water

    def prior_mean(self, parameter: ParameterAnswer) -> float | None:
        """Most likely value of a parameter beforehand; None: all between its bounds are alike."""
        spec = next(s for s in self.result.question.parameters if s.name == parameter.name)
        return None if spec.prior is None else spec.prior.mean

    def side(self, parameter: ParameterAnswer) -> str:
        """The side a parameter's zones slid to, left or right: that of the measured toes.

        Where toes were measured on both sides, or on none, the side of the crest the zones lie on.
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
        """The x of a toe [m], from how far it is beyond the foot of the section [m]."""
        foot = self.case.feet[side]
        return foot - runout if side == "left" else foot + runout


def load_report(folder: str | Path, case_folder: str | Path | None = None) -> ReportData:
    """Read the folder of a back-analysis.

    Args:
        folder: with `result.json`.
        case_folder: of the case; None: the one of that name in `case_histories`, if there is one.

    Raises:
        InputError: no result, a damaged file, or a case that does not hold together; one line.
    """
    folder = Path(folder)
    result = load_result(folder)
    beside = classical_beside(folder)
    if beside:  # they may have been asked since
        result = result.model_copy(update={"classical": beside})
    engines = side_by_side(result, folder)
    if engines:
        result = result.model_copy(update={"engines": engines})
    run = _run(folder / RUN)
    if case_folder is None:
        named = resolve(result.case, CASES)
        case_folder = named if (named / MEASUREMENTS_FILE).is_file() else None
    case = None
    if run is not None and case_folder is not None:
        case = replace(load_case(case_folder).with_set(result.measurement_set), scene=run.scene)
    return ReportData(folder, result, run, case, _sections(folder / SECTIONS))


def _run(path: Path) -> Run | None:
    """The trajectory of the answer, if it is there and has anything to show."""
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
    except (
        OSError, EOFError, KeyError, RuntimeError, ValueError, zipfile.BadZipFile, zlib.error
    ) as error:  # fmt: skip
        raise InputError(f"{path}: cannot be read ({error}); delete it or ask again") from None
