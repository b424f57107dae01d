"""Template (h): an embankment on a layer that liquefies and goes on to both sides.

A road, a railway or a levee on level ground: a loose layer, more often than not under a crust, a
stiffer layer below it in half of the draws, and a fill in one or two lifts. Both ends are far
boundaries, so the toe is that of the fill. Side slopes of 1 : 1.5 to 1 : 3 are those of roads and
levees in use (USACE EM 1110-2-1913 takes 1 : 2 for the steepest of a new levee); all other ranges
are assumed. A section follows from (seed, index) and the most points alone.
"""

from __future__ import annotations

from geometry.random_scenes.going_on import (
    LIQUEFIED_ROWS,
    THINNEST,
    first_sound,
    section_that_goes_on,
    thickness,
    whole_steps,
)
from geometry.random_scenes.sketch import Point
from geometry.random_scenes.standing_dam import Soil, log_uniform, materials_of
from geometry.scenes.scene import Scene
from pipeline.random_numbers import Stream

#: Height of the fill over spacing; lengths below in heights of the fill.
HEIGHT = (9.0, 18.0)
#: Horizontal over vertical of either face; width of the crest.
FACE, CREST = (1.5, 3.0), (0.4, 2.0)
#: Thickness of the loose layer.
LOOSE = (0.15, 0.8)
#: Share of the sections with a crust on it, and with a stiffer layer below; their thicknesses.
CRUST_SHARE, CRUST = 0.6, (0.08, 0.3)
STIFF_SHARE, STIFF = 0.5, (0.15, 0.5)
#: Ground that is drawn beyond either foot.
REACH = (5.0, 8.0)
#: Share of the fills in two lifts, and the top of the lower one.
TWO_SHARE, LOWER = 0.5, (0.35, 0.65)
#: Share of the lower lifts right on the loose layer that liquefy with it.
LOWER_LIQUEFIED_SHARE = 0.25
#: Residual strength [rho g height], evenly over its logarithm; 0.19 bears the fill on deep ground.
RESIDUAL = (0.025, 0.14)
#: Share of the lifts, and of the crusts, that are clay; their undrained strength [rho g height].
CLAYS, CLAY = {"fill": 0.3, "crust": 0.6}, (0.06, 0.3)
#: Friction angle of fills and crusts, and of the stiffer layer [deg].
FRICTION, STIFF_FRICTION = (28.0, 40.0), (33.0, 42.0)
#: Shares: no water; a table below the ground; pools on both sides; the rest a pool on one side.
DRY_SHARE, TABLE_SHARE, POOLS_SHARE = 0.2, 0.4, 0.15
#: Depth of a water table below the ground; depth of a pool on one side, and on both.
TABLE, POOL, POOLS = (0.02, 0.12), (0.25, 0.85), (0.1, 0.5)

# Stream of these scenes, apart from those of other families.
_FOUNDATION = 73


def draw_embankment_on_foundation(seed: int, index: int, spacing: float, max_points: int) -> Scene:
    """Draw an embankment on a foundation.

    Args:
        seed: with the index, decides the scene entirely.
        index: number of the scene, from 0.
        spacing: between the material points [m]; everything scales with it. The loose layer has
            four rows of points, and each zone is wide enough for twice this spacing as well.
        max_points: sections with more material points are drawn again.

    Raises:
        InputError: so few points are allowed that no draw keeps to them.
    """
    return first_sound(_drawn, (seed, _FOUNDATION, index), spacing, max_points)


def _drawn(stream: Stream, index: int, spacing: float) -> Scene:
    height = spacing * log_uniform(stream, *HEIGHT)
    slopes, crest = [stream.uniform(*FACE), stream.uniform(*FACE)], stream.uniform(*CREST)
    loose = thickness(stream, LOOSE, height, spacing, LIQUEFIED_ROWS)
    crust = thickness(stream, CRUST, height, spacing, THINNEST)
    stiff = thickness(stream, STIFF, height, spacing, THINNEST)
    reach = [stream.uniform(*REACH), stream.uniform(*REACH)]
    crust = crust if stream.unit() < CRUST_SHARE else 0.0
    stiff = stiff if stream.unit() < STIFF_SHARE else 0.0
    two, lower = stream.unit() < TWO_SHARE, stream.uniform(*LOWER)
    with_it = stream.unit() < LOWER_LIQUEFIED_SHARE and crust == 0.0

    foot = slopes[0] + crest + slopes[1]
    left = -reach[0]
    right = left + whole_steps(reach[0] + foot + reach[1], height, spacing)
    # Tops of the layers, from the ground down; each goes from end to end.
    layers = {"crust": (-crust, 0.0), "loose": (-crust - loose, -crust)}
    layers["stiff"] = (-crust - loose - stiff, -crust - loose)
    zones: list[tuple[str, list[Point]]] = [
        (name, [(left, low), (right, low), (right, high), (left, high)])
        for name, (low, high) in layers.items()
        if high > low
    ]
    levels = [0.0, lower, 1.0] if two else [0.0, 1.0]
    for number, (low, high) in enumerate(zip(levels, levels[1:], strict=False)):
        outline = [
            (slopes[0] * low, low),
            (foot - slopes[1] * low, low),
            (foot - slopes[1] * high, high),
            (slopes[0] * high, high),
        ]
        zones.append((f"fill_{number + 1}", outline))

    def soil(stream: Stream, name: str, residual: float) -> Soil:
        return _soil(stream, name, residual, liquefies=name == "fill_1" and two and with_it)

    materials = materials_of(stream, height, zones, soil, RESIDUAL)
    line = _line(stream, slopes, foot, crest, left, right)
    name = f"foundation_{index:05d}"
    return section_that_goes_on(
        stream, name, spacing, height, zones, materials, line, ("left", "right")
    )


def _soil(stream: Stream, name: str, residual: float, *, liquefies: bool) -> Soil:
    """The soil of a zone; every zone takes as many numbers from the stream."""
    kind = name.partition("_")[0]
    chance, own, density = stream.unit(), stream.uniform(0.8, 1.25), stream.uniform(0.95, 1.05)
    clay, friction = log_uniform(stream, *CLAY), stream.uniform(*FRICTION)
    firm, cohesion = stream.uniform(*STIFF_FRICTION), stream.uniform(0.0, 0.01)
    if kind == "loose" or liquefies:
        return Soil(0.0, residual * own, liquefied=True, density=density)
    if chance < CLAYS.get(kind, 0.0):
        return Soil(0.0, clay, liquefied=False, density=density)
    angle = firm if kind == "stiff" else friction
    return Soil(angle, cohesion, liquefied=False, density=density)


def _line(
    stream: Stream, slopes: list[float], foot: float, crest: float, left: float, right: float
) -> list[Point] | None:
    """Phreatic line from end to end [heights]; None: no water."""
    kind, depth = stream.unit(), stream.uniform(*TABLE)
    deep, shallow = stream.uniform(*POOL), stream.uniform(*POOLS)
    if kind < DRY_SHARE:
        return None
    if kind < DRY_SHARE + TABLE_SHARE:
        return [(left, -depth), (right, -depth)]
    if kind < DRY_SHARE + TABLE_SHARE + POOLS_SHARE:
        return [(left, shallow), (right, shallow)]
    # A levee: from where the pool meets its face to the other foot.
    return [(left, deep), (slopes[0] * deep, deep), (foot, 0.0), (right, -depth)]
