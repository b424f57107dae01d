"""Slices on a slip surface: the forces that every method of limit equilibrium starts from.

In: a `ClassicalSection`, a slip surface (polyline or circle), the side to which the mass slides.
Out: `Slices`, arrays whose last axis runs over the slices from left to right; leading axes are
other slip surfaces, so that a search is one call.

Water is taken into account in one of two ways, never both:

- `buoyant`: weights are w = gamma h - gamma_w h_submerged, and no water pressure acts anywhere;
- `pore_pressure`: weights are total, pore pressure acts on the slip surface, water pressure on the
  surface of the soil, on the outer ends of the mass and, between slices, on their sides.

In still water the two are equal; where the water line falls through the soil, `pore_pressure` has
the seepage force and the thrust of the pool that `buoyant` leaves out. SI units, per metre of
width.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from geometry.sides import Side
from inversion.classical.section import OUTSIDE, WATER_UNIT_WEIGHT, ClassicalSection

WaterForm = Literal["buoyant", "pore_pressure"]

#: Number of slices of a single slip surface, in addition to those that its corners ask for.
SLICES = 200


@dataclass(frozen=True)
class Polyline:
    """A slip surface through given points; x ascending.

    Attributes:
        points: (P, 2) [m].
    """

    points: np.ndarray

    @property
    def ends(self) -> tuple[float, float]:
        """Left and right end, x [m]."""
        return float(self.points[0, 0]), float(self.points[-1, 0])

    def level(self, x: np.ndarray | float) -> np.ndarray:
        """Elevation [m] at `x` [m]; level beyond the ends."""
        return np.interp(x, self.points[:, 0], self.points[:, 1])


@dataclass(frozen=True)
class Circle:
    """The lower arc of a circle, between two places where it meets the surface.

    Attributes:
        x, y: centre [m].
        radius: [m].
        left, right: ends of the arc, x [m].
    """

    x: float
    y: float
    radius: float
    left: float
    right: float

    @property
    def ends(self) -> tuple[float, float]:
        """Left and right end, x [m]."""
        return self.left, self.right

    def level(self, x: np.ndarray | float) -> np.ndarray:
        """Elevation [m] of the lower arc at `x` [m]."""
        inside = np.maximum(self.radius**2 - (np.asarray(x, dtype=float) - self.x) ** 2, 0.0)
        return self.y - np.sqrt(inside)


SlipSurface = Polyline | Circle


@dataclass(frozen=True)
class Slices:
    """Forces and strengths of slices; every array has the shape (..., n) unless it says otherwise.

    Inclinations count positive where the base falls in the direction of the slide; `downhill` is
    -1 for a slide to the left and +1 to the right. Horizontal forces are positive downhill.

    Attributes:
        x: centres of the slices [m].
        width: [m].
        base: elevation of the middle of the base [m].
        angle: inclination of the base [rad].
        length: of the base [m].
        weight: total or buoyant, by `form`, with the water that stands on the slice [N/m].
        pore: water pressure on the base [Pa]; 0 where weights are buoyant.
        push: horizontal force of free water on the surface and on the ends of the mass [N/m].
        push_moment: integral of that force times its elevation [N].
        side_water: horizontal force of the water in the neighbouring slices on the slice [N/m].
        cohesion: [Pa]; of liquefied soil the value in the scene, with a strength ratio that at the
            depth of the base.
        friction: tangent of the friction angle; nil where the base is liquefied.
        liquefied: True where the strength of the base is the S_r to be found.
        zone: number of the zone at the base, `OUTSIDE` beyond the section.
        mass: total, with the water in the pores, without the pool [kg/m].
        centre: elevation of the centre of the soil above the base [m].
        downhill: -1 or +1.
        form: how water is taken into account.
    """

    x: np.ndarray
    width: np.ndarray
    base: np.ndarray
    angle: np.ndarray
    length: np.ndarray
    weight: np.ndarray
    pore: np.ndarray
    push: np.ndarray
    push_moment: np.ndarray
    side_water: np.ndarray
    cohesion: np.ndarray
    friction: np.ndarray
    liquefied: np.ndarray
    zone: np.ndarray
    mass: np.ndarray
    centre: np.ndarray
    downhill: int
    form: WaterForm

    def with_strength(
        self, residual_strength: float | np.ndarray, *, others: float = 1.0
    ) -> Slices:
        """A copy with S_r [Pa] on the liquefied bases, and the other strengths times `others`."""
        strength = np.asarray(residual_strength, dtype=float)
        if strength.ndim:
            strength = strength[..., None]
        return replace(
            self,
            cohesion=np.where(self.liquefied, strength, others * self.cohesion),
            friction=others * self.friction,
        )


def cut(
    section: ClassicalSection,
    slip: SlipSurface,
    side: Side,
    *,
    form: WaterForm = "buoyant",
    count: int = SLICES,
    strength_of: ClassicalSection | None = None,
    outside_liquefied: bool = False,
    base_soil: Callable[[np.ndarray], np.ndarray] | None = None,
    stops: np.ndarray | None = None,
) -> Slices:
    """Cut the mass above one slip surface into slices.

    Slices end at the corners of the slip surface and where it passes from one zone into another;
    in between they are of about equal width.

    Args:
        section: the soil.
        slip: the slip surface.
        side: to which the mass slides.
        form: how water is taken into account.
        count: of slices, about.
        strength_of: a section whose zones decide the strength along the slip surface (the section
            before the slide, say, while `section` is a later one); None: `section` itself.
        outside_liquefied: bases outside every zone have the strength S_r (ground that the
            liquefied soil overran); otherwise they are an error.
        base_soil: number of the zone (of `strength_of`) whose strength a base at x has, instead of
            the zone that lies there.
        stops: more places x at which slices end [m].
    """
    strength_of = strength_of or section
    left, right = slip.ends
    corners = slip.points if isinstance(slip, Polyline) else _arc(slip, count)
    borders = [strength_of.crossings_with(a, b) for a, b in zip(corners, corners[1:], strict=False)]
    fixed = corners[:, 0] if isinstance(slip, Polyline) else np.array([left, right])
    given = [] if stops is None else [stops]
    stops = np.unique(np.concatenate([fixed, strength_of.extent, *borders, *given]))
    stops = stops[(stops >= left) & (stops <= right)]
    stops = stops[np.append(True, np.diff(stops) > 1e-9 * (right - left))]
    parts = np.maximum(np.ceil(np.diff(stops) / (right - left) * count - 1e-9), 1).astype(int)
    edges = np.concatenate(
        [
            np.linspace(a, b, n, endpoint=False)
            for a, b, n in zip(stops, stops[1:], parts, strict=False)
        ]
        + [stops[-1:]]
    )
    return slice_at(
        section,
        edges,
        slip.level(edges),
        side,
        form=form,
        strength_of=strength_of,
        outside_liquefied=outside_liquefied,
        base_soil=base_soil,
    )


def slice_at(
    section: ClassicalSection,
    edges: np.ndarray,
    base: np.ndarray,
    side: Side,
    *,
    form: WaterForm = "buoyant",
    strength_of: ClassicalSection | None = None,
    outside_liquefied: bool = False,
    base_soil: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Slices:
    """Slices between given edges.

    Args:
        section: the soil.
        edges: x of the slices' edges, (..., n + 1) [m], ascending.
        base: elevation of the slip surface there, (..., n + 1) [m].
        side: to which the mass slides.
        form: how water is taken into account.
        strength_of: the section whose zones decide the strength of the base.
        outside_liquefied: see `cut`.
        base_soil: see `cut`.

    Raises:
        ValueError: a base lies outside every zone and `outside_liquefied` is False.
    """
    strength_of = strength_of or section
    downhill = -1 if side == "left" else 1
    x = 0.5 * (edges[..., 1:] + edges[..., :-1])
    middle = 0.5 * (base[..., 1:] + base[..., :-1])
    width, rise = np.diff(edges), np.diff(base)
    column = section.column(x, middle)
    if base_soil is None:
        # Just above the base: a slip surface on the rigid base is in the soil that lies on it.
        lift = np.minimum(1e-3, 0.01 * np.maximum(column.thickness, 1e-6))
        zone = strength_of.zone_at(x, middle + lift)
        # A chord may rise out of the soil where the arc ends: it is in what lies just below.
        above = (zone == OUTSIDE) & (column.thickness <= 0.0)
        if above.any():
            under = strength_of.zone_at(x[above], (middle - 0.02 * width)[above])
            zone[above] = under
    else:
        zone = base_soil(x)
    outside = zone == OUTSIDE
    if np.any(outside) and not outside_liquefied:
        place = x[outside].flat[0]
        raise ValueError(f"the slip surface leaves the soil at x = {place:.4g} m")
    cohesion, friction, liquefied = _strengths(strength_of, zone)
    ratio = np.array([*(soil.ratio for soil in strength_of.soils), 0.0])[zone]
    if ratio.any():
        before = column if strength_of is section else strength_of.column(x, middle)
        cohesion = np.maximum(cohesion, ratio * np.maximum(before.buoyant_weight, 0.0))
    submerged = _hydrostatics(section, edges, base, x, middle, downhill, form)
    load = column.weight if form == "pore_pressure" else column.buoyant_weight
    thick = np.maximum(column.thickness, 1e-12)
    return Slices(
        x=x,
        width=width,
        base=middle,
        angle=np.arctan2(-downhill * rise, width),
        length=np.hypot(width, rise),
        weight=load * width + submerged["standing"],
        pore=submerged["pore"],
        push=submerged["push"],
        push_moment=submerged["push_moment"],
        side_water=submerged["side_water"],
        cohesion=cohesion,
        friction=friction,
        liquefied=liquefied,
        zone=zone,
        mass=column.mass * width,
        centre=np.where(column.thickness > 0, column.first_moment / thick, middle),
        downhill=downhill,
        form=form,
    )


def _strengths(
    section: ClassicalSection, zone: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cohesion, tangent of friction, liquefied, of zones by number; outside is liquefied."""
    cohesion = np.array([*(soil.cohesion for soil in section.soils), 0.0])
    friction = np.array([*(soil.friction for soil in section.soils), 0.0])
    liquefied = np.array([*(soil.liquefied for soil in section.soils), True])
    friction[liquefied] = 0.0
    return cohesion[zone], friction[zone], liquefied[zone]


def _hydrostatics(
    section: ClassicalSection,
    edges: np.ndarray,
    base: np.ndarray,
    x: np.ndarray,
    middle: np.ndarray,
    downhill: int,
    form: WaterForm,
) -> dict[str, np.ndarray]:
    """Water pressures and forces on slices; all nil where weights are buoyant.

    Pressure is hydrostatic below the water line. On a face from y1 to y2 the horizontal force is
    the integral of gamma_w (level - y) dy, exact for straight faces.
    """
    if form == "buoyant" or section.water is None:
        names = ("standing", "pore", "push", "push_moment", "side_water")
        return {name: np.zeros(x.shape) for name in names}
    level, surface = section.water_level(edges), section.surface(edges)
    surface = np.maximum(surface, base)
    deep = np.maximum(level - surface, 0.0)
    force, moment = _thrust(level, deep)
    push = -downhill * np.diff(force)
    push_moment = -downhill * np.diff(moment)
    # Water next to the soil, from the base to the surface.
    whole, whole_moment = _thrust(level, np.maximum(level - base, 0.0))
    inner, inner_moment = whole - force, whole_moment - moment
    # The left end is pushed to the right (uphill for a slide to the left), the right end back.
    for end, outward in ((0, 1.0), (-1, -1.0)):
        push[..., end] += downhill * outward * inner[..., end]
        push_moment[..., end] += downhill * outward * inner_moment[..., end]
    between = -downhill * np.diff(inner)
    between[..., 0] -= downhill * inner[..., 0]
    between[..., -1] += downhill * inner[..., -1]
    return {
        "standing": WATER_UNIT_WEIGHT * 0.5 * (deep[..., 1:] + deep[..., :-1]) * np.diff(edges),
        "pore": WATER_UNIT_WEIGHT * np.maximum(section.water_level(x) - middle, 0.0),
        "push": push,
        "push_moment": push_moment,
        "side_water": between,
    }


def _thrust(level: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force of still water on a vertical face from `level` down to `depth`, and force times y."""
    level = np.where(np.isfinite(level), level, 0.0)
    force = 0.5 * WATER_UNIT_WEIGHT * depth**2
    return force, force * (level - 2.0 / 3.0 * depth)


def _arc(circle: Circle, count: int) -> np.ndarray:
    """Points (count + 1, 2) on an arc [m]."""
    x = np.linspace(circle.left, circle.right, count + 1)
    return np.column_stack([x, circle.level(x)])
