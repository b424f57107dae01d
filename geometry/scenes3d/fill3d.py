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
    plan = _columns(scene)
    floor, highest = float(ground.base.values.min()), float(ground.surface.at(*plan.T).max())
    levels = floor + d * (np.arange(max(int((highest - floor) / d) + 1, 1)) + 0.5)
    zone = np.full((len(plan), len(levels)), -1, np.int32)
    for number, (entry, (under, over)) in enumerate(
        zip(terrain.zones, _limits(scene, plan), strict=True)
    ):
        hit = (levels > under[:, None]) & (levels < over[:, None]) & (zone < 0)
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


def drawn_volume(scene: Scene3d) -> float:
    """Volume of the zones of a terrain [m3]: that between the rasters, whatever the points hold."""
    plan = _columns(scene)
    limits = np.array(_limits(scene, plan))  # zones, (under, over), columns
    limits = np.take_along_axis(limits, np.argsort(limits[:, :1], axis=0), axis=0)
    thickness, reached = np.zeros(len(plan)), np.full(len(plan), -np.inf)
    for under, over in limits:
        thickness += np.maximum(over - np.maximum(under, reached), 0.0)
        reached = np.maximum(reached, over)
    return float(thickness.sum() * scene.spacing**2)


def _columns(scene: Scene3d) -> np.ndarray:
    """Places (n, 2) of the columns of points."""
    x_min, x_max, y_min, y_max = plan_domain(scene)
    d = scene.spacing
    x = x_min + d * (np.arange(round((x_max - x_min) / d)) + 0.5)
    y = y_min + d * (np.arange(round((y_max - y_min) / d)) + 0.5)
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def _limits(scene: Scene3d, plan: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Elevation below and above each zone in each column; nothing between them outside its plan."""
    terrain, ground = scene.document.terrain, scene.ground
    assert terrain is not None and ground is not None
    tested = plan + np.asarray(BORDER_SHIFT) * scene.spacing
    low, high = (raster.at(*plan.T) for raster in (ground.base, ground.surface))
    found = []
    for entry, (bottom, top) in zip(terrain.zones, ground.limits, strict=True):
        under, over = np.maximum(low, bottom.at(*plan.T)), np.minimum(high, top.at(*plan.T))
        if entry.plan is not None:
            inside = contains(np.asarray(entry.plan, float), tested)
            over = np.where(inside, over, under)
        found.append((under, over))
    return found
