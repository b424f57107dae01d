"""`crest_settlement`: drop of the surface at the initial crest, or of the crest's own points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.marks import Mark
from geometry.survey.measured import Datum, Deposit, SingleLength
from geometry.survey.site import Site, check_in_section
from geometry.survey.surface_profile import surface_profile
from pipeline.cli import InputError


class CrestSettlement(SingleLength):
    """Drop of the surface at the initial crest's place, or of the crest's own points."""

    history: ClassVar[None] = None
    along: ClassVar[None] = None

    type: Literal["crest_settlement"]
    at: Literal["initial_crest_x", "crest_points"] = Field(
        description="the surface at the crest's place, or the crest's own material points"
    )
    x_m: float | None = Field(None, description="place of the crest [m]; for initial_crest_x")

    @model_validator(mode="after")
    def _place_belongs_to_the_surface(self) -> CrestSettlement:
        if self.at == "initial_crest_x" and self.x_m is None:
            raise ValueError("x_m: give the place of the crest, or choose at: crest_points")
        if self.at == "crest_points" and self.x_m is not None:
            raise ValueError("x_m: leave it out, or choose at: initial_crest_x")
        return self

    @property
    def datum(self) -> Datum:
        """A datum that is too high makes the crest drop less."""
        return Datum(np.array([-1.0]), np.array([np.nan if self.x_m is None else self.x_m]), False)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Settlement [m]: of the surface at `x_m`, or the mean drop of the crest's own points.

        Those are the points in the top two rows of the section before the slide.
        """
        if self.x_m is None:
            height = deposit.initial_position[:, 1]
            crest = np.flatnonzero(height > height.max() - 1.5 * deposit.spacing)
            drop = float(np.mean(height[crest] - deposit.position[crest, 1]))
            if not derivative:
                return drop
            change = np.zeros(np.shape(deposit.position))
            change[crest, 1] = -1.0 / len(crest)
            return drop, change
        at_start = deposit.volume if deposit.initial_volume is None else deposit.initial_volume
        points, volume, spacing = deposit.position, deposit.volume, deposit.spacing
        before = surface_profile(deposit.initial_position, at_start, self.x_m, spacing=spacing)
        if derivative:
            now, slope = surface_profile(points, volume, self.x_m, spacing=spacing, derivative=True)
            return float(before - now), -slope
        return float(before - surface_profile(points, volume, self.x_m, spacing=spacing))

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A crest on the section, and no greater settlement than the section is high."""
        if self.x_m is not None:
            check_in_section(self.x_m, scene, f"{where}: x_m")
        height = scene.extent[1] - scene.ground.lowest
        if not -height <= self.value_m <= height:
            raise InputError(
                f"{where}: value_m {self.value_m:g} is more than the section is high above its "
                f"ground, {height:g} m"
            )

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[CrestSettlement]:
        """None: the surface itself is proposed instead."""
        return []

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None."""
        return []
