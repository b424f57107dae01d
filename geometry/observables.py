"""What is measured on a deposit: one definition for field data, simulations and learned rollouts.

Every function takes the points of one moment and gives a number in metres; with ``derivative=True``
it gives also the derivative with respect to the positions, (N, 2). Left and right are those of the
section; which of them is upstream is the case's business. Numpy only.

What the words mean (docs/geometry.md): the *toe* is where the smoothed column height of the mass
still connected to the dam falls below 0.5 m or one spacing, whichever is larger. *Runout* is the
distance of that place from the foot of the section before the slide. *Crest settlement* is the drop
of the surface at the initial crest, or of the crest's own points. *Freeboard* is the highest
remaining ground minus the water level.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from geometry.columns import (
    column_grid,
    column_height,
    connected,
    kernel,
    kernel_length,
    kernel_slope,
    toe_thickness,
)

Side = Literal["left", "right"]

#: Soil fills this share of the space where the ground ends: 0.5 on a plain, 0.3 at a sharp peak.
GROUND_SHARE = 0.4
#: Length of the kernel that decides what is ground, in spacings.
GROUND_KERNEL = 2.0
#: Golden section.
GOLDEN = 0.381966


def surface_profile(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    spacing: float,
    ground: np.ndarray | float = 0.0,
    derivative: bool = False,
) -> np.ndarray | tuple[np.ndarray, np.ndarray]:
    """Elevation of the deposit's surface: the ground plus the smoothed column height.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        x: (M,) or one number [m].
        spacing: distance between material points [m].
        ground: elevation of a level base, or its polyline (P, 2) [m].
        derivative: return also the derivative.

    Returns:
        (M,) [m], or with `derivative` ((M,), (M, N, 2)).
    """
    member = connected(position, volume, spacing)
    weight = np.where(member, volume, 0.0)
    base = ground_elevation(ground, x)
    result = column_height(
        position, weight, x, length=kernel_length(spacing), derivative=derivative
    )
    if derivative:
        return base + result[0], result[1]
    return base + result


def toe(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    anchor_x: float | None = None,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Place of the toe.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        side: the toe left or right of the dam.
        anchor_x: a place in the dam from which the toe is looked for [m]; None = highest column.
        derivative: return also the derivative.

    Returns:
        x [m], or with `derivative` (x, (N, 2)).

    Raises:
        ValueError: no column at the anchor is thick enough to be a dam.
    """
    outward = _outward(side)
    member = connected(position, volume, spacing)
    weight = np.where(member, volume, 0.0)
    length, limit = kernel_length(spacing), toe_thickness(spacing)
    places, heights = column_grid(np.asarray(position)[member], weight[member], length=length)
    start = int(np.argmax(heights) if anchor_x is None else np.argmin(np.abs(places - anchor_x)))
    if heights[start] < limit:
        raise ValueError(
            f"no dam at x = {places[start]:g} m: the column is {heights[start]:.3g} m high, "
            f"less than {limit:g} m"
        )
    walk = heights[start:] if outward > 0 else heights[start::-1]
    first = int(np.argmax(walk < limit))
    inner, outer = places[start + outward * (first - 1)], places[start + outward * first]
    near = np.flatnonzero(
        member
        & (position[:, 0] > min(inner, outer) - 2.0 * length)
        & (position[:, 0] < max(inner, outer) + 2.0 * length)
    )
    points, share = position[near, 0], weight[near]
    x = _crossing(points, share, inner, outer, limit, length)
    if not derivative:
        return x
    # h(x, x_i) = limit holds while the points move: dx/dx_i = V_i W'(x - x_i) / sum of the same.
    slope = share * kernel_slope(x - points, length)
    change = np.zeros((len(position), 2))
    change[near, 0] = slope / slope.sum()
    return x, change


def toe_runout(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    anchor_x: float | None = None,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Distance of the toe from the foot of the section, outward positive.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        side: left or right of the dam.
        initial_toe: x of the foot before the slide [m], `Scene.foot`.
        anchor_x: see `toe`.
        derivative: return also the derivative.

    Returns:
        Runout [m], or with `derivative` (runout, (N, 2)).
    """
    outward = _outward(side)
    result = toe(
        position,
        volume,
        spacing=spacing,
        side=side,
        anchor_x=anchor_x,
        derivative=derivative,
    )
    if derivative:
        return outward * (result[0] - initial_toe), outward * result[1]
    return outward * (result - initial_toe)


def crest_settlement(
    position: np.ndarray,
    initial_position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    x: float,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Drop of the surface at the initial crest's place, downward positive.

    Args:
        position: (N, 2) now [m].
        initial_position: (N, 2) before the slide [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        x: place of the initial crest [m].
        derivative: return also the derivative with respect to `position`.

    Returns:
        Settlement [m], or with `derivative` (settlement, (N, 2)).
    """
    before = surface_profile(initial_position, volume, x, spacing=spacing)
    now = surface_profile(position, volume, x, spacing=spacing, derivative=derivative)
    if derivative:
        return float(before - now[0]), -now[1]
    return float(before - now)


def crest_points(initial_position: np.ndarray, *, spacing: float, rows: float = 2.0) -> np.ndarray:
    """Numbers of the crest's own points: those in the top `rows` spacings of the section before."""
    elevation = np.asarray(initial_position)[:, 1]
    return np.flatnonzero(elevation > elevation.max() - (rows - 0.5) * spacing)


def crest_settlement_of_points(
    position: np.ndarray,
    initial_position: np.ndarray,
    points: np.ndarray,
    *,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Mean drop of chosen points, such as `crest_points`, downward positive.

    Args:
        position: (N, 2) now [m].
        initial_position: (N, 2) before the slide [m].
        points: numbers of the points followed, (K,) integers.
        derivative: return also the derivative with respect to `position`.

    Returns:
        Settlement [m], or with `derivative` (settlement, (N, 2)).
    """
    drop = float(np.mean(initial_position[points, 1] - position[points, 1]))
    if not derivative:
        return drop
    change = np.zeros(np.shape(position))
    np.add.at(change[:, 1], points, -1.0 / len(points))
    return drop, change


def freeboard(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    water_level: float,
    spacing: float,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Highest remaining ground minus the water level; negative where the dam is overtopped.

    Ground is where the share of the space that soil fills, smoothed over about two spacings,
    exceeds `GROUND_SHARE`. Columns would cut a peak off; single points do not reach the share.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        water_level: pool level [m].
        spacing: distance between material points [m].
        derivative: return also the derivative.

    Returns:
        Freeboard [m], or with `derivative` (freeboard, (N, 2)).
    """
    member = np.flatnonzero(connected(position, volume, spacing))
    points = np.asarray(position, dtype=float)[member]
    weight = np.broadcast_to(np.asarray(volume, dtype=float), len(position))[member]
    x, y = _highest_ground(points, weight, GROUND_KERNEL * spacing)
    if not derivative:
        return y - water_level
    # On the contour share(x, y, x_i, y_i) = const and level at its top, so dy/dp_i = -s_i / s_y.
    length = GROUND_KERNEL * spacing
    along, up = x - points[:, 0], y - points[:, 1]
    by_x = weight * kernel_slope(along, length) * kernel(up, length)
    by_y = weight * kernel(along, length) * kernel_slope(up, length)
    change = np.zeros(np.shape(position))
    change[member] = np.column_stack([by_x, by_y]) / by_y.sum()
    return y - water_level, change


def marker_displacement(
    position: np.ndarray,
    initial_position: np.ndarray,
    *,
    spacing: float,
    marker: tuple[float, float],
    derivative: bool = False,
) -> np.ndarray | tuple[np.ndarray, np.ndarray]:
    """Displacement of the soil that was at `marker` before the slide.

    A plane is fitted to the displacements of the points that were within three spacings, the nearer
    ones weighing more, and read at the marker: exact where the displacement varies linearly.

    Args:
        position: (N, 2) now [m].
        initial_position: (N, 2) before the slide [m].
        spacing: distance between material points [m].
        marker: (x, y) before the slide [m].
        derivative: return also the derivative with respect to `position`.

    Returns:
        (2,) dx and dy [m], or with `derivative` ((2,), (2, N, 2)).

    Raises:
        ValueError: fewer than three points were near the marker.
    """
    offset = (np.asarray(initial_position) - np.asarray(marker, dtype=float)) / spacing
    closeness = np.prod(kernel(offset, 1.5), axis=1)
    near = np.flatnonzero(closeness > 0.0)
    if len(near) < 3:
        raise ValueError(
            f"marker ({marker[0]:g}, {marker[1]:g}) lies outside the soil: "
            f"{len(near)} points within 3 spacings, at least 3 are needed"
        )
    plane = np.column_stack([np.ones(len(near)), offset[near]])
    root = np.sqrt(closeness[near])
    # Row 0 of the weighted pseudo-inverse reads the plane at the marker itself.
    share = np.linalg.pinv(plane * root[:, None])[0] * root
    moved = share @ (position[near] - initial_position[near])
    if not derivative:
        return moved
    change = np.zeros((2, *np.shape(position)))
    change[0, near, 0] = share
    change[1, near, 1] = share
    return moved, change


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
        ValueError: there is no soil at `x` then.
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
        raise ValueError(f"no soil at x = {x:g} m at t = {at:g} s")
    speed = (after[:, 0] - before[:, 0]) / interval
    mean = float(share @ speed / share.sum())
    if not derivative:
        return mean
    drift = -0.5 * weight * kernel_slope(offset, length) * (speed - mean)
    change = np.zeros((2, *before.shape))
    change[0, :, 0] = (drift - share / interval) / share.sum()
    change[1, :, 0] = (drift + share / interval) / share.sum()
    return mean, pair, change


def naked_eye_toe(
    position: np.ndarray, volume: np.ndarray | float, *, spacing: float, side: Side
) -> float:
    """Where the last connected point ends, half a spacing beyond its centre [m].

    What an eye sees in a picture. One point decides and there is no useful derivative; for reports.
    """
    outward = _outward(side)
    member = connected(position, volume, spacing)
    return outward * float(np.max(outward * np.asarray(position)[member, 0])) + (
        outward * 0.5 * spacing
    )


def ground_elevation(ground: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
    """Elevation [m] at `x` of a level base (a number) or of a polyline (P, 2), level beyond it."""
    line = np.asarray(ground, dtype=float)
    if line.ndim == 0:
        return np.full(np.shape(x), float(line))
    return np.interp(x, line[:, 0], line[:, 1])


def _outward(side: Side) -> int:
    if side not in ("left", "right"):
        raise ValueError(f"side is {side!r}; allowed are 'left' and 'right'")
    return -1 if side == "left" else 1


def _crossing(
    points: np.ndarray, share: np.ndarray, inner: float, outer: float, limit: float, length: float
) -> float:
    """Place between `inner` (thick enough) and `outer` (not) where the height equals `limit`."""
    x = 0.5 * (inner + outer)
    for _ in range(100):
        offset = x - points
        excess = float(share @ kernel(offset, length)) - limit
        if excess >= 0.0:
            inner = x
        else:
            outer = x
        slope = float(share @ kernel_slope(offset, length))
        step = x - excess / slope if slope else outer
        if abs(step - x) < 1e-12 * length:
            break
        inside = min(inner, outer) < step < max(inner, outer)
        x = step if inside else 0.5 * (inner + outer)
    return x


def _highest_ground(points: np.ndarray, weight: np.ndarray, length: float) -> tuple[float, float]:
    """Top of the region in which the smoothed share of soil exceeds `GROUND_SHARE`."""
    top, bottom = points[:, 1].max(), points[:, 1].min()
    window = 4.0 * length
    while True:
        lowest = top - window
        near = points[:, 1] > lowest - 2.0 * length
        found = _highest_on_grid(points[near], weight[near], length, lowest)
        if found is not None:
            break
        if lowest < bottom:
            raise ValueError("no ground is left: the points are too far apart to fill the space")
        window *= 2.0
    x, y = found
    near = (np.abs(points - found) < (2.5 * length, 3.5 * length)).all(axis=1)
    points, weight = points[near], weight[near]
    low, high = x - 0.5 * length, x + 0.5 * length
    for _ in range(32):
        left, right = low + GOLDEN * (high - low), high - GOLDEN * (high - low)
        if _surface_above(points, weight, length, left, y) < _surface_above(
            points, weight, length, right, y
        ):
            low = left
        else:
            high = right
    x = 0.5 * (low + high)
    return x, _surface_above(points, weight, length, x, y)


def _highest_on_grid(
    points: np.ndarray, weight: np.ndarray, length: float, lowest: float
) -> tuple[float, float] | None:
    """First guess of the highest ground on a grid down to `lowest`, or None."""
    step = 0.25 * length
    x = np.arange(points[:, 0].min() - length, points[:, 0].max() + length, step)
    y = np.arange(points[:, 1].max() + 2.0 * length, lowest, -step)
    across = kernel(x[:, None] - points[:, 0], length) * weight
    ground = across @ kernel(points[:, 1][:, None] - y, length) >= GROUND_SHARE
    rows = np.flatnonzero(ground.any(axis=0))
    if not len(rows):
        return None
    column = np.flatnonzero(ground[:, rows[0]])
    return float(x[column[len(column) // 2]]), float(y[rows[0]])


def _surface_above(
    points: np.ndarray, weight: np.ndarray, length: float, x: float, guess: float
) -> float:
    """Elevation near `guess` at which the share of soil at `x` falls to `GROUND_SHARE`."""
    across = weight * kernel(x - points[:, 0], length)
    low, high = guess - 1.5 * length, guess + 1.5 * length
    y = guess
    for _ in range(60):
        up = y - points[:, 1]
        excess = float(across @ kernel(up, length)) - GROUND_SHARE
        if excess >= 0.0:
            low = y
        else:
            high = y
        slope = float(across @ kernel_slope(up, length))
        step = y - excess / slope if slope else high
        if abs(step - y) < 1e-12 * length:
            break
        y = step if low < step < high else 0.5 * (low + high)
    return y


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
