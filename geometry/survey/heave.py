"""`heave`: rise of the ground before the toe of a fill.

The rise is that of the column of ground alone (`Deposit.front` is the fill): fill that ran over it,
or that the kernel smears over the toe, is no heave. A column's height is the surface over a base
that does not move, so its change is the rise of the surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.sides import Side, outward_of
from geometry.survey.columns import column_height, connected, kernel_length, kernel_slope, toe
from geometry.survey.marks import Height, Mark
from geometry.survey.measured import Along, Datum, Deposit, SingleLength
from geometry.survey.site import NOT_MADE, Site, surface_at
from geometry.survey.toe_runout import check_has_toe
from pipeline.cli import InputError

#: Places per kernel length among which the largest rise is looked for, before it is refined.
PER_LENGTH = 4


class Heave(SingleLength):
    """Rise of the ground's surface before the toe of the fill, upward positive."""

    history: ClassVar[None] = None

    type: Literal["heave"]
    side: Side = Field(description="left or right of the section")
    x_m: float | None = Field(
        None, description="place of the measured rise [m]; null: the largest rise beyond the toe"
    )

    @property
    def along(self) -> Along | None:
        """The place, where one is stated."""
        return None if self.x_m is None else Along("x_m", np.array([self.x_m]), series=False)

    @property
    def datum(self) -> Datum:
        """A datum that is too high after the slide raises the ground."""
        return Datum(np.array([1.0]), np.array([np.nan if self.x_m is None else self.x_m]), False)

    @property
    def slid_to(self) -> Side | None:
        """The side on which the ground rose; a rise of 0 says of no slide."""
        return self.side if self.value_m > 0.0 else None

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Rise of the ground [m]."""
        front = deposit.front.get(self.side)
        if front is None:
            raise ValueError(
                f"{self.name}: no soil goes on beyond the toe to the {self.side}, so no ground "
                "heaves there"
            )
        if len(deposit.position) != len(front):
            raise ValueError(f"{self.name}: needs the same points before and after the slide")
        before = deposit.before
        try:
            return heave(
                deposit.position,
                deposit.volume,
                before.position,
                before.volume,
                front=front,
                spacing=deposit.spacing,
                side=self.side,
                foot=deposit.foot[self.side],
                x=self.x_m,
                derivative=derivative,
            )
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A rise of ground that goes on beyond a toe, read whole, within the domain."""
        side, outward = self.side, outward_of(self.side)
        if not scene.domain.goes_on(side):
            raise InputError(
                f"{where}: no soil goes on to the {side} beyond the toe, so no ground heaves "
                f"there; draw the foundation as a zone of its own (domain: {side}: far)"
            )
        check_has_toe(scene, side, where)
        if self.x_m is None and self.value_m < 0.0:
            raise InputError(
                f"{where}: value_m {self.value_m:g}: the largest rise is 0 or more; give x_m for a "
                "place where the ground sank"
            )
        if self.x_m is None:
            top = surface_at(feet[side], scene, f"{where}: the {side} foot")
        else:
            # The kernel reaches two lengths: nearer to the end it would see a part of the ground.
            end = scene.domain.wall(side) - outward * 2.0 * kernel_length(scene.spacing)
            if outward * (self.x_m - feet[side]) < 0.0:
                raise InputError(
                    f"{where}: x_m {self.x_m:g}: the ground beyond the toe begins at the {side} "
                    f"foot, x {feet[side]:g} m"
                )
            if outward * (end - self.x_m) < 0.0:
                raise InputError(
                    f"{where}: x_m {self.x_m:g}: the ground beyond the toe is read from the foot "
                    f"at x {feet[side]:g} to {end:g} m; draw more of the ground to the {side}"
                )
            top = surface_at(self.x_m, scene, f"{where}: x_m")
        low, high = scene.ground.lowest, scene.domain.y_max
        if not low <= top + self.value_m <= high:
            raise InputError(
                f"{where}: value_m {self.value_m:g} is ground at y {top + self.value_m:g}; the "
                f"domain has {low:g} to {high:g} m"
            )

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[Heave]:
        """The largest rise beyond the toe of a fill on liquefied ground, where the slide ran."""
        scene = site.scene
        known = {entry.side for entry in site.made_of(cls) if entry.x_m is None}
        found = []
        for side in site.sides:
            front = scene.front_zones(side) if scene.domain.goes_on(side) else []
            soft = any(
                scene.materials[zone.material].liquefied
                for number, zone in enumerate(scene.zones)
                if number not in front
            )
            if front and soft and side not in known:
                found.append(
                    cls(
                        type="heave",
                        name=f"heave before the {side} toe",
                        side=side,
                        value_m=0.0,
                        std_m=site.std(cls, 0.01, 0.1),
                        **NOT_MADE,
                    )
                )
        return found

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """The rise at its place, where one is stated."""
        return [] if self.x_m is None else [Height(self.x_m, self.value_m, "heave measured")]


def heave(
    position: np.ndarray,
    volume: np.ndarray | float,
    initial_position: np.ndarray,
    initial_volume: np.ndarray | float,
    *,
    front: np.ndarray,
    spacing: float,
    side: Side,
    foot: float,
    x: float | None = None,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Rise of the ground that goes on beyond the toe of a fill, upward positive.

    Args:
        position: after the slide, (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        initial_position: the same points before the slide, (N, 2) [m].
        initial_volume: (N,) or one number [m2 per m].
        front: (N,) bool, points of the fill, `Deposit.front`; all others are the ground.
        spacing: distance between material points [m].
        side: of the toe.
        foot: x of the foot of the fill before the slide [m].
        x: place of the rise [m]; None: the largest one, from the foot before the slide or the toe
            after it, whichever lies further out, to the end of the ground. Within two kernel
            lengths of that end the columns lack what lies beyond it, and the rise reads low.
        derivative: return also the derivative with respect to `position`.

    Returns:
        Rise [m], or with `derivative` (rise, (N, 2)).

    Raises:
        ValueError: the fill has no toe, or it ran to the end of the ground.
    """
    now = _Ground(position, volume, front, spacing)
    before = _Ground(initial_position, initial_volume, front, spacing)
    change = np.zeros(np.shape(position))
    if x is None:
        x, by_toe = _place_of_largest(now, before, side, foot)
        if by_toe is not None:
            # Largest right at the toe: as that moves, the place where the rise is read does.
            change[front] = (now.slope(x) - before.slope(x)) * by_toe
    rise = now.height(x) - before.height(x)
    if not derivative:
        return rise
    _, by_ground = column_height(
        now.points, now.weight, x, length=kernel_length(spacing), derivative=True
    )
    change[~front] += by_ground
    return rise, change


class _Ground:
    """Columns of the ground without the fill, of what hangs together with it."""

    def __init__(
        self, position: np.ndarray, volume: np.ndarray | float, front: np.ndarray, spacing: float
    ) -> None:
        position = np.asarray(position, dtype=float)
        amounts = np.where(connected(position, volume, spacing), volume, 0.0)
        self.fill, self.fill_weight = position[front], np.broadcast_to(volume, len(front))[front]
        self.points, self.weight = position[~front], amounts[~front]
        self.spacing, self.length = spacing, kernel_length(spacing)

    def height(self, x: Any) -> Any:
        """Height of the column of ground at x [m]."""
        found = column_height(self.points, self.weight, x, length=self.length)
        return float(found) if np.ndim(x) == 0 else found

    def slope(self, x: float) -> float:
        """Its derivative by x."""
        return float(self.weight @ kernel_slope(x - self.points[:, 0], self.length))


def _place_of_largest(
    now: _Ground, before: _Ground, side: Side, foot: float
) -> tuple[float, np.ndarray | None]:
    """Place of the largest rise, x [m].

    Its derivative with respect to the fill's points, (n, 2), where that place is the toe; None:
    it is a summit, the foot or the end of the ground, whose place does not count.
    """
    outward = outward_of(side)
    place, by_toe = toe(now.fill, now.fill_weight, spacing=now.spacing, side=side, derivative=True)
    start = outward * max(outward * place, outward * foot)
    end = outward * float(np.max(outward * before.points[:, 0])) + outward * 0.5 * now.spacing
    reach = outward * (end - start)
    if reach <= 0.0:
        raise ValueError(
            f"the {side} toe ran to the end of the drawn ground at x = {end:g} m: none is left "
            "before it that could heave; draw more of the ground"
        )
    step = now.length / PER_LENGTH
    places = start + outward * np.linspace(0.0, reach, int(np.ceil(reach / step)) + 1)
    largest = int(np.argmax(now.height(places) - before.height(places)))

    def rises(x: float) -> bool:
        return outward * (now.slope(x) - before.slope(x)) > 0.0

    if rises(places[largest]):
        if largest == len(places) - 1:
            return end, None
        inner, outer = places[largest], places[largest + 1]
    else:
        if largest == 0:
            return start, by_toe if start == place else None
        inner, outer = places[largest - 1], places[largest]
    for _ in range(50):
        middle = 0.5 * (inner + outer)
        inner, outer = (middle, outer) if rises(middle) else (inner, middle)
    return float(0.5 * (inner + outer)), None
