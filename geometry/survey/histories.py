"""Observables of a whole run: the toe at given times, the velocity of a column, the duration.

Frames are interpolated linearly in time. A derivative is given for the two frames it needs.
"""

from __future__ import annotations

import numpy as np

from geometry.survey.columns import connected, kernel, kernel_length, kernel_slope
from geometry.survey.toe import Side, toe_runout


class NoSoilError(ValueError):
    """There is no soil where a velocity is asked for."""


def toe_history(
    positions: np.ndarray,
    time: np.ndarray,
    times: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    derivative: bool = False,
) -> np.ndarray | tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Runout at given times, interpolated between frames.

    Args:
        positions: (T, N, 2) [m].
        time: (T,) ascending [s].
        times: (M,) within `time` [s].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        side: left or right of the dam.
        initial_toe: x of the foot before the slide [m].
        derivative: return also the derivative.

    Returns:
        (M,) runout [m]; with `derivative` also the numbers of the two frames of each time, (M, 2),
        and the derivative with respect to the positions in them, (M, 2, N, 2).
    """
    frames, shares = _frames_around(time, times)
    values = np.zeros(len(frames))
    changes = np.zeros((len(frames), 2, *positions.shape[1:])) if derivative else None
    known: dict[int, tuple[float, np.ndarray] | float] = {}
    for k, (pair, share) in enumerate(zip(frames, shares, strict=True)):
        for j in (0, 1):
            frame = int(pair[j])
            if frame not in known:
                known[frame] = toe_runout(
                    positions[frame],
                    volume,
                    spacing=spacing,
                    side=side,
                    initial_toe=initial_toe,
                    derivative=derivative,
                )
            result = known[frame]
            values[k] += share[j] * (result[0] if derivative else result)
            if derivative:
                changes[k, j] = share[j] * result[1]
    return (values, frames, changes) if derivative else values


def column_velocity(
    positions: np.ndarray,
    time: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    x: float,
    at: float,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray, np.ndarray]:
    """Mean horizontal velocity of the column at `x` at the time `at`, weighted by mass.

    Args:
        positions: (T, N, 2) [m].
        time: (T,) ascending [s].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        x: place [m].
        at: time [s].
        derivative: return also the derivative.

    Returns:
        Velocity [m/s]; with `derivative` also the numbers of the frames before and after, (2,), and
        the derivative with respect to the positions in them, (2, N, 2) [1/s].

    Raises:
        NoSoilError: there is no soil at `x` then.
    """
    pair = _frames_around(time, np.asarray([at]))[0][0]
    interval = float(time[pair[1]] - time[pair[0]])
    before, after = positions[pair[0]].astype(float), positions[pair[1]].astype(float)
    middle = 0.5 * (before + after)
    member = connected(middle, volume, spacing)
    length = kernel_length(spacing)
    offset = x - middle[:, 0]
    weight = np.where(member, volume, 0.0)
    share = weight * kernel(offset, length)
    if share.sum() == 0.0:
        raise NoSoilError(f"no soil at x = {x:g} m at t = {at:g} s")
    speed = (after[:, 0] - before[:, 0]) / interval
    mean = float(share @ speed / share.sum())
    if not derivative:
        return mean
    drift = -0.5 * weight * kernel_slope(offset, length) * (speed - mean)
    change = np.zeros((2, *before.shape))
    change[0, :, 0] = (drift - share / interval) / share.sum()
    change[1, :, 0] = (drift + share / interval) / share.sum()
    return mean, pair, change


def slide_duration(
    positions: np.ndarray,
    initial_position: np.ndarray,
    time: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    between: tuple[float, float] = (0.05, 0.95),
    derivative: bool = False,
) -> float | tuple[float, np.ndarray, np.ndarray]:
    """How long the soil takes for the middle part of its way.

    The way is the mean distance of all soil from where it was, weighted by mass. The duration runs
    from the first moment at which the way is `between[0]` of the last one to the first at which it
    is `between[1]`: what moves on slowly at the end hardly counts, and neither does a late start.

    Args:
        positions: (T, N, 2), the last frame at rest [m].
        initial_position: the same points before the slide, (N, 2) [m].
        time: (T,) ascending [s].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m]; less than a thousandth of it is no motion.
        between: shares of the way, ascending, within 0 and 1.
        derivative: return also the derivative.

    Returns:
        Duration [s], 0 where nothing moved; with `derivative` also the numbers of the frames around
        the first and the second moment and of the last frame, (5,), and the derivative with respect
        to the positions in them, (5, N, 2) [s/m].
    """
    time = np.asarray(time, dtype=float)
    if len(time) < 2:
        raise ValueError(f"a duration needs at least two frames, but there are {len(time)}")
    share = np.broadcast_to(np.asarray(volume, dtype=float), positions.shape[1])
    share = share / share.sum()
    moved = positions.astype(float) - initial_position
    distance = np.hypot(moved[..., 0], moved[..., 1])
    way = distance @ share
    last = len(time) - 1
    if way[last] < 1e-3 * spacing:
        nothing = (np.full(5, last), np.zeros((5, *positions.shape[1:])))
        return (0.0, *nothing) if derivative else 0.0
    moments, frames, slopes = [], [], []
    for part in between:
        level = part * way[last]
        after = max(int(np.argmax(way >= level)), 1)
        before = after - 1
        rise, interval = way[after] - way[before], time[after] - time[before]
        passed = (level - way[before]) / rise
        moments.append(time[before] + passed * interval)
        frames += [before, after]
        # By the way before, the way after, and the last way through the level.
        slopes.append(np.array([passed - 1.0, -passed, part]) * interval / rise)
    duration = float(moments[1] - moments[0])
    if not derivative:
        return duration
    (first, second), numbers = slopes, np.array([*frames, last])
    weights = np.array([-first[0], -first[1], second[0], second[1], second[2] - first[2]])
    with np.errstate(invalid="ignore", divide="ignore"):
        direction = np.nan_to_num(moved[numbers] / distance[numbers][..., None])
    return duration, numbers, weights[:, None, None] * share[None, :, None] * direction


def _frames_around(time: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (M, 2) of the frames around each time and their shares (M, 2)."""
    time, times = np.asarray(time, dtype=float), np.asarray(times, dtype=float)
    if len(time) < 2:
        raise ValueError(f"a history needs at least two frames, but there are {len(time)}")
    outside = (times < time[0]) | (times > time[-1])
    if outside.any():
        raise ValueError(
            f"t = {times[outside][0]:g} s lies outside the run, {time[0]:g} to {time[-1]:g} s"
        )
    after = np.clip(np.searchsorted(time, times, side="right"), 1, len(time) - 1)
    later = (times - time[after - 1]) / (time[after] - time[after - 1])
    return np.stack([after - 1, after], axis=1), np.stack([1.0 - later, later], axis=1)
