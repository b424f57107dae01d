"""The document `scene3d.yaml`: a section over a width, or a body between two rasters.

x runs along the section, y across, z up. Lengths in metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from geometry.scenes.scene import (
    Document,
    Material,
    Point,
    Scene,
    checked_document,
    load_scene,
    scene_from_mapping,
)
from geometry.terrain.raster import Raster, read_raster
from pipeline.cli import InputError
from pipeline.files import file_or_within, read_yaml
from pipeline.places import CASES, resolve

FILE_NAME = "scene3d.yaml"
PAGE = "docs/how-to/three-dimensions.md"
POINTS_PER_CELL = 2
"""Along an edge of a cell of a terrain."""
Flanks = Literal["smooth", "rough", "no_slip"]


class Section(Document):
    """A section of two dimensions, extruded over a width."""

    file: str = Field(description="scene of the section, relative to this file")
    width_m: float = Field(gt=0, description="width on the ground [m], rounded to whole cells")
    flank_slope: float | None = Field(
        None, gt=0, le=1, description="rise of the flanks over their run; null = vertical"
    )
    x_min: float | None = Field(None, description="wall [m]; null = the section's")
    x_max: float | None = Field(None, description="wall [m]; null = the section's")


class PlanZone(Document):
    """A body of one material between two elevations, inside a polygon in plan."""

    name: str = Field(min_length=1, description="unique in the scene")
    material: str = Field(description="a key of materials")
    plan: list[Point] | None = Field(
        None, min_length=3, description="(x, y) in order, not closed [m]; null = everywhere"
    )
    bottom: str | float | None = Field(None, description="raster or level [m]; null = the base")
    top: str | float | None = Field(None, description="raster or level [m]; null = the surface")


class Terrain(Document):
    """Real ground: soil between a base and a surface."""

    surface: str = Field(description="raster of the surface before the slide")
    base: str = Field(description="raster of the rigid base")
    after: str | None = Field(None, description="raster of the surface measured after the slide")
    origin: Point = Field((0.0, 0.0), description="subtracted from the rasters' coordinates [m]")
    zones: list[PlanZone] = Field(min_length=1, description="the first that holds a point has it")
    materials: dict[str, Material] = Field(min_length=1)
    contact: Literal["rough", "no_slip", "coulomb", "slip"] = "rough"
    friction_coefficient: float | None = Field(None, ge=0, description="of contact: coulomb")
    water_level: float | None = Field(None, description="pool and groundwater [m]; null = none")

    @model_validator(mode="after")
    def _consistent(self) -> Terrain:
        if (self.contact == "coulomb") != (self.friction_coefficient is not None):
            raise ValueError("friction_coefficient belongs to contact: coulomb, and to it alone")
        names = [zone.name for zone in self.zones]
        for zone in self.zones:
            if names.count(zone.name) > 1:
                raise ValueError(f"zones: two zones are called {zone.name!r}")
            if zone.material not in self.materials:
                known = ", ".join(self.materials)
                raise ValueError(
                    f"zones: zone {zone.name!r} has material {zone.material!r}; known are {known}"
                )
        unused = sorted(set(self.materials) - {zone.material for zone in self.zones})
        if unused:
            raise ValueError(f"materials: {unused[0]!r} is used by no zone; remove it")
        return self


class Scene3dDocument(Document):
    """What `scene3d.yaml` holds."""

    name: str = Field(min_length=1)
    description: str = ""
    section: Section | None = None
    terrain: Terrain | None = None
    flanks: Flanks = Field("rough", description="contact of the walls at y_min and y_max")
    spacing: float | None = Field(
        None, gt=0, description="distance between points [m]; null = that of the section"
    )
    duration_s: float | None = Field(None, gt=0, description="null = simulation.duration_s")
    side: Literal["left", "right"] = Field(
        "right", description="where the toe is read: at the end of small x, or of large x"
    )
    paths: dict[str, list[Point]] = Field(
        default_factory=dict,
        description="name -> (x, y) downstream [m]: runout is read and a section is drawn "
        "along it; none = the middle, along x",
    )
    lines: dict[str, tuple[Point, Point]] = Field(
        default_factory=dict,
        description="name -> its two ends (x, y) [m]: volume that crossed to its right is read",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Scene3dDocument:
        if (self.section is None) == (self.terrain is None):
            raise ValueError("give either section or terrain")
        if self.terrain is not None and self.spacing is None:
            raise ValueError("spacing: needed with terrain")
        for kind, named in (("paths", self.paths), ("lines", self.lines)):
            for name, places in named.items():
                if len(set(places)) < max(len(places), 2):
                    raise ValueError(f"{kind}.{name}: needs two places at least, all different")
        return self


@dataclass(frozen=True)
class Ground3d:
    """The rasters of a terrain, read."""

    surface: Raster
    base: Raster
    after: Raster | None
    limits: tuple[tuple[Raster, Raster], ...]  # bottom and top of each zone

    def zones_at(self, x: np.ndarray, y: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Elevation below and above each zone at places [m], wherever its plan is.

        Both are the same where the zone has no soil.
        """
        low, high = self.base.at(x, y), self.surface.at(x, y)
        found = []
        for bottom, top in self.limits:
            under = np.maximum(low, bottom.at(x, y))
            found.append((under, np.maximum(np.minimum(high, top.at(x, y)), under)))
        return found


@dataclass(frozen=True)
class Scene3d:
    """A three-dimensional scene with its files read."""

    document: Scene3dDocument
    spacing: float
    section: Scene | None
    ground: Ground3d | None

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.document.name

    @property
    def origin(self) -> tuple[float, float]:
        """What was subtracted from the coordinates of rasters [m]."""
        return self.document.terrain.origin if self.document.terrain else (0.0, 0.0)

    @property
    def sliding_height(self) -> float:
        """Height of what slides of the section, or the greatest thickness of the zones [m]."""
        if self.ground is None:
            assert self.section is not None  # a document has one or the other
            return self.section.sliding_height
        surface, base = self.ground.surface, self.ground.base
        x_min, x_max, y_min, y_max = plan_domain(self)
        thickest = 0.0
        for raster in (surface, base):
            x, y = raster.axes
            x, y = x[(x >= x_min) & (x <= x_max)], y[(y >= y_min) & (y <= y_max)]
            place = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2).T
            soil = np.sum([over - under for under, over in self.ground.zones_at(*place)], axis=0)
            most = np.maximum(surface.at(*place) - base.at(*place), 0.0)  # where zones overlap
            thickest = max(thickest, float(np.max(np.minimum(soil, most), initial=0.0)))
        return thickest

    @property
    def crs(self) -> str:
        """Coordinate system of the surface as WKT; empty: none."""
        return self.ground.surface.crs if self.ground else ""

    @property
    def soil(self) -> Scene | Terrain:
        """What holds the zones and their materials: the section, or the terrain."""
        part = self.section or self.document.terrain
        assert part is not None  # a document has one or the other
        return part

    def with_soil(self, soil: Scene | Terrain) -> Scene3d:
        """The scene with another section, or another terrain on the same rasters."""
        if isinstance(soil, Scene):
            return replace(self, section=soil)
        return replace(self, document=self.document.model_copy(update={"terrain": soil}))

    def changed(
        self, *, water: bool = True, strengths_kpa: Mapping[str, float] | None = None
    ) -> Scene3d:
        """The scene with other soil.

        Args:
            water: False takes pool and groundwater away.
            strengths_kpa: material -> cohesion, which is S_r where it liquefied [kPa]; it replaces
                a strength ratio.

        Raises:
            InputError: there is no such material, or a strength that cannot be.
        """
        part = self.soil
        fields = part.model_dump()
        if not water:
            fields["water_level"] = None
        for name, cohesion in (strengths_kpa or {}).items():
            if name not in fields["materials"]:
                known = ", ".join(fields["materials"])
                raise InputError(f"strengths: {self.name} has no material {name!r}; it has {known}")
            fields["materials"][name]["cohesion_kpa"] = cohesion
            fields["materials"][name].pop("strength_ratio", None)
        return self.with_soil(
            checked_document(type(part), fields, f"{self.name} with the options given", PAGE)
        )


def load_scene_3d(path: str | Path, *, spacing: float | None = None) -> Scene3d:
    """Read a scene from its file or its folder, with all that it names.

    Args:
        path: `scene3d.yaml` or its folder.
        spacing: instead of that of the document [m].

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    path = file_or_within(path, FILE_NAME)
    document = read_document(path)
    spacing = spacing or document.spacing
    if document.section is not None:
        section = _section(document.section, path.parent, spacing)
        return Scene3d(document, section.spacing, section, None)
    terrain = document.terrain
    assert terrain is not None and spacing is not None  # both are checked by the document

    surface = read_raster(path.parent / terrain.surface, origin=terrain.origin)

    def read(entry: str | float | None, otherwise: Raster) -> Raster:
        if entry is None:
            return otherwise
        if isinstance(entry, float):
            return Raster.level(entry)
        return read_raster(path.parent / entry, origin=terrain.origin, crs=surface.crs)

    base = read(terrain.base, surface)
    after = None if terrain.after is None else read(terrain.after, surface)
    limits = tuple((read(zone.bottom, base), read(zone.top, surface)) for zone in terrain.zones)
    scene = Scene3d(document, spacing, None, Ground3d(surface, base, after, limits))
    _check_plans(scene, path)
    return scene


def read_document(path: Path) -> Scene3dDocument:
    """Read `scene3d.yaml`, without what it names.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    return checked_document(Scene3dDocument, read_yaml(path), path, PAGE)


def _section(section: Section, folder: Path, spacing: float | None) -> Scene:
    """The section with the walls and the spacing of the document; its walls are closed."""
    scene = load_scene(folder / section.file)
    x_min = scene.domain.x_min if section.x_min is None else section.x_min
    x_max = scene.domain.x_max if section.x_max is None else section.x_max
    domain = {**scene.domain.model_dump(), "x_min": x_min, "x_max": x_max, "walls": "closed"}
    document = {**scene.model_dump(), "domain": domain, "spacing": spacing or scene.spacing}
    source = f"{folder / section.file} at {document['spacing']:g} m spacing"
    return scene_from_mapping(document, source)


def _check_plans(scene: Scene3d, path: Path) -> None:
    x_min, x_max, y_min, y_max = plan_domain(scene)
    terrain = scene.document.terrain
    assert terrain is not None
    for zone in terrain.zones:
        if zone.plan is None:
            continue
        corners = np.asarray(zone.plan)
        low, high = corners.min(axis=0), corners.max(axis=0)
        if high[0] < x_min or low[0] > x_max or high[1] < y_min or low[1] > y_max:
            raise InputError(
                f"{path}: zone {zone.name!r}: plan lies outside the base raster "
                f"(x {x_min:g} to {x_max:g}, y {y_min:g} to {y_max:g} m)"
            )


def overlap(scene: Scene3d) -> tuple[float, float, float, float]:
    """x_min, x_max, y_min, y_max [m]: where both base and surface are given."""
    assert scene.ground is not None
    axes = [raster.axes for raster in (scene.ground.base, scene.ground.surface)]
    x_min, y_min = (float(max(pair[k][0] for pair in axes)) for k in (0, 1))
    x_max, y_max = (float(min(pair[k][-1] for pair in axes)) for k in (0, 1))
    return x_min, x_max, y_min, y_max


def plan_domain(scene: Scene3d) -> tuple[float, float, float, float]:
    """`overlap` in whole cells from its corner [m].

    Raises:
        InputError: there is not one cell.
    """
    x_min, x_max, y_min, y_max = overlap(scene)
    cell = POINTS_PER_CELL * scene.spacing
    along, across = (
        int((high - low) / cell + 1e-6) for low, high in ((x_min, x_max), (y_min, y_max))
    )
    if along < 1 or across < 1:
        raise InputError(
            f"{scene.name}: surface and base raster do not overlap by a cell of {cell:g} m"
        )
    return x_min, x_min + along * cell, y_min, y_min + across * cell


def is_body(place: str | PathLike[str]) -> bool:
    """True for a `scene3d.yaml`, and for a folder with one that has no section of its own.

    A case with a section may have a `scene3d.yaml` as well, for its width. A folder may be named as
    a case is.
    """
    path = resolve(place, CASES)
    return path.name == FILE_NAME or (
        (path / FILE_NAME).is_file() and not (path / "scene.yaml").is_file()
    )
