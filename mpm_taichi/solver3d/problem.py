"""What a three-dimensional run is made of: points, materials, ground, walls, still water."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from geometry.scenes.fill import fill
from geometry.scenes.scene import MOHR_COULOMB
from geometry.scenes3d.fill3d import fill_terrain
from geometry.scenes3d.scene3d import Scene3d, plan_domain
from geometry.terrain.raster import Raster
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Material, Scene


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
    scene: Scene,
    width: float,
    *,
    flanks: Literal["smooth", "rough", "no_slip"] = "smooth",
    flank_slope: float | None = None,
) -> Problem3d:
    """A section over a width [m], its points repeated at their spacing.

    The width is rounded to whole cells: in a cell that a flank cuts, soil is held or let go (a bank
    between smooth flanks 3.5 cells apart stopped 7 % too early).

    Between vertical flanks, or with `flank_slope` (rise over run) in a valley whose sides rise from
    the edges of the width until they are higher than the section; the sides are ground.

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
    cell = scene.cell_size
    floor = width = cell * max(round(width / cell), 1)
    if flank_slope is not None:
        reach = (scene.extent[1] - scene.ground.lowest) / flank_slope
        width = floor + 2 * cell * (math.ceil(reach / cell) + 2)
    rows = round(width / scene.spacing)
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
    fine, places = _fine_places(scene)
    base = Raster((domain.x_min, 0.0), fine, scene.ground.height(places)[:, None])
    problem = Problem3d(
        name=scene.name,
        spacing=scene.spacing,
        position=position.reshape(-1, 3),
        volume=np.repeat(points.volume * width / rows, rows),
        material=np.repeat(points.material, rows),
        zone=np.repeat(points.zone, rows),
        materials=tuple(scene.materials.values()),
        base=base,
        domain=(domain.x_min, domain.x_max, 0.0, width, domain.y_max),
        contact=scene.ground.contact,
        friction_coefficient=scene.ground.friction_coefficient or 0.0,
        flanks=flanks,
        water=_water_of(scene),
        velocity=velocity.reshape(-1, 3) if thrown else None,
        cells_per_spacing=scene.cell_size / scene.spacing,
    )
    if flank_slope is None:
        return problem
    y = fine * np.arange(int(np.ceil(width / fine)) + 1)
    rise = flank_slope * np.maximum(np.abs(y - 0.5 * width) - 0.5 * floor, 0.0)
    side = scene.ground.lowest + rise[None, :]
    base = Raster((domain.x_min, 0.0), fine, np.maximum(base.values, side))
    kept = problem.position[:, 2] > base.at(problem.position[:, 0], problem.position[:, 1])
    return replace(
        problem,
        base=base,
        position=problem.position[kept],
        volume=problem.volume[kept],
        material=problem.material[kept],
        zone=problem.zone[kept],
        velocity=None if problem.velocity is None else problem.velocity[kept],
    )


def _fine_places(scene: Scene) -> tuple[float, np.ndarray]:
    """Places along a section at which its ground and its water are read [m], and their distance."""
    fine = scene.cell_size / 8
    return fine, np.arange(scene.domain.x_min, scene.domain.x_max + fine, fine)


def _water_of(scene: Scene) -> Raster | None:
    """Level of pool and groundwater of a section [m]; None: no water."""
    if not scene.has_water:
        return None
    fine, places = _fine_places(scene)
    level = np.asarray(scene.phreatic_level(places))
    return Raster((scene.domain.x_min, 0.0), fine, level[:, None])


def has_sloping_water(scene: Scene3d) -> bool:
    """The level of pool and groundwater is not the same everywhere; no point is filled for it."""
    if scene.section is None:
        return False  # between rasters there is one level
    water = _water_of(scene.section)
    return water is not None and bool(np.ptp(water.values) > 0.0)


def refuse_flowing_water(problem: Problem3d) -> None:
    """Refuse pore water that flows in one line: in three dimensions it does not."""
    if problem.water is not None and any(
        soil.permeability_m_per_s is not None for soil in problem.materials
    ):
        raise InputError(
            f"{problem.name}: materials: permeability_m_per_s: pore water does not flow in three "
            "dimensions; leave it out, or simulate a section"
        )


def problem_of(scene: Scene3d) -> Problem3d:
    """The problem of a scene: its points, base and water.

    Raises:
        InputError: what the solver does not have, or a zone without points.
    """
    document = scene.document
    if scene.section is not None and document.section is not None:
        problem = extruded(
            scene.section,
            document.section.width_m,
            flanks=document.flanks,
            flank_slope=document.section.flank_slope,
        )
        return replace(problem, name=scene.name)
    terrain, ground = document.terrain, scene.ground
    assert terrain is not None and ground is not None  # a document has one or the other
    points = fill_terrain(scene)
    level = terrain.water_level
    top = float(max(ground.surface.values.max(), ground.base.values.max()))
    return Problem3d(
        name=scene.name,
        spacing=scene.spacing,
        position=points.position,
        volume=points.volume,
        material=points.material,
        zone=points.zone,
        materials=tuple(terrain.materials.values()),
        base=ground.base,
        domain=(*plan_domain(scene), top + 4 * scene.spacing),
        contact=terrain.contact,
        friction_coefficient=terrain.friction_coefficient or 0.0,
        flanks=document.flanks,
        water=None if level is None else Raster.level(level),
    )
