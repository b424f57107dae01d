"""The question of a back-analysis: what is to be found, what it must fit, what else might be so.

In: `inversion.yaml` of a case folder. Out: a checked `Question`. Keys carry the units people use.
Every form of the document is described in docs/method/inversion.md.
"""

from __future__ import annotations

import builtins
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from geometry.scenes.limits import check_density, check_level
from geometry.scenes.scene import (
    MOST_STRENGTH_RATIO,
    Document,
    Material,
    Point,
    Scene,
    checked_document,
)
from geometry.scenes3d.scene3d import Terrain
from inversion.catalogue.correlations import RelationName
from inversion.problem.changes import Changes, Waterfall, check_simulation
from pipeline.cli import InputError, say_once
from pipeline.files import read_yaml

FILE_NAME = "inversion.yaml"

RESIDUAL_STRENGTH: Literal["residual_strength_kpa"] = "residual_strength_kpa"
"""Of liquefied zones; a scene, whose materials have one strength, keeps it as their cohesion."""
STRENGTH_RATIO: Literal["strength_ratio"] = "strength_ratio"
"""S_r / sigma'_v0 of liquefied zones, whose points then have a strength that grows with depth."""
FLOOR_KPA = 0.1
"""Least strength of a point of a zone whose ratio is calibrated, where the question states none.

Soil right under the surface carries no stress, so without a floor it would be a fluid that never
rests. A ratio of 0.05 exceeds this from 0.2 m of submerged soil on: less than a usual spacing.
"""
MaterialProperty = Literal[
    "residual_strength_kpa", "strength_ratio", "cohesion_kpa", "friction_deg", "density"
]
Property = MaterialProperty | Literal["water_level"]

UNITS: dict[str, str] = {
    "residual_strength_kpa": "kPa",
    "strength_ratio": "",
    "cohesion_kpa": "kPa",
    "friction_deg": "deg",
    "density": "kg/m3",
    "water_level": "m",
}
SYMBOLS: dict[str, str] = {
    "residual_strength_kpa": "S_r",
    "strength_ratio": "S_r/sigma'_v0",
    "cohesion_kpa": "c",
    "friction_deg": "phi",
    "density": "density",
    "water_level": "level of the pool",
}


POOL = "the pool"


#: Properties that are fitted as logarithms.
LOGARITHMIC = ("residual_strength_kpa", "strength_ratio", "cohesion_kpa", "density")
#: Properties that are strengths: they grow and shrink together, and with the size of the cells.
STRENGTHS = ("residual_strength_kpa", "strength_ratio", "cohesion_kpa")


def material_key(name: str) -> str:
    """The key of a scene's material that holds a property."""
    return "cohesion_kpa" if name == RESIDUAL_STRENGTH else name


def material_keys(name: str) -> tuple[str, ...]:
    """The keys of a scene's material that a calibrated property sets.

    A ratio also sets the least strength, which a scene keeps as the cohesion.
    """
    return (name, "cohesion_kpa") if name == STRENGTH_RATIO else (material_key(name),)


def ratio_changes(
    zones: Sequence[str], ratio: float, floor_kpa: float
) -> list[tuple[str, str, float]]:
    """What a strength ratio makes of zones: (zone, key of its material, value).

    The doubt of the cells may carry a ratio beyond the greatest; nothing runs at that one either.
    """
    greatest = min(ratio, MOST_STRENGTH_RATIO)
    return [
        change
        for zone in zones
        for change in ((zone, STRENGTH_RATIO, greatest), (zone, "cohesion_kpa", floor_kpa))
    ]


class Prior(Document):
    """Prior knowledge as a normal distribution (of the logarithm, for strengths).

    Either mean and standard deviation, or a published relation of residual strength with blow
    count, from which they follow once the stress before failure is known
    (`inversion.problem.layers`).
    """

    mean: float | None = Field(None, description="most likely value, in the parameter's unit")
    std: float | None = Field(None, gt=0, description="standard deviation, in the parameter's unit")
    relation: RelationName | None = Field(
        None, description="of residual strength with blow count, in place of mean and std"
    )
    n1_60: float | None = Field(
        None,
        ge=0,
        le=60,
        description="blow count for the relation, of the kind that it asks for; null: that of "
        "blow_counts.yaml",
    )
    sigma_v0_kpa: float | None = Field(
        None, description="in results: stress before failure at which the relation was taken"
    )

    @model_validator(mode="after")
    def _one_or_the_other(self) -> Prior:
        if self.relation is None:
            if self.mean is None or self.std is None:
                raise ValueError("give mean and std, or a relation")
            if self.n1_60 is not None:
                raise ValueError("n1_60: belongs to a relation; give it as well")
        elif self.sigma_v0_kpa is None and (self.mean is not None or self.std is not None):
            raise ValueError("mean, std: follow from the relation; give one or the other")
        return self

    @property
    def known(self) -> bool:
        """Mean and standard deviation are known."""
        return self.mean is not None


class ParameterSpec(Document):
    """One number to be found: a property shared by some zones, or the level of the pool."""

    name: str = Field(min_length=1, description="unique in the question")
    label: str = Field("", description="in words, for tables and the report; empty: made of zones")
    zones: list[str] = Field(
        default_factory=list,
        description="names of the zones that share the value; none for water_level",
    )
    property: Property = Field(
        description="residual_strength_kpa (S_r, of liquefied zones), strength_ratio "
        "(S_r / sigma'_v0, of liquefied zones), cohesion_kpa, friction_deg, density, "
        "water_level [m]"
    )
    floor_kpa: float | None = Field(
        None,
        ge=0,
        description="of strength_ratio: least strength of a point [kPa]; null: 0.1",
    )
    start: float = Field(description="first guess")
    low: float = Field(description="lower bound")
    high: float = Field(description="upper bound")
    prior: Prior | None = Field(None, description="knowledge in addition to the bounds; null: none")

    @model_validator(mode="after")
    def _in_order(self) -> ParameterSpec:
        if not self.low < self.high:
            raise ValueError(f"low {self.low:g} must be less than high {self.high:g}")
        if not self.low <= self.start <= self.high:
            raise ValueError(
                f"start {self.start:g} lies outside low {self.low:g} to high {self.high:g}"
            )
        if bool(self.zones) == (self.property == "water_level"):
            raise ValueError(
                "zones: the level of the pool has none"
                if self.zones
                else f"zones: at least one must be named for {self.property}"
            )
        if self.property in LOGARITHMIC and self.low <= 0:
            raise ValueError(
                f"low {self.low:g} must be greater than 0: it is fitted as a logarithm"
            )
        if self.property == STRENGTH_RATIO and self.high > MOST_STRENGTH_RATIO:
            raise ValueError(
                f"high {self.high:g}: a strength ratio S_r / sigma'_v0 is at most "
                f"{MOST_STRENGTH_RATIO:g}"
            )
        if self.floor_kpa is not None and self.property != STRENGTH_RATIO:
            raise ValueError(f"floor_kpa: belongs to {STRENGTH_RATIO}, not {self.property}")
        if self.property == "friction_deg" and not (self.low >= 0 and self.high < 89):
            raise ValueError(f"low {self.low:g} to high {self.high:g} must lie in 0 to 89 degrees")
        if self.prior is not None and self.prior.relation is not None:
            if self.property != RESIDUAL_STRENGTH:
                raise ValueError(f"prior.relation: is of {RESIDUAL_STRENGTH}, not {self.property}")
        elif self.prior is not None and self.prior.mean is not None:
            mean = self.prior.mean
            if not self.low <= mean <= self.high:
                raise ValueError(
                    f"prior.mean {mean:g} lies outside low {self.low:g} to high {self.high:g}"
                )
        return self

    @builtins.property  # the field of that name hides it here
    def unit(self) -> str:
        """Unit of the value: kPa, deg, kg/m3 or m; empty for a ratio."""
        return UNITS[self.property]

    def changes(self, value: float) -> list[tuple[str, str, float]]:
        """What a value makes of its zones: (zone, key of its material, value); none of a level."""
        if self.property == "water_level":
            return []
        if self.property == STRENGTH_RATIO:
            floor = FLOOR_KPA if self.floor_kpa is None else self.floor_kpa
            return ratio_changes(self.zones, value, floor)
        return [(zone, material_key(self.property), value) for zone in self.zones]

    @builtins.property  # the field of that name hides it here
    def words(self) -> str:
        """The label, or one made of the property and the zones."""
        if not self.zones:
            return self.label or SYMBOLS[self.property]
        zones = ", ".join(self.zones)
        return self.label or f"{SYMBOLS[self.property]} of zone{'s'[: len(self.zones) > 1]} {zones}"


class ReadOtherwise(ParameterSpec):
    """An S_r that is simulated as a strength ratio, or a ratio that is simulated as one S_r.

    Bounds and values stay those of the question: an S_r is then the mean over the zones.
    """

    stress_kpa: float = Field(gt=0, description="mean sigma'_v0 of the zones [kPa]")

    def changes(self, value: float) -> list[tuple[str, str, float]]:
        """See `ParameterSpec`."""
        if self.property == STRENGTH_RATIO:
            strength = value * self.stress_kpa
            return [(zone, "cohesion_kpa", strength) for zone in self.zones]
        return ratio_changes(self.zones, value / self.stress_kpa, FLOOR_KPA)


class Variant(Changes):
    """Another reading of the same question, solved and reported in addition to the answer."""

    name: str = Field(min_length=1, description="in words; unique among the variants")
    measurements: str | None = Field(None, description="another set of measurements; null: same")
    fit: list[str] | None = Field(None, description="other measurements to fit; null: same")
    targets: dict[str, float] = Field(
        default_factory=dict, description="measurement -> value used instead of the measured [m]"
    )
    property: Literal["residual_strength_kpa", "strength_ratio"] | None = Field(
        None,
        description="how the unknown strengths are read: one S_r everywhere, or in proportion to "
        "the stress before failure; null: as asked. Values stay in the unit of the question",
    )

    @model_validator(mode="after")
    def _differs(self) -> Variant:
        if not (self.changed or self.measurements or self.fit or self.targets or self.property):
            raise ValueError(f"variant {self.name!r} changes nothing: give water, contact, ...")
        return self


class MovedVertex(Document):
    """A vertex of the section and how far it moves for one standard deviation."""

    at: Point = Field(description="(x, y) as in scene.yaml, to within 0.05 m")
    move: Point = Field(description="(dx, dy) for one standard deviation [m]")


class ZoneBoundary(Document):
    """A boundary lies elsewhere: the vertices move in every zone that has them, and in the base."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["zone_boundary"]
    vertices: list[MovedVertex] = Field(min_length=1, description="vertices that move together")
    sides: Literal["both", "plus", "minus"] = Field("both", description="senses that are tried")

    @property
    def senses(self) -> tuple[float, ...]:
        """The senses as signs."""
        return {"both": (1.0, -1.0), "plus": (1.0,), "minus": (-1.0,)}[self.sides]


class WaterLevel(Document):
    """The pool, and the phreatic line where it stands at pool level, lie higher or lower."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["water_level"]
    std_m: float = Field(gt=0, description="standard deviation of the level [m]")


class UnknownDimension(Document):
    """A dimension of a section that nobody drew: it has the distribution of `dimensions.yaml`."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["dimension"]
    dimension: str = Field(description="a key of the family's dimensions, such as height_m")


class CellSize(Document):
    """Another distance between the material points."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["cell_size"]
    factor: float = Field(gt=0.2, lt=5, description="new spacing / spacing")


class TimeStep(Document):
    """Another time step."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["time_step"]
    factor: float = Field(gt=0.05, lt=4, description="new time step / time step")


class OtherSetting(Document):
    """Another way to simulate."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["simulation"]
    simulation: dict[str, Any] = Field(
        min_length=1, description="settings of the simulation that differ, such as transfer: flip"
    )

    @model_validator(mode="after")
    def _allowed(self) -> OtherSetting:
        check_simulation(self.simulation)
        return self


class FixedProperty(Document):
    """A property that is not a parameter has another value."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["property"]
    zones: list[str] = Field(min_length=1, description="zones that share the value")
    property: MaterialProperty = Field(
        description="residual_strength_kpa, strength_ratio, cohesion_kpa, friction_deg or density"
    )
    std: float = Field(gt=0, description="standard deviation, in the property's unit")


class Target(Document):
    """A measurement at the ends of its stated range, or one standard deviation away."""

    name: str = Field(min_length=1, description="in words; unique among the sensitivities")
    kind: Literal["target"]
    measurement: str = Field(description="name of a fitted measurement")


Sensitivity = Annotated[
    ZoneBoundary
    | WaterLevel
    | UnknownDimension
    | CellSize
    | TimeStep
    | OtherSetting
    | FixedProperty
    | Target,
    Field(discriminator="kind"),
]


class Question(Document):
    """The whole of `inversion.yaml`."""

    parameters: list[ParameterSpec] = Field(min_length=1, description="the unknowns")
    fit: list[str] | None = Field(
        None, description="measurements to fit; null: all neither held out nor constructed"
    )
    loss: Literal["runout", "misfit"] = Field(
        "runout", description="runout: squared error of the runouts [m2]; misfit: standardised"
    )
    engine: str | None = Field(
        None,
        description="what simulates: mpm, gns, direct or mpm3d; null: inversion.engine "
        "of the settings",
    )
    model: str | None = Field(
        None,
        min_length=1,
        description="of the engine gns: a folder with model.pt, or a name in models/; null: "
        "inversion.model",
    )
    spacing_m: float | None = Field(None, gt=0, description="of material points; null: the scene's")
    duration_s: float | None = Field(
        None, gt=0, description="motion simulated; null: simulation.duration_s"
    )
    variants: list[Variant] = Field(default_factory=list, description="other readings, all solved")
    sensitivities: list[Sensitivity] = Field(
        default_factory=list, description="what moves the answer in addition to the survey's error"
    )
    waterfall: Waterfall | None = Field(
        None, description="the way from another reading to this one; null: not asked"
    )

    @model_validator(mode="after")
    def _names_are_unique(self) -> Question:
        for group in ("parameters", "variants", "sensitivities"):
            names = [entry.name for entry in getattr(self, group)]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"{group}: two are called {name!r}; names must be unique")
        taken: dict[tuple[str, str], ParameterSpec] = {}
        for parameter in self.parameters:
            for zone in parameter.zones or [POOL]:
                for key in material_keys(parameter.property):
                    other = taken.setdefault((zone, key), parameter)
                    if other.name != parameter.name:
                        raise ValueError(_calibrated_twice(zone, other, parameter))
        return self


def _calibrated_twice(zone: str, one: ParameterSpec, other: ParameterSpec) -> str:
    both = one.property, other.property
    if both[0] != both[1] and STRENGTH_RATIO in both:
        return (
            f"parameters: {one.name!r} ({both[0]}) and {other.name!r} ({both[1]}) are both the "
            f"strength of {_place(zone)}; ask for one of them"
        )
    return (
        f"parameters: {other.property} of {_place(zone)} is calibrated by {one.name!r} and by "
        f"{other.name!r}"
    )


def calibrated_keys(specs: Sequence[ParameterSpec]) -> set[tuple[str, str]]:
    """Zones and keys of their materials whose values the parameters set."""
    return {
        (zone, key) for spec in specs for zone in spec.zones for key in material_keys(spec.property)
    }


def load_question(folder: str | Path, scene: Scene | Terrain) -> Question:
    """Read `inversion.yaml` of a case folder and check its zones against the scene.

    Raises:
        InputError: no such file, no YAML, an unknown zone, a document that does not hold together.
    """
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        raise InputError(
            f"{path}: no such file; it names the unknown strengths (docs/method/inversion.md)"
        )
    question = checked_document(Question, read_yaml(path), path, "docs/method/inversion.md")
    check_zones(question, scene, str(path))
    return _residual_strengths_named(question, scene, str(path))


def _residual_strengths_named(question: Question, scene: Scene | Terrain, source: str) -> Question:
    """The question with S_r called so: older files call it the cohesion of a liquefied zone."""
    liquefied = {z.name for z in scene.zones if scene.materials[z.material].liquefied}
    renamed: list[str] = []

    def named(entry: Any) -> Any:
        if getattr(entry, "property", "") != "cohesion_kpa" or not liquefied.issuperset(
            entry.zones
        ):
            return entry
        renamed.append(entry.name)
        return entry.model_copy(update={"property": RESIDUAL_STRENGTH})

    update = {
        group: [named(entry) for entry in getattr(question, group)]
        for group in ("parameters", "sensitivities")
    }
    if not renamed:
        return question
    say_once(
        f"{source}: {', '.join(renamed)}: write property: {RESIDUAL_STRENGTH}, not cohesion_kpa: "
        "the zones are liquefied"
    )
    return question.model_copy(update=update)


def _check_bounds(parameter: ParameterSpec, scene: Scene | Terrain, where: str) -> None:
    """The scene must hold together at both bounds, wherever the search goes."""
    for name, value in (("low", parameter.low), ("high", parameter.high)):
        try:
            if parameter.property == "water_level" and isinstance(scene, Scene):
                check_level(name, value, *scene.extent)
            elif parameter.property == "density":
                check_density(name, value)
        except ValueError as error:
            raise InputError(f"{where}: {error}") from None


def _place(zone: str) -> str:
    return zone if zone == POOL else f"zone {zone!r}"


def check_zones(question: Question, scene: Scene | Terrain, source: str) -> None:
    """Every zone that is named must be one of the scene; an unknown level must be there.

    Raises:
        InputError: naming the first that is not.
    """
    for parameter in question.parameters:
        if parameter.property == "water_level" and scene.water_level is None:
            raise InputError(
                f"{source}: parameters: {parameter.name}: property: water_level: the scene has no "
                "water_level"
            )
        if parameter.property == "water_level" and isinstance(scene, Terrain):
            raise InputError(
                f"{source}: parameters: {parameter.name}: property: water_level: only of a section"
            )
        _check_bounds(parameter, scene, f"{source}: parameters: {parameter.name}")
    soils = {zone.name: scene.materials[zone.material] for zone in scene.zones}
    known = list(soils)
    named = [("parameters", p.name, p.zones) for p in question.parameters]
    named += [
        ("sensitivities", s.name, s.zones)
        for s in question.sensitivities
        if isinstance(s, FixedProperty)
    ]
    for group, name, zones in named:
        for zone in zones:
            if zone not in known:
                raise InputError(
                    f"{source}: {group}: {name}: zones: no zone {zone!r} in the scene; "
                    f"known are {', '.join(known)}"
                )
    for entry in question.parameters:
        hard = [zone for zone in entry.zones if not soils[zone].liquefied]
        if entry.property == STRENGTH_RATIO and hard:
            raise InputError(
                f"{source}: parameters: {entry.name}: zones: {STRENGTH_RATIO} is of soil that "
                f"liquefies; the material of zone {hard[0]!r} is not marked liquefied: true"
            )
    _check_fixed_strengths(question, soils, source)


def _check_fixed_strengths(question: Question, soils: Mapping[str, Material], source: str) -> None:
    """A soil has a strength or a strength ratio; a sensitivity must name the one that it has."""
    set_by = calibrated_keys(question.parameters)
    for entry in question.sensitivities:
        if not isinstance(entry, FixedProperty) or entry.property not in STRENGTHS:
            continue
        asks_ratio = entry.property == STRENGTH_RATIO
        for zone in entry.zones:
            if {(zone, "cohesion_kpa"), (zone, STRENGTH_RATIO)} & set_by:
                continue  # refused as calibrated, where the sensitivity is taken
            if asks_ratio != (soils[zone].strength_ratio is not None):
                has = f"has {'no' if asks_ratio else 'a'} {STRENGTH_RATIO}"
                raise InputError(
                    f"{source}: sensitivities: {entry.name}: property: {entry.property}: the "
                    f"material of zone {zone!r} {has} in the scene"
                )
