"""Incremental momentum (Weber 2015): forces on a sequence of sections, momentum in between.

In: the forces at sections from before to after, at least five. Out: the S_r with which a mass that
starts at rest comes to rest at the last one, and its history.

An analyst draws the sections; here they are morphed by machine (`morph`), and results say so. At
section k, F_k = D_k - S_r L_k - T_k. Between two sections the acceleration F / m goes linearly with
the travel of the centre of gravity, so v^2 grows by (a_k + a_(k+1)) ds, and S_r is bisected until
v = 0 at the last.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from inversion.classical.kinetics import Motion
from inversion.classical.slide_forces import SlideForces
from pipeline.cli import WorkFailed

#: Fewer sections than this do not follow the slide.
FEWEST_SECTIONS = 5


def travel_of(stages: Sequence[SlideForces]) -> np.ndarray:
    """Travel of the centre of gravity up to each section, (K,) [m]."""
    steps = [
        float(np.hypot(*(b.centre - a.centre))) for a, b in zip(stages, stages[1:], strict=False)
    ]
    return np.concatenate([[0.0], np.cumsum(steps)])


def squared_velocity(stages: Sequence[SlideForces], residual_strength: float) -> np.ndarray:
    """v^2 at each section, (K,) [m2/s2]; negative where the work would be used up earlier."""
    a = _accelerations(stages, residual_strength)
    gains = (a[1:] + a[:-1]) * np.diff(travel_of(stages))
    return np.concatenate([[0.0], np.cumsum(gains)])


def least_squared_velocity(stages: Sequence[SlideForces], residual_strength: float) -> np.ndarray:
    """Least v^2 after the start of each of the K - 1 steps between sections [m2/s2].

    It lies at the end of a step, or within it where the mass brakes first and then gains.
    """
    a = _accelerations(stages, residual_strength)
    squared = squared_velocity(stages, residual_strength)
    least = squared[1:].copy()
    turns = (a[:-1] < 0) & (a[1:] > 0)
    steps = np.diff(travel_of(stages))[turns]
    before, after = a[:-1][turns], a[1:][turns]
    least[turns] = squared[:-1][turns] - before**2 * steps / (after - before)
    return least


def find_strength(stages: Sequence[SlideForces], shares: Sequence[float]) -> tuple[float, Motion]:
    """The S_r [Pa] with which the mass stops at the last section.

    Args:
        stages: forces at the sections, in order, at least `FEWEST_SECTIONS`.
        shares: of the displacement at each.

    Returns:
        S_r [Pa] and the history, one row per section.

    Raises:
        ValueError: too few sections.
        WorkFailed: the mass does not start, or stops on the way, whatever S_r.
    """
    if len(stages) < FEWEST_SECTIONS:
        raise ValueError(f"{len(stages)} sections: at least {FEWEST_SECTIONS}")
    low, high = 0.0, 1.0
    if squared_velocity(stages, 0.0)[-1] <= 0:
        raise WorkFailed("the mass stops earlier than it was found even without S_r")
    while squared_velocity(stages, high)[-1] > 0:
        low, high = high, 2.0 * high
    for _ in range(60):
        middle = 0.5 * (low + high)
        if squared_velocity(stages, middle)[-1] > 0:
            low = middle
        else:
            high = middle
    strength = 0.5 * (low + high)
    squared = squared_velocity(stages, strength)
    stopped = least_squared_velocity(stages, strength)[:-1] <= 0
    if np.any(stopped):
        place = shares[1 + int(np.argmax(stopped))]
        raise WorkFailed(
            "with the S_r that balances the work the mass would stop at "
            f"{100 * place:.0f} % of the displacement"
        )
    return strength, _history(stages, shares, strength, squared)


def _accelerations(stages: Sequence[SlideForces], strength: float) -> np.ndarray:
    return np.array([stage.net(strength) / stage.mass for stage in stages])


def _history(
    stages: Sequence[SlideForces],
    shares: Sequence[float],
    strength: float,
    squared: np.ndarray,
) -> Motion:
    """The motion through all sections; the acceleration is linear in the travel between two."""
    travel = travel_of(stages)
    a = _accelerations(stages, strength)
    velocity = np.sqrt(np.maximum(squared, 0.0))
    velocity[-1] = 0.0
    steps = [
        _duration(a0, a1, v0, v1, ds)
        for a0, a1, v0, v1, ds in zip(
            a, a[1:], velocity, velocity[1:], np.diff(travel), strict=False
        )
    ]
    time = np.concatenate([[0.0], np.cumsum(steps)])
    return Motion(time, travel, velocity, a, np.asarray(shares, dtype=float))


def _duration(a0: float, a1: float, v0: float, v1: float, ds: float) -> float:
    """Time over `ds` with acceleration a0 + k s: v' = a0 + k s and s' = v, solved exactly.

    From v(t) = v0 C + a0 S with C, S = cosh, sinh(w t) and w^2 = k, or their circular forms.
    """
    k = (a1 - a0) / ds
    if abs(k) * ds < 1e-9 * max(abs(a0), abs(a1), 1e-12):
        return 2.0 * ds / (v0 + v1)
    w = math.sqrt(abs(k))
    if k > 0:
        # a + w v grows as exp(w t).
        return math.log((a1 + w * v1) / (a0 + w * v0)) / w
    # (a, w v) turns by the angle w t.
    start, end = math.atan2(w * v0, a0), math.atan2(w * v1, a1)
    return (end - start) / w
