"""Answers to many slightly different questions at once, from a known derivative.

Sensitivities and jitter seeds change the answer a little. Instead of a search for each, all of them
take a Gauss-Newton step with the derivative of the answer, are run as one batch, learn from what
came (Broyden's rank-one update), and step again: a few batches for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from inversion.estimation.forward import Forward, Prediction
from inversion.estimation.gauss_newton import LEAST, bounded_step, broyden
from inversion.estimation.misfit import Objective
from inversion.estimation.setup import Setup

#: Batches at most, and the largest change of a scaled parameter in one step.
ROUNDS, BOX = 5, 1.0
#: With the loss `misfit` a smaller step of every scaled parameter ends a problem.
SMALL = 0.02


@dataclass
class Problem:
    """One question: its reading and objective, where it begins, the derivative known there.

    Attributes:
        setup: the reading of the question.
        objective: with the question's targets.
        values: (p,) present best.
        slope: derivative of the fitted numbers by the scaled parameters (k, p).
        prediction: at `values`; None before the first batch.
        before: the first prediction, at the values it began with.
        frozen: direction (p,) in scaled parameters along which no step may go; None: none.
        box: largest change of a scaled parameter in one step.
        settled: the step that was left was too small to be worth a run.
    """

    setup: Setup
    objective: Objective
    values: np.ndarray
    slope: np.ndarray
    prediction: Prediction | None = None
    before: Prediction | None = None
    frozen: np.ndarray | None = None
    box: float = BOX
    settled: bool = False
    _trial: np.ndarray | None = field(default=None, repr=False)

    @property
    def loss(self) -> float:
        """At the present best; infinite before the first batch."""
        return float("inf") if self.prediction is None else self.objective.value(self.prediction)

    @property
    def reached(self) -> bool:
        """The loss is below the tolerance, or with the loss `misfit` as low as it gets."""
        if self.objective.loss == "misfit":
            return self.settled and bool(np.isfinite(self.loss))
        return self.loss < self.objective.tolerance

    @property
    def words(self) -> str:
        """How good the fit is."""
        if not self.reached:
            return f"not fitted: loss {self.loss:.2g}"
        if self.objective.loss == "misfit":
            return LEAST
        return f"loss {self.loss:.2g} below the tolerance {self.objective.tolerance:g}"

    def propose(self) -> np.ndarray | None:
        """Values of the next run (p,); None: nothing more to be done."""
        if self.prediction is None:
            self._trial = self.values
            return self._trial
        if not np.isfinite(self.loss) or self.box < 1e-3:
            return None
        if self.reached:
            return None
        here = self.objective.parameters.to_fitted(self.values)
        change = self._step(here)
        if np.max(np.abs(change)) < (SMALL if self.objective.loss == "misfit" else 1e-4):
            self.settled = True
            return None
        self._trial = self.objective.parameters.to_values(here + change)
        return self._trial

    def receive(self, prediction: Prediction) -> None:
        """Take in the run that was proposed."""
        if self.prediction is None:
            self.prediction = self.before = prediction
            return
        parameters = self.objective.parameters
        change = parameters.to_fitted(self._trial) - parameters.to_fitted(self.values)
        loss = self.objective.value(prediction)
        if np.isfinite(loss):
            gained = self.objective.counted(prediction) - self.objective.counted(self.prediction)
            self.slope = broyden(self.slope, change, gained)
        if loss < self.loss:
            self.values, self.prediction = self._trial, prediction
        else:
            self.box = 0.35 * min(self.box, float(np.max(np.abs(change))))

    @property
    def refined(self) -> np.ndarray:
        """Present best with the linear step that would be next, (p,).

        Below the tolerance no further run is worth it, yet a change of the answer is measured from
        the difference of two such points, so what each still lacks is taken into account.
        """
        if not np.isfinite(self.loss):
            return self.values
        here = self.objective.parameters.to_fitted(self.values)
        return self.objective.parameters.to_values(here + self._step(here))

    def _step(self, here: np.ndarray) -> np.ndarray:
        """Bounded least squares of the linearised residuals, as Gauss-Newton's."""
        parameters, objective = self.objective.parameters, self.objective
        matrix = np.concatenate([objective.whitener @ self.slope, objective.prior[0]])
        residuals = objective.residuals(self.prediction, here)
        if self.frozen is not None:  # a heavy weight: no step along the direction
            matrix = np.concatenate([matrix, 1e3 * self.frozen[None, :]])
            residuals = np.append(residuals, 0.0)
        low = np.maximum(parameters.fitted_low - here, -self.box)
        high = np.minimum(parameters.fitted_high - here, self.box)
        return bounded_step(matrix, -residuals, low, high)


def resolve(engine: Forward, problems: Sequence[Problem], rounds: int = ROUNDS) -> None:
    """Solve all problems in place by an engine, by at most `rounds` batches after the first."""
    for _ in range(rounds + 1):
        asked = [(problem, problem.propose()) for problem in problems]
        asked = [(problem, values) for problem, values in asked if values is not None]
        if not asked:
            return
        predictions = engine.predict([problem.setup.at(values) for problem, values in asked])
        for (problem, _), prediction in zip(asked, predictions, strict=True):
            problem.receive(prediction)
