"""Sections of a slide on its way, by machine: x_pre + f (x_post - x_pre), area conserved.

In: the section before, the slip surface, the surface after. Out: `MorphedSlide.section(f)`, the
section after a share f of the displacement.

Which soil goes where is not known; an analyst draws it. Here every vertical column of the moving
mass goes, in order, to the place where as much area lies ahead of it as before: the columns keep
their order, their area and their layers, and only shift and change height. With A the area ahead of
a column, x_f(A) = (1 - f) x_pre(A) + f x_post(A), so the height at f is
1 / ((1 - f) / h_pre + f / h_post), and the area is conserved at every f. Below the mass lies the
slip surface; beyond its toe the old surface and the ground in front of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from shapely.geometry import Polygon, box

from geometry.sides import Side
from inversion.classical.section import ClassicalSection, water_line_after
from inversion.classical.slices import Polyline, Slices, WaterForm, cut
from pipeline.cli import InputError

BaseStrength = Literal["weaker", "place", "carried"]

#: Columns of the moving mass before, and as many after, whose areas are matched.
COLUMNS = 1500
#: Longest edge of a moved zone, as a share of the width of the moving mass.
EDGE_SHARE = 1.0 / 300.0
#: A mass whose area before and after differ by more than this share is refused.
AREA_TOLERANCE = 0.25


@dataclass(frozen=True)
class Stage:
    """The section at a share f of the displacement.

    Attributes:
        share: f.
        section: all zones, those of the moving mass moved.
        slip: base of the moving mass, from its toe to its head.
        origin: x before the slide [m] of the columns that now stand at x [m].
        destination: the reverse.
        surface: of the moving mass (K, 2) [m].
    """

    share: float
    section: ClassicalSection
    slip: Polyline
    origin: Callable[[np.ndarray], np.ndarray]
    destination: Callable[[np.ndarray], np.ndarray]
    surface: np.ndarray


@dataclass(frozen=True)
class MorphedSlide:
    """A slide from one section to another.

    Attributes:
        before: the section before.
        slip: slip surface within the section before, x ascending.
        after: surface after the slide, (P, 2) [m], x ascending; it need only cover the moving mass.
        side: to which the mass slid.
    """

    before: ClassicalSection
    slip: Polyline
    after: np.ndarray
    side: Side

    @property
    def head(self) -> float:
        """Upper end of the slip surface, x [m]; it does not move."""
        return self.slip.ends[1 if self.side == "left" else 0]

    @property
    def toe_before(self) -> float:
        """Lower end of the slip surface, x [m]."""
        return self.slip.ends[0 if self.side == "left" else 1]

    @cached_property
    def toe_after(self) -> float:
        """Where the surface after the slide meets the ground it ran over, x [m]."""
        x = self._grid(self.after[:, 0].min(), self.after[:, 0].max())
        high = np.flatnonzero(self.after_surface(x) - self.base(x) > 1e-6)
        if not len(high):
            raise InputError("the surface after the slide lies nowhere above the slip surface")
        if self.side == "left":
            return float(x[max(high[0] - 1, 0)])
        return float(x[min(high[-1] + 1, len(x) - 1)])

    def base(self, x: np.ndarray | float) -> np.ndarray:
        """The surface under the mass [m]: the slip surface, ahead of it the old surface."""
        left, right = self.slip.ends
        x = np.asarray(x, dtype=float)
        inside = (x >= left) & (x <= right)
        return np.where(inside, self.slip.level(x), self.before.surface(x))

    def after_surface(self, x: np.ndarray | float) -> np.ndarray:
        """Surface after the slide [m]; beyond the surveyed ends that of the section before."""
        x = np.asarray(x, dtype=float)
        inside = (x >= self.after[0, 0]) & (x <= self.after[-1, 0])
        level = np.interp(x, self.after[:, 0], self.after[:, 1])
        return np.where(inside, level, self.before.surface(x))

    @property
    def area_before(self) -> float:
        """Area of the moving mass before [m2]."""
        return float(self._columns[0].total)

    @property
    def area_factor(self) -> float:
        """Area of the moving mass before, over that after; heights after are multiplied by it."""
        return float(self._columns[0].total / self._columns[1].total)

    @cached_property
    def _columns(self) -> tuple[_Columns, _Columns]:
        before = self._grid(self.toe_before, self.head)
        after = self._grid(self.toe_after, self.head)
        return (
            _Columns(before, np.maximum(self.before.surface(before) - self.base(before), 0.0)),
            _Columns(after, np.maximum(self.after_surface(after) - self.base(after), 0.0)),
        )

    def _grid(self, a: float, b: float) -> np.ndarray:
        corners = [self.slip.points[:, 0], self.after[:, 0]]
        corners += [polygon[:, 0] for polygon in self.before.polygons]
        x = np.concatenate([np.linspace(a, b, COLUMNS), *corners])
        return np.unique(x[(x >= min(a, b)) & (x <= max(a, b))])

    def check(self) -> None:
        """Refuse sections that cannot be those of one slide.

        Raises:
            InputError: the slip surface leaves the soil, the areas differ too much, or the mass
                went the other way.
        """
        left, right = self.slip.ends
        x = np.linspace(left, right, 400)[1:-1]
        if np.any(self.before.surface(x) - self.base(x) < -0.05):
            place = x[np.argmin(self.before.surface(x) - self.base(x))]
            raise InputError(f"slip surface: above the soil before the slide at x = {place:.4g} m")
        if np.any(self.base(x) < self.before.ground_level(x) - 0.05):
            place = x[np.argmin(self.base(x) - self.before.ground_level(x))]
            raise InputError(f"slip surface: below the rigid base at x = {place:.4g} m")
        # The scarp after the slide may cut the slip surface by the roughness of both drawings.
        height = float(np.max(self.before.surface(x) - self.base(x)))
        low = self.after_surface(x) - self.base(x)
        if np.any(low < -0.05 * height):
            place = x[np.argmin(low)]
            raise InputError(
                f"slip surface: {-low.min():.2g} m above the surface after the slide at "
                f"x = {place:.4g} m; `search` looks for one that is not"
            )
        if abs(self.area_factor - 1.0) > AREA_TOLERANCE:
            raise InputError(
                f"area of the sliding mass: {self.area_before:.4g} m² before and "
                f"{self.area_before / self.area_factor:.4g} m² after; they may differ by "
                f"{100 * AREA_TOLERANCE:.0f} %: the slip surface or the profile is wrong"
            )

        moved = self._columns[1].middle - self._columns[0].middle
        if moved * (-1 if self.side == "left" else 1) <= 0:
            raise InputError(
                f"the mass above the slip surface moved {abs(moved):.3g} m to the "
                f"{'left' if moved < 0 else 'right'}, not to the {self.side}: side, slip surface "
                "or profile is wrong"
            )

    def section(self, share: float) -> Stage:
        """The section after a share of the displacement, 0 to 1."""
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"share of the displacement {share:g}: must be from 0 to 1")
        old, new, height = self._matched(share)
        moving, standing = self._parts
        polygons = [polygon for polygon, _ in standing]
        soils = [self.before.soils[number] for _, number in standing]
        names = [self._name(number) for _, number in standing]
        for polygon, number in moving:
            polygons.append(self._moved(polygon, old, new, height))
            soils.append(self.before.soils[number])
            names.append(self._name(number))
        section = ClassicalSection(polygons, soils, self.before.ground, self.before.water, names)
        section = replace(section, water=water_line_after(self.before, section))
        base = np.unique(np.concatenate([new[[0, -1]], self._corners(new[0], new[-1])]))
        return Stage(
            share=share,
            section=section,
            slip=Polyline(np.column_stack([base, self.base(base)])),
            origin=lambda x: np.interp(x, new, old),
            destination=lambda x: np.interp(x, old, new),
            surface=np.column_stack([new, self.base(new) + height]),
        )

    def slices(
        self,
        stage: Stage,
        *,
        form: WaterForm = "buoyant",
        base: BaseStrength = "weaker",
        count: int = 200,
    ) -> Slices:
        """Slices of the moving mass at a stage.

        Args:
            stage: from `section`.
            form: how water is taken into account.
            base: whose strength a base has. `place`: of the soil that lay there before, S_r where
                none lay; `carried`: of the soil that came there with its column; `weaker`: S_r
                where either is liquefied (shear stays in the weaker of the two), else `place`.
            count: of slices, about.
        """

        def carried(x: np.ndarray) -> np.ndarray:
            start = stage.origin(x)
            return self.before.zone_at(start, self.base(start) + 1e-3)

        def weaker(x: np.ndarray) -> np.ndarray:
            here, came = self.before.zone_at(x, self.base(x) + 1e-3), carried(x)
            return np.where(self._liquefied[came], came, here)

        corners = self.slip.points
        borders = [
            self.before.crossings_with(a, b) for a, b in zip(corners, corners[1:], strict=False)
        ]
        moved = stage.destination(np.concatenate([self.before.extent, corners[:, 0], *borders]))
        return cut(
            stage.section,
            stage.slip,
            self.side,
            form=form,
            count=count,
            strength_of=self.before,
            outside_liquefied=True,
            base_soil={"place": None, "carried": carried, "weaker": weaker}[base],
            stops=moved,
        )

    @cached_property
    def _liquefied(self) -> np.ndarray:
        """Whether each zone, and last what lies outside all of them, is liquefied."""
        return np.array([*(soil.liquefied for soil in self.before.soils), True])

    def _matched(self, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places of columns before and at `share`, and their heights then: (K,) each [m]."""
        before, after = self._columns
        # Nodes of both sections, as shares of the area left of them.
        nodes = np.unique(np.concatenate([before.filled, after.filled]))
        old, late = before.place(nodes), after.place(nodes)
        early, last = before.height(old), self.area_factor * after.height(late)
        new = (1.0 - share) * old + share * late
        with np.errstate(divide="ignore"):
            height = 1.0 / ((1.0 - share) / early + share / last) if 0 < share < 1 else early
        if share == 1.0:
            height = last
        keep = np.append(True, np.diff(new) > 1e-9 * (new[-1] - new[0]))
        keep &= np.append(True, np.diff(old) > 0)
        return old[keep], new[keep], height[keep]

    def _moved(
        self, polygon: np.ndarray, old: np.ndarray, new: np.ndarray, height: np.ndarray
    ) -> np.ndarray:
        """A zone of the moving mass after its columns have moved: (V, 2) [m]."""
        x = np.clip(polygon[:, 0], old[0], old[-1])
        base = self.base(x)
        full = self.before.surface(x) - base
        with np.errstate(divide="ignore", invalid="ignore"):
            level = np.where(full > 1e-9, (polygon[:, 1] - base) / full, 0.0)
        place = np.interp(x, old, new)
        raised = np.clip(level, 0.0, 1.0) * np.interp(x, old, height)
        return np.column_stack([place, self.base(place) + raised])

    @cached_property
    def _parts(self) -> tuple[list[tuple[np.ndarray, int]], list[tuple[np.ndarray, int]]]:
        """Zones of the moving mass with dense edges, and those that stay; with their numbers."""
        left, right = self.slip.ends
        top = max(float(polygon[:, 1].max()) for polygon in self.before.polygons) + 1.0
        above = Polygon([*map(tuple, self.slip.points), (right, top), (left, top)])
        column = box(left, -1e9, right, 1e9)
        longest = EDGE_SHARE * (right - left)
        moving: list[tuple[np.ndarray, int]] = []
        standing: list[tuple[np.ndarray, int]] = []
        for number, polygon in enumerate(self.before.polygons):
            shape = Polygon(polygon)
            for part in _pieces(shape.intersection(above)):
                dense = shapely.segmentize(part, longest)
                moving.append((np.asarray(dense.exterior.coords)[:-1], number))
            rest = shape.difference(above)
            # Split at the ends of the slip surface, so that no part wraps around the mass.
            for half in (rest.intersection(column), rest.difference(column)):
                standing.extend(
                    (np.asarray(part.exterior.coords)[:-1], number) for part in _pieces(half)
                )
        return moving, standing

    def _corners(self, left: float, right: float) -> np.ndarray:
        """Places between `left` and `right` where what the mass slides on has a corner [m]."""
        ahead = [polygon[:, 0] for polygon in self.before.polygons]
        inside = self.slip.points[:, 0]
        outside = np.concatenate([*ahead, self.before.ground[:, 0]])
        outside = outside[(outside < inside[0]) | (outside > inside[-1])]
        x = np.concatenate([inside, outside])
        return x[(x > left) & (x < right)]

    def _name(self, number: int) -> str:
        return self.before.names[number] if self.before.names else str(number)


@dataclass(frozen=True)
class _Columns:
    """Heights of a mass at places x, and the share of its area that lies left of each."""

    x: np.ndarray
    heights: np.ndarray

    @cached_property
    def _sums(self) -> np.ndarray:
        strips = 0.5 * (self.heights[1:] + self.heights[:-1]) * np.diff(self.x)
        return np.concatenate([[0.0], np.cumsum(strips)])

    @property
    def total(self) -> float:
        """Area [m2]."""
        return float(self._sums[-1])

    @property
    def filled(self) -> np.ndarray:
        """Share of the area left of each place."""
        return self._sums / self.total

    @property
    def middle(self) -> float:
        """Centre of the area, x [m]."""
        strips = np.diff(self._sums)
        return float(strips @ (0.5 * (self.x[1:] + self.x[:-1])) / self.total)

    def place(self, share: np.ndarray) -> np.ndarray:
        """Where a share of the area lies to the left [m]; exact for straight surfaces."""
        number = np.clip(np.searchsorted(self.filled, share, side="right") - 1, 0, len(self.x) - 2)
        h0, h1 = self.heights[number], self.heights[number + 1]
        width = self.x[number + 1] - self.x[number]
        area = share * self.total - self._sums[number]
        slope = (h1 - h0) / width
        # slope/2 d^2 + h0 d = area, in the form that stays exact where the slope vanishes.
        root = np.sqrt(np.maximum(h0**2 + 2.0 * slope * area, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(h0 + root > 0, 2.0 * area / (h0 + root), 0.0)
        return self.x[number] + np.clip(step, 0.0, width)

    def height(self, x: np.ndarray) -> np.ndarray:
        """Height [m] at `x` [m]."""
        return np.interp(x, self.x, self.heights)


def _pieces(shape: shapely.Geometry) -> list[Polygon]:
    """The polygons of a shape that have an area worth the name."""
    parts = getattr(shape, "geoms", [shape])
    return [part for part in parts if isinstance(part, Polygon) and part.area > 1e-6]
