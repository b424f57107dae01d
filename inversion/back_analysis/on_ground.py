"""A back-analysis on maps: strengths from what a slide left in plan.

The stages and the estimator are those of a section; a run is three-dimensional, and what is read of
it are maps (`inversion.engines.ground_engine`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.ground_case import ENGINE, GroundCase
from inversion.back_analysis.result import Result, save_result
from inversion.back_analysis.result_files import HISTORY, history_text
from inversion.back_analysis.variants import Changed
from inversion.engines.ground_engine import GroundEngine
from inversion.engines.measured_ground import MeasuredGround
from inversion.engines.run_store import RunStore
from inversion.estimation.derivatives import FiniteSteps
from inversion.estimation.misfit import Objective
from inversion.problem.question import Sensitivity, Variant
from pipeline.files import write_text
from pipeline.progress import Watch

#: A search begins where a measured number differs by this share of the spacing from before the
#: slide [m, m2 or m3]; a surface moves by less than a toe does.
LEAST_SHARE = 0.25
#: Widest step of a logarithm: a map is many numbers, each with its own noise.
WIDEST_LOG = 0.4


@dataclass(kw_only=True)
class AnalysisOnGround(BackAnalysis):
    """A slide in plan under back-analysis.

    Attributes:
        make_engine: makes the engine, with no runs counted.
    """

    case: GroundCase
    make_engine: Callable[[], GroundEngine]
    engine_name: str = ENGINE

    def engine_of(self) -> GroundEngine:
        """The engine, with no runs counted."""
        return self.make_engine()

    def tell_doubts(self) -> None:
        """Remarks on the answer, also where its soil has reached a wall."""
        super().tell_doubts()
        kept = self.make_engine().kept_maps(self.case.setup.at(self.found.values))
        if kept.walls:
            walls = ", ".join(kept.walls)
            self.remark(f"soil reached the wall at {walls}: the domain is too small for its map")

    def known_variants(self) -> tuple[list[Variant], list[str]]:
        """Those that three dimensions have."""
        return self.case.variants

    def known_sensitivities(self) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
        """Those that three dimensions have."""
        return self.case.sensitivities

    @staticmethod
    def _least_m(setup: MeasuredGround) -> float:
        return LEAST_SHARE * setup.scene.spacing

    def _steps(self, noise: np.ndarray, objective: Objective) -> FiniteSteps:
        return replace(super()._steps(noise, objective), widest_log=WIDEST_LOG)

    def _seeds(self) -> dict[str, int]:
        return {}


def on_ground(
    case: GroundCase, folder: Path, watch: Watch, *, threads: int | None = None
) -> AnalysisOnGround:
    """The back-analysis of a case whose runs are kept in a folder.

    Args:
        case: with its question.
        folder: of the results.
        watch: told of progress.
        threads: CPU threads; None: all.
    """
    return AnalysisOnGround(
        case=case,
        store=RunStore(None, threads=threads),
        say=watch.say,
        watch=watch,
        make_engine=lambda: GroundEngine(
            folder / "runs", threads=threads, on_run=watch.run_done, on_frame=watch.frame_done
        ),
    )


def answered_on_ground(analysis: AnalysisOnGround, folder: Path) -> Result:
    """Run a back-analysis, and write result and history; the result as written."""
    result = analysis.run()
    timings = {**result.timings, "in all": round(sum(result.timings.values()), 3)}
    result = result.model_copy(update={"timings": timings})
    write_text(folder / HISTORY, history_text(result))
    save_result(result, folder)
    return result
