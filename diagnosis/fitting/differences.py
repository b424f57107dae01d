"""Derivatives of predictions by central differences, with steps that stand out of the noise.

One run at either side of each unknown. Where exactly the points lie moves every run a little, so a
step is as wide as is needed for the difference to be five times that noise, all fitted numbers
together, within limits.
"""

from __future__ import annotations

import numpy as np

from diagnosis.fitting.runs import Runs
from diagnosis.fitting.space import Space
from diagnosis.fitting.whitened import Data

#: Shortest, first and widest step of a scaled parameter; of an amplitude in units of its rung.
SHORTEST, FIRST, WIDEST = 0.08, 0.2, 0.35
#: Difference of two runs, in units of the noise of one.
FACTOR = 5.0


def central_differences(
    runs: Runs, space: Space, x: np.ndarray, prediction: np.ndarray, steps: np.ndarray, what: str
) -> np.ndarray | None:
    """Derivative (m, q) at x; None where the allowance does not cover it.

    Args:
        runs: the model.
        space: unknowns.
        x: where, (q,).
        prediction: there, jitter seed 0, (m,); used on the side whose run failed or does not exist.
        steps: half-width for each unknown, (q,).
        what: words for what is left out where the allowance ends.
    """
    sides = []
    for place in np.flatnonzero(space.free):
        for sign in (-1.0, 1.0):
            moved = x.copy()
            moved[place] += sign * steps[place]
            moved = space.clipped(moved)
            sides.append((place, moved))
    states = [space.state(moved) for _, moved in sides]
    if not runs.affords(states, what):
        return None
    rows = runs.predict(states)
    derivative = np.zeros((len(prediction), space.size))
    for number in range(0, len(sides), 2):
        place = sides[number][0]
        pair = [(sides[number + side][1][place], rows[number + side]) for side in (0, 1)]
        pair = [(at, row if np.all(np.isfinite(row)) else None) for at, row in pair]
        pair = [(at, row) if row is not None else (x[place], prediction) for at, row in pair]
        (low, before), (high, after) = pair
        if high > low:
            derivative[:, place] = (after - before) / (high - low)
    return derivative


def first_steps(space: Space) -> np.ndarray:
    """Steps (q,) before anything is known of noise or slope."""
    return np.full(space.size, FIRST)


def steps_above_noise(
    space: Space, data: Data, derivative: np.ndarray, jitter: np.ndarray
) -> np.ndarray:
    """Steps (q,) whose difference is `FACTOR` times the noise.

    Args:
        space: unknowns.
        data: weighs the numbers.
        derivative: as known so far, (m, q).
        jitter: covariance of one run's noise, (m, m).
    """
    fitted = jitter[np.ix_(data.fitted, data.fitted)]
    noise = np.sqrt(max(np.trace(data.whitener @ fitted @ data.whitener.T), 0.0))
    effect = np.linalg.norm(data.whitened(derivative), axis=0)
    wanted = FACTOR * noise / np.maximum(2.0 * effect, 1e-12)
    return np.clip(wanted, SHORTEST, WIDEST)
