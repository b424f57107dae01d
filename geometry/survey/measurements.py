"""Measurements after a slide: the document in a case's folder, and how it is read.

In: `measurements.yaml` of a folder of `case_histories/` and the CSV files it names. Out: a
`Measurements` document whose entries know their values, their covariance, how far they may be
trusted, whether a fit may use them, and how the same is read on points (`observe`).

The types of its entries are those of `geometry.survey.registry`. File format:
docs/method/measurements.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from geometry.scenes.limits import check_level
from geometry.scenes.scene import Document, Scene, document_error
from geometry.sides import SIDES, Side
from geometry.survey.registry import Measurement, measurement_types
from geometry.survey.sets import Sets
from geometry.survey.site import check_in_domain, check_in_section
from geometry.survey.surface_profile import SurfaceProfile
from pipeline.cli import InputError
from pipeline.files import read_yaml

FILE_NAME = "measurements.yaml"


class InitialSection(Document):
    """Where distances are measured from."""

    toe_left_x_m: float | None = Field(None, description="left foot before the slide [m]")
    toe_right_x_m: float | None = Field(None, description="right foot before the slide [m]")
    crest_x_m: float | None = Field(None, description="place of the crest [m]")
    crest_y_m: float | None = Field(None, description="elevation of the crest [m]")
    pool_y_m: float | None = Field(None, description="pool level [m]")


class Measurements(Sets):
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

    @property
    def profiles(self) -> list[SurfaceProfile]:
        """The surface profiles of the default set."""
        return [m for m in self.chosen() if isinstance(m, SurfaceProfile)]

    def foot(self, side: Side) -> float | None:
        """Measured foot before the slide [m], or None where only the scene knows it."""
        return self.initial.toe_left_x_m if side == "left" else self.initial.toe_right_x_m

    def feet(self, scene: Scene) -> dict[Side, float]:
        """Foot of the section before the slide by side, x [m]: as surveyed, else as drawn."""
        surveyed = {side: self.foot(side) for side in SIDES}
        return {side: scene.foot(side) if x is None else x for side, x in surveyed.items()}


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
            entry.read_files(path.parent, f"{path}: sets.{group}: {entry.name!r}")
    if scene is not None:
        check_places(measurements, scene, str(path))
    return measurements


def check_places(measurements: Measurements, scene: Scene, source: str) -> None:
    """Refuse what cannot have been measured on this section.

    Raises:
        InputError: naming the first entry with a place outside the domain or the section.
    """
    for side in SIDES:
        foot = measurements.foot(side)
        if foot is not None:
            check_in_domain(foot, scene, f"{source}: initial.toe_{side}_x_m")
    _check_initial(measurements.initial, scene, f"{source}: initial")
    feet = measurements.feet(scene)
    for group, entries in measurements.sets.items():
        for entry in entries:
            entry.check_in(scene, feet, f"{source}: sets.{group}: {entry.name!r}")


def _check_initial(initial: InitialSection, scene: Scene, where: str) -> None:
    """The crest lies on the section, the feet on their own sides of it, the water near it."""
    crest = initial.crest_x_m
    if crest is not None:
        check_in_section(crest, scene, f"{where}.crest_x_m")
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


def _error_line(error: ValidationError, source: str) -> str:
    """`document_error`, with a hint where a key merely lacks its unit or a type is not known."""
    if error.errors(include_url=False)[0]["type"] == "union_tag_invalid":
        return f"{document_error(error, source)}; your own types need --measurements-code FILE"
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
    if not where:
        return list(Measurements.model_fields)
    if where == ("initial",):
        return list(InitialSection.model_fields)
    model = measurement_types().get(str(where[-1]))
    return list(model.model_fields) if model else []
