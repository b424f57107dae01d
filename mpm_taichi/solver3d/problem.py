"""What a three-dimensional run is made of: points, materials, ground, walls, still water."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from geometry.scenes.fill import fill
from geometry.scenes.scene import MOHR_COULOMB
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Material, Scene


@dataclass(frozen=True)
class Raster:
    """Elevations on a regular grid of places, linear between them and level beyond its ends."""

    origin: tuple[float, float]  # of the first place [m]
    spacing: float  # m
    values: np.ndarray  # (nx, ny) [m]

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Elevation at x, y [m], of any one shape."""
        values = np.asarray(self.values, dtype=float)
        (i, u), (j, v) = (
            _cell((place - start) / self.spacing, count)
            for place, start, count in zip((x, y), self.origin, values.shape, strict=True)
        )
        i1, j1 = np.minimum(i + 1, values.shape[0] - 1), np.minimum(j + 1, values.shape[1] - 1)
        low = (1.0 - v) * values[i, j] + v * values[i, j1]
        high = (1.0 - v) * values[i1, j] + v * values[i1, j1]
        return (1.0 - u) * low + u * high

    @classmethod
    def level(cls, elevation: float) -> Raster:
        """The same elevation everywhere [m]."""
        return cls((0.0, 0.0), 1.0, np.full((1, 1), float(elevation)))


def _cell(place: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Number of the place before each and the way to the next one [0-1]."""
    place = np.clip(place, 0.0, count - 1.0)
    first = np.minimum(np.floor(place).astype(np.int64), max(count - 2, 0))
    return first, place - first


@dataclass(frozen=True)
class Problem3d:
    """A body of soil on real ground. N points; x along the section, y across, z up; SI units."""

    name: str
    spacing: float  # between points [m]; a cell is as many spacings wide as in two dimensions
    position: np.ndarray  # (N, 3) [m]
    volume: np.ndarray  # (N,) [m3]
    material: np.ndarray  # (N,) place in `materials`
    zone: np.ndarray  # (N,)
    materials: Sequence[Material]
    base: Raster  # elevation of the ground
    domain: tuple[float, float, float, float, float]  # x_min, x_max, y_min, y_max, z_max [m]
    contact: Literal["rough", "no_slip", "coulomb", "slip"] = "rough"
    friction_coefficient: float = 0.0  # of "coulomb" ground
    flanks: Literal["smooth", "rough", "no_slip"] = "smooth"  # at y_min and y_max
    water: Raster | None = None  # level of pool and groundwater
    velocity: np.ndarray | None = None  # (N, 3) [m/s]: a body that is thrown or hangs in the air
    cells_per_spacing: float = 2.0


def extruded(
    scene: Scene, width: float, *, flanks: Literal["smooth", "rough", "no_slip"] = "smooth"
) -> Problem3d:
    """A section over a width [m] between vertical flanks, its points repeated at their spacing.

    Raises:
        InputError: open walls, effects, another law, kinematic zones: the solver does not have them
            in three dimensions.
    """
    lacking = {
        "domain.walls: open": scene.domain.walls == "open",
        "effects": bool(scene.effects),
        f"law: {scene.law}": scene.law != MOHR_COULOMB,
        "kinematic zones": any(zone.kinematic for zone in scene.zones),
    }
    if any(lacking.values()):
        word = next(word for word, present in lacking.items() if present)
        raise InputError(f"{scene.name}: {word}: not in three dimensions")
    points = fill(scene)
    rows = max(round(width / scene.spacing), 1)
    across = width / rows * (np.arange(rows) + 0.5)
    count = len(points)
    position = np.empty((count, rows, 3))
    position[:, :, 0] = points.position[:, None, 0]
    position[:, :, 1] = across
    position[:, :, 2] = points.position[:, None, 1]
    thrown = bool(np.any(points.velocity))
    velocity = np.zeros((count, rows, 3))
    velocity[:, :, (0, 2)] = points.velocity[:, None]
    domain = scene.domain
    fine = scene.cell_size / 8
    places = np.arange(domain.x_min, domain.x_max + fine, fine)
    base = Raster((domain.x_min, 0.0), fine, scene.ground.height(places)[:, None])
    water = None
    if scene.has_water:
        level = scene.phreatic_level(places)
        water = Raster((domain.x_min, 0.0), fine, np.asarray(level)[:, None])
    return Problem3d(
        name=scene.name,
        spacing=scene.spacing,
        position=position.reshape(-1, 3),
        volume=np.full(count * rows, points.volume * width / rows),
        material=np.repeat(points.material, rows),
        zone=np.repeat(points.zone, rows),
        materials=tuple(scene.materials.values()),
        base=base,
        domain=(domain.x_min, domain.x_max, 0.0, width, domain.y_max),
        contact=scene.ground.contact,
        friction_coefficient=scene.ground.friction_coefficient or 0.0,
        flanks=flanks,
        water=water,
        velocity=velocity.reshape(-1, 3) if thrown else None,
        cells_per_spacing=scene.cell_size / scene.spacing,
    )
