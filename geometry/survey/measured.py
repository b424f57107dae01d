"""Base of every measurement: numbers with a covariance, read on material points.

An entry of `measurements.yaml` is a vector of one or more values with a covariance, and `observe`
predicts the same vector from material points: one definition for field data, the material point
method and learned simulators. `Measured` is the base of all types. Everything that differs from
type to type is a member that the type must give (`REQUIRED`); a type that forgets one is refused
when it is registered (`geometry.survey.registry`), not when the member is first needed.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator
from shapely import contains_xy
from shapely.geometry import Polygon
from shapely.ops import unary_union

from geometry.scenes.scene import Scene
from geometry.sides import SIDES, Side
from geometry.survey.marks import Mark
from geometry.survey.quantity import Along, Datum, OneNumber, Quantity
from pipeline.files import content_hash

if TYPE_CHECKING:
    from geometry.survey.site import Site

#: Raised whenever the same run is read otherwise: readings that are kept of it are not used then.
READING_VERSION = 2


@dataclass(frozen=True)
class Deposit:
    """Points of one moment, with those before the slide and, where known, the way between.

    Attributes:
        position: (N, 2) [m].
        initial_position: the same points before the slide, (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        foot: where the section ended before the slide, x [m] by side.
        ground: rigid base, a level or a polyline (P, 2) [m]; None: unknown, so no profiles.
        positions: all frames (T, N, 2) [m]; None: only the last is known, so no histories.
        time: of the frames, (T,) ascending [s].
        at_rest: the soil stays where it is after the last frame.
        initial_volume: before the slide, where that is another than `volume`; None: the same.
        front: by side the points (N,) whose front is the toe; a side that is absent: all.
    """

    position: np.ndarray
    initial_position: np.ndarray
    volume: np.ndarray | float
    spacing: float
    foot: Mapping[Side, float]
    ground: np.ndarray | float | None = None
    positions: np.ndarray | None = None
    time: np.ndarray | None = None
    at_rest: bool = True
    initial_volume: np.ndarray | float | None = None
    front: Mapping[Side, np.ndarray] = field(default_factory=dict)

    @property
    def before(self) -> Deposit:
        """The points before the slide."""
        volume = self.volume if self.initial_volume is None else self.initial_volume
        return replace(self, position=self.initial_position, volume=volume)

    @classmethod
    def on(
        cls,
        scene: Scene,
        foot: Mapping[Side, float],
        position: np.ndarray,
        initial_position: np.ndarray,
        initial_volume: np.ndarray | float,
        *,
        volume: np.ndarray | float | None = None,
        positions: np.ndarray | None = None,
        time: np.ndarray | None = None,
        at_rest: bool = True,
    ) -> Self:
        """Points of a simulated section; arguments as the attributes, `volume` None: unchanged."""
        return cls(
            position=position,
            initial_position=initial_position,
            volume=initial_volume if volume is None else volume,
            spacing=scene.spacing,
            foot=foot,
            ground=np.asarray(scene.ground.points, dtype=float),
            positions=positions,
            time=time,
            at_rest=at_rest,
            initial_volume=initial_volume,
            front=_fronts(scene, initial_position),
        )


def _fronts(scene: Scene, initial_position: np.ndarray) -> dict[Side, np.ndarray]:
    """Points of the zones whose front is the toe, on the sides where the ground goes on."""
    found = {}
    for side in SIDES:
        front = scene.front_zones(side)
        if front and len(front) < len(scene.zones):
            part = unary_union([Polygon(scene.zones[number].polygon) for number in front])
            found[side] = contains_xy(part, initial_position)
    return found


@dataclass(frozen=True)
class Observed:
    """A prediction and its derivative with respect to the positions of the frames it depends on.

    Attributes:
        values: (m,) in the unit of the measurement.
        frames: numbers of the frames each value depends on, (m, K); -1: the deposit's position.
        change: derivative with respect to the positions in these frames, (m, K, N, 2).
    """

    values: np.ndarray
    frames: np.ndarray
    change: np.ndarray


@dataclass(frozen=True)
class Reading:
    """A reading of one measurement on one run.

    Attributes:
        values: (m,) in the measurement's unit; NaN where it could not be read.
        trouble: why it could not; else empty.
    """

    values: np.ndarray
    trouble: str = ""


class Measured(Quantity):
    """Base of all types of measurement on a section.

    A type adds its fields, among them ``type: Literal["its_name"]``, and gives every member named
    in `REQUIRED`.
    """

    history: ClassVar[tuple[str, ...] | None]
    """Names of the fields that decide what is read on all frames of a run; None: the measurement is
    read on the last frame alone. Runs keep such a reading by these fields, not their frames."""
    code: ClassVar[str] = ""
    """Hash of the file of a user's own type."""

    # --- what a type must give ---

    @property
    @abstractmethod
    def along(self) -> Along | None:
        """Where or when the numbers were taken; None: they have no place."""

    @property
    @abstractmethod
    def datum(self) -> Datum | None:
        """How the survey's datum enters the numbers; None: not at all."""

    @abstractmethod
    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Read this measurement on a deposit, in `unit`.

        Returns:
            The value or values (m,). With `derivative` a tuple: the values and their derivative
            with respect to the last positions, (N, 2) or (m, N, 2); of a type with a `history` the
            values, the numbers of the frames they depend on, (K,) or (m, K), and the derivative
            with respect to the positions in these, (K, N, 2) or (m, K, N, 2).

        Raises:
            ValueError: it cannot be read on this deposit, or its derivative is not known.
        """

    @abstractmethod
    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """Refuse what cannot have been measured on a section.

        Args:
            scene: the section before the slide.
            feet: where it ended, x [m] by side: as surveyed, else as drawn.
            where: beginning of the message.

        Raises:
            InputError: a place or a value outside the section or its domain; one line.
        """

    @classmethod
    @abstractmethod
    def could_be_made(cls, site: Site) -> Sequence[Measured]:
        """Measurements of this type that could still be made on a section; their values are 0."""

    @abstractmethod
    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """Marks of this measurement in a picture of the section; `feet` as for `check_in`."""

    # --- what a type may give ---

    @property
    def toe_side(self) -> Side | None:
        """The side on which this is the runout of the toe; None: it is another quantity."""
        return None

    @property
    def is_runout(self) -> bool:
        """It is the runout of the toe."""
        return self.toe_side is not None

    @property
    def slid_to(self) -> Side | None:
        """The side to which, as far as this says, the soil ran; None: it does not say."""
        return None

    @property
    def files(self) -> list[str]:
        """Further files of the case folder that belong to this entry."""
        return []

    def read_files(self, folder: Path, where: str) -> None:
        """Read `files`; `where` begins messages.

        Raises:
            InputError: one of them cannot be read or does not fit the entry; one line.
        """

    def by_eye(self, deposit: Deposit) -> float | None:
        """Reading by eye in a picture of the deposit; None: the same as computed."""
        return None

    def soil_at(self, feet: Mapping[Side, float]) -> list[float]:
        """Places to which, as far as this says, soil reached, x [m]; `feet` as for `check_in`."""
        return []

    # --- what follows from it ---

    @property
    def needs_history(self) -> bool:
        """The measurement is read on all frames of a run, not on the last alone."""
        return self.history is not None

    def reading_key(self, foot: Mapping[Side, float]) -> str:
        """Name of the reading among those that are kept of a run, for a type with a `history`.

        Measured values, errors and names are not part of it, so another survey of the same quantity
        is read from the same run.

        Args:
            foot: where the section ended before the slide, x [m] by side.
        """
        deciding: dict[str, Any] = {name: getattr(self, name) for name in self.history or ()}
        if "side" in deciding:
            deciding["foot"] = float(foot[deciding["side"]])
        if self.code:
            deciding["code"] = self.code
        return content_hash({"type": type(self).__name__, "reading": READING_VERSION, **deciding})

    def observe(self, deposit: Deposit) -> np.ndarray:
        """Read this measurement on a deposit, (m,), in `unit`.

        Raises:
            ValueError: the deposit lacks what this needs: the ground, or the frames before.
            InputError: the run was cut off in motion before the time measured.
        """
        return np.atleast_1d(self.read_points(deposit, derivative=False)).astype(float)

    def observe_with_derivative(self, deposit: Deposit) -> Observed:
        """The same with its derivative with respect to the positions."""
        values, *frames, change = self.read_points(deposit, derivative=True)
        values = np.atleast_1d(values).astype(float)
        numbers = np.reshape(frames[0] if frames else np.full(len(values), -1), (len(values), -1))
        return Observed(
            values, numbers, np.reshape(change, (*numbers.shape, *np.shape(deposit.position)))
        )

    def reading(self, deposit: Deposit) -> Reading:
        """The same as `observe`, with the reason where it cannot be read."""
        try:
            return Reading(self.observe(deposit))
        except ValueError as error:
            return Reading(np.full(len(self.values), np.nan), str(error))


#: Members that every type must give, itself or by a base such as `Length`.
REQUIRED = (
    "unit",
    "history",
    "values",
    "with_values",
    "along",
    "datum",
    "read_points",
    "check_in",
    "could_be_made",
    "marks",
)
#: Fields that every type must have, in its unit: `std_m`.
REQUIRED_FIELDS = ("std", "model_std")


class Length(Measured):
    """A measurement in metres."""

    unit: ClassVar[str] = "m"

    std_m: float = Field(gt=0, description="standard deviation of the survey [m]")
    model_std_m: float = Field(
        0.0, ge=0, description="granted to the model in addition to the survey's error [m]"
    )


class Single(OneNumber, Measured):
    """A measurement that is one number, in a field `value` in its unit: `value_m`."""


class SingleLength(Single, Length):
    """A measurement that is one length."""

    value_m: float = Field(description="the measured value [m]")
    low_m: float | None = Field(None, description="lower end of the stated range [m]")
    high_m: float | None = Field(None, description="upper end of the stated range [m]")

    @model_validator(mode="after")
    def _in_range(self) -> Self:
        if (self.low_m is None) != (self.high_m is None):
            raise ValueError("low_m and high_m: give both or neither")
        if self.stated_range is not None:
            low, high = self.stated_range
            if not low <= self.value_m <= high:
                raise ValueError(
                    f"value_m {self.value_m:g} lies outside low_m {low:g} to high_m {high:g}"
                )
        return self

    @property
    def stated_range(self) -> tuple[float, float] | None:
        """Lower and upper end of the stated range [m]."""
        return None if self.low_m is None or self.high_m is None else (self.low_m, self.high_m)


def single_lengths(entries: Iterable[Measured]) -> list[SingleLength]:
    """Those of the measurements that are one length each."""
    return [entry for entry in entries if isinstance(entry, SingleLength)]


def exponential_correlation(places: np.ndarray, length: float | None) -> np.ndarray:
    """exp(-|distance| / length) between places (m,) -> (m, m); None: independent errors."""
    if length is None:
        return np.eye(len(places))
    return np.exp(-np.abs(places[:, None] - places[None, :]) / length)
