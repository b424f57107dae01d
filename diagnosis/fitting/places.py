"""Where along a measurement its numbers lie: x of a profile, time of a history.

A series is a measurement of several numbers at ascending places. Windows, neighbours and held-out
blocks are sought along series; all else is single numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from inversion.problem.predictions import Targets

Axis = Literal["x_m", "time_s", "none"]


@dataclass(frozen=True)
class Places:
    """Numbers of one measurement.

    Attributes:
        name: of the measurement.
        axis: what `place` is.
        place: where or when, (n,) in m or s; NaN where the measurement has no place.
        index: of its numbers in the vector of all, (n,).
        series: they follow each other along the axis.
    """

    name: str
    axis: Axis
    place: np.ndarray
    index: np.ndarray
    series: bool


def places_of(targets: Targets) -> list[Places]:
    """Places of every measurement, in the order of the entries."""
    found, first = [], 0
    for entry in targets.entries:
        n, along = len(entry.values), entry.along
        index = np.arange(first, first + n)
        if along is None:
            found.append(Places(entry.name, "none", np.full(n, np.nan), index, False))
        else:
            found.append(Places(entry.name, along.axis, along.place, index, along.series))
        first += n
    return found
