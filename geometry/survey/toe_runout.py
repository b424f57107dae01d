"""`toe_runout`: how far the toe ran beyond the foot of the section before the slide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, overload

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.survey.columns import Side, naked_eye_toe, outward_of, toe
from geometry.survey.marks import Distance, Mark
from geometry.survey.measured import Deposit, SingleLength
from geometry.survey.site import NOT_MADE, Site, check_in_domain


@overload
def toe_runout(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    derivative: Literal[False] = ...,
) -> float: ...


@overload
def toe_runout(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    derivative: Literal[True],
) -> tuple[float, np.ndarray]: ...


@overload
def toe_runout(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    derivative: bool,
) -> float | tuple[float, np.ndarray]: ...


def toe_runout(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Distance of the toe from the foot of the section, outward positive.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        side: left or right of the dam.
        initial_toe: x of the foot before the slide [m], `Scene.foot`.
        derivative: return also the derivative.

    Returns:
        Runout [m], or with `derivative` (runout, (N, 2)).
    """
    outward = outward_of(side)
    if derivative:
        place, slope = toe(position, volume, spacing=spacing, side=side, derivative=True)
        return outward * (place - initial_toe), outward * slope
    return outward * (toe(position, volume, spacing=spacing, side=side) - initial_toe)


class ToeRunout(SingleLength):
    """Distance of the toe from the foot of the section before the slide, outward positive."""

    history: ClassVar[None] = None
    along: ClassVar[None] = None
    datum: ClassVar[None] = None

    type: Literal["toe_runout"]
    side: Side = Field(description="left or right of the section")

    @property
    def toe_side(self) -> Side:
        """The side of the toe."""
        return self.side

    @property
    def slid_to(self) -> Side:
        """The side of the toe."""
        return self.side

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Runout [m]."""
        return toe_runout(
            deposit.position,
            deposit.volume,
            spacing=deposit.spacing,
            side=self.side,
            initial_toe=deposit.foot[self.side],
            derivative=derivative,
        )

    def by_eye(self, deposit: Deposit) -> float:
        """Runout of the outermost connected point [m]."""
        seen = naked_eye_toe(
            deposit.position, deposit.volume, spacing=deposit.spacing, side=self.side
        )
        return outward_of(self.side) * (seen - deposit.foot[self.side])

    def place(self, feet: Mapping[Side, float]) -> float:
        """Where the measured toe lies, x [m]."""
        return feet[self.side] + outward_of(self.side) * self.value_m

    def soil_at(self, feet: Mapping[Side, float]) -> list[float]:
        """The measured toe [m]."""
        return [self.place(feet)]

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A toe within closed walls; open ones give way."""
        if scene.domain.walls == "closed":
            check_in_domain(self.place(feet), scene, f"{where}: the toe")

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[ToeRunout]:
        """The final toe on the sides to which the slide ran."""
        known = {entry.side for entry in site.made_of(cls)}
        return [
            cls(
                type="toe_runout",
                name=f"{side} toe in the end",
                side=side,
                value_m=0.0,
                std_m=site.std(cls, 0.02, 0.3),
                **NOT_MADE,
            )
            for side in site.sides
            if side not in known
        ]

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """A dimension line from the foot to the toe."""
        outward = outward_of(self.side)
        return [Distance(feet[self.side], outward, self.value_m, self.stated_range)]
