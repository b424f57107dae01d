"""A back-analysis by the learned simulator, with the material point method as its judge.

The stages of `inversion.back_analysis.back_analysis` with other engines: first the learned
simulator alone finds an answer, as in the paper; then the material point method also runs at a
few states around that answer (`inversion.engines.model_error`); corrected by their mean difference,
and with their covariance in that of the fit, it answers again. What the material point method says
at the answer is kept, and where it is off there, the answer is corrected by it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import gns
from gns.data.scene_facts import with_known_water
from inversion.back_analysis.asked import Asked
from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.in_small_cells import told_values
from inversion.back_analysis.learned_analysis import LearnedAnalysis
from inversion.back_analysis.result import EngineAnswer, Result, Surrogate, SurrogatePair
from inversion.back_analysis.result_files import own_answer
from inversion.engines.gns_engine import GNSEngine, prepare
from inversion.engines.registry import REFERENCE, engine_named
from inversion.engines.rollout_store import RolloutStore
from inversion.engines.run_store import Store
from inversion.engines.trained_model import TrainedModel, load_model
from inversion.estimation.calibrate import calibrate
from inversion.estimation.forward import Prediction
from inversion.estimation.search import SearchResult
from pipeline.progress import Watch

#: Source of the surrogate's error among the sources of uncertainty.
SOURCE = "error of the learned simulator"


def surrogate_analysis(
    case: Asked, store: Store, watch: Watch, model: Path | None, folder: Path
) -> SurrogateAnalysis:
    """The back-analysis of a section by a trained model.

    Args:
        case: with its question.
        store: of runs of the material point method.
        watch: called with the progress.
        model: folder of the model.
        folder: of the results.

    Raises:
        InputError: there is no such model or device.
    """
    assert isinstance(case, InversionCase) and model is not None
    prepare(store.device, store.threads)
    chosen = load_model(model, store.device)
    known, left_out = with_known_water(
        case.scene, case.setup.settings, thrust=chosen.simulator.config.thrust
    )
    return SurrogateAnalysis(
        replace(case, setup=replace(case.setup, settings=known)),
        store,
        watch.say,
        watch,
        model=chosen,
        rollouts=RolloutStore(folder / "rollouts"),
        on_frame=watch.frame_done,
        left_out=left_out,
    )


@dataclass(kw_only=True)
class SurrogateAnalysis(LearnedAnalysis):
    """A case under back-analysis by a learned simulator.

    Attributes:
        model: the simulator.
        rollouts: where its rollouts and their derivatives are kept.
        on_frame: called for each frame of a rollout.
        left_out: what of the case's water neither engine has here, in words.
        alone: the answer without any correction.
        judged: what the material point method predicts at the answer.
    """

    engine_name: str = "gns"

    model: TrainedModel
    rollouts: RolloutStore
    on_frame: Callable[[int, int], None] | None = None
    left_out: str = ""
    alone: SearchResult = field(init=False)
    judged: Prediction = field(init=False)
    judged_alone: Prediction = field(init=False)
    answer_std: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        super().__post_init__()
        self.truth = engine_named(REFERENCE).made(self.store)

    # --- what the engine decides ---

    def stages_to_answer(self) -> list[tuple[str, Callable[[], None]]]:
        """Alone, compared, corrected."""
        return [
            ("answer without correction", self.search_alone),
            ("paired runs", self.compare),
            ("answer", self.search),
        ]

    # --- stages ---

    def search_alone(self) -> None:
        """The answer of the learned simulator by itself, from the question's first guess."""
        if self.left_out:
            self.remark(self.left_out)
        start = self.case.setup.at(self.case.parameters.start)
        anywhere = self.case.config.inversion.outside_training
        away = self.uncorrected().distance(start, anywhere=anywhere)
        if away is not None:
            self.remark(
                f"the section lies at {away:.2f} from the training of the model {self.model.name} "
                "(1: as far as its outermost scenes from each other)"
            )
        for line in self.uncorrected().outside(start):
            self.remark(f"outside the training of the model {self.model.name}: {line}")
        self.found = self.alone = self._fit(self.case.parameters.start)
        (self.judged_alone,) = self.truth.predict([self.case.setup.at(self.found.values)])
        self.say(f"answer of the learned simulator alone: {self._described(self.found)}")

    def compare(self) -> None:
        """Run the material point method next to it around the answer: its error from now on."""
        surrogate = self.run_pairs(self.truth, self.case.config.inversion.surrogate_pairs)
        self.runs += surrogate.runs
        self.steps = self._steps(np.zeros(int(self.objective.targets.fitted.sum())), self.objective)
        self.say(
            f"material point method minus learned simulator: {', '.join(self.differences()[:6])}"
        )

    def search(self) -> None:
        """The answer with the correction; where it lies far from the pairs, these are run again."""
        self.answer_by_pairs(self.truth, self.compare)
        self.say(f"answer after {self.found.runs} rollouts: {self.found.words}")
        self._judge()
        self._uncertainty()
        self.tell_doubts()

    # --- the result ---

    def result(self) -> Result:
        """All that was found, with the engines side by side."""
        result = super().result()
        std = np.sqrt(np.diag(self.paired.covariance))
        targets, parameters = self.case.setup.targets, self.case.parameters
        surrogate = Surrogate(
            model=self.model.name,
            model_sha256=self.model.sha256,
            outside=self.uncorrected().outside(self.case.setup.at(self.found.values)),
            pairs=[
                SurrogatePair(
                    values=parameters.as_mapping(state),
                    surrogate=targets.named(quick),
                    mpm=targets.named(exact),
                )
                for state, quick, exact in zip(
                    self.paired.states, self.paired.surrogate, self.paired.truth, strict=True
                )
            ],
            mean_difference=targets.named(self.paired.correction),
            settled=self.paired.settled is not None,
            std=targets.named(np.where(np.isfinite(self.paired.mean), std, np.nan)),
            answer_std=parameters.as_mapping(self.answer_std),
            runs_mpm=self.truth.runs,
        )
        rows = [
            ("gns", "without correction", self.alone.values, self.alone.best.prediction),
            ("mpm", "at that answer", self.alone.values, self.judged_alone),
            ("mpm", "at that answer", self.found.values, self.judged),
        ]
        alone, judged_alone, judged = (
            row.model_copy(update={"values": told_values(row.values, result.answer)})
            for row in (self._engine(*one) for one in rows)
        )
        engines = [alone, judged_alone, own_answer(result), judged]
        return result.model_copy(update={"surrogate": surrogate, "engines": engines})

    def _engine(
        self, engine: str, note: str, values: np.ndarray, prediction: Prediction
    ) -> EngineAnswer:
        loss = self.case.objective().value(prediction)
        return EngineAnswer(
            name=engine_named(engine).title,
            engine=engine,
            note=note,
            spacing_m=self.case.spacing_m,
            values=self.case.parameters.as_mapping(values),
            std={},
            predicted=self.case.setup.targets.named(prediction.values),
            loss=loss if np.isfinite(loss) else None,
        )

    # --- what the stages share ---

    def uncorrected(self) -> GNSEngine:
        """The learned simulator."""
        return GNSEngine(self.rollouts, self.model, on_frame=self.on_frame)

    def _fit(self, start: np.ndarray) -> SearchResult:
        """A search with the engine and objective that are known by now."""
        method = self.case.config.inversion.method
        setup = self.case.setup
        search = self._search(self.engine, setup, self.steps, tell=True)
        found = calibrate(search, start, method=method, least_m=setup.least_move_m)
        self.runs += found.runs
        return found

    def search_again(self) -> None:
        """Search from the present answer; the evaluations follow those before."""
        before = self.found
        self.found = self._fit(before.values).after(before, self.case.config.inversion.method)

    def _judge(self) -> None:
        """The material point method at the answer; the stress before failure is its own."""
        (self.judged,) = self.truth.predict([self.case.setup.at(self.found.values)])
        prediction = replace(
            self.found.best.prediction,
            sigma_v0_kpa=self.judged.sigma_v0_kpa,
            sigma_v0_std_kpa=self.judged.sigma_v0_std_kpa,
        )
        self.found = replace(self.found, best=replace(self.found.best, prediction=prediction))
        targets = self.objective.targets
        predicted = targets.named(self.judged.values, targets.fitted)
        self.say(
            "the material point method at the answer: "
            + (
                ", ".join(f"{name} {value:.1f}" for name, value in list(predicted.items())[:6])
                or f"failed: {self.judged.reason}"
            )
        )

    def _uncertainty(self) -> None:
        """The uncertainty from the survey, and how much the surrogate's error adds to it."""
        self.answer_std = self.share_of_engine(SOURCE)

    def _manifest(self) -> dict[str, Any]:
        made = super()._manifest()
        versions = {**made["physics_versions"], "gns": gns.PHYSICS_VERSION}
        return {**made, "physics_versions": versions, "model_sha256": self.model.sha256}
