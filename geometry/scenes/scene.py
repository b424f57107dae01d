"""The scene document: domain, ground, zones, materials, water.

A scene drawn at random and a case history written by hand are the same document, so everything
behind this file sees one kind of input. Keys carry the units people use (kPa, MPa, degrees); the
properties of `Material` give SI. The checks on polygons live in `geometry.scenes.polygon_checks`.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)

from geometry.scenes.limits import FARTHEST_M, check_density, check_level, extent
from geometry.scenes.polygon_checks import Fault, ground_faults, zone_faults
from geometry.sides import SIDES, Side, outward_of
from pipeline.cli import InputError
from pipeline.documents import StrictDocument
from pipeline.files import read_json, read_yaml, write_text, yaml_text
from pipeline.places import CASES, resolve

Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Point = tuple[float, float]
Vertex = tuple[Coordinate, Coordinate]
Problem = Mapping[str, Any]
"""What pydantic says of a field: `loc`, `type`, `msg`, `input`, and for limits `ctx`."""

PAGE = "docs/method/geometry.md"
"""Lists the keys of a scene."""

MOHR_COULOMB = "mohr_coulomb"
"""Material law of a scene that names none."""

MOST_STRENGTH_RATIO = 1.0
"""Greatest S_r / sigma'_v0 that is accepted; flow slides have 0.05 to 0.12, clay at peak 0.3."""

MOST_PERMEABILITY = 1.0
"""Greatest permeability that is accepted [m/s]: that of coarse gravel; sand has 1e-6 to 1e-3."""

#: Context of a validation that looks at each field alone.
UNCHECKED = "each field alone"

#: An outline ends in a face where its vertices within this share of the section's height from its
#: end rise by more than the other share of it, from the ground: natural ground, or a dam, that was
#: cut off by the edge of the drawing. A toe of 1 : 5 or gentler has none.
FACE_WITHIN, FACE_HEIGHT = 0.02, 0.1
#: Small against every section [m].
HAIR = 1e-6

#: A pair of numbers that the JSON writer has spread over four lines.
_PAIR = re.compile(r"\[\s+([-+.\deE]+),\s+([-+.\deE]+)\s+\]")


class Document(StrictDocument):
    """Base of every part of a case's files, in which a name such as 1 may look like a number."""

    model_config = ConfigDict(coerce_numbers_to_str=True)


AnyDocument = TypeVar("AnyDocument", bound=BaseModel)


class Strength(Document):
    """A Mohr-Coulomb strength."""

    friction_deg: float = Field(ge=0, lt=89, description="friction angle [degrees]")
    cohesion_kpa: float = Field(ge=0, description="cohesion, or S_r where friction is 0 [kPa]")

    @property
    def friction_rad(self) -> float:
        """Friction angle [rad]."""
        return math.radians(self.friction_deg)

    @property
    def cohesion_pa(self) -> float:
        """Cohesion [Pa]."""
        return 1e3 * self.cohesion_kpa


class Material(Strength):
    """One soil: strength during the flow, stiffness, density."""

    density: float = Field(1800.0, gt=0, description="total density of the soil [kg/m3]")
    youngs_modulus_mpa: float = Field(30.0, gt=0, description="Young's modulus [MPa]")
    poisson_ratio: float = Field(0.3, ge=0, lt=0.5, description="Poisson's ratio")
    liquefied: bool = Field(False, description="true where the cohesion is a residual strength")
    tension_cap_kpa: float | None = Field(
        None, ge=0, description="tension cut-off [kPa]; null = c cot(phi), none for phi = 0"
    )
    saturated_density: float | None = Field(
        None, gt=0, description="density below the phreatic line [kg/m3]; null = density"
    )
    pre_failure: Strength | None = Field(
        None, description="strength while the initial stress settles; null = elastic"
    )
    strength_ratio: float | None = Field(
        None,
        ge=0,
        le=MOST_STRENGTH_RATIO,
        description="S_r / sigma'_v0 of a liquefied soil: each point then has the strength ratio x "
        "its vertical effective stress before failure, at least cohesion_kpa; null = cohesion_kpa "
        "everywhere",
    )
    permeability_m_per_s: float | None = Field(
        None,
        gt=0,
        le=MOST_PERMEABILITY,
        description="of saturated soil whose pore water flows [m/s]; null = none flows through it; "
        "soil that liquefies has pre_failure.friction_deg where the water has drained",
    )
    excess_pressure_ratio: float | None = Field(
        None,
        ge=0,
        le=1,
        description="r_u at t = 0 of saturated soil whose pore water flows, excess pressure over "
        "mean stress in the plane; null = 0, or initial_ratio of pore_water in soil that liquefies",
    )
    # A note: two scenes that differ in it alone are the same simulation.
    source: str = Field("", exclude=True, description="where the numbers come from; free text")

    @model_serializer(mode="wrap")
    def _written(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What a soil may lack is not written: soils without it keep their hashes."""
        document = write(self)
        for key in ("strength_ratio", "permeability_m_per_s", "excess_pressure_ratio"):
            if getattr(self, key) is None:
                document.pop(key, None)
        return document

    @property
    def youngs_modulus_pa(self) -> float:
        """Young's modulus [Pa]."""
        return 1e6 * self.youngs_modulus_mpa

    @property
    def tension_cap_pa(self) -> float | None:
        """Tension cut-off [Pa], or None where the rule in the field's description holds."""
        return None if self.tension_cap_kpa is None else 1e3 * self.tension_cap_kpa

    @model_validator(mode="after")
    def _saturated_not_lighter(self) -> Material:
        check_density("density", self.density)
        if self.saturated_density is not None:
            check_density("saturated_density", self.saturated_density)
        if self.saturated_density is not None and self.saturated_density < self.density:
            raise ValueError(
                f"saturated_density {self.saturated_density:g} is below density "
                f"{self.density:g}; water adds weight"
            )
        return self

    @model_validator(mode="after")
    def _excess_pressure_of_water_that_flows(self) -> Material:
        if self.excess_pressure_ratio is not None and self.permeability_m_per_s is None:
            raise ValueError(
                "excess_pressure_ratio: of soil whose pore water flows; give permeability_m_per_s"
            )
        return self

    @model_validator(mode="after")
    def _ratio_of_liquefied_soil(self) -> Material:
        if self.strength_ratio is not None and not self.liquefied:
            raise ValueError(
                "strength_ratio: S_r / sigma'_v0 is of soil that liquefies; give liquefied: true"
            )
        return self


class Domain(Document):
    """The box in which the scene lies; its lower edge follows from the ground."""

    x_min: float = Field(description="left wall [m]")
    x_max: float = Field(description="right wall [m]")
    y_max: float = Field(description="top [m]")
    walls: Literal["closed", "open"] = Field(
        "closed",
        description="closed: the walls are part of the scene; open: enlarged until nothing touches",
    )
    left: Literal["far", "free"] | None = Field(
        None,
        description="far: the ground goes on beyond the left end of the section, which is a smooth "
        "wall; free: it ends there; null = far where open walls see it end in a face, else free",
    )
    right: Literal["far", "free"] | None = Field(None, description="the same on the right")

    @model_serializer(mode="wrap")
    def _written(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Ends that nobody stated are not written: scenes without them keep their hashes."""
        document = write(self)
        for side in SIDES:
            if document.get(side) is None:
                document.pop(side, None)
        return document

    @model_validator(mode="after")
    def _has_width(self) -> Domain:
        if self.x_max <= self.x_min:
            raise ValueError(f"x_max {self.x_max:g} must be greater than x_min {self.x_min:g}")
        return self

    @property
    def width(self) -> float:
        """Distance between the side walls [m]."""
        return self.x_max - self.x_min

    def goes_on(self, side: Side) -> bool:
        """The ground goes on beyond the end of the section: a far boundary is there."""
        return (self.left if side == "left" else self.right) == "far"

    def is_open(self, side: Side) -> bool:
        """The domain is enlarged on this side until nothing touches its end."""
        return self.walls == "open" and not self.goes_on(side)

    def wall(self, side: Side) -> float:
        """Place of a side wall, x [m]."""
        return self.x_min if side == "left" else self.x_max


class Ground(Document):
    """The rigid base: a polyline from left to right, level beyond its ends."""

    points: list[Vertex] = Field(min_length=1, description="(x, y), x ascending [m]")
    contact: Literal["rough", "no_slip", "coulomb"] = Field(
        "rough",
        description="rough: slip where the soil's own strength is exceeded; no_slip: bonded; "
        "coulomb: with a coefficient",
    )
    friction_coefficient: float | None = Field(
        None, ge=0, description="Coulomb coefficient; for contact: coulomb only"
    )

    @field_validator("points")
    @classmethod
    def _ascending(cls, points: list[Point]) -> list[Point]:
        for left, right in zip(points, points[1:], strict=False):
            if right[0] <= left[0]:
                raise ValueError(f"x must ascend, but {right[0]:g} follows {left[0]:g}")
        return points

    @model_validator(mode="after")
    def _coefficient_belongs_to_coulomb(self) -> Ground:
        if self.contact == "coulomb" and self.friction_coefficient is None:
            raise ValueError("contact: coulomb needs a friction_coefficient")
        if self.contact != "coulomb" and self.friction_coefficient is not None:
            raise ValueError(
                f"friction_coefficient has no effect with contact: {self.contact}; remove it"
            )
        return self

    def height(self, x: np.ndarray | float) -> np.ndarray:
        """Elevation of the base [m] at `x` [m], any shape."""
        line = np.asarray(self.points, dtype=float)
        return np.interp(x, line[:, 0], line[:, 1])

    @property
    def lowest(self) -> float:
        """Lowest elevation of the base [m]; the filling lattice counts from here."""
        return min(y for _, y in self.points)


class Zone(Document):
    """A polygon of one material."""

    name: str = Field(min_length=1, description="unique in the scene")
    polygon: list[Vertex] = Field(min_length=3, description="(x, y) in order, not closed [m]")
    material: str = Field(description="a key of materials")
    initial_velocity: Point = Field((0.0, 0.0), description="(vx, vy) at t = 0 [m/s]")
    kinematic: bool = Field(False, description="true: the points keep their initial velocity")

    @field_validator("polygon")
    @classmethod
    def _open_ring(cls, polygon: list[Point]) -> list[Point]:
        if len(polygon) > 3 and polygon[0] == polygon[-1]:
            return polygon[:-1]
        return polygon


class Origin(Document):
    """Where a generated scene comes from; it can be drawn again from this alone."""

    template: str = Field(description="letter of the template, a to i")
    scale: str = Field(description="name of the scale in the configuration")
    index: int = Field(ge=0, description="number of the scene")
    draws: int = Field(ge=1, description="draws until a valid scene came; 1 = the first was valid")
    materials: str = Field(description="name of the material ranges")


class Scene(Document):
    """One scene, complete: everything the solver needs but its own settings."""

    name: str = Field(min_length=1)
    description: str = Field("", description="free text; sources and assumptions")
    origin: Origin | None = Field(None, description="filled in generated scenes")
    domain: Domain
    ground: Ground
    zones: list[Zone] = Field(min_length=1)
    materials: dict[str, Material] = Field(min_length=1)
    water_level: float | None = Field(
        None, description="pool level [m]; null = no water anywhere, phreatic_line included"
    )
    phreatic_line: list[Vertex] | None = Field(
        None, description="(x, y), x ascending [m]; null = water_level everywhere"
    )
    spacing: float = Field(gt=0, description="distance between material points [m]")
    points_per_cell: int = Field(4, ge=1, description="a square number")
    jitter: float = Field(
        0.0, ge=0, lt=1, description="each point moves by up to jitter x spacing / 2 in x and y"
    )
    seed: int = Field(0, ge=0, lt=2**63, description="seed of the jitter")
    lattice_from_y: float | None = Field(
        None,
        description="height from which points and grid count [m]; null = the lowest ground. A "
        "section that is compared with another keeps that of the other",
    )
    law: str = Field(
        MOHR_COULOMB, description="material law of all soils; the solver refuses unknown names"
    )
    effects: dict[str, float | dict[str, float]] = Field(
        default_factory=dict,
        description="name -> amplitude, or amplitude and parameters; 0 is off; the solver refuses "
        "unknown names",
    )

    @model_serializer(mode="wrap")
    def _written(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The usual law and lattice are not written: scenes without another keep their hashes."""
        document = write(self)
        if self.law == MOHR_COULOMB:
            del document["law"]
        if self.lattice_from_y is None:
            document.pop("lattice_from_y", None)
        return document

    @field_validator("effects", mode="before")
    @classmethod
    def _numbers(cls, value: Any) -> Any:
        if not isinstance(value, Mapping):
            raise ValueError("is a mapping, effect: amplitude or effect: {amplitude: 1, ...}")
        for name, entry in value.items():
            numbers = entry if isinstance(entry, Mapping) else {"": entry}
            for key, number in numbers.items():
                if isinstance(number, bool) or not isinstance(number, int | float):
                    where = f"{name}.{key}" if key else name
                    raise ValueError(f"{where}: {number!r} is not a number")
        return value

    @field_validator("points_per_cell")
    @classmethod
    def _square(cls, value: int) -> int:
        if math.isqrt(value) ** 2 != value:
            raise ValueError(f"{value} is not a square number (1, 4, 9, 16, ...)")
        return value

    @field_validator("phreatic_line")
    @classmethod
    def _line_ascends(cls, line: list[Point] | None) -> list[Point] | None:
        if line is not None:
            if len(line) < 2:
                raise ValueError("needs at least two points")
            for left, right in zip(line, line[1:], strict=False):
                if right[0] <= left[0]:
                    raise ValueError(f"x must ascend, but {right[0]:g} follows {left[0]:g}")
        return line

    @model_validator(mode="after")
    def _ends(self) -> Scene:
        """Far boundaries are at the ends of the section, a whole number of cells apart."""
        faces: dict[str, str] = {side: "far" for side in SIDES if self._ends_in_a_face(side)}
        domain = self.domain.model_copy(update=faces)
        left, right = (domain.goes_on(side) for side in SIDES)
        if not left and not right:
            return self
        x_min = self.end("left") if left else domain.x_min
        x_max = self.end("right") if right else domain.x_max
        cells = math.ceil(round((x_max - x_min) / self.cell_size, 6)) * self.cell_size
        x_min, x_max = (x_min, x_min + cells) if left else (x_max - cells, x_max)
        # A document is frozen for who has it; this one is still being made.
        self.__dict__["domain"] = domain.model_copy(update={"x_min": x_min, "x_max": x_max})
        return self

    def _ends_in_a_face(self, side: Side) -> bool:
        """An open side of which nobody has said what it is ends in a face of soil at rest."""
        domain = self.domain
        stated = (domain.left if side == "left" else domain.right) is not None
        if stated or domain.walls == "closed":
            return False
        if any(zone.kinematic or zone.initial_velocity != (0.0, 0.0) for zone in self.zones):
            return False
        low, high = self.extent
        heights = [y for zone in self.zones for _, y in self.at_end(zone, side)]
        foot = float(self.ground.height(self.end(side))) + FACE_WITHIN * (high - low)
        return min(heights) <= foot and max(heights) - min(heights) > FACE_HEIGHT * (high - low)

    def at_end(self, zone: Zone, side: Side) -> list[Point]:
        """Vertices of a zone at the end of the outline on one side."""
        low, high = self.extent
        end, reach = self.end(side), FACE_WITHIN * (high - low)
        return [(x, y) for x, y in zone.polygon if abs(x - end) <= reach]

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Scene:
        if info.context is not UNCHECKED:
            for fault in self._faults():
                raise ValueError(fault.message)
        return self

    def _faults(self) -> Iterator[Fault]:
        """Whatever does not hold together."""
        names = [zone.name for zone in self.zones]
        for name in dict.fromkeys(names):
            if names.count(name) > 1:
                message = f"zones: two zones are called {name!r}; names must be unique"
                yield Fault(message, (name,))
        for zone in self.zones:
            if zone.material not in self.materials:
                known = ", ".join(self.materials)
                yield Fault(
                    f"zones: zone {zone.name!r} has material {zone.material!r}; known are {known}",
                    (zone.name,),
                )
        for name in sorted(set(self.materials) - {zone.material for zone in self.zones}):
            yield Fault(f"materials: {name!r} is used by no zone; remove it")
        try:
            if self.water_level is not None:
                check_level("water_level", self.water_level, *self.extent)
            for x, y in self.phreatic_line or ():
                check_level(f"phreatic_line at x {x:g}: y", y, *self.extent)
        except ValueError as error:
            yield Fault(str(error))
        yield from ground_faults(self.ground.points, self.domain.y_max)
        yield from zone_faults(
            {zone.name: zone.polygon for zone in self.zones},
            box=(self.domain.x_min, self.domain.x_max, self.domain.y_max),
            ground=self.ground.points,
            spacing=self.spacing,
        )

    @property
    def material_names(self) -> list[str]:
        """Names of the materials; the place in the list is the material's number."""
        return list(self.materials)

    @property
    def cell_size(self) -> float:
        """Edge of a grid cell [m]."""
        return math.isqrt(self.points_per_cell) * self.spacing

    @property
    def lattice_y(self) -> float:
        """Height from which points and grid count [m]."""
        return self.ground.lowest if self.lattice_from_y is None else self.lattice_from_y

    @property
    def extent(self) -> tuple[float, float]:
        """Lowest and highest elevation of the section's outline [m]."""
        return extent(zone.polygon for zone in self.zones)

    @property
    def height(self) -> float:
        """Height of the section [m]."""
        low, high = self.extent
        return high - low

    @property
    def sliding_height(self) -> float:
        """From the lowest soil that liquefies to the top [m]; of all where none is marked."""
        soft = [zone.polygon for zone in self.zones if self.materials[zone.material].liquefied]
        return self.extent[1] - extent(soft)[0] if soft else self.height

    def end(self, side: Side) -> float:
        """Place x [m] where the outline of the section ends on one side."""
        x = [place for zone in self.zones for place, _ in zone.polygon]
        return min(x) if side == "left" else max(x)

    def front_zones(self, side: Side) -> list[int]:
        """Numbers of the zones whose front is the toe on one side.

        All, where the section ends in a foot. Where the ground goes on, those that do not reach the
        far boundary, if they rise above what lies before them: a dam on its foundation. None: the
        section has no toe there; it is cut, or the dam is buried on that side.
        """
        if not self.domain.goes_on(side):
            return list(range(len(self.zones)))
        front = [n for n, zone in enumerate(self.zones) if not self.at_end(zone, side)]
        corners = [corner for number in front for corner in self.zones[number].polygon]
        if not corners:
            return []
        low, high = self.extent
        foot = (min if side == "left" else max)(x for x, _ in corners)
        # A hair before the foot: over it a wall rises to its top.
        rise = max(y for _, y in corners) - self.surface(foot + outward_of(side) * HAIR)
        return front if rise > FACE_HEIGHT * (high - low) else []

    def surface(self, x: float) -> float:
        """Elevation of the outline's highest point at `x` [m]."""
        found = []
        for zone in self.zones:
            line = np.asarray([*zone.polygon, zone.polygon[0]], dtype=float)
            (x0, y0), (x1, y1) = line[:-1].T, line[1:].T
            over = (np.minimum(x0, x1) <= x) & (x <= np.maximum(x0, x1))
            width = np.where(x1 == x0, 1.0, x1 - x0)
            found += [
                np.where(x1 == x0, np.maximum(y0, y1), y0 + (x - x0) / width * (y1 - y0))[over]
            ]
        return float(np.max(np.concatenate(found)))

    def foot(self, side: Side) -> float:
        """Place x [m] of the foot of the section: where its front ends, or else its outline."""
        front = self.front_zones(side)
        x = [x for number in front for x, _ in self.zones[number].polygon]
        if not x:
            return self.end(side)
        return min(x) if side == "left" else max(x)

    def outlines(self) -> list[np.ndarray]:
        """Outlines of the zones, (V, 2) [m] each; what reaches a far boundary ends at its wall."""
        found = [np.asarray(zone.polygon, dtype=float) for zone in self.zones]
        for side in SIDES:
            if self.domain.goes_on(side):
                reach = FACE_WITHIN * self.height
                end, wall = self.end(side), self.domain.wall(side)
                for outline in found:
                    outline[np.abs(outline[:, 0] - end) <= reach, 0] = wall
        return found

    @property
    def has_water(self) -> bool:
        """True where there is a pool or groundwater."""
        return self.water_level is not None

    @property
    def head_falls(self) -> bool:
        """True where the water level differs from place to place, so that water pushes sideways."""
        return self.has_water and len({y for _, y in self.phreatic_line or []}) > 1

    def phreatic_level(self, x: np.ndarray | float) -> np.ndarray:
        """Elevation [m] below which pores are full of water, at `x` [m]; -inf without water."""
        x = np.asarray(x, dtype=float)
        if self.water_level is None:
            return np.full(x.shape, -np.inf)
        if self.phreatic_line is None:
            return np.full(x.shape, self.water_level)
        line = np.asarray(self.phreatic_line, dtype=float)
        return np.interp(x, line[:, 0], line[:, 1])

    def changed(self, **fields: Any) -> Scene:
        """Return a checked copy with `fields` replaced, e.g. ``changed(water_level=None)``."""
        return Scene.model_validate({**self.model_dump(), **fields})

    def with_strength(
        self,
        material: str,
        *,
        friction_deg: float | None = None,
        cohesion_kpa: float | None = None,
    ) -> Scene:
        """Return a checked copy in which one material has another strength.

        A cohesion replaces a strength ratio.
        """
        if material not in self.materials:
            known = ", ".join(self.materials)
            raise InputError(f"{self.name}: no material {material!r}; known are {known}")
        document = self.model_dump()
        if friction_deg is not None:
            document["materials"][material]["friction_deg"] = friction_deg
        if cohesion_kpa is not None:
            document["materials"][material]["cohesion_kpa"] = cohesion_kpa
            document["materials"][material].pop("strength_ratio", None)
        return Scene.model_validate(document)


def scene_hash(scene: Scene) -> str:
    """SHA-256 (hex) of the scene's canonical JSON: sorted keys, shortest exact numbers."""
    text = json.dumps(scene.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def scene_from_mapping(document: Mapping[str, Any], source: str = "scene") -> Scene:
    """Check a mapping and make a scene of it.

    Raises:
        InputError: one line with source, field, value and what is allowed.
    """
    try:
        return Scene.model_validate(document)
    except ValidationError as error:
        raise InputError(document_error(error, source)) from None


def document_problems(
    model: type[BaseModel], document: Any, *, context: Any = None
) -> list[Problem]:
    """All that is wrong with the fields of a document, as pydantic says it."""
    try:
        model.model_validate(document, context=context)
    except ValidationError as error:
        problems = error.errors(include_url=False)
    else:
        return []
    # A misspelt key is also a missing one; the misspelling says more.
    alone = {problem["loc"][:-1] for problem in problems if problem["type"] == "extra_forbidden"}
    return [one for one in problems if one["type"] != "missing" or one["loc"][:-1] not in alone]


def scene_problems(document: Mapping[str, Any]) -> list[Problem]:
    """All that is wrong with the fields of a scene, each looked at alone."""
    return document_problems(Scene, document, context=UNCHECKED)


def scene_faults(document: Mapping[str, Any], problems: Sequence[Problem] = ()) -> list[Fault]:
    """All that is wrong with how the parts of a scene go together.

    Args:
        document: of a scene.
        problems: of its fields. Outlines are judged all the same: a strength that is missing must
            not hide that two zones overlap.
    """
    try:
        scene = Scene.model_validate(_sound_part(document, problems), context=UNCHECKED)
    except ValidationError:
        return []  # the base or the domain is not known: the problems say so
    return list(scene._faults())


_ANY_SOIL = {"friction_deg": 0.0, "cohesion_kpa": 1.0}


def _sound_part(document: Mapping[str, Any], problems: Sequence[Problem]) -> dict[str, Any]:
    """The scene without what its problems are about: zones that are none, strengths, water."""
    places = [one["loc"] for one in problems if one["loc"]]
    sound = {key: value for key, value in document.items() if (key,) not in places}
    bad = {place[1] for place in places if place[0] == "zones" and len(place) > 1}
    if bad:
        sound["zones"] = [zone for n, zone in enumerate(document["zones"]) if n not in bad]
    if "zones" in sound and (bad or any(place[0] == "materials" for place in places)):
        sound["materials"] = {str(zone["material"]): _ANY_SOIL for zone in sound["zones"]}
    for key in ("water_level", "phreatic_line", "effects"):
        if any(place[0] == key for place in places):
            sound.pop(key, None)
    return sound


def zones_at(document: Mapping[str, Any], place: tuple[int | str, ...]) -> tuple[str, ...]:
    """Name of the zone in which a problem is."""
    if len(place) > 1 and place[0] == "zones":
        name = document["zones"][place[1]].get("name")
        return (name,) if isinstance(name, str) else ()
    return ()


def load_scene(path: str | Path) -> Scene:
    """Read a scene from YAML or JSON (by the suffix).

    Raises:
        InputError: no such file, no YAML or JSON, or a scene that does not hold together.
    """
    path = Path(path)
    document = read_json(path) if path.suffix.lower() == ".json" else read_yaml(path)
    if not isinstance(document, Mapping):
        raise InputError(f"{path}: a scene is a mapping of keys, not {type(document).__name__}")
    return scene_from_mapping(document, str(path))


def save_scene(scene: Scene, path: str | Path) -> None:
    """Write a scene as JSON or, with the suffix .yaml, as YAML; the file appears when whole."""
    write_text(path, scene_text(scene, Path(path).suffix))


def scene_text(scene: Scene, suffix: str = ".json") -> str:
    """The text of a scene's file: JSON, or YAML where the suffix says so."""
    if suffix.lower() == ".json":
        text = json.dumps(scene.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"
        return _PAIR.sub(r"[\1, \2]", text)
    document = scene.model_dump(mode="json", exclude_none=True)
    return yaml_text(document, width=100, default_flow_style=None)


def checked_document(
    model: type[AnyDocument], document: Any, source: str | Path, page: str = PAGE
) -> AnyDocument:
    """A document that was read from a file, checked.

    Args:
        model: what it is.
        document: as read.
        source: file for messages.
        page: that lists the keys.

    Raises:
        InputError: not a mapping, or one that does not hold together; one line.
    """
    if document is None:
        raise InputError(f"{source}: is empty; the keys are listed in {page}")
    if not isinstance(document, Mapping):
        raise InputError(f"{source}: must be a mapping of keys, not {type(document).__name__}")
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise InputError(document_error(error, str(source), page)) from None


def document_error(error: ValidationError, source: str, page: str = PAGE) -> str:
    """The first problem of a document in one line: source, field, value, what is allowed.

    `page` lists the keys of the document.
    """
    problems = error.errors(include_url=False)
    first = problems[0]
    if (
        first["type"] == "missing"
    ):  # a misspelt key is also a missing one; the misspelling says more
        first = next((e for e in problems if e["type"] == "extra_forbidden"), first)
    more = error.error_count() - 1
    tail = f"; and {more} more" if more else ""
    return f"{source}: {problem_line(first, page)}{tail}"


def problem_line(problem: Mapping[str, Any], page: str) -> str:
    """One problem of a document: field, what is allowed, value."""
    where = ".".join(str(part) for part in problem["loc"])
    message = problem["msg"].removeprefix("Value error, ")
    value = problem.get("input")
    shown = f" (got {value!r})" if isinstance(value, (str, int, float, bool)) else ""
    if problem["type"] == "extra_forbidden":
        message = f"unknown key; the keys are listed in {page}"
        shown = ""
    return f"{where + ': ' if where else ''}{message}{shown}"


def scene_files(paths: Iterable[str]) -> list[Path]:
    """Files of scenes: those given, those in given folders, and those of cases given by name."""
    found: list[Path] = []
    for text in paths:
        path = Path(text) if Path(text).exists() else resolve(text, CASES)
        if not path.is_dir():
            found.append(path)
        elif (path / "scene.yaml").is_file():
            found.append(path / "scene.yaml")
        else:
            inside = sorted(path.glob("*.json"))
            if not inside:
                raise InputError(
                    f"{path}: the folder holds no scene.yaml and no scene file (.json)"
                )
            found.extend(inside)
    return found
