"""A section as columns: what the direct model sees, and what it predicts.

The section is cut into `COLUMNS` columns of `COLUMN` heights, from `HALF_WIDTH` heights left of its
middle to as far right. Lengths are in heights of the section, strengths in rho g height, so that
one model serves all sizes. The soil of a column is cut into `LAYERS` layers of equal thickness; the
share of each zone in each of them is known (`zone_share`), so that what a layer holds is a smooth
function of the values of the zones and has a derivative with respect to them
(`gns.direct.network`).

Shapes: C columns, K layers, Z zones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from geometry.scenes.polygon_checks import on_verticals
from geometry.scenes.scene import Scene
from geometry.sides import SIDES
from geometry.survey.columns import column_height, kernel_length, toe
from gns.data.scene_facts import check_base_physics
from gns.direct.effects import NAMES, inputs_of
from mpm_taichi.effects import acting_scene, effects_on, liquefied_zones
from mpm_taichi.solver.water import WATER_DENSITY
from pipeline.cli import InputError

if TYPE_CHECKING:
    from pipeline.config import SimulationSettings

COLUMNS, LAYERS = 192, 12
#: Width of a column, and half that of all columns [heights].
COLUMN = 0.125
HALF_WIDTH = 0.5 * COLUMNS * COLUMN
#: Places along x and y at which the zones of a layer of a column are looked up.
SAMPLES = 3
#: Kernel that smooths the deposit into column thicknesses [columns].
SMOOTHING = 0.7
#: Properties of a zone that the model sees.
PROPERTIES = ("cohesion", "tan_friction", "density")
#: Settings of the runs that are learned from, which the columns do not hold; those of water matter
#: where its level falls: pressure and reduced weight are one elsewhere.
LEARNED = {
    "initial_stress": "settled",
    "k0": None,
    "transfer": "affine_flip",
    "pic_rate_per_s": 1.0,
    "local_damping": 0.0,
    "volumetric_averaging": True,
    "pressure_relaxation": 1.0,
    "pressure_smoothing": 0.02,
    "volume_correction": True,
    "wall_contact": "smooth",
}
LEARNED_OF_WATER = {"water": "pore_pressure", "water_face": "moving"}
#: Effects that the columns hold: a factor on the strength of the liquefied soil at each place.
FIELDS = ("strength_contrast",)
#: Effects that are another scene, which the columns hold as such.
SCENES = ("pool_level",)
#: Levels of water are cut at this many heights above and below the surface.
DEEPEST = 2.0


@dataclass(frozen=True)
class SectionColumns:
    """A scene as the model sees it.

    Attributes:
        height: of the section above its ground, the unit of length [m].
        middle: x of the middle of the columns [m]; base: elevation of the ground there [m].
        unit_kpa: the unit of strength, rho g height of the mean density [kPa].
        unit_s: the unit of time, sqrt(height / g) [s].
        feet: where the section ends, (left, right) [heights from the middle].
        thickness: of the soil, (C,) [heights]; ground: its elevation over `base`, likewise.
        water: level of the water over the ground, (C,) [heights]; -DEEPEST where there is none.
        wall: 1 beyond a wall, (C,).
        zone_share: (C, K, Z), of each layer from the lowest; sums to 1 where there is soil.
        strength_share: the same times the factor by which the strength of the zone differs there,
            where an effect of FIELDS is on.
        values: of the zones (Z, 3), see PROPERTIES: [rho g height], -, [mean density].
        saturated: density under water over that above it, (Z,).
        density: mean over that of water.
        spacing: between the material points of the runs learned from, or of a question [heights].
        effects: see `gns.direct.effects.inputs_of`, (E,).
    """

    height: float
    middle: float
    base: float
    unit_kpa: float
    unit_s: float
    feet: tuple[float, float]
    thickness: np.ndarray
    ground: np.ndarray
    water: np.ndarray
    wall: np.ndarray
    zone_share: np.ndarray
    strength_share: np.ndarray
    values: np.ndarray
    saturated: np.ndarray
    density: float
    spacing: float
    effects: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """Middle of each column (C,) [m]."""
        return self.middle + self.height * places()


def places() -> np.ndarray:
    """Middle of each column (C,) [heights from the middle of the section]."""
    return (np.arange(COLUMNS) + 0.5) * COLUMN - HALF_WIDTH


def check_known(scene: Scene) -> None:
    """Refuse what the model has never seen.

    Raises:
        InputError: an effect that no direct model knows, another law, soil that moves at t = 0, a
            ground of its own friction.
    """
    check_base_physics(scene, "the direct model", known=(*FIELDS, *SCENES, *NAMES))
    if any(any(zone.initial_velocity) for zone in scene.zones):
        raise InputError(
            f"{scene.name}: initial_velocity: the direct model knows soil at rest alone"
        )
    if scene.ground.contact != "rough":
        raise InputError(
            f"{scene.name}: ground.contact: {scene.ground.contact}; the direct model knows rough "
            "ground alone"
        )


def check_settings(scene: Scene, settings: SimulationSettings) -> None:
    """Refuse settings by which a run is another than those learned from.

    Raises:
        InputError: the start or the water is taken otherwise.
    """
    scene = _with_its_water(scene)
    learned = {**LEARNED, **(LEARNED_OF_WATER if scene.head_falls else {})}
    for name, known in learned.items():
        asked = getattr(settings, name)
        if asked != known:
            raise InputError(
                f"{scene.name}: simulation.{name}: {asked}; the direct model knows "
                f"{'none' if known is None else known} alone"
            )


def section_of(scene: Scene, gravity: float = 9.81) -> SectionColumns:
    """The columns of a scene.

    Raises:
        InputError: see `check_known`.
    """
    check_known(scene)
    scene = _with_its_water(scene)
    polygons = [shapely.Polygon(zone.polygon) for zone in scene.zones]
    whole = shapely.union_all([one.buffer(1e-6 * scene.spacing) for one in polygons])
    left, _, right, _ = whole.bounds
    middle = 0.5 * (left + right)
    fine = np.linspace(left, right, 201)
    height = float(
        np.max(_surface(whole, fine, scene.ground.height(fine)) - scene.ground.height(fine))
    )
    x = middle + height * places()
    ground = scene.ground.height(x)
    inside = (x > left) & (x < right)
    thickness = np.zeros(COLUMNS)
    offsets = ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5) * COLUMN * height
    share = np.zeros((COLUMNS, LAYERS, len(polygons)))
    factors = _Factors(scene)
    strong = np.zeros_like(share)
    rows = (np.arange(LAYERS * SAMPLES) + 0.5) / (LAYERS * SAMPLES)
    for shift in offsets:
        at = x + shift
        base = scene.ground.height(at)
        depth = _surface(whole, at, base) - base
        thickness += depth / SAMPLES
        columns = np.flatnonzero(depth > 0.0)
        grid_x = np.repeat(at[columns], len(rows))
        grid_y = (base[columns, None] + depth[columns, None] * rows).ravel()
        factor = factors.at(grid_x, grid_y)
        for number, polygon in enumerate(polygons):
            held = shapely.contains_xy(polygon, grid_x, grid_y)
            share[columns, :, number] += _of_layers(held)
            if factors:
                strong[columns, :, number] += _of_layers(
                    held * factor if factors.acts_in(number) else held
                )
    total = np.maximum(share.sum(axis=2, keepdims=True), 1.0)  # no sample: no soil
    share = share / total
    strong = strong / total if factors else share
    inside &= thickness > 0.0
    level = scene.phreatic_level(x)
    water = np.clip((level - ground) / height, -DEEPEST, DEEPEST)
    materials = [scene.materials[zone.material] for zone in scene.zones]
    areas = np.array([polygon.area for polygon in polygons])
    density = float(np.average([one.density for one in materials], weights=areas))
    unit = density * gravity * height / 1000.0
    spans = [one.density / density for one in materials]
    closed = scene.domain.walls == "closed"
    wall = (x < scene.domain.x_min) | (x > scene.domain.x_max) if closed else np.zeros(COLUMNS)
    base, unit_s = float(scene.ground.height(middle)), float(np.sqrt(height / gravity))
    return SectionColumns(
        height=height,
        middle=middle,
        base=base,
        unit_kpa=unit,
        unit_s=unit_s,
        feet=((left - middle) / height, (right - middle) / height),
        thickness=thickness / height,
        ground=(ground - base) / height,
        water=water,
        wall=wall.astype(float),
        zone_share=share,
        strength_share=strong,
        values=np.column_stack([_strengths(scene, unit), spans]),
        saturated=np.array(
            [(one.saturated_density or one.density) / one.density for one in materials]
        ),
        density=density / WATER_DENSITY,
        spacing=scene.spacing / height,
        effects=inputs_of(scene, height, unit, unit_s),
    )


def _with_its_water(scene: Scene) -> Scene:
    """The scene that effects of SCENES mean."""
    return acting_scene(scene, tuple(o for o in effects_on(scene) if o.effect.name in SCENES))


class _Factors:
    """By what effects of FIELDS multiply the strength of a scene's liquefied soil."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._on = [one for one in effects_on(scene) if one.effect.name in FIELDS]
        liquefied = liquefied_zones(scene) if self._on else ()
        self._zones = {n for n, zone in enumerate(scene.zones) if zone.name in liquefied}

    def __bool__(self) -> bool:
        return bool(self._on)

    def acts_in(self, zone: int) -> bool:
        """Whether a zone, by its place in the scene, has another strength somewhere."""
        return zone in self._zones

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The factor in liquefied soil at places (N,) [m], (N,)."""
        place, factor = np.column_stack([x, y]), np.ones(len(x))
        for one in self._on if len(x) else ():
            factor *= one.field_of(self.scene, place)
        return factor


def _of_layers(held: np.ndarray) -> np.ndarray:
    """Sums over the samples of each layer, (columns, LAYERS), of those of all columns."""
    return held.reshape(-1, LAYERS, SAMPLES).sum(axis=2)


def with_strengths(section: SectionColumns, scene: Scene) -> SectionColumns:
    """A section with the strengths of a scene that differs from its own in nothing else."""
    own = _strengths(scene, section.unit_kpa)
    return replace(section, values=np.column_stack([own, section.values[:, 2]]))


def _strengths(scene: Scene, unit_kpa: float) -> np.ndarray:
    """Cohesion [unit] and tan phi of each zone, (Z, 2)."""
    materials = [scene.materials[zone.material] for zone in scene.zones]
    return np.array(
        [(one.cohesion_pa / 1000.0 / unit_kpa, np.tan(one.friction_rad)) for one in materials]
    )


@dataclass(frozen=True)
class Outcome:
    """What the model predicts, of a run.

    Attributes:
        thickness: of the deposit, (C,) [heights].
        toes: left and right, (2,) [heights from the middle].
        toes_before: the same reading before the slide.
    """

    thickness: np.ndarray
    toes: np.ndarray
    toes_before: np.ndarray


def outcome_of(
    section: SectionColumns,
    initial: np.ndarray,
    final: np.ndarray,
    volume: np.ndarray,
    spacing: float,
) -> Outcome | None:
    """What a run left, read as a survey reads it; None: it went beyond the columns.

    Args:
        section: of its scene.
        initial: positions before the slide (N, 2) [m].
        final: after it.
        volume: of the points (N,) [m2 per m of width].
        spacing: between its material points [m].
    """
    length = max(SMOOTHING * COLUMN * section.height, 0.5 * kernel_length(spacing))
    thickness = column_height(final.astype(float), volume, section.x, length=length)
    try:
        toes, before = (toes_of(section, points, volume, spacing) for points in (final, initial))
    except ValueError:  # nothing is left that is thick enough to be a dam
        return None
    if np.abs(toes).max() > HALF_WIDTH - COLUMN:
        return None
    return Outcome(thickness / section.height, toes, before)


def toes_of(
    section: SectionColumns, points: np.ndarray, volume: np.ndarray, spacing: float
) -> np.ndarray:
    """Left and right toe of points (N, 2) [m] as a survey reads them, (2,) [heights].

    Their volumes are (N,) [m2 per m of width].

    Raises:
        ValueError: nothing is thick enough to be a dam.
    """
    at = [toe(points.astype(float), volume, spacing=spacing, side=side) for side in SIDES]
    return (np.array(at) - section.middle) / section.height


def _surface(whole, x: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Highest elevation of the soil at `x` [m]; that of the ground where there is none."""
    found = np.array(ground, dtype=float)
    cut = on_verticals(whole, x)
    hit = ~shapely.is_empty(cut)
    found[hit] = np.maximum(shapely.bounds(cut[hit])[:, 3], ground[hit])
    return found
