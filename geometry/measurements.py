"""What was measured after a slide: the document beside a case's scene, and how it is read.

In: `measurements.yaml` of a folder of `case_histories/`. Out: a `Measurements` document. Each
entry knows its value, its standard deviation, how far it may be trusted, and how the same quantity
is read on a deposit of points (`observe`), by the definitions of `geometry.observables`.

A new type of measurement is one class with `observe` and its name in `Measurement`.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from geometry import observables
from geometry.scene import Document, document_error
from geometry.toe import Side
from pipeline.cli import InputError
from pipeline.files import read_yaml

Confidence = Literal["published", "paper", "recalled", "assumed", "constructed"]

FILE_NAME = "measurements.yaml"


@dataclass(frozen=True)
class Deposit:
    """Points of one moment, with those of the section before the slide.

    Attributes:
        position: (N, 2) [m].
        initial_position: the same points before the slide, (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        foot: where the section ended before the slide, x [m] by side.
    """

    position: np.ndarray
    initial_position: np.ndarray
    volume: np.ndarray | float
    spacing: float
    foot: Mapping[str, float]


@dataclass(frozen=True)
class Profile:
    """A measured surface: places (n,), elevations (n,) [m], and the part each vertex belongs to."""

    x: np.ndarray
    y: np.ndarray
    part: list[str]

    def pieces(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Stretches of one part each (part, x, y); a stretch starts where the one before ended."""
        pieces = []
        start = 0
        for end in range(1, len(self.part) + 1):
            if end == len(self.part) or self.part[end] != self.part[start]:
                first = max(start - 1, 0)
                pieces.append((self.part[start], self.x[first:end], self.y[first:end]))
                start = end
        return pieces


class _Measured(Document):
    """What every measurement says about itself."""

    name: str = Field(min_length=1, description="unique in its set")
    std_m: float = Field(gt=0, description="standard deviation of the survey [m]")
    std_is: Literal["published", "assumed"] = Field(
        "assumed", description="where the standard deviation comes from"
    )
    confidence: Confidence = Field(description="how far the value may be trusted")
    source: str = Field(min_length=1, description="where the value is written")

    @property
    def constructed(self) -> bool:
        """True for data drawn by hand: shown, but in no fit and no score unless asked."""
        return self.confidence == "constructed"


class _Number(_Measured):
    """A measurement that is one length."""

    value_m: float = Field(description="the measured value [m]")
    low_m: float | None = Field(None, description="lower end of the stated range [m]")
    high_m: float | None = Field(None, description="upper end of the stated range [m]")

    @model_validator(mode="after")
    def _in_range(self) -> _Number:
        if (self.low_m is None) != (self.high_m is None):
            raise ValueError("low_m and high_m: give both or neither")
        if self.low_m is not None and not self.low_m <= self.value_m <= self.high_m:
            raise ValueError(
                f"value_m {self.value_m:g} lies outside low_m {self.low_m:g} to "
                f"high_m {self.high_m:g}"
            )
        return self


class ToeRunout(_Number):
    """Distance of the toe from the foot of the section before the slide."""

    type: Literal["toe_runout"]
    side: Side = Field(description="left or right of the section")

    def observe(self, deposit: Deposit) -> float:
        """Runout [m], outward positive."""
        return observables.toe_runout(
            deposit.position,
            deposit.volume,
            spacing=deposit.spacing,
            side=self.side,
            initial_toe=deposit.foot[self.side],
        )


class CrestSettlement(_Number):
    """Drop of the surface at the initial crest's place, or of the crest's own points."""

    type: Literal["crest_settlement"]
    at: Literal["initial_crest_x", "crest_points"] = Field(
        description="the surface at the crest's place, or the crest's own material points"
    )
    x_m: float | None = Field(None, description="place of the crest [m]; for initial_crest_x")

    @model_validator(mode="after")
    def _place_belongs_to_the_surface(self) -> CrestSettlement:
        if (self.at == "initial_crest_x") != (self.x_m is not None):
            raise ValueError("x_m goes with at: initial_crest_x, and only with it")
        return self

    def observe(self, deposit: Deposit) -> float:
        """Settlement [m], downward positive."""
        if self.x_m is None:
            points = observables.crest_points(deposit.initial_position, spacing=deposit.spacing)
            return observables.crest_settlement_of_points(
                deposit.position, deposit.initial_position, points
            )
        return observables.crest_settlement(
            deposit.position,
            deposit.initial_position,
            deposit.volume,
            spacing=deposit.spacing,
            x=self.x_m,
        )


class Freeboard(_Number):
    """Highest remaining ground minus the water level."""

    type: Literal["freeboard"]
    water_level_m: float = Field(description="pool level [m]")

    def observe(self, deposit: Deposit) -> float:
        """Freeboard [m], negative where the remnant is under water."""
        return observables.freeboard(
            deposit.position,
            deposit.volume,
            water_level=self.water_level_m,
            spacing=deposit.spacing,
        )


class SurfaceProfile(_Measured):
    """The surface after the slide, as a polyline in a file of its own."""

    type: Literal["surface_profile"]
    file: str = Field(description="CSV beside this document: x_m, y_m, part")
    part: str | None = Field(
        None, description="the part of the profile this entry is about; null: all of it"
    )
    correlation_length_m: float | None = Field(
        None, gt=0, description="of the survey's error along the profile [m]"
    )


Number = ToeRunout | CrestSettlement | Freeboard
Measurement = Annotated[Number | SurfaceProfile, Field(discriminator="type")]


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
            names = [entry.name for entry in entries]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"sets.{group}: two measurements are called {name!r}")
        return self

    @property
    def numbers(self) -> list[Number]:
        """The measurements of the default set that are one number each."""
        return [m for m in self.sets[self.default_set] if isinstance(m, Number)]

    @property
    def profiles(self) -> list[SurfaceProfile]:
        """The surface profiles of the default set."""
        return [m for m in self.sets[self.default_set] if isinstance(m, SurfaceProfile)]

    def foot(self, side: Side) -> float | None:
        """Measured foot before the slide [m], or None where only the scene knows it."""
        return self.initial.toe_left_x_m if side == "left" else self.initial.toe_right_x_m


def load_measurements(folder: str | Path) -> Measurements:
    """Read `measurements.yaml` of a case folder.

    Raises:
        InputError: no such file, no YAML, or an entry that does not hold together; one line.
    """
    path = Path(folder) / FILE_NAME
    document = read_yaml(path)
    if not isinstance(document, Mapping):
        raise InputError(f"{path}: must be a mapping of keys, not {type(document).__name__}")
    try:
        return Measurements.model_validate(document)
    except ValidationError as error:
        raise InputError(document_error(error, str(path))) from None


def load_profile(path: str | Path) -> Profile:
    """Read a surface profile: CSV with the columns x_m, y_m and part; `#` starts a comment.

    Raises:
        InputError: no such file, a missing column, a value that is no finite number.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with path.open(encoding="utf-8", newline="") as file:
        lines = [line for line in file if line.strip() and not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    for column in ("x_m", "y_m", "part"):
        if not rows or column not in rows[0]:
            raise InputError(f"{path}: column {column} is missing; needed are x_m, y_m, part")
    points = np.array([[_number(row, column, path) for column in ("x_m", "y_m")] for row in rows])
    return Profile(points[:, 0], points[:, 1], [row["part"] for row in rows])


def _number(row: Mapping[str, str], column: str, path: Path) -> float:
    try:
        value = float(row[column])
    except (TypeError, ValueError):
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{path}: {column}: {row[column]!r} is not a finite number")
    return value
