"""Filling the soil between two rasters with points on a regular lattice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.scenes.fill import BORDER_SHIFT, contains
from geometry.scenes3d.scene3d import Scene3d, plan_domain
from pipeline.cli import InputError


@dataclass(frozen=True)
class Points3d:
    """A filled scene of N points."""

    position: np.ndarray  # (N, 3) [m]
    volume: np.ndarray  # (N,) [m3]
    zone: np.ndarray  # (N,) int32, place in the scene's zones
    material: np.ndarray  # (N,) int32, place in the scene's materials


def fill_terrain(scene: Scene3d) -> Points3d:
    """Fill the zones of a terrain; points lie at (i + 1/2) spacing from the domain's lower corner.

    A point lies in the first zone whose plan holds it and whose bottom and top it lies between,
    above the base and below the surface.

    Raises:
        InputError: a zone that got no point.
    """
    terrain, ground, d = scene.document.terrain, scene.ground, scene.spacing
    assert terrain is not None and ground is not None
    x_min, x_max, y_min, y_max = plan_domain(scene)
    x = x_min + d * (np.arange(round((x_max - x_min) / d)) + 0.5)
    y = y_min + d * (np.arange(round((y_max - y_min) / d)) + 0.5)
    plan = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    low, high = (raster.at(*plan.T) for raster in (ground.base, ground.surface))
    floor = float(ground.base.values.min())
    levels = floor + d * (np.arange(max(int((high.max() - floor) / d) + 1, 1)) + 0.5)
    tested = plan + np.asarray(BORDER_SHIFT) * d
    zone = np.full((len(plan), len(levels)), -1, np.int32)
    for number, (entry, (bottom, top)) in enumerate(zip(terrain.zones, ground.limits, strict=True)):
        inside = np.ones(len(plan), bool)
        if entry.plan is not None:
            inside = contains(np.asarray(entry.plan, float), tested)
        under = np.maximum(low, bottom.at(*plan.T))[:, None]
        over = np.minimum(high, top.at(*plan.T))[:, None]
        hit = inside[:, None] & (levels > under) & (levels < over) & (zone < 0)
        if not hit.any():
            raise InputError(
                f"{scene.name}: zone {entry.name!r} holds no point at a spacing of {d:g} m"
            )
        zone[hit] = number
    column, level = np.nonzero(zone >= 0)
    names = list(terrain.materials)
    material = np.array([names.index(entry.material) for entry in terrain.zones], np.int32)
    chosen = zone[column, level]
    return Points3d(
        position=np.column_stack([plan[column], levels[level]]),
        volume=np.full(len(column), d**3),
        zone=chosen,
        material=material[chosen],
    )
