"""Shares with their intervals (Wilson 1927)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

#: Two-sided 95 %.
NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Share:
    """How many of how many."""

    hits: int
    n: int

    @classmethod
    def of(cls, outcomes: Iterable[bool]) -> Share:
        """The share of true ones."""
        known = list(outcomes)
        return cls(sum(known), len(known))

    @property
    def value(self) -> float | None:
        """Hits / n; None of nothing."""
        return self.hits / self.n if self.n else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval; (0, 1) of nothing."""
        return wilson(self.hits, self.n)

    @property
    def document(self) -> dict:
        """As JSON has it."""
        low, high = self.interval
        return {"hits": self.hits, "n": self.n, "low": round(low, 4), "high": round(high, 4)}

    @property
    def words(self) -> str:
        """For a table: 83 % (71-91), 40 of 48."""
        if not self.n:
            return "none"
        low, high = (100.0 * end for end in self.interval)
        return f"{100.0 * self.hits / self.n:.0f} % ({low:.0f}-{high:.0f}), {self.hits} of {self.n}"


def wilson(hits: int, n: int, z: float = NORMAL_95) -> tuple[float, float]:
    """Interval of a share: where its score test does not refuse it.

    Raises:
        ValueError: more hits than trials.
    """
    if not 0 <= hits <= n:
        raise ValueError(f"{hits} hits of {n}")
    if n == 0:
        return 0.0, 1.0
    share, square = hits / n, z * z
    middle = (share + square / (2 * n)) / (1 + square / n)
    half = z * math.sqrt(share * (1 - share) / n + square / (4 * n * n)) / (1 + square / n)
    # At the ends rounding alone would leave 1e-17.
    low = 0.0 if hits == 0 else max(middle - half, 0.0)
    high = 1.0 if hits == n else min(middle + half, 1.0)
    return low, high
