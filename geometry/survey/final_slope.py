"""`final_slope`: how steep the slid soil lies, from its toe to where it stood high before."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.sides import Side, outward_of
from geometry.survey.columns import column_grid, connected, kernel_length
from geometry.survey.marks import Mark
from geometry.survey.measured import Deposit, Single
from geometry.survey.site import Site
from geometry.survey.surface_profile import ground_elevation, surface_profile
from geometry.survey.toe_runout import check_has_toe, runout_of
from pipeline.cli import InputError

#: Share of the section's height at which the face that slid ends and its crest begins.
CREST_SHARE = 0.9
#: Places of the surface before the slide per spacing, among which that is looked for.
PER_SPACING = 4


class FinalSlope(Single):
    """Inclination of the line from the toe to the surface where the crest's edge was before.

    The edge is where the surface before the slide first had nine tenths of the section's height,
    seen from the toe; its place does not move with the slide.
    """

    unit: ClassVar[str] = "deg"
    history: ClassVar[None] = None
    along: ClassVar[None] = None
    # A datum that is too high lifts both ends of the line.
    datum: ClassVar[None] = None

    type: Literal["final_slope"]
    side: Side = Field(description="left or right of the section")
    value_deg: float = Field(gt=0, lt=90, description="the measured value [degrees]")
    std_deg: float = Field(gt=0, description="standard deviation of the measurement [degrees]")
    model_std_deg: float = Field(
        0.0, ge=0, description="granted to the model in addition to the measurement's error [deg]"
    )

    @property
    def slid_to(self) -> Side:
        """The side of the toe."""
        return self.side

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Slope [degrees]."""
        if deposit.ground is None:
            raise ValueError(f"{self.name}: needs the ground below the deposit")
        ground, outward = deposit.ground, outward_of(self.side)
        edge = crest_edge(deposit.before, self.side)
        toe = runout_of(deposit, self.side, start=edge, derivative=derivative)
        surface = surface_profile(
            deposit.position,
            deposit.volume,
            edge,
            spacing=deposit.spacing,
            ground=ground,
            derivative=derivative,
        )
        (length, by_toe), (top, by_top) = (
            one if isinstance(one, tuple) else (one, 0.0) for one in (toe, surface)
        )
        rise = float(top - ground_elevation(ground, edge + outward * length))
        if length <= 0.0 or rise <= 0.0:
            raise ValueError(
                f"{self.name}: no soil is left between the toe and where the crest's edge was, "
                f"x = {edge:g} m"
            )
        slope = float(np.degrees(np.arctan2(rise, length)))
        if not derivative:
            return slope
        reach = 1e-3 * deposit.spacing
        ends = ground_elevation(ground, edge + outward * (length + np.array([-reach, reach])))
        fall = float(ends[0] - ends[1]) / (2.0 * reach)  # of the ground, outward
        by_rise = by_top + fall * by_toe
        return slope, np.degrees(length * by_rise - rise * by_toe) / (length**2 + rise**2)

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """On a side that has a toe, no steeper than the section can have been."""
        check_has_toe(scene, self.side, where)
        if self.value_deg > 60.0:
            raise InputError(
                f"{where}: value_deg {self.value_deg:g}: slid soil lies flatter than 60 degrees; "
                "20 horizontal per vertical are 2.9 degrees"
            )

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[FinalSlope]:
        """None: the surface itself is proposed instead."""
        return []

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None: where the line begins is read from the section."""
        return []


def crest_edge(before: Deposit, side: Side) -> float:
    """Where the surface first reaches `CREST_SHARE` of its greatest height, seen from a side [m].

    Args:
        before: the section before the slide, with its ground.
        side: from which it is seen.
    """
    outward, spacing = outward_of(side), before.spacing
    x, length = before.position[:, 0], kernel_length(spacing)
    member = connected(before.position, before.volume, spacing)
    places, heights = column_grid(
        before.position,
        np.where(member, before.volume, 0.0),
        length=length,
        per_length=math.ceil(PER_SPACING * length / spacing),
    )
    within = (places >= x.min()) & (places <= x.max())
    places, heights = places[within][::-outward], heights[within][::-outward]
    assert before.ground is not None
    ground = ground_elevation(before.ground, places)
    surface, low = ground + heights, ground.min()
    level = low + CREST_SHARE * (surface.max() - low)
    first = int(np.argmax(surface >= level))
    if first == 0:
        return float(places[0])
    share = (level - surface[first - 1]) / (surface[first] - surface[first - 1])
    return float(places[first - 1] + share * (places[first] - places[first - 1]))
