"""Shared by all searches: the problem, its evaluations so far, the way a search ended.

An *evaluation* is one forward run with its derivative, or one run of the scan. `on_evaluation` is
called with each, so that progress can be shown, and all are kept for the history.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from inversion.estimation.derivatives import FiniteSteps, measured_noise
from inversion.estimation.forward import Forward, Prediction
from inversion.estimation.misfit import Objective

if TYPE_CHECKING:
    from inversion.estimation.forward import Setup

Kind = Literal["start", "scan", "lbfgsb", "gauss_newton", "limit"]


@dataclass(frozen=True)
class Evaluation:
    """One evaluation of the engine, p parameters, m numbers.

    Attributes:
        iteration: 0 for the start and the scan.
        kind: what asked for it.
        values: (p,).
        prediction: there.
        derivative: (m, p) per outside unit; None: not asked for.
        steps: of the finite differences (p,); None: no derivative.
        loss: there; infinite if the run failed.
        accepted: False: a step that made it worse and was taken back.
        runs: simulations asked for by the search so far.
        seconds: since the search began.
    """

    iteration: int
    kind: Kind
    values: np.ndarray
    prediction: Prediction
    derivative: np.ndarray | None
    steps: np.ndarray | None
    loss: float
    accepted: bool
    runs: int
    seconds: float


@dataclass
class Search:
    """A problem under search, with all evaluations so far.

    Attributes:
        engine: the forward engine.
        setup: the reading of the question.
        objective: what is made small.
        steps: chooses the finite differences.
        seeds: readings that differ in the seed of the jitter; they measure the noise at the first
            point where something moves. Empty: the noise in `steps` is taken as it is.
        max_iterations: evaluations with a derivative after the first, for each place the search
            starts from.
        max_runs: simulations after which no further evaluation is taken.
        on_evaluation: called with each evaluation.
    """

    engine: Forward
    setup: Setup
    objective: Objective
    steps: FiniteSteps
    seeds: Sequence[Setup] = ()
    max_iterations: int = 20
    max_runs: int = 200
    on_evaluation: Callable[[Evaluation], None] | None = None
    evaluations: list[Evaluation] = field(default_factory=list)
    began: float = field(default_factory=time.perf_counter)
    runs_before: int = field(init=False)
    _iterations_before: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.runs_before = self.engine.runs

    @property
    def runs(self) -> int:
        """Simulations this search has asked for, those for the noise included."""
        return self.engine.runs - self.runs_before

    @property
    def exhausted(self) -> bool:
        """No further evaluation is allowed."""
        iterations = self._iterations - self._iterations_before
        return iterations >= self.max_iterations or self.runs >= self.max_runs

    def start_again(self) -> None:
        """Allow as many iterations again, for a search from another place.

        Without them a search that used up its iterations in the wrong valley could see the right
        one and not go there.
        """
        self._iterations_before = self._iterations

    @property
    def _iterations(self) -> int:
        return max((evaluation.iteration for evaluation in self.evaluations), default=0)

    def evaluate(self, values: np.ndarray, kind: Kind, iteration: int) -> Evaluation:
        """Run at `values` with the derivative; learn the next steps from it."""
        steps = self.steps.steps(values)
        prediction, derivative, taken = self.engine.derivative(self.setup.at(values), steps)
        derivative = np.where(self.objective.silent(prediction)[:, None], 0.0, derivative)
        if prediction.status != "failed":
            self.steps.learn(derivative[self.objective.targets.fitted], values)
        return self.record(values, kind, iteration, prediction, derivative, taken)

    def predict(self, values: Sequence[np.ndarray]) -> list[Prediction]:
        """Predictions at many values (p,), as one batch; not evaluations yet."""
        return self.engine.predict([self.setup.at(one) for one in values])

    def measure_noise(self, evaluation: Evaluation | None, values: np.ndarray) -> None:
        """Measure the noise at `values`; the next steps follow from the derivative there."""
        if not self.seeds:
            return
        mask = self.objective.targets.fitted
        self.steps.noise = measured_noise(self.engine, self.seeds, values, mask)
        if evaluation is None or evaluation.derivative is None:
            return
        if evaluation.prediction.status != "failed":
            self.steps.learn(evaluation.derivative[mask], evaluation.values)

    def record(
        self,
        values: np.ndarray,
        kind: Kind,
        iteration: int,
        prediction: Prediction,
        derivative: np.ndarray | None = None,
        steps: np.ndarray | None = None,
    ) -> Evaluation:
        """Keep an evaluation; whether it is accepted is said later by `reject`."""
        evaluation = Evaluation(
            iteration=iteration,
            kind=kind,
            values=np.array(values, dtype=float),
            prediction=prediction,
            derivative=derivative,
            steps=steps,
            loss=self.objective.value(prediction),
            accepted=True,
            runs=self.runs,
            seconds=time.perf_counter() - self.began,
        )
        self.evaluations.append(evaluation)
        if self.on_evaluation is not None:
            self.on_evaluation(evaluation)
        return evaluation

    def reject(self, evaluation: Evaluation) -> None:
        """Mark an evaluation as a step that was taken back."""
        place = next(i for i, kept in enumerate(self.evaluations) if kept is evaluation)
        self.evaluations[place] = replace(evaluation, accepted=False)


@dataclass(frozen=True)
class SearchResult:
    """How a search ended.

    Attributes:
        best: the best point, with its derivative.
        reached: its loss is below the tolerance.
        words: why the search ended.
        evaluations: all of them, in order.
        runs: simulations asked for.
    """

    best: Evaluation
    reached: bool
    words: str
    evaluations: list[Evaluation]
    runs: int

    @property
    def values(self) -> np.ndarray:
        """The answer, (p,)."""
        return self.best.values

    @property
    def iterations(self) -> int:
        """Iterations after the start."""
        return max(evaluation.iteration for evaluation in self.evaluations)

    def after(self, before: SearchResult, kind: Kind) -> SearchResult:
        """This search as the continuation of another: its evaluations follow those before.

        Its first evaluation, a start by itself, is then one more of `kind`.
        """
        last = before.evaluations[-1]
        evaluations = [
            replace(
                evaluation,
                kind=kind if evaluation.kind == "start" else evaluation.kind,
                iteration=evaluation.iteration + last.iteration + 1,
                runs=evaluation.runs + before.runs,
                seconds=evaluation.seconds + last.seconds,
            )
            for evaluation in self.evaluations
        ]
        place = next(i for i, one in enumerate(self.evaluations) if one is self.best)
        return replace(
            self,
            best=evaluations[place],
            evaluations=[*before.evaluations, *evaluations],
            runs=self.runs + before.runs,
        )
