"""Velocities and accelerations of moving points: means, spreads and extremes, run by run.

Dimensionless (METHODS: lengths in spacings d, time in sqrt(d / g)): velocity v / sqrt(g d) over one
frame, acceleration a / g over two. Only soil that moves counts, or a data set of mostly resting
points would have hardly any spread: a point moves at a frame if it is faster than SLOWEST before or
after it. The frames before t = 0 are those of the first window (`scene_facts.before`).

Moments of disjoint samples are merged by the formula of Chan, Golub and LeVeque (1979), which does
not cancel, in whatever order. Nothing but the moments of a run is kept.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from gns.data.scene_facts import SOIL, SceneFacts, before

SLOWEST = 0.01
"""Speed [sqrt(g d)] above which a point moves."""

BLOCK = 32
"""Frames that are looked at at once."""


@dataclass(frozen=True)
class Moments:
    """Of a sample of vectors.

    Attributes:
        count: of vectors.
        mean: (2,).
        squares: sum of squared differences from the mean (2,).
        low, high: extremes (2,).
    """

    count: int
    mean: np.ndarray
    squares: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> Moments:
        """Of vectors (n, 2), in two passes."""
        if len(values) == 0:
            return cls(0, *np.zeros((2, 2)), np.full(2, np.inf), np.full(2, -np.inf))
        mean = values.mean(axis=0)
        squares = ((values - mean) ** 2).sum(axis=0)
        return cls(len(values), mean, squares, values.min(axis=0), values.max(axis=0))

    def merged(self, other: Moments) -> Moments:
        """Of both samples together."""
        count = self.count + other.count
        if count == 0:
            return self
        difference = other.mean - self.mean
        return Moments(
            count,
            self.mean + difference * (other.count / count),
            self.squares + other.squares + difference**2 * (self.count * (other.count / count)),
            np.minimum(self.low, other.low),
            np.maximum(self.high, other.high),
        )

    @property
    def std(self) -> np.ndarray:
        """Standard deviation (2,), of the sample itself (divisor n); 0 for an empty one."""
        return np.sqrt(self.squares / max(self.count, 1))

    def stored(self) -> np.ndarray:
        """As (5, 2) float64: count (twice), mean, squares, low, high."""
        return np.stack(
            [np.full(2, float(self.count)), self.mean, self.squares, self.low, self.high]
        )

    @classmethod
    def from_stored(cls, values: np.ndarray) -> Moments:
        """The reverse of `stored`."""
        return cls(int(values[0, 0]), *values[1:])


def run_moments(positions: np.ndarray, facts: SceneFacts) -> tuple[Moments, Moments]:
    """Moments of the velocities and accelerations of the moving points of a run.

    Args:
        positions: (T, N, 2) [m].
        facts: of its scene.

    Returns:
        of v / sqrt(g d) and of a / g, at all frames but the last.
    """
    soil = facts.type == SOIL
    start = positions[0, soil].astype(np.float64)
    earlier = before(start, facts.initial_velocity[soil], facts.frame_time, 1)
    velocity = acceleration = Moments.of(np.zeros((0, 2)))
    for first in range(0, len(positions) - 1, BLOCK):
        now = positions[first : first + BLOCK + 1, soil].astype(np.float64)
        past = earlier if first == 0 else positions[first - 1 : first, soil]
        old, new = velocities(np.concatenate([past, now]), facts)
        moves = moving(old, new)
        velocity = velocity.merged(Moments.of(old[moves]))
        change = (new[moves] - old[moves]) / facts.frame_interval
        acceleration = acceleration.merged(Moments.of(change))
    return velocity, acceleration


def velocities(frames: np.ndarray, facts: SceneFacts) -> tuple[np.ndarray, np.ndarray]:
    """Velocity [sqrt(g d)] before and after each frame but the first and the last.

    Args:
        frames: (T, N, 2) [m].
        facts: of the scene.

    Returns:
        two of (T - 2, N, 2).
    """
    steps = np.diff(frames, axis=0) / (facts.spacing * facts.frame_interval)
    return steps[:-1], steps[1:]


def moving(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Which points move: velocities before and after (..., 2) [sqrt(g d)] -> (...) bool."""
    fastest = np.maximum((old**2).sum(axis=-1), (new**2).sum(axis=-1))
    return fastest > SLOWEST**2


def merge(moments: Iterable[Moments]) -> Moments:
    """Of all samples together, merged in the order given."""
    return reduce(Moments.merged, moments, Moments.of(np.zeros((0, 2))))
