"""Random numbers that are the same on every machine and for every order of drawing.

A stream is named by whole numbers (seed, scale, index, purpose). numpy promises the raw bits of
Philox and of SeedSequence for good, but not how its distributions use them: those few are here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def number_of(name: str) -> int:
    """A whole number that stands for a name; the same for every Python, unlike ``hash``."""
    return int.from_bytes(name.encode("utf-8"), "big")


class Stream:
    """A row of random numbers named by whole numbers of any size."""

    def __init__(self, *key: int) -> None:
        self._bits = np.random.Philox(np.random.SeedSequence(key))

    def unit(self) -> float:
        """Uniform in [0, 1), a multiple of 2^-53."""
        return float(int(self._bits.random_raw()) >> 11) * 2.0**-53

    def uniform(self, low: float, high: float) -> float:
        """Uniform in [low, high)."""
        return low + (high - low) * self.unit()

    def integer(self, low: int, high: int) -> int:
        """One of low, ..., high."""
        return low + int(self.unit() * (high - low + 1))

    def pick(self, weights: Sequence[float]) -> int:
        """A place in `weights`, each as likely as its weight."""
        target = self.unit() * sum(weights)
        for place, weight in enumerate(weights):
            target -= weight
            if target < 0.0:
                return place
        return max(place for place, weight in enumerate(weights) if weight > 0.0)

    def direction(self) -> tuple[float, float]:
        """A unit vector, every direction equally likely; without sine and cosine."""
        while True:
            x, y = self.uniform(-1.0, 1.0), self.uniform(-1.0, 1.0)
            square = x * x + y * y
            if 0.01 < square < 1.0:
                return x / square**0.5, y / square**0.5

    def seed(self) -> int:
        """A whole number below 2^63."""
        return int(self._bits.random_raw()) >> 1


def unit_array(seed: int, shape: tuple[int, ...]) -> np.ndarray:
    """Uniform numbers in [0, 1) of a shape, from one seed."""
    raw = np.random.Philox(np.random.SeedSequence(seed)).random_raw(int(np.prod(shape)))
    return ((raw >> np.uint64(11)).astype(float) * 2.0**-53).reshape(shape)
