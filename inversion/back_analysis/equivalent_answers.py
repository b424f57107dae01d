"""Other answers that fit as well: the segment through the answer along what is not determined.

Two toes cannot fix three strengths. From the answer one walks along each flat direction to either
side, and at every stop brings the fitted numbers back to their targets at right angles to it. A
walk ends at a bound, at the width of what was known before, or where the fit cannot be kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from inversion.back_analysis.perturbed_answers import Problem, resolve
from inversion.estimation.forward import Forward, Prediction
from inversion.estimation.misfit import Objective
from inversion.estimation.setup import Setup

#: Stops on either side of the answer, where one direction is flat, and where several are.
STOPS_OF_ONE, STOPS_OF_MANY = 3, 1
#: Length of a walk to one side in standard deviations beforehand: half the width of the bounds.
LENGTH = 1.74
#: A stop that cannot be brought back to the data is tried again at half the distance, so often.
HALVINGS = 2
#: Batches that bring the stops of a round back to the data.
ROUNDS = 4


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
        resolve(engine, problems, ROUNDS)
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
