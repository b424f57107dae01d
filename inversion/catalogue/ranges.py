"""Ranges of the strength ratio of flow slides that a secondary source transcribes.

In: `ratio_ranges.csv` of `case_histories/`. Out: `RatioRange` entries, their geometric mean and
scatter. For comparison only; no answer has them as an input.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inversion.catalogue.catalogue import FOLDER, number_of, rows_of
from pipeline.cli import InputError

FILE = "ratio_ranges.csv"
SOURCE = (
    "Table 6.5 of Jefferies and Been (2016), as transcribed on a public study page: secondary, "
    "not checked against the book"
)


@dataclass(frozen=True)
class RatioRange:
    """S_r / sigma'_v0 of one slide, between `low` and `high`."""

    name: str
    low: float
    high: float

    @property
    def log_middle(self) -> float:
        """Ln of the geometric middle."""
        return 0.5 * math.log(self.low * self.high)


def load_ranges(folder: Path = FOLDER) -> list[RatioRange]:
    """The ranges.

    Raises:
        InputError: no such file, a missing column, or a range whose ends are no range.
    """
    found = []
    for where, row in rows_of(folder / FILE, RatioRange.__dataclass_fields__):
        low, high = number_of(row, "low", where), number_of(row, "high", where)
        if low > high:
            raise InputError(f"{where}: low {low:g} exceeds high {high:g}")
        found.append(RatioRange(row["name"], low, high))
    return found


def geometric_mean(ranges: Sequence[RatioRange]) -> tuple[float, float]:
    """Geometric mean of the middles, and the standard deviation of their logarithm."""
    logs = np.array([one.log_middle for one in ranges])
    return float(np.exp(logs.mean())), float(logs.std(ddof=1))
