"""Sliding block: the soil over the bottom of what liquefied, between an active and a passive ramp.

Circles cannot follow a thin layer, along which most dams on a weak base slide. In: a section before
the slide. Out: the lowest factor of safety by the balance of forces (Janbu's simplified method) of
the surfaces that run along the bottom of the liquefied soil and up to the ground at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.ops import unary_union

from geometry.scenes.polygon_checks import on_verticals
from geometry.sides import Side, outward_of
from inversion.classical.limit_equilibrium import force_balance
from inversion.classical.section import ClassicalSection
from inversion.classical.slices import WaterForm, slice_at

#: Verticals at which the bottom of the liquefied soil is read, and places of either end of a block.
VERTICALS, ENDS = 400, 12
#: Slopes of the ramp behind a block (54 and 66 degrees) and before it (0 to 45 degrees).
BEHIND, BEFORE = (1.4, 2.25), (0.0, 0.5, 1.0)
#: Places at which a surface is looked for, and slices of it; fewer slices in a block are none.
PLACES, SLICES, LEAST = 200, 50, 5
#: Above the bottom of the layer, in heights of the section: within the layer, not on its border.
LIFT = 1e-3


@dataclass(frozen=True)
class Blocks:
    """Surfaces along the bottom of a layer, C of them.

    Attributes:
        x: places (n,) of the bottom; bottom: its elevations (n,) [m].
        front, back: ends of the blocks on it, x (C,) [m].
        climb, rise: slopes of the ramps before and behind, (C,).
        outward: -1 to the left, +1 to the right.
    """

    x: np.ndarray
    bottom: np.ndarray
    front: np.ndarray
    back: np.ndarray
    climb: np.ndarray
    rise: np.ndarray
    outward: float

    def level(self, places: np.ndarray) -> np.ndarray:
        """Elevations [m] of the surfaces at places x, (C, M) or (M,)."""
        front, back = self.front[:, None], self.back[:, None]
        ahead = np.maximum(self.outward * (places - front), 0.0)
        behind = np.maximum(self.outward * (back - places), 0.0)
        on_base = np.interp(np.clip(places, *np.sort([front, back], axis=0)), self.x, self.bottom)
        return on_base + self.climb[:, None] * ahead + self.rise[:, None] * behind

    def chosen(self, keep: np.ndarray) -> Blocks:
        """Some of them."""
        names = ("front", "back", "climb", "rise")
        return replace(self, **{name: getattr(self, name)[keep] for name in names})


def block_factor(section: ClassicalSection, side: Side, form: WaterForm) -> float:
    """The lowest factor of safety of a block on the liquefied soil; nan where there is no block.

    Args:
        section: before the slide, with its strengths.
        side: to which it slides.
        form: how water acts.
    """
    x, bottom = _bottom(section)
    if not len(x):
        return float("nan")
    ends = np.linspace(x[0], x[-1], ENDS)
    outward = outward_of(side)
    front, back, climb, rise = (
        one.ravel() for one in np.meshgrid(ends, ends, BEFORE, BEHIND, indexing="ij")
    )
    ahead = outward * (front - back) > 0.0
    blocks = Blocks(x, bottom, front, back, climb, rise, outward).chosen(ahead)
    places = np.linspace(*section.extent, PLACES)
    under = blocks.level(places) < section.surface(places)
    whole = (under.sum(axis=1) >= LEAST) & (np.diff(under, axis=1).sum(axis=1) <= 2)
    blocks, under = blocks.chosen(whole), under[whole]
    if not whole.any():
        return float("nan")
    first = np.maximum(under.argmax(axis=1) - 1, 0)
    last = np.minimum(PLACES - under[:, ::-1].argmax(axis=1), PLACES - 1)
    edges = np.linspace(places[first], places[last], SLICES + 1, axis=1)
    base = np.minimum(blocks.level(edges), section.surface(edges))
    base = np.maximum(base, section.ground_level(edges))
    slices = slice_at(section, edges, base, side, form=form, outside_liquefied=True)
    factor = force_balance(slices)
    return float(np.nanmin(factor)) if np.isfinite(factor).any() else float("nan")


def _bottom(section: ClassicalSection) -> tuple[np.ndarray, np.ndarray]:
    """The lowest liquefied soil: places x (n,) and elevations (n,) [m], a hair above its border."""
    zones = zip(section.polygons, section.soils, strict=True)
    liquefied = [Polygon(outline) for outline, soil in zones if soil.liquefied]
    if not liquefied:
        return np.zeros(0), np.zeros(0)
    whole = unary_union(liquefied)
    height = np.ptp(np.concatenate(list(section.polygons))[:, 1])
    left, _, right, _ = whole.bounds
    x = np.linspace(left, right, VERTICALS + 2)[1:-1]
    cut = on_verticals(whole, x)
    there = ~shapely.is_empty(cut)
    return x[there], shapely.bounds(cut[there])[:, 1] + LIFT * height
