"""`crest_settlement`: drop of the surface at the initial crest, or of the crest's own points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from geometry.scenes.scene import Scene
from geometry.survey.checks import check_in_section
from geometry.survey.marks import Mark
from geometry.survey.measured import Datum, Deposit, SingleLength
from geometry.survey.site import Site
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe import Side
from pipeline.cli import InputError


def crest_settlement(
    position: np.ndarray,
    initial_position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    x: float,
    initial_volume: np.ndarray | float | None = None,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Drop of the surface at the initial crest's place, downward positive.

    Args:
        position: (N, 2) now [m].
        initial_position: (N, 2) before the slide [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        x: place of the initial crest [m].
        initial_volume: before the slide, where that is another; None: `volume`.
        derivative: return also the derivative with respect to `position`.

    Returns:
        Settlement [m], or with `derivative` (settlement, (N, 2)).
    """
    first = volume if initial_volume is None else initial_volume
    before = surface_profile(initial_position, first, x, spacing=spacing)
    now = surface_profile(position, volume, x, spacing=spacing, derivative=derivative)
    if derivative:
        return float(before - now[0]), -now[1]
    return float(before - now)


def crest_points(initial_position: np.ndarray, *, spacing: float, rows: float = 2.0) -> np.ndarray:
    """Numbers of the crest's own points: those in the top `rows` spacings of the section before."""
    elevation = np.asarray(initial_position)[:, 1]
    return np.flatnonzero(elevation > elevation.max() - (rows - 0.5) * spacing)


def crest_settlement_of_points(
    position: np.ndarray,
    initial_position: np.ndarray,
    points: np.ndarray,
    *,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Mean drop of chosen points, such as `crest_points`, downward positive.

    Args:
        position: (N, 2) now [m].
        initial_position: (N, 2) before the slide [m].
        points: numbers of the points followed, (K,) integers.
        derivative: return also the derivative with respect to `position`.

    Returns:
        Settlement [m], or with `derivative` (settlement, (N, 2)).
    """
    drop = float(np.mean(initial_position[points, 1] - position[points, 1]))
    if not derivative:
        return drop
    change = np.zeros(np.shape(position))
    np.add.at(change[:, 1], points, -1.0 / len(points))
    return drop, change


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
        if (self.at == "initial_crest_x") != (self.x_m is not None):
            raise ValueError("x_m goes with at: initial_crest_x, and only with it")
        return self

    @property
    def datum(self) -> Datum:
        """A datum that is too high makes the crest drop less."""
        return Datum(np.array([-1.0]), np.array([np.nan if self.x_m is None else self.x_m]), False)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Settlement [m]."""
        if self.x_m is None:
            points = crest_points(deposit.initial_position, spacing=deposit.spacing)
            return crest_settlement_of_points(
                deposit.position, deposit.initial_position, points, derivative=derivative
            )
        return crest_settlement(
            deposit.position,
            deposit.initial_position,
            deposit.volume,
            spacing=deposit.spacing,
            x=self.x_m,
            initial_volume=deposit.initial_volume,
            derivative=derivative,
        )

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
