"""What was measured after a slide: the document beside a case's scene, and how it is read.

In: `measurements.yaml` of a folder of `case_histories/` and the CSV files it names. Out: a
`Measurements` document whose entries know their values, their covariance, how far they may be
trusted, whether a fit may use them, and how the same is read on points (`observe`).

The types are in `geometry.survey.measured_numbers` and `geometry.survey.measured_series`; a new one
is one class there and its name in `Measurement`. File format: docs/method/measurements.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import BaseModel, Field, ValidationError, model_validator
from shapely.geometry import Point as PlacedPoint
from shapely.geometry import Polygon

from geometry.scenes.limits import check_level
from geometry.scenes.scene import Document, Scene, document_error
from geometry.survey.measured import Confidence, Deposit, Measured, Observed
from geometry.survey.measured_numbers import (
    CrestSettlement,
    Freeboard,
    MarkerDisplacement,
    ToeRunout,
)
from geometry.survey.measured_series import SlideDuration, SurfaceProfile, ToeHistory, Velocity
from geometry.survey.profiles import Profile, load_profile
from geometry.survey.toe import Side
from pipeline.cli import InputError
from pipeline.files import read_yaml

__all__ = [
    "FILE_NAME",
    "Confidence",
    "CrestSettlement",
    "Deposit",
    "Freeboard",
    "InitialSection",
    "MarkerDisplacement",
    "Measured",
    "Measurement",
    "Measurements",
    "Number",
    "Observed",
    "Profile",
    "SlideDuration",
    "SurfaceProfile",
    "ToeHistory",
    "ToeRunout",
    "Velocity",
    "check_places",
    "load_measurements",
    "load_profile",
]

FILE_NAME = "measurements.yaml"

Number = ToeRunout | CrestSettlement | Freeboard
Anything = Number | MarkerDisplacement | SurfaceProfile | ToeHistory | Velocity | SlideDuration
Measurement = Annotated[Anything, Field(discriminator="type")]


class InitialSection(Document):
    """Where distances are measured from."""

    toe_left_x_m: float | None = Field(None, description="left foot before the slide [m]")
    toe_right_x_m: float | None = Field(None, description="right foot before the slide [m]")
    crest_x_m: float | None = Field(None, description="place of the crest [m]")
    crest_y_m: float | None = Field(None, description="elevation of the crest [m]")
    pool_y_m: float | None = Field(None, description="pool level [m]")


class Measurements(Document):
    """The whole of `measurements.yaml`."""

    case: str = Field(description="name of the case")
    upstream: Side = Field(description="which side of the section is upstream")
    axes: str = Field("", description="what x and y mean; free text")
    initial: InitialSection = Field(description="the section before the slide")
    default_set: str = Field(description="the set used unless another is named")
    sets: dict[str, list[Measurement]] = Field(min_length=1, description="sets of measurements")
    other: dict[str, Any] = Field(
        default_factory=dict, description="known, but no observable of the slide itself; notes"
    )
    strength_published_kpa: dict[str, dict[str, Any]] = Field(
        default_factory=dict, description="residual strengths found by others; notes, no input"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Measurements:
        if self.default_set not in self.sets:
            raise ValueError(f"default_set: {self.default_set!r} is none of {', '.join(self.sets)}")
        for group, entries in self.sets.items():
            if not entries:
                raise ValueError(f"sets.{group}: holds no measurement")
            names = [entry.name for entry in entries]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"sets.{group}: two measurements are called {name!r}")
        return self

    def chosen(self, name: str | None = None) -> list[Anything]:
        """The measurements of a set; None: of the default one.

        Raises:
            InputError: there is no such set.
        """
        wanted = self.default_set if name is None else name
        if wanted not in self.sets:
            raise InputError(
                f"{self.case}: no set of measurements {wanted!r}; there are {', '.join(self.sets)}"
            )
        return list(self.sets[wanted])

    @property
    def numbers(self) -> list[Number]:
        """The measurements of the default set that are one length each."""
        return [m for m in self.chosen() if isinstance(m, Number)]

    @property
    def profiles(self) -> list[SurfaceProfile]:
        """The surface profiles of the default set."""
        return [m for m in self.chosen() if isinstance(m, SurfaceProfile)]

    def foot(self, side: Side) -> float | None:
        """Measured foot before the slide [m], or None where only the scene knows it."""
        return self.initial.toe_left_x_m if side == "left" else self.initial.toe_right_x_m


def load_measurements(folder: str | Path, scene: Scene | None = None) -> Measurements:
    """Read `measurements.yaml` of a case folder and the profiles it names.

    Args:
        folder: of the case.
        scene: the section before the slide; given, every place is checked against it.

    Raises:
        InputError: no such file, no YAML, an entry that does not hold together, a profile that
            cannot be read, or a place outside the section; one line.
    """
    path = Path(folder) / FILE_NAME
    document = read_yaml(path)
    if not isinstance(document, Mapping):
        raise InputError(f"{path}: must be a mapping of keys, not {type(document).__name__}")
    try:
        measurements = Measurements.model_validate(document)
    except ValidationError as error:
        raise InputError(_error_line(error, str(path))) from None
    for group, entries in measurements.sets.items():
        for entry in entries:
            if isinstance(entry, SurfaceProfile):
                _attach(entry, path, group)
    if scene is not None:
        check_places(measurements, scene, str(path))
    return measurements


def check_places(measurements: Measurements, scene: Scene, source: str) -> None:
    """Refuse what cannot have been measured on this section.

    Raises:
        InputError: naming the first entry with a place outside the domain or the section.
    """
    for side in ("left", "right"):
        foot = measurements.foot(side)
        if foot is not None:
            _in_domain(foot, scene, f"{source}: initial.toe_{side}_x_m")
    _check_initial(measurements.initial, scene, f"{source}: initial")
    for group, entries in measurements.sets.items():
        for entry in entries:
            _check_entry(entry, measurements, scene, f"{source}: sets.{group}: {entry.name!r}")


def _check_entry(entry: Anything, measurements: Measurements, scene: Scene, where: str) -> None:
    if isinstance(entry, ToeRunout) and scene.domain.walls == "closed":
        surveyed = measurements.foot(entry.side)
        foot = scene.foot(entry.side) if surveyed is None else surveyed
        outward = -1.0 if entry.side == "left" else 1.0
        _in_domain(foot + outward * entry.value_m, scene, f"{where}: the toe")
    elif isinstance(entry, CrestSettlement):
        if entry.x_m is not None:
            _in_section(entry.x_m, scene, f"{where}: x_m")
        height = scene.extent[1] - scene.ground.lowest
        if not -height <= entry.value_m <= height:
            raise InputError(
                f"{where}: value_m {entry.value_m:g} is more than the section is high above its "
                f"ground, {height:g} m"
            )
    elif isinstance(entry, Freeboard):
        if not scene.ground.lowest <= entry.water_level_m <= scene.domain.y_max:
            raise InputError(
                f"{where}: water_level_m {entry.water_level_m:g} lies outside the domain, "
                f"y {scene.ground.lowest:g} to {scene.domain.y_max:g} m"
            )
        ground = entry.water_level_m + entry.value_m
        if not scene.ground.lowest <= ground <= scene.domain.y_max:
            raise InputError(
                f"{where}: value_m {entry.value_m:g} over water at {entry.water_level_m:g} m is "
                f"ground at y {ground:g}; the domain has {scene.ground.lowest:g} to "
                f"{scene.domain.y_max:g} m"
            )
    elif isinstance(entry, MarkerDisplacement):
        place = PlacedPoint(entry.x_m, entry.y_m)
        if min(place.distance(Polygon(zone.polygon)) for zone in scene.zones) > 0.0:
            raise InputError(
                f"{where}: the marker ({entry.x_m:g}, {entry.y_m:g}) lies in no zone of the section"
            )
    elif isinstance(entry, SurfaceProfile):
        _check_profile(entry.whole, scene, f"{where}: {entry.file}")
    elif isinstance(entry, Velocity):
        _in_domain(entry.x_m, scene, f"{where}: x_m")


def _check_initial(initial: InitialSection, scene: Scene, where: str) -> None:
    """The crest lies on the section, the feet on their own sides of it, the water near it."""
    crest = initial.crest_x_m
    if crest is not None:
        _in_section(crest, scene, f"{where}.crest_x_m")
    for side, foot, sign in (
        ("left", initial.toe_left_x_m, 1.0),
        ("right", initial.toe_right_x_m, -1.0),
    ):
        if foot is not None and crest is not None and sign * (crest - foot) < 0.0:
            raise InputError(
                f"{where}.toe_{side}_x_m: {foot:g} lies beyond the crest at x {crest:g} m; the "
                f"{side} foot is {side} of it"
            )
    left, right = initial.toe_left_x_m, initial.toe_right_x_m
    if left is not None and right is not None and not left < right:
        raise InputError(f"{where}.toe_left_x_m: {left:g} must be left of toe_right_x_m {right:g}")
    if initial.crest_y_m is not None:
        low, high = scene.ground.lowest, scene.domain.y_max
        if not low <= initial.crest_y_m <= high:
            raise InputError(
                f"{where}.crest_y_m: {initial.crest_y_m:g} lies outside the domain, y {low:g} to "
                f"{high:g} m"
            )
    if initial.pool_y_m is not None:
        try:
            check_level("pool_y_m", initial.pool_y_m, *scene.extent)
        except ValueError as error:
            raise InputError(f"{where}.{error}") from None


def _in_section(x: float, scene: Scene, where: str) -> None:
    left, right = scene.foot("left"), scene.foot("right")
    if not left <= x <= right:
        raise InputError(f"{where} {x:g} lies outside the section, x {left:g} to {right:g} m")


def _check_profile(profile: Profile, scene: Scene, where: str) -> None:
    for x, y in zip(profile.x, profile.y, strict=True):
        _in_domain(x, scene, f"{where}: x_m")
        base = float(scene.ground.height(x))
        if not base - scene.spacing <= y <= scene.domain.y_max:
            raise InputError(
                f"{where}: ({x:g}, {y:g}) lies outside the domain, from the ground at "
                f"y {base:g} to y_max {scene.domain.y_max:g} m"
            )


def _in_domain(x: float, scene: Scene, where: str) -> None:
    domain = scene.domain
    if not domain.x_min <= x <= domain.x_max:
        raise InputError(
            f"{where}: {x:g} lies outside the domain, x {domain.x_min:g} to {domain.x_max:g} m"
        )


def _attach(entry: SurfaceProfile, path: Path, group: str) -> None:
    """Read the file of a profile and check that the entry finds in it what it names."""
    file, where = path.parent / entry.file, f"{path}: sets.{group}: {entry.name!r}"
    if not file.is_file():
        raise InputError(f"{where}: file: {file}: no such file")
    profile = load_profile(file)
    if entry.part is not None and entry.part not in profile.part:
        known = ", ".join(dict.fromkeys(profile.part))
        raise InputError(f"{where}: part: {entry.part!r} is not in {file}; it has {known}")
    entry.attach(profile)
    if entry.held_out_x_m is not None:
        held = entry.held_out_values
        if held.all() or not held.any():
            first, last = entry.held_out_x_m
            found = "every point" if held.all() else "no point"
            raise InputError(
                f"{where}: held_out_x_m: {found} of {file} lies between {first:g} and {last:g} m"
            )


def _error_line(error: ValidationError, source: str) -> str:
    """`document_error`, with a hint where a key merely lacks its unit."""
    # A misspelt key is also a missing one; the misspelling says more.
    unknown = [e for e in error.errors(include_url=False) if e["type"] == "extra_forbidden"]
    if not unknown:
        return document_error(error, source)
    first = unknown[0]
    where, key = first["loc"][:-1], str(first["loc"][-1])
    fields = _fields_at(where)
    meant = [name for name in fields if name.startswith(f"{key.partition('_')[0]}_")]
    if not meant and not fields:
        return document_error(error, source)
    hint = f"did you mean {' or '.join(meant)}?" if meant else f"allowed are {', '.join(fields)}"
    place = ".".join(str(part) for part in where)
    return f"{source}: {place + '.' if place else ''}{key}: unknown key; {hint}"


def _fields_at(where: tuple[int | str, ...]) -> list[str]:
    """Keys that are allowed at a place of the document, as far as that is known."""
    models: dict[str, type[BaseModel]] = {
        model.model_fields["type"].annotation.__args__[0]: model for model in get_args(Anything)
    }
    if not where:
        return list(Measurements.model_fields)
    if where == ("initial",):
        return list(InitialSection.model_fields)
    model = models.get(str(where[-1]))
    return list(model.model_fields) if model else []
