"""`toe_runout`: how far the toe ran beyond the foot of the section before the slide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, overload

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.sides import Side, outward_of
from geometry.survey.columns import naked_eye_toe, toe
from geometry.survey.marks import Distance, Mark
from geometry.survey.measured import Deposit, SingleLength
from geometry.survey.site import NOT_MADE, Site, check_in_domain
from geometry.survey.surface_profile import ground_elevation
from pipeline.cli import InputError

#: Share of the soil that has passed the foot. A sheet thinner than the points that holds more is
#: where the slide ends.
SHEET = 0.1
#: Fewer points than these are no sheet: what they do differs from run to run.
FEW = 8
#: Soil within this many spacings of the ground lies on it, and does not fly.
LYING = 2.0


@overload
def toe_runout(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    front: np.ndarray | None = ...,
    ground: np.ndarray | float | None = ...,
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
    front: np.ndarray | None = ...,
    ground: np.ndarray | float | None = ...,
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
    front: np.ndarray | None = ...,
    ground: np.ndarray | float | None = ...,
    derivative: bool,
) -> float | tuple[float, np.ndarray]: ...


def toe_runout(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    spacing: float,
    side: Side,
    initial_toe: float,
    front: np.ndarray | None = None,
    ground: np.ndarray | float | None = None,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Distance of the toe from the foot of the section, outward positive.

    The toe is no nearer than the place beyond which a sheet of `SHEET` of the soil in front of the
    foot lies: otherwise soil too weak to hang together would seem to run less far than stronger
    soil.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        spacing: distance between material points [m].
        side: left or right of the dam.
        initial_toe: x of the foot before the slide [m], `Scene.foot`.
        front: (N,) bool, points whose front is the toe, `Deposit.front`; None: all.
        ground: elevation of a level base, or its polyline (P, 2) [m]; None: a sheet does not
            count.
        derivative: return also the derivative.

    Returns:
        Runout [m], or with `derivative` (runout, (N, 2)).
    """
    outward = outward_of(side)
    points, amounts = _part(position, volume, front)
    slope = np.zeros(np.shape(points))
    if derivative:
        place, slope = toe(points, amounts, spacing=spacing, side=side, derivative=True)
    else:
        place = toe(points, amounts, spacing=spacing, side=side)
    if ground is not None:
        last = _edge_of_sheet(points, amounts, ground, spacing, outward, place, initial_toe)
        if last is not None:
            place, slope = float(points[last, 0]), np.zeros(np.shape(points))
            slope[last, 0] = 1.0
    if not derivative:
        return outward * (place - initial_toe)
    change = np.zeros(np.shape(position))
    change[slice(None) if front is None else front] = outward * slope
    return outward * (place - initial_toe), change


def runout_of(
    deposit: Deposit,
    side: Side,
    *,
    position: np.ndarray | None = None,
    start: float | None = None,
    derivative: bool = False,
) -> Any:
    """`toe_runout` of a deposit.

    Args:
        deposit: on its ground.
        side: left or right.
        position: of its points, (N, 2) [m]; None: where they are in the end.
        start: x from which it is counted [m]; None: the foot of the section.
        derivative: return also the derivative.
    """
    return toe_runout(
        deposit.position if position is None else position,
        deposit.volume,
        spacing=deposit.spacing,
        side=side,
        initial_toe=deposit.foot[side] if start is None else start,
        front=deposit.front.get(side),
        ground=deposit.ground,
        derivative=derivative,
    )


def _edge_of_sheet(
    points: np.ndarray,
    volume: np.ndarray | float,
    ground: np.ndarray | float,
    spacing: float,
    outward: int,
    place: float,
    foot: float,
) -> int | None:
    """Number of the point beyond which a sheet lies; None: it is not beyond `place`."""
    amounts = np.broadcast_to(np.asarray(volume, dtype=float), len(points))
    x, y = np.asarray(points, dtype=float).T
    beyond = outward * (x - place) > 0.0
    lying = np.flatnonzero(beyond & (y < ground_elevation(ground, x) + LYING * spacing))
    order = lying[np.argsort(-outward * x[lying], kind="stable")]
    passed = amounts[outward * (x - foot) > 0.0].sum()
    first = int(np.searchsorted(np.cumsum(amounts[order]), max(SHEET * passed, FEW * spacing**2)))
    return int(order[first]) if first < len(order) else None


def runout_by_eye(deposit: Deposit, side: Side, initial_toe: float) -> float:
    """The same of the outermost connected point [m]."""
    points, amounts = _part(deposit.position, deposit.volume, deposit.front.get(side))
    seen = naked_eye_toe(points, amounts, spacing=deposit.spacing, side=side)
    return outward_of(side) * (seen - initial_toe)


def _part(
    position: np.ndarray, volume: np.ndarray | float, front: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | float]:
    """Points and volumes of a front."""
    if front is None:
        return position, volume
    amounts = np.broadcast_to(np.asarray(volume, dtype=float), len(position))
    return np.asarray(position)[front], amounts[front]


def check_has_toe(scene: Scene, side: Side, where: str) -> None:
    """Refuse a toe on a side on which the whole section goes on.

    Raises:
        InputError: beginning with `where`; one line.
    """
    if not scene.front_zones(side):
        raise InputError(
            f"{where}: the ground goes on to the {side}, and so does every zone of the section: it "
            f"has no toe there; where it ends in a free face, say so (domain: {side}: free), and "
            "draw soil that slides over other soil as a zone of its own"
        )


def check_toe_in_domain(x: float, scene: Scene, side: Side, where: str) -> None:
    """Refuse a toe behind a wall, at which the soil would have been held.

    Raises:
        InputError: beginning with `where`; one line.
    """
    if not scene.domain.goes_on(side):
        if not scene.domain.is_open(side):
            check_in_domain(x, scene, where)
    elif outward_of(side) * (x - scene.domain.wall(side)) > 0.0:
        raise InputError(
            f"{where}: {x:g} lies beyond the end of the drawn ground at x = {scene.end(side):g} m; "
            f"draw more of the ground to the {side}"
        )


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
        return runout_of(deposit, self.side, derivative=derivative)

    def by_eye(self, deposit: Deposit) -> float:
        """Runout of the outermost connected point [m]."""
        return runout_by_eye(deposit, self.side, deposit.foot[self.side])

    def place(self, feet: Mapping[Side, float]) -> float:
        """Where the measured toe lies, x [m]."""
        return feet[self.side] + outward_of(self.side) * self.value_m

    def soil_at(self, feet: Mapping[Side, float]) -> list[float]:
        """The measured toe [m]."""
        return [self.place(feet)]

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A toe on a side that has one, within walls; open ones give way."""
        check_has_toe(scene, self.side, where)
        check_toe_in_domain(self.place(feet), scene, self.side, f"{where}: the toe")

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
