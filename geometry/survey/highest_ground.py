"""The highest ground of a deposit: the top of what soil fills, not of single points.

Column heights cut a peak off, and the highest point of all may be one thrown up. Here the share of
space that soil fills is smoothed in both directions; where it exceeds `GROUND_SHARE` is ground.
"""

from __future__ import annotations

import numpy as np

from geometry.survey.columns import kernel, kernel_slope

#: Soil fills this share of the space where the ground ends: 0.5 on a plain, 0.3 at a sharp peak.
GROUND_SHARE = 0.4
#: Length of the kernel that decides what is ground, in spacings.
GROUND_KERNEL = 2.0
#: Golden section.
GOLDEN = 0.381966


def highest_ground(points: np.ndarray, weight: np.ndarray, length: float) -> tuple[float, float]:
    """Top of the region in which the smoothed share of soil exceeds `GROUND_SHARE`.

    Args:
        points: (N, 2) [m].
        weight: (N,) volumes [m2 per m].
        length: kernel length [m].

    Returns:
        (x, y) of the top [m].

    Raises:
        ValueError: the points fill so little of the space that there is no ground.
    """
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
