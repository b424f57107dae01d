"""`freeboard`: highest remaining ground minus the water level.

The highest ground is the top of what soil fills, not of single points. Column heights cut a peak
off, and the highest point of all may be one thrown up. So the share of space that soil fills is
smoothed in both directions; where it exceeds `GROUND_SHARE` is ground.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.columns import connected, kernel, kernel_slope
from geometry.survey.marks import Mark
from geometry.survey.measured import Deposit, SingleLength
from geometry.survey.site import NOT_MADE, Site
from pipeline.cli import InputError

#: Soil fills this share of the space where the ground ends: 0.5 on a plain, 0.3 at a sharp peak.
GROUND_SHARE = 0.4
#: Length of the kernel that decides what is ground, in spacings.
GROUND_KERNEL = 2.0
#: Golden section.
GOLDEN = 0.381966


class Freeboard(SingleLength):
    """Highest remaining ground minus the water level; negative where the remnant is under water."""

    history: ClassVar[None] = None
    along: ClassVar[None] = None
    # Measured from the water, so no datum enters it.
    datum: ClassVar[None] = None

    type: Literal["freeboard"]
    water_level_m: float = Field(description="pool level [m]")

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Freeboard [m]."""
        return freeboard(
            deposit.position,
            deposit.volume,
            water_level=self.water_level_m,
            spacing=deposit.spacing,
            derivative=derivative,
        )

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """Water and ground between the base and the top of the domain."""
        low, high = scene.ground.lowest, scene.domain.y_max
        if not low <= self.water_level_m <= high:
            raise InputError(
                f"{where}: water_level_m {self.water_level_m:g} lies outside the domain, "
                f"y {low:g} to {high:g} m"
            )
        ground = self.water_level_m + self.value_m
        if not low <= ground <= high:
            raise InputError(
                f"{where}: value_m {self.value_m:g} over water at {self.water_level_m:g} m is "
                f"ground at y {ground:g}; the domain has {low:g} to {high:g} m"
            )

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[Freeboard]:
        """The freeboard of the remnant, where there is water."""
        if not site.scene.has_water or site.made_of(cls):
            return []
        return [
            cls(
                type="freeboard",
                name="freeboard of the remnant",
                value_m=0.0,
                water_level_m=site.scene.water_level,
                std_m=site.std(cls, 0.01, 0.1),
                **NOT_MADE,
            )
        ]

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """None."""
        return []


def freeboard(
    position: np.ndarray,
    volume: np.ndarray | float,
    *,
    water_level: float,
    spacing: float,
    derivative: bool = False,
) -> float | tuple[float, np.ndarray]:
    """Highest remaining ground minus the water level; negative where the dam is overtopped.

    Ground is where the share of the space that soil fills, smoothed over about two spacings,
    exceeds 0.4 (`highest_ground`). Columns would cut a peak off, and single points
    do not reach the share.

    Args:
        position: (N, 2) [m].
        volume: (N,) or one number [m2 per m].
        water_level: pool level [m].
        spacing: distance between material points [m].
        derivative: return also the derivative.

    Returns:
        Freeboard [m], or with `derivative` (freeboard, (N, 2)).
    """
    member = np.flatnonzero(connected(position, volume, spacing))
    points = np.asarray(position, dtype=float)[member]
    weight = np.broadcast_to(np.asarray(volume, dtype=float), len(position))[member]
    x, y = highest_ground(points, weight, GROUND_KERNEL * spacing)
    if not derivative:
        return y - water_level
    # On the contour share(x, y, x_i, y_i) = const and level at its top, so dy/dp_i = -s_i / s_y.
    length = GROUND_KERNEL * spacing
    along, up = x - points[:, 0], y - points[:, 1]
    by_x = weight * kernel_slope(along, length) * kernel(up, length)
    by_y = weight * kernel(along, length) * kernel_slope(up, length)
    change = np.zeros(np.shape(position))
    change[member] = np.column_stack([by_x, by_y]) / by_y.sum()
    return y - water_level, change


def highest_ground(points: np.ndarray, weight: np.ndarray, length: float) -> tuple[float, float]:
    """Top of the region in which the smoothed share of soil exceeds `GROUND_SHARE`.

    Args:
        points: (N, 2) [m].
        weight: (N,) volumes [m2 per m].
        length: kernel length [m].

    Returns:
        (x, y) of the top [m].

    Raises:
        ValueError: the points fill so little of the space that there is no ground.
    """
    top, bottom = points[:, 1].max(), points[:, 1].min()
    window = 4.0 * length
    while True:
        lowest = top - window
        near = points[:, 1] > lowest - 2.0 * length
        found = _highest_on_grid(points[near], weight[near], length, lowest)
        if found is not None:
            break
        if lowest < bottom:
            raise ValueError("no ground is left: the points are too far apart to fill the space")
        window *= 2.0
    x, y = found
    near = (np.abs(points - found) < (2.5 * length, 3.5 * length)).all(axis=1)
    points, weight = points[near], weight[near]

    def surface(at: float) -> float:
        return _surface_above(points, weight, length, at, y)

    # Golden section: of the two places within, one is a place of the narrower interval as well.
    low, high = x - 0.5 * length, x + 0.5 * length
    left, right = low + GOLDEN * (high - low), high - GOLDEN * (high - low)
    at_left, at_right = surface(left), surface(right)
    for _ in range(32):
        if at_left < at_right:
            low, left, at_left = left, right, at_right
            right = high - GOLDEN * (high - low)
            at_right = surface(right)
        else:
            high, right, at_right = right, left, at_left
            left = low + GOLDEN * (high - low)
            at_left = surface(left)
    x = 0.5 * (low + high)
    return x, _surface_above(points, weight, length, x, y)


def _highest_on_grid(
    points: np.ndarray, weight: np.ndarray, length: float, lowest: float
) -> tuple[float, float] | None:
    """First guess of the highest ground on a grid down to `lowest`, or None."""
    step = 0.25 * length
    x = np.arange(points[:, 0].min() - length, points[:, 0].max() + length, step)
    y = np.arange(points[:, 1].max() + 2.0 * length, lowest, -step)
    # A point reaches 2 lengths, so only the nearest places of the grid hold any of it.
    reach = np.arange(-int(2.0 * length / step), int(2.0 * length / step) + 1)
    columns = np.rint((points[:, 0] - x[0]) / step).astype(np.intp)[:, None] + reach
    rows = np.rint((y[0] - points[:, 1]) / step).astype(np.intp)[:, None] + reach
    across = kernel(x[0] + step * columns - points[:, :1], length) * weight[:, None]
    up = kernel(points[:, 1:] - (y[0] - step * rows), length)
    cell = columns[:, :, None] * len(y) + rows[:, None, :]
    within = ((columns >= 0) & (columns < len(x)))[:, :, None]
    within = within & ((rows >= 0) & (rows < len(y)))[:, None, :]
    share = (across[:, :, None] * up[:, None, :])[within]
    ground = np.bincount(cell[within], share, len(x) * len(y)).reshape(len(x), -1) >= GROUND_SHARE
    rows = np.flatnonzero(ground.any(axis=0))
    if not len(rows):
        return None
    column = np.flatnonzero(ground[:, rows[0]])
    return float(x[column[len(column) // 2]]), float(y[rows[0]])


def _surface_above(
    points: np.ndarray, weight: np.ndarray, length: float, x: float, guess: float
) -> float:
    """Elevation near `guess` at which the share of soil at `x` falls to `GROUND_SHARE`."""
    across = weight * kernel(x - points[:, 0], length)
    low, high = guess - 1.5 * length, guess + 1.5 * length
    y = guess
    for _ in range(60):
        up = y - points[:, 1]
        excess = float(across @ kernel(up, length)) - GROUND_SHARE
        if excess >= 0.0:
            low = y
        else:
            high = y
        slope = float(across @ kernel_slope(up, length))
        step = y - excess / slope if slope else high
        if abs(step - y) < 1e-12 * length:
            break
        y = step if low < step < high else 0.5 * (low + high)
    return y
