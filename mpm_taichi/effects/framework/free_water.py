"""Where water stands in a section; what effects of water share. No effect itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene, Zone

FAR = 1e9
"""Stands for an end of the section beyond which nothing changes [m]."""
SUCTION = 1e5
"""Water in soil holds no larger one, below the pressure of the air [Pa]."""


@dataclass(frozen=True)
class Pool:
    """Free water: below `level` [m] between `left` and `right` [m]."""

    level: float
    left: float
    right: float


def pool_of(scene: Scene) -> Pool | None:
    """The pool: where the phreatic line stands at the water level; None where there is none.

    Groundwater below the pool's level is not free water. Without a phreatic line the pool lies on
    both sides. Where the line is at the pool's level in several places, the pool spans them all.
    """
    if scene.water_level is None:
        return None
    level = scene.water_level
    if scene.phreatic_line is None:
        return Pool(level, -FAR, FAR)
    line = np.asarray(scene.phreatic_line, dtype=float)
    full = np.flatnonzero(line[:, 1] >= level - 1e-6)
    if not full.size:
        return None
    left = -FAR if full[0] == 0 else float(line[full[0], 0])
    right = FAR if full[-1] == len(line) - 1 else float(line[full[-1], 0])
    return Pool(level, left, right)


def soaked_area(scene: Scene, zone: Zone) -> float:
    """Area of a zone below the phreatic line [m2]."""
    from shapely.geometry import Polygon

    if scene.water_level is None:
        return 0.0
    left, right = -FAR, FAR
    line = [(left, scene.water_level), (right, scene.water_level)]
    if scene.phreatic_line is not None:
        inner = [tuple(point) for point in scene.phreatic_line]
        line = [(left, inner[0][1]), *inner, (right, inner[-1][1])]
    below = Polygon([*line, (right, -FAR), (left, -FAR)])
    return float(Polygon(zone.polygon).intersection(below).area)


def soil_in_pool(scene: Scene, pool: Pool) -> tuple[float, float]:
    """Area [m2] and height above the ground [m] of the soil that stands in the pool."""
    from shapely import box
    from shapely.geometry import Polygon

    water = box(pool.left, -FAR, pool.right, pool.level)
    area, top = 0.0, -np.inf
    for zone in scene.zones:
        part = Polygon(zone.polygon).intersection(water)
        if part.area > 0.0:
            area += part.area
            top = max(top, part.bounds[3])
    return area, max(top - scene.ground.lowest, 0.0) if area > 0.0 else 0.0
