"""What a forecast of a direct model says of the way between start and end.

In: a `Forecast`, which has the times at which a toe and the soil have done shares of their way.
Out: the numbers of a `slide_duration` and of a `toe_history`, and the standard deviation of the
model's error of each. Between two shares a toe and the soil are taken to move evenly, and the last
hundredth of a toe's travel to take as long as the four before it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeGuard

import numpy as np

from geometry.sides import SIDES, Side, outward_of
from geometry.survey.measured import Measured
from geometry.survey.slide_duration import SlideDuration
from geometry.survey.toe_history import ToeHistory
from gns.direct.arrivals import SHARES, WAY
from gns.direct.predictor import Forecast

#: Types of measurement that are read on these times.
TIMED = ("slide_duration", "toe_history")
#: Half-width of a 90 % interval over the standard deviation of a normal distribution.
NORMAL = 1.645


def timed(entry: Measured) -> TypeGuard[SlideDuration | ToeHistory]:
    """Whether these times tell a measurement."""
    if _lasts(entry):
        return SHARES[0] <= entry.between[0] and entry.between[1] <= SHARES[-1]
    return entry.type in TIMED


def _lasts(entry: Measured) -> TypeGuard[SlideDuration]:
    return entry.type == "slide_duration"


def read_times(
    entry: SlideDuration | ToeHistory,
    forecast: Forecast,
    before: np.ndarray,
    foot: Mapping[Side, float],
) -> np.ndarray:
    """Numbers of a measurement that is `timed`, (m,) [s] or [m].

    Args:
        entry: the measurement.
        forecast: what the model predicts.
        before: toes before the slide, x (2,) [m].
        foot: x from which a runout counts, of each side [m].
    """
    if entry.type == "slide_duration":
        return np.diff(np.interp(entry.between, SHARES, forecast.times[WAY]))
    number = SIDES.index(entry.side)
    outward = outward_of(entry.side)
    travel = outward * (forecast.toes[number] - before[number])
    share = _share(np.array(entry.times_s), forecast.times[number])
    return outward * (before[number] - foot[entry.side]) + share * travel


def time_error_std(
    entry: SlideDuration | ToeHistory, forecast: Forecast, before: np.ndarray
) -> np.ndarray:
    """Standard deviation of the model's error of each number of a measurement that is `timed`."""
    if entry.type == "slide_duration":
        own = forecast.times[WAY] * np.log(forecast.times_within[WAY]) / NORMAL
        return np.array([np.interp(entry.between[1], SHARES, own)])
    number, at = SIDES.index(entry.side), np.array(entry.times_s)
    times, within = forecast.times[number], np.log(forecast.times_within[number]) / NORMAL
    travel = abs(forecast.toes[number] - before[number])
    early, late = (_share(at, times * np.exp(sign * within)) for sign in (-1.0, 1.0))
    toe = forecast.toe_interval[number] / NORMAL
    return np.hypot(_share(at, times) * toe, 0.5 * (early - late) * travel)


def _share(at: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Share of its travel that a toe has done at times (m,) [s]."""
    rest = times[-1] + (times[-1] - times[-2])
    return np.interp(at, [0.0, *times, rest], [0.0, *SHARES, 1.0])
