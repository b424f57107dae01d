"""Where along a measurement its numbers lie: x of a profile, time of a history.

A series is a measurement of several numbers at ascending places. Windows, neighbours and held-out
blocks are sought along series; all else is single numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.survey.measured import Measured
from geometry.survey.measured_numbers import MarkerDisplacement
from geometry.survey.measured_series import SurfaceProfile, ToeHistory, Velocity
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
        n = len(entry.values)
        axis, place, series = _places(entry, n)
        found.append(Places(entry.name, axis, place, np.arange(first, first + n), series))
        first += n
    return found


def _places(entry: Measured, n: int) -> tuple[Axis, np.ndarray, bool]:
    if isinstance(entry, SurfaceProfile):
        return "x_m", entry.profile.x.astype(float), n > 1
    if isinstance(entry, ToeHistory):
        return "time_s", np.array(entry.times_s, dtype=float), n > 1
    if isinstance(entry, MarkerDisplacement):
        return "x_m", np.full(n, entry.x_m), False
    if isinstance(entry, Velocity):
        return "time_s", np.full(n, entry.at_s), False
    return "none", np.full(n, np.nan), False
