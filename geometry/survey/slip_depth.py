"""`slip_depth`: depth of the slip surface below the surface before the slide, at one place.

An inclinometer reads horizontal displacement over depth, and so is this read: the slip surface is
where, from below, the displacement first reaches half of the largest one in the column. Soil shears
in a band, whose width in a simulation goes with the spacing. The displacement of half lies in the
middle of the band whatever its width; a small displacement, say of 0.1 m, would lie at its lower
edge, deeper the coarser the points. The largest displacement, not that of the surface, because a
weak layer that is squeezed out from under a fill moves further than the fill.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.sides import SIDES, Side
from geometry.survey.columns import kernel, kernel_integral, kernel_slope
from geometry.survey.marks import Height, Mark
from geometry.survey.measured import Along, Deposit, SingleLength
from geometry.survey.site import NOT_MADE, Site, surface_at
from geometry.survey.surface_profile import ground_elevation, surface_profile
from pipeline.cli import InputError

#: Share of the largest displacement at which the slip surface lies.
SHARE = 0.5
#: Nothing slipped where no depth moved sideways by more than so many spacings.
MOVED = 1.0
#: Kernel over the points before the slide, in spacings; it reaches twice as far.
LENGTH = 1.5
#: Depths per spacing among which the crossing is looked for, before it is refined.
PER_SPACING = 4


class SlipDepth(SingleLength):
    """Depth of the slip surface below the surface before the slide."""

    history: ClassVar[None] = None
    # A depth in a borehole or along a casing: no levelled datum enters it.
    datum: ClassVar[None] = None

    type: Literal["slip_depth"]
    x_m: float = Field(description="place before the slide [m]")

    @property
    def along(self) -> Along:
        """The place."""
        return Along("x_m", np.array([self.x_m]), series=False)

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Depth [m]."""
        if deposit.ground is None:
            raise ValueError(f"{self.name}: the depth of a slip needs the ground of the deposit")
        if len(deposit.position) != len(deposit.initial_position):
            raise ValueError(f"{self.name}: needs the same points before and after the slide")
        before = deposit.before
        try:
            return slip_depth(
                deposit.position,
                before.position,
                before.volume,
                self.x_m,
                spacing=deposit.spacing,
                ground=deposit.ground,
                derivative=derivative,
            )
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A depth between the surface and the base of the section."""
        depth = surface_at(self.x_m, scene, f"{where}: x_m") - float(scene.ground.height(self.x_m))
        if not 0.0 < self.value_m <= depth:
            raise InputError(
                f"{where}: value_m {self.value_m:g}: the soil at x {self.x_m:g} is {depth:g} m "
                "deep; a depth of the slip lies between 0 and that"
            )

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[SlipDepth]:
        """Halfway up the slopes to which the slide ran, away from the depths there are."""
        scene, had = site.scene, [entry.x_m for entry in site.made_of(cls)]
        std, found = site.std(cls, 0.05, 0.5), []
        for side in site.sides:
            x = round(0.5 * (site.feet[side] + _edge_of_top(scene, side)), 1)
            if scene.front_zones(side) and site.apart(x, had):
                found.append(
                    cls(
                        type="slip_depth",
                        name=f"depth of the slip at x {x:g} m",
                        x_m=x,
                        value_m=0.0,
                        std_m=std,
                        **NOT_MADE,
                    )
                )
                had.append(x)
        return found

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """The depth at its place."""
        return [Height(self.x_m, -self.value_m, "depth of the slip measured")]


def _edge_of_top(scene: Scene, side: Side) -> float:
    """Place x [m] of the highest corner of a section, the outermost on one side."""
    corners = [corner for zone in scene.zones for corner in zone.polygon]
    top = max(y for _, y in corners)
    x = [x for x, y in corners if y == top]
    return min(x) if side == SIDES[0] else max(x)


def slip_depth(
    position: np.ndarray,
    initial_position: np.ndarray,
    initial_volume: np.ndarray | float,
    x: float,
    *,
    spacing: float,
    ground: np.ndarray | float,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Depth at which the horizontal displacement falls to half of the largest one in a column.

    The displacement u(y) is the mean over the points that stood within 3 spacings of (x, y) before
    the slide, the nearer ones weighing more. The base counts as soil that does not move, so that
    soil that slid on it as one body has its slip surface there.

    Args:
        position: after the slide, (N, 2) [m].
        initial_position: the same points before the slide, (N, 2) [m].
        initial_volume: of them, (N,) or one number [m2 per m].
        x: place before the slide [m].
        spacing: distance between material points [m].
        ground: elevation of a level base, or its polyline (P, 2) [m].
        derivative: return also the derivative with respect to `position`.

    Returns:
        Depth below the surface before the slide [m], or with `derivative` (depth, (N, 2)).

    Raises:
        ValueError: no soil stood there, or nothing moved sideways by more than a spacing.
    """
    start = np.asarray(initial_position, dtype=float)
    length, base = LENGTH * spacing, float(ground_elevation(ground, x))
    near = np.flatnonzero(np.abs(start[:, 0] - x) < 2.0 * length)
    top = float(surface_profile(start, initial_volume, x, spacing=spacing, ground=ground))
    if top - base < spacing or not len(near):
        raise ValueError(f"no soil stood at x {x:g} m before the slide")
    height = start[near, 1]
    across = np.broadcast_to(initial_volume, len(start))[near] * kernel(x - start[near, 0], length)
    moved = np.asarray(position, dtype=float)[near, 0] - start[near, 0]

    def share(y: np.ndarray | float) -> np.ndarray:
        """Weight of each point at elevations y (...) -> (..., n); that of the base is the rest."""
        up = across * kernel(np.asarray(y)[..., None] - height, length)
        still = kernel_integral(base - np.asarray(y), length)
        # Neither soil nor base in reach: nothing that moves.
        return up / np.maximum(up.sum(axis=-1) + still, 1e-12)[..., None]

    # From below the reach of the soil, where nothing moves, to half a spacing below the surface.
    low, high = base - 1.9 * length, top - 0.5 * spacing
    depths = np.linspace(low, high, int(np.ceil((high - low) / spacing * PER_SPACING)) + 1)
    profile = share(depths) @ moved
    farthest = int(np.argmax(np.abs(profile)))
    largest = float(np.abs(profile[farthest]))
    if largest <= MOVED * spacing:
        raise ValueError(
            f"the soil at x {x:g} m moved sideways by at most {largest:.2g} m, less than "
            f"{MOVED * spacing:g} m: no slip"
        )
    sign = float(np.sign(profile[farthest]))
    over = int(np.argmax(sign * profile >= SHARE * largest))
    below, above = depths[over - 1], depths[over]
    for _ in range(50):
        y = 0.5 * (below + above)
        reached = sign * float(share(y) @ moved) >= SHARE * largest
        below, above = (below, y) if reached else (y, above)
    y = 0.5 * (below + above)
    if not derivative:
        return top - y
    # F(y, p) = sign u(y) - SHARE |u| at its largest stays 0 while the points move.
    at_slip = share(y)
    up = y - height
    rate = across * kernel_slope(up, length)
    whole = float((across * kernel(up, length)).sum() + kernel_integral(base - y, length))
    thins = float(rate.sum() - kernel(base - y, length))
    steepness = sign * float(rate @ moved - thins * (at_slip @ moved)) / whole
    change = np.zeros(np.shape(position))
    change[near, 0] = sign * (at_slip - SHARE * share(depths[farthest])) / steepness
    return top - y, change
