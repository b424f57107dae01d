"""Shared by all searches: the problem, its evaluations so far, the way a search ended.

An *evaluation* is one forward run with its derivative, or one run of the scan. `on_evaluation` is
called with each, so that progress can be shown, and all are kept for the history.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeVar

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
        loss: there; infinite if the run failed.
        accepted: False: a step that made it worse and was taken back.
        runs: simulations asked for by the search so far.
        seconds: since the search began.
    """

    iteration: int
    kind: Kind
    values: np.ndarray
    prediction: Prediction
    loss: float
    accepted: bool
    runs: int
    seconds: float


@dataclass(frozen=True)
class Linearised(Evaluation):
    """An evaluation with the derivative there.

    Attributes:
        derivative: (m, p) per outside unit.
        steps: of the finite differences (p,); 0 where it is exact.
    """

    derivative: np.ndarray
    steps: np.ndarray


Kept = TypeVar("Kept", bound=Evaluation)


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

    def evaluate(self, values: np.ndarray, kind: Kind, iteration: int) -> Linearised:
        """Run at `values` with the derivative; learn the next steps from it."""
        steps = self.steps.steps(values)
        prediction, derivative, taken = self.engine.derivative(self.setup.at(values), steps)
        derivative = np.where(self.objective.silent(prediction)[:, None], 0.0, derivative)
        if prediction.status != "failed":
            self.steps.learn(derivative[self.objective.targets.fitted], values)
        plain = self._evaluation(values, kind, iteration, prediction)
        return self._kept(Linearised(**vars(plain), derivative=derivative, steps=taken))

    def predict(self, values: Sequence[np.ndarray]) -> list[Prediction]:
        """Predictions at many values (p,), as one batch; not evaluations yet."""
        return self.engine.predict([self.setup.at(one) for one in values])

    def measure_noise(self, evaluation: Linearised | None, values: np.ndarray) -> None:
        """Measure the noise at `values`; the next steps follow from the derivative there."""
        if not self.seeds:
            return
        mask = self.objective.targets.fitted
        self.steps.noise = measured_noise(self.engine, self.seeds, values, mask)
        if evaluation is not None and evaluation.prediction.status != "failed":
            self.steps.learn(evaluation.derivative[mask], evaluation.values)

    def record(
        self, values: np.ndarray, kind: Kind, iteration: int, prediction: Prediction
    ) -> Evaluation:
        """Keep an evaluation without a derivative; `reject` may mark it later."""
        return self._kept(self._evaluation(values, kind, iteration, prediction))

    def _evaluation(
        self, values: np.ndarray, kind: Kind, iteration: int, prediction: Prediction
    ) -> Evaluation:
        return Evaluation(
            iteration=iteration,
            kind=kind,
            values=np.array(values, dtype=float),
            prediction=prediction,
            loss=self.objective.value(prediction),
            accepted=True,
            runs=self.runs,
            seconds=time.perf_counter() - self.began,
        )

    def _kept(self, evaluation: Kept) -> Kept:
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
        best: the best point.
        reached: its loss is below the tolerance.
        words: why the search ended.
        evaluations: all of them, in order.
        runs: simulations asked for.
    """

    best: Linearised
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

        def later(evaluation: Kept) -> Kept:
            return replace(
                evaluation,
                kind=kind if evaluation.kind == "start" else evaluation.kind,
                iteration=evaluation.iteration + last.iteration + 1,
                runs=evaluation.runs + before.runs,
                seconds=evaluation.seconds + last.seconds,
            )

        best = later(self.best)
        own = [best if one is self.best else later(one) for one in self.evaluations]
        return replace(
            self,
            best=best,
            evaluations=[*before.evaluations, *own],
            runs=self.runs + before.runs,
        )
