"""Measurements of one moment: toe, crest, freeboard, the way of a marker."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from geometry.survey import observables
from geometry.survey.measured import Deposit, Length
from geometry.survey.toe import Side


class SingleLength(Length):
    """A measurement that is one length."""

    value_m: float = Field(description="the measured value [m]")
    low_m: float | None = Field(None, description="lower end of the stated range [m]")
    high_m: float | None = Field(None, description="upper end of the stated range [m]")

    @model_validator(mode="after")
    def _in_range(self) -> SingleLength:
        if (self.low_m is None) != (self.high_m is None):
            raise ValueError("low_m and high_m: give both or neither")
        if self.low_m is not None and not self.low_m <= self.value_m <= self.high_m:
            raise ValueError(
                f"value_m {self.value_m:g} lies outside low_m {self.low_m:g} to "
                f"high_m {self.high_m:g}"
            )
        return self

    @property
    def values(self) -> np.ndarray:
        """The measured length, (1,) [m]."""
        return np.array([self.value_m])


class ToeRunout(SingleLength):
    """Distance of the toe from the foot of the section before the slide, outward positive."""

    type: Literal["toe_runout"]
    side: Side = Field(description="left or right of the section")

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        return observables.toe_runout(
            deposit.position,
            deposit.volume,
            spacing=deposit.spacing,
            side=self.side,
            initial_toe=deposit.foot[self.side],
            derivative=derivative,
        )


class CrestSettlement(SingleLength):
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

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        if self.x_m is None:
            points = observables.crest_points(deposit.initial_position, spacing=deposit.spacing)
            return observables.crest_settlement_of_points(
                deposit.position, deposit.initial_position, points, derivative=derivative
            )
        return observables.crest_settlement(
            deposit.position,
            deposit.initial_position,
            deposit.volume,
            spacing=deposit.spacing,
            x=self.x_m,
            initial_volume=deposit.initial_volume,
            derivative=derivative,
        )


class Freeboard(SingleLength):
    """Highest remaining ground minus the water level; negative where the remnant is under water."""

    type: Literal["freeboard"]
    water_level_m: float = Field(description="pool level [m]")

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        return observables.freeboard(
            deposit.position,
            deposit.volume,
            water_level=self.water_level_m,
            spacing=deposit.spacing,
            derivative=derivative,
        )


class MarkerDisplacement(Length):
    """How far the soil that was at one place before the slide has moved."""

    type: Literal["marker_displacement"]
    x_m: float = Field(description="place before the slide [m]")
    y_m: float = Field(description="elevation before the slide [m]")
    dx_m: float | None = Field(None, description="measured displacement to the right [m]")
    dy_m: float | None = Field(None, description="measured displacement upwards [m]")

    @model_validator(mode="after")
    def _something_was_measured(self) -> MarkerDisplacement:
        if self.dx_m is None and self.dy_m is None:
            raise ValueError("dx_m, dy_m: give at least one of them")
        return self

    @property
    def values(self) -> np.ndarray:
        """Displacement to the right and upwards, as far as measured, (1,) or (2,) [m]."""
        return np.array([value for value in (self.dx_m, self.dy_m) if value is not None])

    @property
    def parts(self) -> list[str]:
        """`dx`, `dy`, or both."""
        return [("dx", "dy")[number] for number in self._components()]

    def _components(self) -> list[int]:
        return [number for number, value in enumerate((self.dx_m, self.dy_m)) if value is not None]

    def _read(self, deposit: Deposit, *, derivative: bool) -> Any:
        result = observables.marker_displacement(
            deposit.position,
            deposit.initial_position,
            spacing=deposit.spacing,
            marker=(self.x_m, self.y_m),
            derivative=derivative,
        )
        kept = self._components()
        return (result[0][kept], result[1][kept]) if derivative else result[kept]
