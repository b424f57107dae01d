"""Answers to many slightly different questions at once, from a known derivative.

Sensitivities and jitter seeds change the answer a little. Instead of a search for each, all of them
take a Gauss-Newton step with the derivative of the answer, are run as one batch, learn from what
came (Broyden's rank-one update), and step again: a few batches for all.

Other answers that fit as well are found in the same way. Two toes cannot fix three strengths: from
the answer one walks along each flat direction to either side, and at every stop brings the fitted
numbers back to their targets at right angles to it. A walk ends at a bound, at the width of what
was known before, or where the fit cannot be kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inversion.estimation.forward import Forward, Prediction, Setup
from inversion.estimation.gauss_newton import LEAST, bounded_step, broyden
from inversion.estimation.misfit import Objective

#: Batches at most, and the largest change of a scaled parameter in one step.
ROUNDS, BOX = 5, 1.0
#: With the loss `misfit` a smaller step of every scaled parameter ends a problem.
SMALL = 0.02
#: Stops on either side of the answer, where one direction is flat, and where several are.
STOPS_OF_ONE, STOPS_OF_MANY = 3, 1
#: Length of a walk to one side in standard deviations beforehand: half the width of the bounds.
LENGTH = 1.74
#: A stop that cannot be brought back to the data is tried again at half the distance, so often.
HALVINGS = 2
#: Batches that bring the stops of a round back to the data.
WALK_ROUNDS = 4


@dataclass
class Problem:
    """One question: its reading and objective, where it begins, the derivative known there.

    Attributes:
        setup: the reading of the question.
        objective: with the question's targets.
        values: (p,) present best.
        slope: derivative of the fitted numbers by the scaled parameters (k, p).
        ran: the prediction at `values`; None before the first batch.
        began: the first prediction, at the values it began with.
        frozen: direction (p,) in scaled parameters along which no step may go; None: none.
        box: largest change of a scaled parameter in one step.
        settled: the step that was left was too small to be worth a run.
    """

    setup: Setup
    objective: Objective
    values: np.ndarray
    slope: np.ndarray
    ran: Prediction | None = None
    began: Prediction | None = None
    frozen: np.ndarray | None = None
    box: float = BOX
    settled: bool = False
    _trial: np.ndarray | None = field(default=None, repr=False)

    @property
    def prediction(self) -> Prediction:
        """At `values`, once a batch was run."""
        assert self.ran is not None
        return self.ran

    @property
    def before(self) -> Prediction:
        """At the values it began with, once a batch was run."""
        assert self.began is not None
        return self.began

    @property
    def loss(self) -> float:
        """At the present best; infinite before the first batch."""
        return float("inf") if self.ran is None else self.objective.value(self.ran)

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
        if self.ran is None:
            return self.values
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
        if self.ran is None or self._trial is None:
            self.ran = self.began = prediction
            return
        parameters = self.objective.parameters
        change = parameters.to_fitted(self._trial) - parameters.to_fitted(self.values)
        loss = self.objective.value(prediction)
        if np.isfinite(loss):
            gained = self.objective.counted(prediction) - self.objective.counted(self.prediction)
            self.slope = broyden(self.slope, change, gained)
        if loss < self.loss:
            self.values, self.ran = self._trial, prediction
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
        asked = [
            (problem, values) for problem in problems if (values := problem.propose()) is not None
        ]
        if not asked:
            return
        predictions = engine.predict([problem.setup.at(values) for problem, values in asked])
        for (problem, _), prediction in zip(asked, predictions, strict=True):
            problem.receive(prediction)


@dataclass(frozen=True)
class EquivalentAnswer:
    """One of the equally good answers.

    Attributes:
        along: number of the flat direction.
        values: (p,).
        prediction: there.
        loss: below the tolerance, or as good as the answer's.
    """

    along: int
    values: np.ndarray
    prediction: Prediction
    loss: float


@dataclass
class Walker:
    """One on the way along a flat direction, to one side.

    Attributes:
        along: number of the direction.
        heading: unit vector (p,) in scaled parameters, turned with the way.
        values: where the walker stands (p,).
        slope: derivative known there (k, p).
        left: stops still to be made; stride: distance to the next.
        halvings: still allowed.
    """

    along: int
    heading: np.ndarray
    values: np.ndarray
    slope: np.ndarray
    left: int
    stride: float
    halvings: int = HALVINGS

    def turn(self) -> None:
        """Turn the heading into what the data do not notice here."""
        noticed = np.linalg.pinv(self.slope, rcond=1e-6) @ (self.slope @ self.heading)
        ahead = self.heading - noticed
        if np.linalg.norm(ahead) > 0.3:
            self.heading = ahead / np.linalg.norm(ahead)


def walk(
    engine: Forward,
    setup: Setup,
    objective: Objective,
    values: np.ndarray,
    slope: np.ndarray,
    flat: np.ndarray,
    loss: float,
) -> list[EquivalentAnswer]:
    """Walk along flat directions.

    Args:
        engine: the forward engine.
        setup: the reading of the question.
        objective: of the answer; its priors and preferences do not count here.
        values: the answer (p,).
        slope: derivative of the fitted numbers by the scaled parameters there (k, p).
        flat: directions (q, p) in scaled parameters.
        loss: of the answer; a stop may be as bad, if that is above the tolerance.

    Returns:
        the stops, along each direction from one end to the other.
    """
    data_alone = replace(objective, data_alone=True)
    stops = STOPS_OF_ONE if len(flat) == 1 else STOPS_OF_MANY
    good_enough = max(objective.tolerance, 1.5 * loss)
    walkers = [
        Walker(along, sense * flat[along], values, slope, stops, LENGTH / stops)
        for along in range(len(flat))
        for sense in (1.0, -1.0)
    ]
    found: list[EquivalentAnswer] = []
    while walkers:
        problems = [_ahead(setup, data_alone, walker) for walker in walkers]
        resolve(engine, problems, WALK_ROUNDS)
        for walker, problem in zip(walkers, problems, strict=True):
            if problem.loss < good_enough:
                found.append(
                    EquivalentAnswer(walker.along, problem.values, problem.prediction, problem.loss)
                )
                walker.values, walker.slope = problem.values, problem.slope
                walker.left -= 1
                if any(objective.parameters.at_bound(problem.values)):
                    walker.left = 0
            else:
                walker.stride *= 0.5
                walker.halvings -= 1
        walkers = [walker for walker in walkers if walker.left > 0 and walker.halvings >= 0]
    fitted = objective.parameters.to_fitted
    return sorted(found, key=lambda stop: (stop.along, flat[stop.along] @ fitted(stop.values)))


def _ahead(setup: Setup, objective: Objective, walker: Walker) -> Problem:
    """The next stop of a walker, still to be brought back to the data."""
    walker.turn()
    here = objective.parameters.to_fitted(walker.values)
    far = reach(objective, here, walker.heading, walker.stride)
    start = objective.parameters.to_values(here + far * walker.heading)
    return Problem(setup, objective, start, walker.slope, frozen=walker.heading)


def reach(objective: Objective, here: np.ndarray, direction: np.ndarray, length: float) -> float:
    """How far one may go along a direction, at most `length`, before a bound is met."""
    low, high = objective.parameters.fitted_low, objective.parameters.fitted_high
    room = np.where(direction > 0, high - here, here - low)
    with np.errstate(divide="ignore"):
        return float(min(length, np.min(room / np.maximum(np.abs(direction), 1e-12))))
