"""The toe of a deposit.

The toe is where the smoothed column height of the mass still connected to the dam falls below 0.5 m
or one spacing, whichever is larger. Walking outwards from the dam, the first such place counts.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from geometry.survey.columns import (
    column_grid,
    connected,
    kernel,
    kernel_length,
    kernel_slope,
    toe_thickness,
)

Side = Literal["left", "right"]


def outward_of(side: Side) -> int:
    """Direction away from the dam: -1 on the left, 1 on the right.

    Raises:
        ValueError: no such side.
    """
    if side not in ("left", "right"):
        raise ValueError(f"side is {side!r}; allowed are 'left' and 'right'")
    return -1 if side == "left" else 1


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
