"""Other answers that fit as well: the segment through the answer along what is not determined.

Two toes cannot fix three strengths. From the answer one walks along each flat direction to either
side, and at every stop brings the fitted numbers back to their targets at right angles to it. A
walk ends at a bound, at the width of what was known before, or where the fit cannot be kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from inversion.forward import Forward, Prediction
from inversion.objective import Objective
from inversion.resolve import Problem, resolve

#: Stops on either side of the answer, where one direction is flat, and where several are.
STOPS_OF_ONE, STOPS_OF_MANY = 3, 1
#: Length of a walk to one side in standard deviations beforehand: half the width of the bounds.
LENGTH = 1.74


@dataclass(frozen=True)
class Stop:
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


def walk(
    engine: Forward,
    objective: Objective,
    values: np.ndarray,
    slope: np.ndarray,
    flat: np.ndarray,
    loss: float,
) -> list[Stop]:
    """Walk along flat directions.

    Args:
        engine: the forward engine.
        objective: of the answer; its preferences do not count here.
        values: the answer (p,).
        slope: derivative of the fitted numbers by the scaled parameters there (k, p).
        flat: directions (q, p) in scaled parameters.
        loss: of the answer; a stop may be as bad, if that is above the tolerance.
    """
    data_alone = DataAlone(**vars_of(objective))
    stops = STOPS_OF_ONE if len(flat) == 1 else STOPS_OF_MANY
    parameters = objective.parameters
    found = []
    walkers = [(q, sense, values, slope) for q in range(len(flat)) for sense in (1.0, -1.0)]
    for _ in range(stops):
        problems = []
        for q, sense, at, known in walkers:
            here = parameters.to_fitted(at)
            far = reach(objective, here, sense * flat[q], LENGTH / stops)
            ahead = here + sense * far * flat[q]
            start = parameters.to_values(ahead)
            problems.append((q, sense, Problem(engine, data_alone, start, known, frozen=flat[q])))
        resolve([problem for _, _, problem in problems], rounds=3)
        walkers = []
        for q, sense, problem in problems:
            if not np.isfinite(problem.loss):
                continue
            if problem.loss < max(objective.tolerance, 1.5 * loss):
                found.append(Stop(q, problem.values, problem.prediction, problem.loss))
                if not any(parameters.at_bound(problem.values)):
                    walkers.append((q, sense, problem.values, problem.slope))
        if not walkers:
            break
    return sorted(found, key=lambda stop: (stop.along, float(flat[stop.along]
                  @ parameters.to_fitted(stop.values))))  # fmt: skip


def reach(objective: Objective, here: np.ndarray, direction: np.ndarray, length: float) -> float:
    """How far one may go along a direction, at most `length`, before a bound is met."""
    low, high = objective.parameters.fitted_low, objective.parameters.fitted_high
    room = np.where(direction > 0, high - here, here - low)
    with np.errstate(divide="ignore"):
        return float(min(length, np.min(room / np.maximum(np.abs(direction), 1e-12))))


class DataAlone(Objective):
    """An objective without priors and preferences: every answer that fits is as good."""

    @property
    def regularisation(self) -> tuple[np.ndarray, np.ndarray]:
        """A faint pull to nowhere in particular: steps stay as short as they can."""
        p = len(self.parameters.specs)
        return np.zeros((0, p)), np.zeros(0)


def vars_of(objective: Objective) -> dict:
    """The fields of an objective, for one of another kind."""
    copy = replace(objective)
    return {name: getattr(copy, name) for name in ("parameters", "targets", "loss", "tolerance")}
