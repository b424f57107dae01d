"""When a slide gets where: arrival times of both toes, and of all its soil on its way.

In: the frames of a run. Out: `Arrivals`, the times at which a toe has done given shares of its
travel, and the soil given shares of its way (its mean distance from where it was, as the duration
of a slide is defined). Shares, unlike places, are the same for slides of all sizes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.sides import SIDES, Side, outward_of
from geometry.survey.columns import toe

#: Shares of the travel of a toe, and of the way of all soil, at which the time is taken.
SHARES = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
#: Row of all soil in times of the left toe, the right toe and all soil.
WAY = 2
#: A toe that goes less far than this has no arrival [spacings]; soil likewise.
LEAST_TRAVEL, LEAST_WAY = 1.0, 1e-2


@dataclass(frozen=True)
class Arrivals:
    """Times after the start [s]; NaN for what does not move.

    Attributes:
        toes: at SHARES of the travel of the left and of the right toe, (2, 6).
        way: at SHARES of the way of all soil, (6,).
    """

    toes: np.ndarray
    way: np.ndarray


def arrivals_of(
    positions: np.ndarray, time: np.ndarray, volume: np.ndarray, spacing: float
) -> Arrivals:
    """Arrival times of a run that came to rest.

    Args:
        positions: of its frames (T, N, 2) [m].
        time: of the frames (T,) [s].
        volume: of its points (N,) [m2 per m of width].
        spacing: between its points before the slide [m].
    """
    return Arrivals(
        np.stack([_of_toe(positions, time, volume, spacing, side) for side in SIDES]),
        _of_way(positions, time, volume, spacing),
    )


def _of_way(
    positions: np.ndarray, time: np.ndarray, volume: np.ndarray, spacing: float
) -> np.ndarray:
    moved = positions.astype(float) - positions[0]
    way = np.hypot(moved[..., 0], moved[..., 1]) @ (volume / volume.sum())
    if way[-1] < LEAST_WAY * spacing:
        return np.full(len(SHARES), np.nan)
    after = [max(int(np.argmax(way >= share * way[-1])), 1) for share in SHARES]
    return np.array(
        [
            _passed(share * way[-1], way[frame - 1 : frame + 1], time[frame - 1 : frame + 1])
            for frame, share in zip(after, SHARES, strict=True)
        ]
    )


def _of_toe(
    positions: np.ndarray, time: np.ndarray, volume: np.ndarray, spacing: float, side: Side
) -> np.ndarray:
    """By bisection, since a toe is dear to read and goes outward but for the noise of its points.

    A share is passed between two neighbouring frames, the first below it and the second not.
    """
    outward, known = outward_of(side), dict[int, float]()

    def travel(frame: int) -> float:
        if frame not in known:
            points = positions[frame].astype(float)
            known[frame] = outward * toe(points, volume, spacing=spacing, side=side)
        return known[frame] - known.get(0, known[frame])

    nothing = np.full(len(SHARES), np.nan)
    last = len(time) - 1
    try:
        travel(0)
        if travel(last) < LEAST_TRAVEL * spacing:
            return nothing
        found = []
        for share in SHARES:
            level, before, after = share * travel(last), 0, last
            while after - before > 1:
                middle = (before + after) // 2
                before, after = (middle, after) if travel(middle) < level else (before, middle)
            ends = np.array([before, after])
            found.append(_passed(level, np.array([travel(i) for i in ends]), time[ends]))
    except ValueError:  # nothing is left that is thick enough to be a dam
        return nothing
    return np.maximum.accumulate(found)


def _passed(level: float, values: np.ndarray, time: np.ndarray) -> float:
    """When a level between two values is passed [s]."""
    share = (level - values[0]) / (values[1] - values[0])
    return float(time[0] + share * (time[1] - time[0]))
