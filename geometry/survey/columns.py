"""Columns of material, of which the observables are made, and the toe of a deposit.

A deposit is a set of material points. Its column height at x is the volume of the points near x,
spread along x by a smooth kernel, so it weighs mass, has derivatives, and forgets the lattice. Only
points that still hang together with the dam are counted. Plain functions of arrays, numpy only.

The toe is where the smoothed column height of the mass still connected to the dam falls below 0.5 m
or one spacing, whichever is larger. Walking outwards from the dam, the first such place counts.

Shapes: N points, M places. Lengths in metres, volumes in m2 per metre of width.
"""

from __future__ import annotations

from typing import Literal, overload

import numpy as np

from geometry.sides import Side, outward_of

#: A column thinner than this [m], or than one spacing, does not count as deposit.
THINNEST_COLUMN = 0.5
#: Kernel length over the thinnest column; at 1 m spacing the standard deviation is then 1.4 m.
#: Shorter follows single points, longer rounds the front off: figures in docs/method/geometry.md.
KERNEL_LENGTHS = 2.5
#: Points within this many spacings (1.5 cells at 4 points a cell) hang together.
REACH = 3.0


def toe_thickness(spacing: float) -> float:
    """Column height [m] below which a deposit ends: 0.5 m or one spacing, whichever is larger."""
    return max(THINNEST_COLUMN, spacing)


def kernel_length(spacing: float) -> float:
    """Length b [m] of the kernel; its support is 4 b wide, its standard deviation b / sqrt(3)."""
    return KERNEL_LENGTHS * toe_thickness(spacing)


def kernel(offset: np.ndarray, length: float) -> np.ndarray:
    """Cubic B-spline of integral 1 [1/m], at `offset` [m] from its centre."""
    q = np.abs(offset) / length
    near = 2.0 / 3.0 - q**2 * (1.0 - 0.5 * q)
    far = np.maximum(2.0 - q, 0.0) ** 3 / 6.0
    return np.where(q < 1.0, near, far) / length


def kernel_slope(offset: np.ndarray, length: float) -> np.ndarray:
    """Derivative of `kernel` with respect to `offset` [1/m2]."""
    q = np.abs(offset) / length
    near = q * (1.5 * q - 2.0)
    far = -0.5 * np.maximum(2.0 - q, 0.0) ** 2
    return np.sign(offset) * np.where(q < 1.0, near, far) / length**2


def kernel_integral(offset: np.ndarray | float, length: float) -> np.ndarray:
    """Integral of `kernel` up to `offset` [m]: 0 far below, 0.5 at its centre, 1 far above."""
    q = np.abs(offset) / length
    near = 0.5 + q * (2.0 / 3.0 - q**2 * (1.0 / 3.0 - q / 8.0))
    far = 1.0 - np.maximum(2.0 - q, 0.0) ** 4 / 24.0
    above = np.where(q < 1.0, near, far)
    return np.where(np.asarray(offset) < 0.0, 1.0 - above, above)


@overload
def column_height(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    length: float,
    derivative: Literal[False] = ...,
) -> np.ndarray: ...


@overload
def column_height(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    length: float,
    derivative: Literal[True],
) -> tuple[np.ndarray, np.ndarray]: ...


@overload
def column_height(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    length: float,
    derivative: bool,
) -> np.ndarray | tuple[np.ndarray, np.ndarray]: ...


def column_height(
    position: np.ndarray,
    volume: np.ndarray | float,
    x: np.ndarray | float,
    *,
    length: float,
    derivative: bool = False,
) -> np.ndarray | tuple[np.ndarray, np.ndarray]:
    """Smoothed column height h(x) = sum of V_i W(x - x_i).

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        x: places, any shape (M = number of places) [m].
        length: kernel length b [m], see `kernel_length`.
        derivative: return also the derivative with respect to the positions.

    Returns:
        Heights [m] in the shape of `x`; with `derivative` also an array of that shape + (N, 2).
    """
    places = np.asarray(x, dtype=float)
    points = np.asarray(position, dtype=float)[:, 0]
    weight = np.broadcast_to(np.asarray(volume, dtype=float), points.shape)
    offset = places[..., None] - points
    height = kernel(offset, length) @ weight
    if not derivative:
        return height
    change = np.zeros((*offset.shape, 2))
    change[..., 0] = -weight * kernel_slope(offset, length)
    return height, change


def column_grid(
    position: np.ndarray, volume: np.ndarray | float, *, length: float, per_length: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """Column heights on an even row of places that covers all points.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        length: kernel length b [m].
        per_length: places per kernel length.

    Returns:
        (places (M,), heights (M,)) [m]; the heights at both ends are 0.
    """
    points = np.asarray(position, dtype=float)[:, 0]
    weight = np.broadcast_to(np.asarray(volume, dtype=float), points.shape)
    step = length / per_length
    reach = 2 * per_length
    origin = points.min() - 2.0 * length - step
    count = int(np.ceil((points.max() - origin) / step)) + reach + 2
    nearest = np.floor((points - origin) / step).astype(np.intp)
    fraction = (points - origin) / step - nearest
    heights = np.zeros(count)
    for shift in range(-reach, reach + 2):
        share = weight * kernel((shift - fraction) * step, length)
        heights += np.bincount(nearest + shift, weights=share, minlength=count)[:count]
    return origin + step * np.arange(count), heights


def connected(position: np.ndarray, volume: np.ndarray | float, spacing: float) -> np.ndarray:
    """Find the points that hang together with the dam.

    The dam is the mass around the heaviest column. A point belongs to it when a chain of points
    leads there, each link no longer than `REACH` spacings.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points before the slide [m].

    Returns:
        (N,) bool.
    """
    points = np.asarray(position, dtype=float)
    reach = REACH * spacing
    # Two cells of this size that share an edge fit in a circle of radius `reach`: whatever points
    # they hold are linked, and no distance needs to be taken in the bulk.
    cell = _packed_cells(points, reach / np.sqrt(5.0))
    occupied = np.zeros(cell.max(axis=0) + 2, dtype=bool)
    occupied[cell[:, 0], cell[:, 1]] = True
    reached = np.zeros_like(occupied)
    reached[tuple(cell[_seed(cell, volume)])] = True
    reached = _flood(occupied, reached)
    member = reached[cell[:, 0], cell[:, 1]]
    return _grow_exactly(points, member, reach)


def _packed_cells(points: np.ndarray, size: float) -> np.ndarray:
    """(N, 2) cell numbers from 0; a run of empty rows or columns shrinks to one."""
    cell = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    for axis in (0, 1):
        values, inverse = np.unique(cell[:, axis], return_inverse=True)
        packed = np.concatenate([[0], np.cumsum(np.minimum(np.diff(values), 2))])
        cell[:, axis] = packed[inverse]
    return cell


def _seed(cell: np.ndarray, volume: np.ndarray | float) -> int:
    """Number of a point of the dam: in the fullest cell of the heaviest column of cells."""
    weight = np.broadcast_to(np.asarray(volume, dtype=float), len(cell))
    column = np.argmax(np.bincount(cell[:, 0], weights=weight))
    candidates = np.flatnonzero(cell[:, 0] == column)
    counts = np.bincount(cell[candidates, 1])
    return int(candidates[np.argmax(cell[candidates, 1] == np.argmax(counts))])


def _flood(occupied: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Spread `reached` over occupied cells that share an edge, run by run along both axes."""
    while True:
        spread = _along_rows(occupied, reached)
        spread = _along_rows(occupied.T, spread.T).T
        if np.array_equal(spread, reached):
            return reached
        reached = spread


def _along_rows(occupied: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Mark every run of occupied cells of a row in which one cell is marked (last column empty)."""
    starts = occupied.copy()
    starts[:, 1:] &= ~occupied[:, :-1]
    run = np.cumsum(starts).reshape(occupied.shape)
    hit = np.zeros(run.max() + 1, dtype=bool)
    hit[run[reached]] = True
    return occupied & hit[run]


def _grow_exactly(points: np.ndarray, member: np.ndarray, reach: float) -> np.ndarray:
    """Add the points that the cells left out although a link leads to them."""
    member = member.copy()
    front = points[member]
    while True:
        rest = np.flatnonzero(~member)
        if not len(rest) or not len(front):
            return member
        low, high = points[rest].min(axis=0) - reach, points[rest].max(axis=0) + reach
        front = front[((front >= low) & (front <= high)).all(axis=1)]
        linked = np.zeros(len(rest), dtype=bool)
        for block in np.array_split(np.arange(len(rest)), 1 + len(rest) * len(front) // 1_000_000):
            apart = points[rest[block], None, :] - front[None, :, :]
            linked[block] = ((apart**2).sum(axis=-1) <= reach**2).any(axis=1)
        member[rest[linked]] = True
        front = points[rest[linked]]


@overload
def toe(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    anchor_x: float | None = ...,
    derivative: Literal[False] = ...,
) -> float: ...


@overload
def toe(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    anchor_x: float | None = ...,
    derivative: Literal[True],
) -> tuple[float, np.ndarray]: ...


@overload
def toe(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    anchor_x: float | None = ...,
    derivative: bool,
) -> float | tuple[float, np.ndarray]: ...


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
    outward = outward_of(side)
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


def naked_eye_toe(
    position: np.ndarray, volume: np.ndarray | float, *, spacing: float, side: Side
) -> float:
    """Where the last connected point ends, half a spacing beyond its centre [m].

    What an eye sees in a picture. One point decides and there is no useful derivative; for reports.
    """
    outward = outward_of(side)
    member = connected(position, volume, spacing)
    return outward * float(np.max(outward * np.asarray(position)[member, 0])) + (
        outward * 0.5 * spacing
    )


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
