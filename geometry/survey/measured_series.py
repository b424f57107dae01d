"""Measurements along a line or in time: the surface, the toe's way, a velocity, a duration."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from geometry.survey import observables
from geometry.survey.histories import NoSoilError
from geometry.survey.measured import Deposit, Length, Measured, Observed, exponential_correlation
from geometry.survey.profiles import Profile
from geometry.survey.toe import Side
from pipeline.cli import InputError


class SurfaceProfile(Length):
    """The surface after the slide: a polyline in a file of its own, its vertices are the values."""

    type: Literal["surface_profile"]
    file: str = Field(min_length=1, description="CSV beside this document: x_m, y_m, part")
    part: str | None = Field(
        None, description="the part of the profile this entry is about; null: all of it"
    )
    correlation_length_m: float | None = Field(
        None, gt=0, description="of the errors along the profile [m]; null: independent"
    )
    held_out_x_m: tuple[float, float] | None = Field(
        None, description="(from, to): the points between are held out [m]"
    )

    _whole: Profile | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _block_has_width(self) -> SurfaceProfile:
        if self.held_out_x_m is not None:
            first, last = self.held_out_x_m
            if last <= first:
                raise ValueError(f"held_out_x_m runs from {first:g} to {last:g}; it must ascend")
            if self.held_out:
                raise ValueError("held_out: true holds out all of it; leave held_out_x_m out")
        return self

    def attach(self, profile: Profile) -> None:
        """Give the entry what was read from its file."""
        self._whole = profile

    @property
    def whole(self) -> Profile:
        """All that the file holds, other parts included; for drawing."""
        if self._whole is None:
            raise RuntimeError(f"{self.name}: {self.file} has not been read; see load_measurements")
        return self._whole

    @property
    def profile(self) -> Profile:
        """The vertices this entry is about."""
        return self.whole.only(self.part)

    @property
    def values(self) -> np.ndarray:
        """Elevations of the vertices, (m,) [m]."""
        return self.profile.y

    @property
    def parts(self) -> list[str]:
        """Where each vertex lies."""
        return [f"at x {x:g} m" for x in self.profile.x]

    @property
    def held_out_values(self) -> np.ndarray:
        """The vertices within `held_out_x_m`, or all or none of them, (m,) bool."""
        if self.held_out_x_m is None:
            return super().held_out_values
        first, last = self.held_out_x_m
        return (self.profile.x >= first) & (self.profile.x <= last)

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        if deposit.ground is None:
            raise ValueError(f"{self.name}: a surface profile needs the ground of the deposit")
        return observables.surface_profile(
            deposit.position,
            deposit.volume,
            self.profile.x,
            spacing=deposit.spacing,
            ground=deposit.ground,
            derivative=derivative,
        )

    def _correlation(self) -> np.ndarray:
        return exponential_correlation(self.profile.x, self.correlation_length_m)


class ToeHistory(Length):
    """Runout of the toe at given times after the start of the slide, outward positive."""

    type: Literal["toe_history"]
    side: Side = Field(description="left or right of the section")
    times_s: list[float] = Field(min_length=1, description="times, ascending [s]")
    values_m: list[float] = Field(min_length=1, description="runout at these times [m]")
    correlation_time_s: float | None = Field(
        None, gt=0, description="of the errors along the history [s]; null: independent"
    )

    @model_validator(mode="after")
    def _times_ascend(self) -> ToeHistory:
        if len(self.times_s) != len(self.values_m):
            raise ValueError(
                f"times_s has {len(self.times_s)} numbers and values_m {len(self.values_m)}; "
                "they go in pairs"
            )
        if self.times_s[0] < 0:
            raise ValueError(f"times_s begins at {self.times_s[0]:g}; times count from the start")
        for before, after in zip(self.times_s, self.times_s[1:], strict=False):
            if after <= before:
                raise ValueError(f"times_s: {after:g} follows {before:g}; times must ascend")
        return self

    @property
    def values(self) -> np.ndarray:
        """Runout at the times, (m,) [m]."""
        return np.array(self.values_m)

    @property
    def parts(self) -> list[str]:
        """When each value was read."""
        return [f"at {time:g} s" for time in self.times_s]

    def observe_with_derivative(self, deposit: Deposit) -> Observed:
        """Runout [m] with its derivative with respect to the two frames around each time."""
        return Observed(*self._read(deposit, derivative=True))

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        positions, time = _frames(deposit, self)
        _check_end(deposit, self, self.times_s[-1])
        return observables.toe_history(
            positions,
            time,
            np.minimum(self.times_s, time[-1]),  # at rest the toe stays where it is
            deposit.volume,
            spacing=deposit.spacing,
            side=self.side,
            initial_toe=deposit.foot[self.side],
            derivative=derivative,
        )

    def _correlation(self) -> np.ndarray:
        return exponential_correlation(np.array(self.times_s), self.correlation_time_s)


class Velocity(Measured):
    """Mean horizontal velocity of the column at one place and time, to the right positive.

    Where no soil is at that time, and once all is at rest, the reading is 0: nothing moves there.
    """

    unit: ClassVar[str] = "m/s"

    type: Literal["velocity"]
    x_m: float = Field(description="place [m]")
    at_s: float = Field(ge=0, description="time after the start of the slide [s]")
    value_m_per_s: float = Field(description="the measured value, to the right positive [m/s]")
    std_m_per_s: float = Field(gt=0, description="standard deviation of the survey [m/s]")
    model_std_m_per_s: float = Field(
        0.0, ge=0, description="what the model is granted beside the survey's error [m/s]"
    )

    @property
    def values(self) -> np.ndarray:
        """The measured velocity, (1,) [m/s]."""
        return np.array([self.value_m_per_s])

    @property
    def std(self) -> float:
        """Standard deviation of the survey [m/s]."""
        return self.std_m_per_s

    @property
    def model_std(self) -> float:
        """What the user grants the model beside the survey's error [m/s]."""
        return self.model_std_m_per_s

    def observe_with_derivative(self, deposit: Deposit) -> Observed:
        """Velocity [m/s] with its derivative with respect to the frames before and after [1/s]."""
        value, frames, change = self._read(deposit, derivative=True)
        return Observed(np.array([value]), np.asarray(frames)[None], change[None])

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        positions, time = _frames(deposit, self)
        _check_end(deposit, self, self.at_s)
        still = (0.0, (-1, -1), np.zeros((2, *positions.shape[1:]))) if derivative else 0.0
        if self.at_s > time[-1]:
            return still
        try:
            return observables.column_velocity(
                positions,
                time,
                deposit.volume,
                spacing=deposit.spacing,
                x=self.x_m,
                at=self.at_s,
                derivative=derivative,
            )
        except NoSoilError:
            return still


class SlideDuration(Measured):
    """How long the slide took: the time in which the soil does the middle part of its way.

    The way is the mean distance of all soil from where it was. A slow start and a slow end, which
    no witness and no instrument tells apart from rest, do not count.
    """

    unit: ClassVar[str] = "s"

    type: Literal["slide_duration"]
    value_s: float = Field(ge=0, description="the measured value [s]")
    std_s: float = Field(gt=0, description="standard deviation of the measurement [s]")
    model_std_s: float = Field(
        0.0, ge=0, description="what the model is granted beside the measurement's error [s]"
    )
    between: tuple[float, float] = Field(
        (0.05, 0.95), description="shares of the way between which the time counts"
    )

    @model_validator(mode="after")
    def _shares_ascend(self) -> SlideDuration:
        first, last = self.between
        if not 0.0 < first < last < 1.0:
            raise ValueError(
                f"between {first:g} and {last:g}: shares of the way must ascend within 0 and 1"
            )
        return self

    @property
    def values(self) -> np.ndarray:
        """The measured duration, (1,) [s]."""
        return np.array([self.value_s])

    @property
    def std(self) -> float:
        """Standard deviation of the measurement [s]."""
        return self.std_s

    @property
    def model_std(self) -> float:
        """What the user grants the model beside the measurement's error [s]."""
        return self.model_std_s

    def observe_with_derivative(self, deposit: Deposit) -> Observed:
        """Duration [s] with its derivative with respect to the frames it hangs on [s/m]."""
        value, frames, change = self._read(deposit, derivative=True)
        return Observed(np.array([value]), np.asarray(frames)[None], change[None])

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        positions, time = _frames(deposit, self)
        if not deposit.at_rest:
            raise InputError(
                f"{self.name}: the run was stopped in motion at {time[-1]:g} s; give it a longer "
                "duration_s"
            )
        return observables.slide_duration(
            positions,
            deposit.initial_position,
            time,
            deposit.volume,
            spacing=deposit.spacing,
            between=self.between,
            derivative=derivative,
        )


def _frames(deposit: Deposit, measurement: Measured) -> tuple[np.ndarray, np.ndarray]:
    if deposit.positions is None or deposit.time is None:
        raise ValueError(f"{measurement.name}: needs all frames of the run; only one is known")
    return deposit.positions, np.asarray(deposit.time, dtype=float)


def _check_end(deposit: Deposit, measurement: Measured, last: float) -> None:
    """Refuse to read a run that was cut off in motion before the last time measured [s]."""
    end = float(deposit.time[-1])
    if last > end and not deposit.at_rest:
        raise InputError(
            f"{measurement.name}: measured at {last:g} s, but the run was stopped in motion at "
            f"{end:g} s; give it a longer duration_s"
        )
