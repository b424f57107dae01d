"""What is measured on a deposit: one definition for field data, simulations and learned rollouts.

Every function takes the points of one moment and gives a number in metres; with ``derivative=True``
it gives also the derivative with respect to the positions, (N, 2). Left and right are those of the
section; which of them is upstream is the case's business. Numpy only.

Definitions (docs/method/geometry.md): the *toe* is where the smoothed column height of the mass
still connected to the dam falls below 0.5 m or one spacing, whichever is larger. *Runout* is the
distance of that place from the foot of the section before the slide. *Crest settlement* is the drop
of the surface at the initial crest, or of the crest's own points. *Freeboard* is the highest
remaining ground minus the water level.
"""

from __future__ import annotations

import numpy as np

from geometry.survey.columns import (
    column_height,
    connected,
    kernel,
    kernel_length,
    kernel_slope,
)
from geometry.survey.highest_ground import GROUND_KERNEL, highest_ground
from geometry.survey.histories import column_velocity, slide_duration, toe_history
from geometry.survey.toe import Side, naked_eye_toe, toe, toe_runout

__all__ = [
    "Side",
    "column_height",
    "column_velocity",
    "connected",
    "crest_points",
    "crest_settlement",
    "crest_settlement_of_points",
    "freeboard",
    "ground_elevation",
    "marker_displacement",
    "naked_eye_toe",
    "slide_duration",
    "surface_profile",
    "toe",
    "toe_history",
    "toe_runout",
]


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


def crest_settlement(
    position: np.ndarray,
    initial_position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    x: float,
    initial_volume: np.ndarray | float | None = None,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Drop of the surface at the initial crest's place, downward positive.

    Args:
        position: (N, 2) now [m].
        initial_position: (N, 2) before the slide [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        x: place of the initial crest [m].
        initial_volume: before the slide, where that is another; None: `volume`.
        derivative: return also the derivative with respect to `position`.

    Returns:
        Settlement [m], or with `derivative` (settlement, (N, 2)).
    """
    first = volume if initial_volume is None else initial_volume
    before = surface_profile(initial_position, first, x, spacing=spacing)
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
    exceeds 0.4 (`geometry.survey.highest_ground`). Columns would cut a peak off, and single points
    do not reach the share.

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
    x, y = highest_ground(points, weight, GROUND_KERNEL * spacing)
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


def ground_elevation(ground: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
    """Elevation [m] at `x` of a level base (a number) or of a polyline (P, 2), level beyond it."""
    line = np.asarray(ground, dtype=float)
    if line.ndim == 0:
        return np.full(np.shape(x), float(line))
    return np.interp(x, line[:, 0], line[:, 1])
