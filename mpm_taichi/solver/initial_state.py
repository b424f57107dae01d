"""A scene made ready for the solver: points on the grid, material table, stress before settling.

The settled start (`SimulationSettings.initial_stress = "settled"`) begins from K0 stress and lets
the solver relax it elastically on points that do not move (`solver.settle`); at t = 0 every zone
has its own strength, a soil with a strength ratio that of each point (`effects.framework.hooks`,
`start_strength`). Bodies that are thrown or that hang in the air start free of stress.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from shapely.geometry import Polygon
from shapely.ops import unary_union

from geometry.scenes.fill import MaterialPoints, fill
from geometry.scenes.overburden import vertical_effective_stress
from mpm_taichi.effects import Active, acting_scene, effects_on, relative_width
from mpm_taichi.layout import AREA, PER_COVER
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.materials.law import CONSTANTS, MaterialLaw
from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB, NO_CAP
from mpm_taichi.solver.boundary import (
    LOWEST,
    STICK,
    Grid,
    fixed_by_bodies,
    make_grid,
    node_tables,
)
from mpm_taichi.solver.splines import EDGES
from mpm_taichi.solver.water import (
    MovingFace,
    head_places,
    level_and_fall,
    moving_face,
    water_force,
)

if TYPE_CHECKING:
    from geometry.scenes.scene import Material, Scene
    from pipeline.config import SimulationSettings


@dataclass
class PreparedScene:
    """One scene as the kernels take it: P moving points (settled ones first), R material rows."""

    given: Scene
    scene: Scene  # the given one, as changed by effects that act on the scene as a whole
    effects: tuple[Active, ...]
    settings: SimulationSettings
    points: MaterialPoints
    order: np.ndarray  # (P,) place in `points` of each moving point
    settled: int  # the first this many points take part in settling
    grid: Grid
    kind: np.ndarray  # (nodes,) int32
    surroundings: np.ndarray  # (nodes, 8) float32
    motion: np.ndarray  # (P, 4) float32
    home: np.ndarray  # (P,) int32, node within the grid
    stress: np.ndarray  # (P, 4) float32 [Pa]
    row: np.ndarray  # (P,) int32
    elastic: np.ndarray  # (R, 4) float32
    strength: np.ndarray  # (R, 8) float32
    settle_strength: np.ndarray  # (R, 8) float32
    density: np.ndarray  # (R,) float32 [kg/m3]
    variables: np.ndarray  # (R, V) float32, history variables of the law at t = 0
    # (R, 5) float32: liquefied (1 or 0), tan(phi), c [Pa], tension cap set [Pa], strength ratio
    soil: np.ndarray
    soils: tuple[Material, ...]  # R materials of the rows
    width: np.ndarray  # (P,) float64, of the slide where the point is at t = 0: `relative_width`
    volume: np.ndarray  # (P,) float64 [m2 x width]
    mass: np.ndarray  # (P,) float64 [kg/m x width]
    wave_speed: float  # m/s
    frame_time: float  # s
    face: MovingFace | None  # where the head moves with the soil

    @property
    def busy_until(self) -> float:
        """Time before which the run may not be ended for resting, because of its effects [s]."""
        return max((one.until(self.given) for one in self.effects), default=0.0)

    def water_now(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force of the water per volume [N/m3], x and y, at the nodes (grid.shape).

        `position` (P, 2) [m] is where the moving points are now.
        """
        x, y = self.grid.coordinates()
        head = self.face.head(head_places(x[:, 0], self.grid.cell), position)
        level, fall = level_and_fall(head, self.grid.cell)
        return water_force(level, fall, y, self.grid.cell, self.settings.gravity_m_per_s2)

    def enlarge(self, left: int, right: int) -> PreparedScene:
        """Lay a wider grid for an open domain, more nodes by this many columns on either side."""
        cell, shape = self.grid.cell, self.grid.shape
        self.grid = Grid(
            origin=(self.grid.origin[0] - left * cell, self.grid.origin[1]),
            cell=cell,
            shape=(shape[0] + left + right, shape[1]),
        )
        self.kind, self.surroundings = nodes_of(
            self.scene, self.settings, self.points, self.grid, self.effects
        )
        return self


def prepare(
    scene: Scene, settings: SimulationSettings, law: MaterialLaw = MOHR_COULOMB
) -> PreparedScene:
    """Fill a scene, lay its grid and its tables, with the constants of a material law."""
    given, active = scene, effects_on(scene)
    scene = acting_scene(scene, active)
    points = fill(scene)
    grid = make_grid(scene)
    kind, surroundings = nodes_of(scene, settings, points, grid, active)
    fixed = points.kinematic
    row, rows, densities = material_rows(scene, points)
    mass = np.asarray(densities)[row] * points.volume

    resting = resting_points(scene, points) & ~fixed
    order = np.concatenate([np.flatnonzero(resting), np.flatnonzero(~resting & ~fixed)])
    motion, home = locate(grid, points.position[order])
    motion[:, 2:] = points.velocity[order]
    stress = np.zeros((len(order), 4), np.float32)
    if settings.initial_stress != "gravity_on":
        lateral = np.array([settings.k0 or _k0(material) for material in rows])[row]
        at_rest = k0_stress(scene, points, mass, lateral, settings.gravity_m_per_s2)
        stress[:] = np.where(resting[order, None], at_rest[order], 0.0)
    width = relative_width(active, scene, points.position[order])
    moduli = [
        m.youngs_modulus_pa
        * (1 - m.poisson_ratio)
        / ((1 + m.poisson_ratio) * (1 - 2 * m.poisson_ratio))
        for m in rows
    ]
    return PreparedScene(
        given=given,
        scene=scene,
        effects=active,
        settings=settings,
        points=points,
        order=order,
        settled=int(resting.sum()) if settings.initial_stress == "settled" else 0,
        grid=grid,
        kind=kind,
        surroundings=surroundings,
        motion=motion,
        home=home,
        stress=stress,
        row=row[order].astype(np.int32),
        elastic=np.array([_elastic(material) for material in rows]),
        strength=_constants(rows, law.constants),
        settle_strength=_constants(rows, law.settling_constants),
        density=np.asarray(densities, np.float32),
        variables=_variables(rows, law),
        soil=np.array([_soil(material) for material in rows], np.float32),
        soils=tuple(rows),
        width=width,
        volume=points.volume[order] * width,
        mass=mass[order] * width,
        wave_speed=float(np.sqrt(np.max(np.asarray(moduli) / np.asarray(densities)))),
        frame_time=settings.frame_interval
        * float(np.sqrt(scene.spacing / settings.gravity_m_per_s2)),
        face=moving_face(scene, settings, points.position[order]),
    )


def nodes_of(
    scene: Scene,
    settings: SimulationSettings,
    points: MaterialPoints,
    grid: Grid,
    active: Sequence[Active],
) -> tuple[np.ndarray, np.ndarray]:
    """Types (nodes,) int32 and surroundings (nodes, 8) of a grid, fixed bodies included.

    Where effects have the slide wider, the ground has more area, and full contact more volume.
    """
    kind, surroundings = node_tables(
        scene,
        grid,
        wall_contact=settings.wall_contact,
        water=settings.water,
        water_face=settings.water_face,
        gravity=settings.gravity_m_per_s2,
    )
    fixed = points.kinematic
    width = relative_width(active, scene, np.stack(grid.coordinates(), axis=-1).reshape(-1, 2))
    surroundings[:, AREA] *= width
    surroundings[:, PER_COVER] /= width
    held = fixed_by_bodies(grid, points.position[~fixed], points.position[fixed], kind)
    kept = kind & (EDGES | LOWEST)
    return np.where(held, STICK | kept, kind).astype(np.int32), surroundings


def material_rows(
    scene: Scene, points: MaterialPoints
) -> tuple[np.ndarray, list[Material], list[float]]:
    """Material rows of the points: one per material, and one more where it is saturated.

    Returns:
        row: (N,) int64 into the lists; rows: materials; densities [kg/m3].
    """
    materials = list(scene.materials.values())
    rows = list(materials)
    densities = [m.density for m in materials]
    row = points.material.astype(np.int64)
    wet = points.position[:, 1] < scene.phreatic_level(points.position[:, 0])
    for number, material in enumerate(materials):
        soaked = wet & (points.material == number)
        if material.saturated_density is not None and soaked.any():
            row[soaked] = len(rows)
            rows.append(material)
            densities.append(material.saturated_density)
    return row, rows, densities


def resting_points(scene: Scene, points: MaterialPoints) -> np.ndarray:
    """Points of bodies that rest on the ground or on fixed bodies and are not thrown, (N,) bool.

    A body is a group of zones that touch; it rests if one of them comes within a spacing of the
    ground, and is thrown if one has an initial velocity.
    """
    near = 0.51 * scene.spacing
    shapes = [Polygon(zone.polygon).buffer(near) for zone in scene.zones]
    union = unary_union(shapes)
    bodies = list(union.geoms) if union.geom_type == "MultiPolygon" else [union]
    resting = np.zeros(len(scene.zones), bool)
    position = points.position
    close = position[:, 1] - scene.ground.height(position[:, 0]) < scene.spacing
    for body in bodies:
        members = [i for i, shape in enumerate(shapes) if body.intersects(shape)]
        thrown = any(scene.zones[i].initial_velocity != (0.0, 0.0) for i in members)
        held = close[np.isin(points.zone, members)].any() or any(
            scene.zones[i].kinematic for i in members
        )
        resting[members] = held and not thrown
    return resting[points.zone]


def k0_stress(
    scene: Scene, points: MaterialPoints, mass: np.ndarray, lateral: np.ndarray, gravity: float
) -> np.ndarray:
    """K0 stress (N, 4) [Pa] from the weight, less buoyancy, of the points above in the column."""
    vertical = -vertical_effective_stress(scene, points.position, points.volume, mass, gravity)
    side = lateral * vertical
    return np.stack([side, vertical, side, np.zeros_like(side)], axis=1)


def locate(grid: Grid, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (N, 4; velocity still zero) float32 and home nodes (N,) int32 of points [m]."""
    scaled = (position - np.asarray(grid.origin)) / grid.cell
    centre = np.floor(scaled + 0.5).astype(np.int64)
    motion = np.zeros((len(position), 4), np.float32)
    motion[:, :2] = scaled - centre
    return motion, (centre[:, 0] * grid.shape[1] + centre[:, 1]).astype(np.int32)


def _k0(material: Material) -> float:
    return material.poisson_ratio / (1.0 - material.poisson_ratio)


def _soil(material: Material) -> tuple[float, float, float, float, float]:
    """A row of `PreparedScene.soil`."""
    cap = NO_CAP if material.tension_cap_pa is None else material.tension_cap_pa
    tangent = float(np.tan(material.friction_rad))
    ratio = material.strength_ratio or 0.0
    return float(material.liquefied), tangent, material.cohesion_pa, cap, ratio


def _elastic(material: Material) -> np.ndarray:
    return elastic_constants(
        youngs_modulus=material.youngs_modulus_pa, poisson_ratio=material.poisson_ratio
    )


def _constants(
    materials: list[Material], constants: Callable[[Material], Sequence[float]]
) -> np.ndarray:
    """Rows of constants of a law, (R, 8) float32."""
    rows = np.zeros((len(materials), CONSTANTS), np.float32)
    for row, material in zip(rows, materials, strict=True):
        values = constants(material)
        row[: len(values)] = values
    return rows


def _variables(materials: list[Material], law: MaterialLaw) -> np.ndarray:
    """History variables of a law at t = 0, (R, V) float32."""
    rows = np.zeros((len(materials), law.variables), np.float32)
    if law.initial_variables is not None:
        rows[:] = [law.initial_variables(material) for material in materials]
    return rows
