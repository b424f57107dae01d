"""Filling the soil between two rasters with points that hold all of it.

Points stand in columns, a spacing apart in plan. In each column the soil of a zone is cut into as
many equal slices as come nearest to one spacing, and each slice is a point with the volume of the
slice. A lattice of points with one volume gains or loses up to half a spacing of every level
surface: on a tailings dam of 290,000 m3 up to 5 %, and its runout with it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from geometry.scenes.fill import BORDER_SHIFT, contains
from geometry.scenes3d.scene3d import Ground3d, Scene3d, overlap, plan_domain
from pipeline.cli import InputError

#: Places across a column, each way, at which the thickness of its soil is read: of the points, and
#: of the volume that they are compared with.
PARTS, FINER_PARTS = 6, 7
#: Slices of less than this share of a full point's volume are left out.
LEAST = 0.01
#: Places that are read at once.
BATCH = 1_000_000


@dataclass(frozen=True)
class Points3d:
    """A filled scene of N points."""

    position: np.ndarray  # (N, 3) [m]
    volume: np.ndarray  # (N,) [m3]
    zone: np.ndarray  # (N,) int32, place in the scene's zones
    material: np.ndarray  # (N,) int32, place in the scene's materials


@dataclass(frozen=True)
class _Piece:
    """Soil of one zone in columns, n of them.

    Attributes:
        zone: place in the scene's zones.
        plan: its middle in plan, (n, 2) [m].
        middle: its elevation, (n,) [m].
        height: where it is, (n,) [m].
        volume: of it, (n,) [m3]; 0: the column has none.
    """

    zone: int
    plan: np.ndarray
    middle: np.ndarray
    height: np.ndarray
    volume: np.ndarray


def fill_terrain(scene: Scene3d) -> Points3d:
    """Fill the zones of a terrain; columns stand at (i + 1/2) spacing from the domain's corner.

    Soil belongs to the first zone whose plan holds it and whose bottom and top it lies between,
    above the base and below the surface. A column that the edge of a plan cuts has its points in
    the middle of what lies within.

    Raises:
        InputError: a zone that got no point.
    """
    terrain, ground, d = scene.document.terrain, scene.ground, scene.spacing
    assert terrain is not None and ground is not None
    position, volume, zone = [], [], []
    for plan in _columns(scene):
        for piece in _pieces(scene, plan, PARTS):
            slices = np.maximum(np.rint(piece.height / d), 1.0).astype(int)
            slices[piece.volume < LEAST * d**3] = 0
            column = np.repeat(np.arange(len(slices)), slices)
            first = np.concatenate([[0], np.cumsum(slices)[:-1]])
            share = (np.arange(len(column)) - first[column] + 0.5) / slices[column]
            level = piece.middle[column] + (share - 0.5) * piece.height[column]
            position.append(np.column_stack([piece.plan[column], level]))
            volume.append(piece.volume[column] / slices[column])
            zone.append(np.full(len(column), piece.zone, np.int32))
    for number, entry in enumerate(terrain.zones):
        if not any(np.any(part == number) for part in zone):
            raise InputError(
                f"{scene.name}: zone {entry.name!r} holds no point at a spacing of {d:g} m"
            )
    place, held, chosen = (np.concatenate(parts) for parts in (position, volume, zone))
    # On hollow ground the middle of a column lies deeper than its soil does on the whole.
    place[:, 2] = np.maximum(place[:, 2], ground.base.at(place[:, 0], place[:, 1]) + 0.01 * d)
    names = list(terrain.materials)
    material = np.array([names.index(entry.material) for entry in terrain.zones], np.int32)
    return Points3d(place, held, chosen, material[chosen])


def drawn_volume(scene: Scene3d) -> float:
    """Volume of the zones of a terrain [m3]: that between the rasters, whatever the points hold."""
    return float(
        sum(
            piece.volume.sum()
            for plan in _columns(scene)
            for piece in _pieces(scene, plan, FINER_PARTS)
        )
    )


def volume_left_out(scene: Scene3d) -> float:
    """Volume between the rasters [m3] beyond the last whole cell, which no point stands for."""
    ground = scene.ground
    assert ground is not None
    x_min, x_max, y_min, y_max = overlap(scene)
    _, x_end, _, y_end = plan_domain(scene)
    strips = ((x_end, x_max, y_min, y_max), (x_min, x_end, y_end, y_max))
    return sum(_soil_over(ground, *strip, 0.25 * scene.spacing) for strip in strips)


def _soil_over(
    ground: Ground3d, x_min: float, x_max: float, y_min: float, y_max: float, step: float
) -> float:
    """Volume between the rasters over a rectangle [m3]."""
    if x_max <= x_min or y_max <= y_min:
        return 0.0
    x, y = (
        low + (high - low) * (np.arange(n) + 0.5) / n
        for low, high in ((x_min, x_max), (y_min, y_max))
        for n in [max(int(np.ceil((high - low) / step)), 1)]
    )
    place = np.meshgrid(x, y, indexing="ij")
    thick = np.maximum(ground.surface.at(*place) - ground.base.at(*place), 0.0)
    return float(thick.mean()) * (x_max - x_min) * (y_max - y_min)


def _columns(scene: Scene3d) -> Iterator[np.ndarray]:
    """Places (n, 2) of the columns of points, so many at a time that memory holds them."""
    x_min, x_max, y_min, y_max = plan_domain(scene)
    d = scene.spacing
    x = x_min + d * (np.arange(round((x_max - x_min) / d)) + 0.5)
    y = y_min + d * (np.arange(round((y_max - y_min) / d)) + 0.5)
    rows = max(BATCH // (FINER_PARTS**2 * len(y)), 1)
    for first in range(0, len(x), rows):
        grid = np.meshgrid(x[first : first + rows], y, indexing="ij")
        plan = np.stack(grid, axis=-1).reshape(-1, 2)
        yield plan[_may_hold_soil(scene, plan)]


def _may_hold_soil(scene: Scene3d, plan: np.ndarray) -> np.ndarray:
    """Columns (n,) with soil anywhere at 4 x 4 places, edges included: most of a map has none."""
    ground = scene.ground
    assert ground is not None
    across = scene.spacing * np.linspace(-0.5, 0.5, 4)
    found = np.zeros(len(plan), bool)
    for x in across:
        for y in across:
            place = (plan + (x, y)).T
            found |= ground.surface.at(*place) > ground.base.at(*place)
    return found


def _pieces(scene: Scene3d, plan: np.ndarray, parts: int) -> list[_Piece]:
    """The soil in columns (n, 2), read at `parts` x `parts` places across each."""
    d = scene.spacing
    across = d * ((np.arange(parts) + 0.5) / parts - 0.5)
    apart = np.stack(np.meshgrid(across, across, indexing="ij"), axis=-1).reshape(-1, 2)
    places = (plan[:, None] + apart).reshape(-1, 2)
    found = []
    for zone, thickness, moment in _layers(_limits(scene, places)):
        thick = thickness.reshape(len(plan), -1)
        whole, covered = thick.sum(axis=1), (thick > 0.0).sum(axis=1)
        there = np.maximum(whole, 1e-300)
        shift = thick @ apart / there[:, None]
        middle = moment.reshape(thick.shape).sum(axis=1) / there
        height = whole / np.maximum(covered, 1)
        found.append(_Piece(zone, plan + shift, middle, height, whole * d**2 / len(apart)))
    return found


def _layers(
    limits: list[tuple[np.ndarray, np.ndarray]],
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Layers of soil at some places, from below: zone, thickness [m], and its moment [m2].

    A zone has a layer more where another one lies within it. Both arrays are (places,); the moment
    is about level 0.
    """
    under, over = (np.stack(values) for values in zip(*limits, strict=True))
    levels = np.sort(np.concatenate([under, over]), axis=0)
    runs: dict[tuple[int, int], list[np.ndarray]] = {}
    below = np.full(levels.shape[1], -1)
    seen = np.zeros(under.shape, int)
    for low, high in zip(levels, levels[1:], strict=False):
        inside = (under <= low) & (over >= high)
        owner = np.where(inside.any(axis=0) & (high > low), inside.argmax(axis=0), -1)
        for zone in range(len(under)):
            own = owner == zone
            if not own.any():
                continue
            seen[zone] += own & (below != zone)
            for run in np.unique(seen[zone][own]):
                here = own & (seen[zone] == run)
                sums = runs.setdefault((zone, int(run)), [np.zeros(len(own)) for _ in range(2)])
                thickness = np.where(here, high - low, 0.0)
                sums[0] += thickness
                sums[1] += thickness * 0.5 * (high + low)
        below = np.where(high > low, owner, below)
    for (zone, _), (thickness, moment) in sorted(runs.items(), key=lambda item: item[0]):
        yield zone, thickness, moment


def _limits(scene: Scene3d, plan: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Elevation below and above each zone in each column; nothing between them outside its plan."""
    terrain, ground = scene.document.terrain, scene.ground
    assert terrain is not None and ground is not None
    tested = plan + np.asarray(BORDER_SHIFT) * scene.spacing
    found = []
    for entry, (under, over) in zip(terrain.zones, ground.zones_at(*plan.T), strict=True):
        inside = True if entry.plan is None else contains(np.asarray(entry.plan, float), tested)
        found.append((under, np.where(inside, over, under)))
    return found
