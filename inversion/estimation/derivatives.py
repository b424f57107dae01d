"""Derivatives by finite differences, one- or two-sided, with steps chosen from measured noise.

A simulation is not a smooth function: where exactly its points lie moves a toe by decimetres. A
step is wide enough when its effect on some fitted number is at least five times that noise, and no
wider than needed, so that curvature does not show. Where many numbers are fitted together (loss
`misfit`) the gradient of their sum must stand out of the noise, not the most sensitive of them: the
effect and the noise of all are then compared, each in units of its error.

The search of a back-analysis takes one-sided differences (`Forward.derivative`, `FiniteSteps`): one
run for each parameter. A response surface takes central ones (`central_differences`): one run on
either side of each unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from inversion.estimation.budget import Runs
from inversion.estimation.data import Data
from inversion.estimation.forward import Forward, Prediction, Setup
from inversion.estimation.unknowns import Parameters, Unknowns

#: Least effect of a step, in units of the noise of one run: a slope of two runs errs by 28 %.
FACTOR = 5.0
#: Shortest, first and widest step of central differences: of a scaled parameter, and of an
#: amplitude in units of its rung. By judgement: a logarithm of 0.35 is a factor of 1.4, beyond
#: which a slope is that of another place; 0.08 keeps out what a few points do.
SHORTEST, FIRST, WIDEST = 0.08, 0.2, 0.35
#: The same of one-sided ones: of a logarithm, and as shares of the width of the bounds.
LOG_STEPS, SHARE_STEPS = (0.02, 0.04, Setup.widest_log), (0.1, 0.25, 0.45)


@dataclass
class FiniteSteps:
    """Chooses steps; learns from every derivative.

    Attributes:
        parameters: what is to be found.
        noise: standard deviation of the fitted numbers over seeds, (k,); zeros: no noise known.
        factor: least effect of a step, in units of the noise.
        whitener: (k, k), makes the errors of the fitted numbers independent, of variance 1; None:
            the most sensitive number decides.
        widest_log: widest step of a logarithm.
    """

    parameters: Parameters
    noise: np.ndarray
    factor: float = FACTOR
    whitener: np.ndarray | None = None
    widest_log: float = LOG_STEPS[2]
    _size: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self._size = self._limits()[1]

    def steps(self, values: np.ndarray) -> np.ndarray:
        """Signed steps of the values, (p,): strengths downwards, since weaker soil moves.

        A step goes the other way where the bound leaves no room.
        """
        fitted = self.parameters.to_fitted(values)
        down, up = fitted - self.parameters.fitted_low, self.parameters.fitted_high - fitted
        prefer_down = self.parameters.logarithmic | (down > up)
        room = np.where(prefer_down, down, up)
        turned = (room < self._size) & (room < np.maximum(down, up))
        sign = np.where(prefer_down ^ turned, -1.0, 1.0)
        room = np.where(sign < 0, down, up)
        size = np.minimum(self._size, room)
        return self.parameters.to_values(fitted + sign * size) - values

    def learn(self, derivative: np.ndarray, values: np.ndarray) -> None:
        """Choose the next steps by a derivative of the fitted numbers, (k, p) per outside unit."""
        slope = np.nan_to_num(derivative) * self.parameters.value_per_fitted(values)
        shortest, _, widest = self._limits()
        if not np.any(self.noise > 0):
            return
        strongest = self._effect(slope)
        with np.errstate(divide="ignore"):
            wanted = self.factor / strongest
        self._size = np.clip(wanted, shortest, widest)

    def resolved(self, derivative: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """(p,) bool: the step taken had an effect of at least `factor` times the noise.

        Args:
            derivative: of the fitted numbers, (k, p) per outside unit.
            steps: taken, (p,); 0 for an exact derivative, which is always resolved.
        """
        effect = np.nan_to_num(derivative) * steps[None, :]
        if not np.any(self.noise > 0):
            enough = np.any(effect != 0, axis=0)
        else:
            enough = self._effect(effect) >= self.factor * (1.0 - 1e-9)
        return (enough & (steps != 0)) | ((steps == 0) & np.any(derivative != 0, axis=0))

    def signal(self, derivative: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Share of each column of a derivative that is not noise, (p,), 0 to 1.

        The difference of two runs holds noise of variance 2; so much is taken off the square of
        the effect. A column that is nothing but noise would otherwise pass for knowledge.
        Arguments as of `resolved`.
        """
        if not np.any(self.noise > 0):
            return np.ones(len(steps))
        effect = self._effect(np.nan_to_num(derivative) * steps[None, :])
        with np.errstate(divide="ignore"):
            share = np.sqrt(np.maximum(0.0, 1.0 - 2.0 / effect**2))
        return np.where(steps == 0, 1.0, share)

    def _effect(self, change: np.ndarray) -> np.ndarray:
        """Change of the fitted numbers (k, p) in units of their noise, (p,)."""
        if self.whitener is None:
            return np.max(np.abs(change) / np.maximum(self.noise, 1e-12)[:, None], axis=0)
        noise = np.linalg.norm(self.whitener * self.noise[None, :])
        return np.linalg.norm(self.whitener @ change, axis=0) / max(noise, 1e-12)

    def _limits(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Shortest, first and widest step in fitted units, (p,) each."""
        parameters = self.parameters
        width = parameters.fitted_high - parameters.fitted_low
        shortest, first, widest = (
            np.where(parameters.logarithmic, log / parameters.prior_std, share * width)
            for log, share in zip((*LOG_STEPS[:2], self.widest_log), SHARE_STEPS, strict=True)
        )
        return shortest, first, widest


def noise_of(predictions: Sequence[Prediction], mask: np.ndarray) -> np.ndarray:
    """Standard deviation of the chosen numbers over runs that differ in the seed, (k,).

    Runs that failed are left out; with fewer than two left the noise is unknown and 0.
    """
    kept = [p.values[mask] for p in predictions if np.all(np.isfinite(p.values[mask]))]
    if len(kept) < 2:
        return np.zeros(int(np.sum(mask)))
    return np.std(kept, axis=0, ddof=1)


def measured_noise(
    engine: Forward, setups: Sequence[Setup], values: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """Noise (k,) at `values` from readings that differ in nothing but the seed of the jitter."""
    return noise_of(engine.predict([setup.at(values) for setup in setups]), mask)


def central_differences(
    runs: Runs,
    space: Unknowns,
    x: np.ndarray,
    prediction: np.ndarray,
    steps: np.ndarray,
    what: str,
    *,
    known: np.ndarray | None = None,
) -> np.ndarray | None:
    """Derivative (m, q) at x; None where the allowance does not cover it.

    Args:
        runs: the model.
        space: unknowns.
        x: where, (q,).
        prediction: there, jitter seed 0, (m,); used on the side whose run failed or does not exist.
        steps: half-width for each unknown, (q,).
        what: words for what is left out where the allowance ends.
        known: a derivative (m, q) whose columns stay for unknowns that are held; None: zeros.
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
    if known is not None:
        derivative[:, ~space.free] = known[:, ~space.free]
    for number in range(0, len(sides), 2):
        place = sides[number][0]
        pair = [(sides[number + side][1][place], rows[number + side]) for side in (0, 1)]
        pair = [(at, row if np.all(np.isfinite(row)) else None) for at, row in pair]
        pair = [(at, row) if row is not None else (x[place], prediction) for at, row in pair]
        (low, before), (high, after) = pair
        if high > low:
            derivative[:, place] = (after - before) / (high - low)
    return derivative


def first_steps(space: Unknowns) -> np.ndarray:
    """Steps (q,) before anything is known of noise or slope."""
    return np.full(space.size, FIRST)


def steps_above_noise(
    space: Unknowns, data: Data, derivative: np.ndarray, jitter: np.ndarray
) -> np.ndarray:
    """Steps (q,) whose difference is `FACTOR` times the noise.

    Args:
        space: unknowns.
        data: weighs the numbers.
        derivative: as known so far, (m, q).
        jitter: covariance of one run's noise, (m, m).
    """
    noise = data.noise(jitter)
    effect = np.linalg.norm(data.whitened(derivative), axis=0)
    wanted = FACTOR * noise / np.maximum(2.0 * effect, 1e-12)
    return np.clip(wanted, SHORTEST, WIDEST)
