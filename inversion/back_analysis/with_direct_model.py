"""A back-analysis by a direct model: an answer in seconds, with the model's error in it.

The stages of `inversion.back_analysis.back_analysis`. The answer is found twice: the second time
with the model's own error, as it is at the first answer, in the covariance of the measurements. Or,
where runs of the material point method are asked for (`inversion.paired_runs`), with their mean
difference around the first answer added to every prediction, and what it varies by in the
covariance (`inversion.engines.model_error`). How far the section lies from the training is among
the remarks, and an answer far outside is refused (`inversion.engines.direct_engine`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from geometry.random_scenes.standing_dam import HEIGHT
from inversion.back_analysis.asked import Asked
from inversion.back_analysis.learned_analysis import LearnedAnalysis
from inversion.engines.direct_engine import DirectEngine, shipped
from inversion.engines.registry import REFERENCE, engine_named
from inversion.engines.run_store import Store
from inversion.estimation.forward import Setup
from inversion.estimation.misfit import Objective
from pipeline.progress import Watch

#: Source of the model's error among the sources of uncertainty.
SOURCE = "error of the direct model"


def direct_analysis(
    case: Asked, store: Store, watch: Watch, model: Path | None, folder: Path
) -> DirectAnalysis:
    """The back-analysis of a case by the model that ships; it needs no other and keeps nothing."""
    return DirectAnalysis(case, store, watch.say, watch, engine_name="direct")


@dataclass(kw_only=True)
class DirectAnalysis(LearnedAnalysis):
    """A case under back-analysis by a direct model.

    Attributes:
        error_std: of the model's error of each number, by its name [m]; empty: not known yet.
    """

    error_std: dict[str, float] = field(default_factory=dict)

    @property
    def coarse_spacing_m(self) -> float | None:
        """None: a forecast costs the same at every spacing."""
        return None

    def uncorrected(self) -> DirectEngine:
        """The model that ships under the engine's name."""
        engine: DirectEngine = shipped(self.engine_name)
        engine.anywhere = self.case.config.inversion.outside_training
        return engine

    def objective_of(self, setup: Setup) -> Objective:
        """With the model's own error where no runs of the solver have corrected it."""
        if self.pairs is None and self.error_std:
            variance = [self.error_std.get(name, 0.0) ** 2 for name in setup.targets.names]
            covariance = setup.targets.covariance + np.diag(variance)
            setup = replace(setup, targets=replace(setup.targets, covariance=covariance))
        return super().objective_of(setup)

    def search(self) -> None:
        """The answer; again with the model's error at it."""
        start, model = self.case.setup.at(self.case.parameters.start), self.uncorrected()
        self.remark(
            f"the section lies at {model.distance(start):.2f} from the training of the "
            "direct model (1: as far as its outermost sections lie from each other)"
        )
        height, (low, high) = model.spacings_high(start), HEIGHT
        if not low <= height <= high:
            self.remark(
                f"the section is {height:.0f} spacings high; the direct model has learned from "
                f"{low:.0f} to {high:.0f} and answers about as the solver does there: choose "
                "--spacing accordingly"
            )
        super().search()
        if self.case.config.inversion.paired_runs:
            self._correct()
        else:
            self._doubt()
        self.share_of_engine(SOURCE)

    def search_again(self) -> None:
        """The stage of the solver, by the engine as it is corrected now."""
        super().search()

    def _doubt(self) -> None:
        """Answer again with the model's own error, as it is at the first answer."""
        std = self.engine.error_std(self.case.setup.at(self.found.values))
        names = self.case.setup.targets.names
        self.error_std = dict(zip(names, map(float, std), strict=True))
        self.objective = self.objective_of(self.case.setup)
        super().search()

    def _correct(self) -> None:
        """Answer again with the mean difference to the solver."""
        truth = engine_named(REFERENCE).made(self.store)

        def run_pairs() -> None:
            self.run_pairs(truth, self.case.config.inversion.paired_runs)

        run_pairs()
        self.answer_by_pairs(truth, run_pairs)
        self.runs += truth.runs
        self.remark(
            f"corrected by {len(self.paired.states)} runs of the material point method: "
            + ", ".join(self.differences())
        )
