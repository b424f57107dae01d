"""Filling a scene with material points on a regular lattice.

The lattice counts from the left wall and the lowest ground, unless the scene has another
`lattice_from_y`: points lie at (i + 1/2) spacing, so on level ground every grid cell that touches
the base holds exactly `points_per_cell` points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.scenes.scene import Scene
from pipeline.random_numbers import unit_array

#: Points are tested a hair next to their place, so that none lies exactly on a border; in spacings.
#: The shift points right and up: a point on a border belongs to the zone right of or above it.
BORDER_SHIFT = (1e-7, 0.618e-7)


@dataclass(frozen=True)
class MaterialPoints:
    """A filled scene. N is the number of points."""

    position: np.ndarray
    """(N, 2) float64 [m]."""
    zone: np.ndarray
    """(N,) int32, place in ``scene.zones``."""
    material: np.ndarray
    """(N,) int32, place in ``scene.material_names``."""
    kinematic: np.ndarray
    """(N,) bool, points whose velocity is imposed."""
    velocity: np.ndarray
    """(N, 2) float64 [m/s]."""
    volume: float
    """Volume of one point [m2 per m of width]."""

    def __len__(self) -> int:
        return len(self.position)


def fill(scene: Scene) -> MaterialPoints:
    """Fill every zone of a scene with points.

    Each lattice point goes to exactly one zone, to the first in the list where zones overlap within
    the tolerance. With `jitter`, every point then moves by a uniform random step of up to
    jitter x spacing / 2 in x and in y, drawn in lattice order from `seed`; a point that would sink
    below the ground or leave the domain stays where it was.
    """
    position, zone = lattice_points(
        scene.outlines(),
        np.asarray(scene.ground.points, dtype=float),
        (scene.domain.x_min, scene.lattice_y),
        scene.spacing,
    )
    if scene.jitter:
        position = _jittered(scene, position)
    number = {name: i for i, name in enumerate(scene.material_names)}
    material_of_zone = np.array([number[z.material] for z in scene.zones], dtype=np.int32)
    kinematic_of_zone = np.array([z.kinematic for z in scene.zones], dtype=bool)
    velocity_of_zone = np.array([z.initial_velocity for z in scene.zones], dtype=float)
    return MaterialPoints(
        position=position,
        zone=zone,
        material=material_of_zone[zone],
        kinematic=kinematic_of_zone[zone],
        velocity=velocity_of_zone[zone],
        volume=scene.spacing**2,
    )


def contains(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which points lie in a polygon, by counting crossings of a ray to the right.

    Args:
        polygon: (V, 2) vertices in order [m].
        points: (N, 2) [m].

    Returns:
        (N,) bool. An edge belongs to the polygon above it or right of it, so that polygons sharing
        an edge (with the same two vertices) share no point and lose none.
    """
    upwards = np.argsort(points[:, 1], kind="stable")
    x, y = points[upwards].T
    crossed = np.zeros(len(points), dtype=bool)
    following = np.roll(polygon, -1, axis=0)
    rises = (polygon[:, 1] <= following[:, 1])[:, None]
    low, high = np.where(rises, polygon, following), np.where(rises, following, polygon)
    # Of each edge only the points between its ends: outlines may have as many edges as points.
    first, last = np.searchsorted(y, low[:, 1]), np.searchsorted(y, high[:, 1])
    for edge in np.flatnonzero(first < last):
        (x0, y0), (x1, y1), part = low[edge], high[edge], slice(first[edge], last[edge])
        crossed[part] ^= x[part] < x0 + (y[part] - y0) * ((x1 - x0) / (y1 - y0))
    inside = np.empty(len(points), dtype=bool)
    inside[upwards] = crossed
    return inside


def lattice_points(
    polygons: Sequence[np.ndarray],
    ground: np.ndarray,
    origin: tuple[float, float],
    spacing: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Find the lattice points inside polygons, above the ground.

    Args:
        polygons: (V, 2) vertices of each zone [m].
        ground: (P, 2) polyline of the base [m].
        origin: (x, y) from which the lattice counts [m].
        spacing: distance between points [m].

    Returns:
        places (N, 2) [m] and zone numbers (N,), row by row upwards.
    """
    start, vertices = np.asarray(origin), np.concatenate(list(polygons))
    first = np.floor((vertices.min(axis=0) - start) / spacing - 0.5).astype(int)
    last = np.ceil((vertices.max(axis=0) - start) / spacing - 0.5).astype(int)
    column, row = np.meshgrid(
        np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1), indexing="xy"
    )
    lattice = start + (np.stack([column.ravel(), row.ravel()], axis=1) + 0.5) * spacing
    tested = lattice + np.asarray(BORDER_SHIFT) * spacing
    zone = np.full(len(lattice), -1, dtype=np.int32)
    for number, polygon in enumerate(polygons):
        free = np.flatnonzero(zone < 0)
        hit = contains(polygon, tested[free])
        zone[free[hit]] = number
    kept = (zone >= 0) & (lattice[:, 1] > np.interp(lattice[:, 0], ground[:, 0], ground[:, 1]))
    return lattice[kept], zone[kept]


def _jittered(scene: Scene, position: np.ndarray) -> np.ndarray:
    half = 0.5 * scene.jitter * scene.spacing
    moved = position + half * (2.0 * unit_array(scene.seed, position.shape) - 1.0)
    allowed = (
        (moved[:, 1] > scene.ground.height(moved[:, 0]))
        & (moved[:, 0] > scene.domain.x_min)
        & (moved[:, 0] < scene.domain.x_max)
        & (moved[:, 1] < scene.domain.y_max)
    )
    return np.where(allowed[:, None], moved, position)
