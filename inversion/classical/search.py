"""Search for slip surfaces: circles, and polylines through the liquefied zone.

In: a section, and where the surface may begin and end. Out: the critical surface: the one with the
lowest factor of safety, or the one that needs the highest S_r to stand. All surfaces of a round
are computed in one call; the grid is then narrowed around the best.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.sides import Side
from inversion.classical.limit_equilibrium import bishop, required_strength
from inversion.classical.section import ClassicalSection
from inversion.classical.slices import Circle, Polyline, WaterForm, slice_at
from pipeline.cli import WorkFailed
from pipeline.ties import largest_place, ranked

#: Slices of a surface during a search.
SLICES = 60
#: Grid points per unknown, and rounds of narrowing.
GRID, ROUNDS = 13, 4
#: The same for polylines, whose Spencer's method is dear.
POLYLINE_GRID = 8


@dataclass(frozen=True)
class FoundCircle:
    """A critical circle and the value that makes it so (a factor of safety, or an S_r in Pa)."""

    circle: Circle
    value: float
    tried: int


@dataclass(frozen=True)
class FoundPolyline:
    """A critical polyline and the S_r [Pa] that it needs."""

    polyline: Polyline
    strength: float
    tried: int


def critical_circle(
    section: ClassicalSection,
    side: Side,
    *,
    head: tuple[float, float],
    toe: tuple[float, float],
    form: WaterForm = "buoyant",
    wanted: Literal["factor", "strength"] = "factor",
    rounds: int = ROUNDS,
) -> FoundCircle:
    """The critical circle by Bishop's method.

    Args:
        section: the soil.
        side: to which the mass slides.
        head: smallest and largest x of the upper end [m].
        toe: smallest and largest x of the lower end [m].
        form: how water is taken into account.
        wanted: `factor`: the lowest factor of safety; `strength`: the highest S_r for FS = 1.
        rounds: grids of circles, each finer than the one before.

    Raises:
        WorkFailed: no circle in the ranges stays within the soil.
    """
    ranges = np.array([head, toe, (0.03, 0.60)], dtype=float)
    widest = ranges.copy()
    best, best_value, tried = None, np.inf, 0
    for _ in range(rounds):
        numbers = [np.linspace(low, high, GRID) for low, high in ranges]
        x_head, x_toe, sag = (a.ravel() for a in np.meshgrid(*numbers, indexing="ij"))
        circles = _circles(section, x_head, x_toe, sag)
        values = _circle_values(section, circles, side, form, wanted)
        tried += int(np.isfinite(values).sum())
        if np.isfinite(values).any():
            place = largest_place(-values)
            if values[place] < best_value:
                best_value = float(values[place])
                best = Circle(*(float(part[place]) for part in circles))
                middle = np.array([x_head[place], x_toe[place], sag[place]])
        if best is None:
            break
        half = np.diff(ranges, axis=1)[:, 0] / GRID * 1.5
        ranges = np.column_stack([middle - half, middle + half])
        ranges = np.clip(ranges, widest[:, :1], widest[:, 1:])
    if best is None:
        raise WorkFailed("no circle between the given ends stays within the soil")
    return FoundCircle(best, best_value if wanted == "factor" else -best_value, tried)


def critical_polyline(
    section: ClassicalSection,
    side: Side,
    *,
    toe: float,
    head: float,
    head_level: float,
    foot_range: tuple[float, float],
    not_above: Polyline | None = None,
    form: WaterForm = "buoyant",
) -> FoundPolyline:
    """The surface along the rigid base and up a bent ramp that needs the highest S_r to stand.

    It runs along the base from the toe to a foot, from there to a corner and on to the head. The
    unknowns are the foot and the corner. The ordinary method ranks the surfaces, Spencer's decides
    between the best.

    Args:
        section: the soil.
        side: to which the mass slides.
        toe: lower end, x [m].
        head: upper end, x [m].
        head_level: elevation of the upper end [m].
        foot_range: smallest and largest x of the place where the surface leaves the base [m].
        not_above: the surface after the slide, which must nowhere lie below the slip surface.
        form: how water is taken into account.

    Raises:
        WorkFailed: no such surface stays within the soil.
    """
    ranges = np.array([foot_range, (0.2, 0.8), (0.0, 1.0)], dtype=float)
    widest = ranges.copy()
    best, tried = None, 0
    for _ in range(ROUNDS):
        numbers = [np.linspace(low, high, POLYLINE_GRID) for low, high in ranges]
        foot, along, bend = (a.ravel() for a in np.meshgrid(*numbers, indexing="ij"))
        surfaces = _polylines(section, toe, foot, along, bend, head, head_level)
        keep = _within(section, surfaces, not_above)
        if not keep.any():
            break
        surfaces, chosen = surfaces[keep], np.column_stack([foot, along, bend])[keep]
        edges = np.sort(surfaces[:, [0, -1], 0], axis=1)
        edges = edges[:, :1] + np.diff(edges, axis=1) * np.linspace(0.0, 1.0, 2 * SLICES + 1)
        base = _levels(surfaces, edges)
        slices = slice_at(section, edges, base, side, form=form, outside_liquefied=True)
        strength = required_strength(slices, "ordinary")
        tried += len(strength)
        if not np.isfinite(strength).any():
            break
        known = np.where(np.isfinite(strength), strength, np.nan)
        top = ranked(range(len(known)), known.__getitem__)[:24]
        few = slice_at(section, edges[top], base[top], side, form=form, outside_liquefied=True)
        exact = required_strength(few, "spencer")
        if np.isfinite(exact).any():
            place = largest_place(exact)
            if best is None or exact[place] > best[0]:
                best = (float(exact[place]), surfaces[top[place]], chosen[top[place]])
        if best is None:
            break
        half = np.diff(ranges, axis=1)[:, 0] / POLYLINE_GRID * 1.5
        ranges = np.column_stack([best[2] - half, best[2] + half])
        ranges = np.clip(ranges, widest[:, :1], widest[:, 1:])
    if best is None:
        raise WorkFailed("no slip surface along the base and up to the head stays within the soil")
    points = best[1][np.argsort(best[1][:, 0])]
    points = points[np.append(True, np.diff(points[:, 0]) > 1e-6)]
    return FoundPolyline(Polyline(points), best[0], tried)


# --- circles ---


def _circles(
    section: ClassicalSection, x_head: np.ndarray, x_toe: np.ndarray, sag: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Centres, radii and ends of arcs by their ends on the surface and sag / chord: (C,) each."""
    y_head, y_toe = section.surface(x_head), section.surface(x_toe)
    chord = np.hypot(x_head - x_toe, y_head - y_toe)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = chord * (0.25 + sag**2) / (2.0 * sag)
        # From the middle of the chord upwards across it, away from the arc.
        rise = radius - sag * chord
        nx, ny = (y_head - y_toe) / chord, -(x_head - x_toe) / chord
        up = np.where(ny < 0, -1.0, 1.0)
        x = 0.5 * (x_head + x_toe) + up * rise * nx
        y = 0.5 * (y_head + y_toe) + up * rise * ny
    return x, y, radius, np.minimum(x_head, x_toe), np.maximum(x_head, x_toe)


def _circle_values(
    section: ClassicalSection,
    circles: tuple[np.ndarray, ...],
    side: Side,
    form: WaterForm,
    wanted: str,
) -> np.ndarray:
    """The objective to minimise, of each circle; nan where it is not a slip surface."""
    x, y, radius, left, right = circles
    good = np.isfinite(radius) & (right - left > 1e-3)
    good &= (x - radius <= left + 1e-9) & (x + radius >= right - 1e-9)
    good &= (y >= section.surface(left) - 1e-9) & (y >= section.surface(right) - 1e-9)
    values = np.full(len(x), np.nan)
    if not good.any():
        return values
    chosen = tuple(part[good] for part in circles)
    x, y, radius, left, right = (part[:, None] for part in chosen)
    edges = left + (right - left) * np.linspace(0.0, 1.0, SLICES + 1)
    base = y - np.sqrt(np.maximum(radius**2 - (edges - x) ** 2, 0.0))
    room = section.surface(edges) - base
    inside = (room[:, 1:-1] > 0).all(axis=1)
    inside &= (base >= section.ground_level(edges) - 1e-6).all(axis=1)
    if not inside.any():
        return values
    slices = slice_at(section, edges[inside], base[inside], side, form=form, outside_liquefied=True)
    circle = Circle(*(part[inside] for part in chosen))
    if wanted == "factor":
        found = bishop(slices, circle)
    else:
        found = -required_strength(slices, "bishop", circle)
    values[np.flatnonzero(good)[inside]] = found
    return values


# --- polylines ---


def _polylines(
    section: ClassicalSection,
    toe: float,
    foot: np.ndarray,
    along: np.ndarray,
    bend: np.ndarray,
    head: float,
    head_level: float,
) -> np.ndarray:
    """Toe, foot, corner and head of each surface: (C, 4, 2) [m].

    The corner lies at the share `along` of the way from foot to head; `bend` 0 puts it onto the
    straight line, 1 onto the level of the foot.
    """
    one = np.ones(foot.shape)
    foot_level = section.ground_level(foot)
    corner = foot + along * (head - foot)
    level = foot_level + along * (head_level - foot_level) * (1.0 - bend)
    x = np.stack([toe * one, foot, corner, head * one], axis=1)
    y = np.stack([section.ground_level(toe) * one, foot_level, level, head_level * one], axis=1)
    return np.stack([x, y], axis=2)


def _levels(surfaces: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Elevation of every polyline (C, P, 2) at its own places (C, M)."""
    return np.stack(
        [
            np.interp(places, *points[np.argsort(points[:, 0])].T)
            for places, points in zip(x, surfaces, strict=True)
        ]
    )


def _within(
    section: ClassicalSection, surfaces: np.ndarray, not_above: Polyline | None
) -> np.ndarray:
    """Which polylines stay in the soil, and under the surface after the slide."""
    ends = np.sort(surfaces[:, [0, -1], 0], axis=1)
    x = ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, 81)[1:-1]
    base = _levels(surfaces, x)
    keep: np.ndarray = np.all(base <= section.surface(x), axis=1)
    keep &= (base >= section.ground_level(x) - 1e-6).all(axis=1)
    if not_above is not None:
        keep &= (base <= not_above.level(x) + 1e-6).all(axis=1)
    return keep
