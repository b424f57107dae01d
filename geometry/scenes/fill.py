"""Filling a scene with material points on a regular lattice.

The lattice counts from the left wall and the lowest ground, unless the scene has another
`lattice_from_y`: points lie at (i + 1/2) spacing, so on level ground every grid cell that touches
the base holds exactly `points_per_cell` points.

A point carries the volume of the soil that it stands for, not that of its square of the lattice:
soil of squares whose middle lies outside its zone goes to the nearest points of the zone. So the
surface, the base and every zone keep their volume at any spacing. What is thinner than half a
spacing for long is too far from such points: it joins the soil next to it, or is left out.
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

#: Shares of a square that differ by less are the same: rounding of outlines far from zero.
ROUNDED = 1e-9

#: Distances between squares and points that are taken at once.
PAIRS = 4_000_000

#: Spacings beyond which a point does not hold the soil of a square.
REACH = 4.0


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
    volume: np.ndarray
    """(N,) float64, of the soil that a point stands for [m2 per m of width]."""

    def __len__(self) -> int:
        return len(self.position)


def fill(scene: Scene) -> MaterialPoints:
    """Fill every zone of a scene with points.

    Each lattice point goes to exactly one zone, to the first in the list where zones overlap within
    the tolerance. With `jitter`, every point then moves by a uniform random step of up to
    jitter x spacing / 2 in x and in y, drawn in lattice order from `seed`; a point that would sink
    below the ground or leave the domain stays where it was.
    """
    origin, outlines = (scene.domain.x_min, scene.lattice_y), scene.outlines()
    position, zone = _on_lattice(scene, outlines, origin)
    volume, left = np.zeros(len(position)), []
    for place, outline in enumerate(outlines):
        own = zone == place
        volume[own], rest = soil_held(position[own], outline, origin, scene.spacing)
        left.append(rest)
    volume += _joining(position, np.concatenate(left), scene.spacing)
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
        volume=volume,
    )


def point_count(scene: Scene) -> int:
    """Number of points of `fill`, without what each of them holds."""
    origin = (scene.domain.x_min, scene.lattice_y)
    return len(_on_lattice(scene, scene.outlines(), origin)[0])


def _on_lattice(
    scene: Scene, outlines: Sequence[np.ndarray], origin: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    ground = np.asarray(scene.ground.points, dtype=float)
    return lattice_points(outlines, ground, origin, scene.spacing)


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


def soil_held(
    points: np.ndarray, polygon: np.ndarray, origin: tuple[float, float], spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Volume of the soil of a zone that each of its points holds, (N,) [m2 per m of width].

    A point holds what its own square has of the zone, and its share of the squares without a point
    that are nearer to it than to any other; points equally near share alike. The rest is farther
    than `REACH` from all: rows of x, y [m] and volume, (R, 3).

    Args:
        points: (N, 2) places of the lattice that belong to the zone [m].
        polygon: (V, 2) vertices of the zone [m].
        origin: (x, y) from which the lattice counts [m].
        spacing: distance between points [m].
    """
    corner = np.floor((polygon.min(axis=0) - origin) / spacing).astype(int) - 1
    share = covered_squares((polygon - origin) / spacing - corner)
    own = np.floor((points - origin) / spacing).astype(int) - corner
    held = share[own[:, 0], own[:, 1]]
    taken = np.zeros(share.shape, bool)
    taken[own[:, 0], own[:, 1]] = True
    inner = taken.copy()
    for axis in (0, 1):
        inner &= np.roll(taken, 1, axis) & np.roll(taken, -1, axis)
    rim = np.flatnonzero(~inner[own[:, 0], own[:, 1]])  # the nearest is one of these
    lacking = np.argwhere((share > 0.0) & ~taken)
    amounts = share[lacking[:, 0], lacking[:, 1]]
    given, far = _to_the_nearest(own[rim], lacking, amounts)
    held[rim] += given
    rest = origin + (lacking[far] + corner + 0.5) * spacing
    return held * spacing**2, np.column_stack([rest, amounts[far] * spacing**2])


def _joining(position: np.ndarray, rest: np.ndarray, spacing: float) -> np.ndarray:
    """What all points (N, 2) get of soil that is far from points of its own zone, (N,) [m2]."""
    given, _ = _to_the_nearest(position / spacing, rest[:, :2] / spacing, rest[:, 2])
    return given


def _to_the_nearest(
    points: np.ndarray, places: np.ndarray, amounts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What points (N, 2) get of amounts (M,) at places (M, 2), and which are too far (M,) bool."""
    given, far = np.zeros(len(points)), np.ones(len(places), bool)
    if not len(points):
        return given, far
    for some in np.array_split(np.arange(len(places)), 1 + len(places) * len(points) // PAIRS):
        apart = ((points - places[some, None]) ** 2).sum(axis=2)
        least = apart.min(axis=1, keepdims=True)
        far[some] = least[:, 0] > REACH**2
        nearest = (apart <= least * (1.0 + ROUNDED)) & ~far[some, None]
        parts = nearest * (amounts[some] / np.maximum(nearest.sum(axis=1), 1))[:, None]
        given += parts.sum(axis=0)
    return given, far


def covered_squares(polygon: np.ndarray) -> np.ndarray:
    """Share of every unit square that a polygon covers, (columns, rows), from (0, 0) on.

    Exact: the outline is cut at the lines of the lattice, and each piece covers what lies below it,
    with the sign of its direction.

    Args:
        polygon: (V, 2) vertices in order, none negative, in squares.
    """
    size = np.floor(polygon.max(axis=0)).astype(int) + 2
    start, end = polygon, np.roll(polygon, -1, axis=0)
    pieces = [_cut(*edge) for edge in zip(start, end, strict=True)]
    first = np.concatenate([piece[:-1] for piece in pieces])
    second = np.concatenate([piece[1:] for piece in pieces])
    middle, width = 0.5 * (first + second), second[:, 0] - first[:, 0]
    column, row = np.floor(middle).astype(int).T
    below, within = np.zeros(size), np.zeros(size)
    np.add.at(below, (column, row), width)
    np.add.at(within, (column, row), width * (middle[:, 1] - row))
    whole = np.cumsum(below[:, ::-1], axis=1)[:, ::-1] - below
    share = np.abs(within + whole)
    share[share < ROUNDED] = 0.0
    share[np.abs(share - 1.0) < ROUNDED] = 1.0
    return share


def _cut(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """An edge with the points at which it crosses lines of the lattice, (n, 2)."""
    low, high = np.minimum(start, end), np.maximum(start, end)
    along = [np.array([0.0, 1.0])]
    for axis in (0, 1):
        lines = np.arange(np.floor(low[axis]) + 1.0, np.ceil(high[axis]))
        along.append((lines - start[axis]) / (end[axis] - start[axis]))
    places = np.sort(np.concatenate(along))[:, None]
    return start + places * (end - start)


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
