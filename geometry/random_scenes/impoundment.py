"""Template (i): an upstream tailings dam, drawn as far as into its impoundment.

Dikes one on the other, each partly on the tailings that the one before has held back (the upstream
method), or one shell of sand; behind them tailings in layers, of which some liquefy. The tailings
go on: their end is a far boundary, and the toe is on the other side, on firm ground. Most have
water: a pond behind a beach, or a table below the tailings, which falls to a starter dike that
drains or does not. Faces of 1 : 1.5 to 1 : 4 and beaches that fall by 0.5 to 1 % towards the pond
are usual (Vick 1990, Planning, Design, and Analysis of Tailings Dams); all other ranges are
assumed. A section follows from (seed, index) and the most points alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from geometry.random_scenes.going_on import (
    LIQUEFIED_ROWS,
    first_sound,
    section_that_goes_on,
    thickness,
)
from geometry.random_scenes.sketch import Point, between
from geometry.random_scenes.standing_dam import Soil, log_uniform, materials_of
from geometry.scenes.scene import Scene
from pipeline.random_numbers import Stream

#: Height of the dam over spacing; lengths below in heights of the dam.
HEIGHT = (13.0, 26.0)
#: Share of the dams with one shell; its face (horizontal over vertical), crest and base.
SHELL_SHARE, SHELL_FACE, SHELL_CREST, SHELL_BASE = 0.3, (2.5, 4.0), (0.25, 0.5), (0.8, 1.8)
#: Of a starter dike: height, crest, outer and inner face.
STARTER, STARTER_CREST = (0.2, 0.4), (0.12, 0.3)
STARTER_FACE, INNER_FACE = (1.5, 2.5), (1.5, 2.2)
#: Most raises; their crests and outer faces; benches, as shares of the crest below.
RAISES, RAISE_CREST, RAISE_FACE, BENCH = 4, (0.1, 0.25), (1.8, 3.0), (0.0, 0.8)
#: Tailings drawn behind the crest; the fall of the beach there, and how far it begins below the
#: crest.
REACH, BEACH, FREEBOARD = (5.0, 7.0), (0.005, 0.01), (0.045, 0.09)
#: Chance that a layer of tailings is liquefied: the top one, and the others; if none, the lowest.
LIQUEFIED_TOP, LIQUEFIED = 0.35, 0.85
#: Residual strength [rho g height], evenly over its logarithm: about 0.04 to 0.2 of the effective
#: stress at the base.
RESIDUAL = (0.02, 0.1)
#: Share of the other layers that are clay-like slimes; their undrained strength [rho g height].
SLIMES_SHARE, SLIMES = 0.25, (0.05, 0.25)
#: Friction angle of tailings and of dikes [deg].
FRICTION, DIKE_FRICTION = (27.0, 35.0), (30.0, 40.0)
#: Shares: no water; a pond on the drawing; the rest a table, at a depth at the far end.
DRY_SHARE, POND_SHARE, TABLE = 0.1, 0.35, (0.03, 0.2)
#: Where the pond begins, from the crest to the far end; share of the starter dikes that drain, and
#: the level behind those that do not, over their height.
POND_FROM, DRAINED_SHARE, UNDRAINED = (0.25, 0.8), 0.5, (0.5, 0.9)

# Stream of these scenes, apart from those of other families.
_IMPOUNDMENT = 74


def draw_impoundment(seed: int, index: int, spacing: float, max_points: int) -> Scene:
    """Draw a tailings dam with a part of its impoundment.

    Args:
        seed: with the index, decides the scene entirely.
        index: number of the scene, from 0.
        spacing: between the material points [m]; everything scales with it. Layers of tailings
            have four rows of points, and each zone is wide enough for twice this spacing as well.
        max_points: sections with more material points are drawn again.

    Raises:
        InputError: so few points are allowed that no draw keeps to them.
    """
    return first_sound(_drawn, (seed, _IMPOUNDMENT, index), spacing, max_points)


def _drawn(stream: Stream, index: int, spacing: float) -> Scene:
    height = spacing * log_uniform(stream, *HEIGHT)
    thinnest = LIQUEFIED_ROWS * spacing / height
    low = thickness(stream, STARTER, height, spacing, LIQUEFIED_ROWS)
    reach, fall = stream.uniform(*REACH), stream.uniform(*BEACH)
    freeboard = stream.uniform(*FREEBOARD)
    # Top of the tailings at the far end, where the layer that ends with the crest is thinnest.
    top = 1.0 - freeboard - fall * reach
    levels = _levels(stream, low, top, thinnest)
    beach = 1.0 - freeboard
    if stream.unit() < SHELL_SHARE:
        dikes, begins = _shell(stream, levels, beach)
        names = ["shell"]
    else:
        dikes, begins = _dikes(stream, levels, beach)
        names = ["starter", *(f"raise_{number}" for number in range(1, len(dikes)))]
    zones = list(zip(names, dikes, strict=True))
    end, count = begins[-1][1] + reach, len(begins)
    tops = [(high, high) for high in levels[1:-1]] + [(beach, top)]
    for number, ((at_bottom, at_top), bottom, (high, at_end)) in enumerate(
        zip(begins, levels, tops, strict=False)
    ):
        outline = [(at_bottom, bottom), (end, bottom), (end, at_end), (at_top, high)]
        zones.append((f"tailings_{number + 1}", outline))
    chances = [LIQUEFIED] * (count - 1) + [LIQUEFIED_TOP]
    wet = [n for n, chance in enumerate(chances, 1) if stream.unit() < chance] or [1]
    liquefied = {f"tailings_{n}" for n in wet}

    def soil(stream: Stream, name: str, residual: float) -> Soil:
        return _soil(stream, name, residual, liquefies=name in liquefied)

    materials = materials_of(stream, height, zones, soil, RESIDUAL)
    line = _line(stream, begins[0], levels[1], (begins[-1][1], beach), (end, top))
    name = f"impoundment_{index:05d}"
    return section_that_goes_on(stream, name, spacing, height, zones, materials, line, ("right",))


def _levels(stream: Stream, starter: float, top: float, thinnest: float) -> list[float]:
    """Limits of the layers, from the ground to the crest.

    The first layer ends with the starter dike, the last with the crest; at the far end it ends at
    `top`, and is no thinner than the others there.
    """
    count = stream.integer(1, max(1, min(RAISES, int((top - starter) / thinnest))))
    spare = top - starter - count * thinnest
    cuts = sorted(stream.unit() for _ in range(count - 1))
    inner = [starter + spare * cut + (n + 1) * thinnest for n, cut in enumerate(cuts)]
    return [0.0, starter, *inner, 1.0]


#: Outlines of the dikes, and where the tailings of each layer begin: x at its bottom and its top.
Dikes = tuple[list[list[Point]], list[tuple[float, float]]]


def _shell(stream: Stream, levels: Sequence[float], beach: float) -> Dikes:
    """One shell from the ground to the crest; its inner face leans over the tailings to the beach.

    The face has the vertices of the tailings: where two outlines are rounded apart, they would
    leave a crack.
    """
    face, crest = stream.uniform(*SHELL_FACE), stream.uniform(*SHELL_CREST)
    base, above = stream.uniform(*SHELL_BASE), stream.uniform(*INNER_FACE)
    sides = [(base + y / beach * (face + crest - base), y) for y in (*levels[:-1], beach)]
    inner_crest = (face + crest - above * (1.0 - beach), 1.0)
    begins = [(low[0], high[0]) for low, high in zip(sides, sides[1:], strict=False)]
    return [[(0.0, 0.0), *sides, inner_crest, (face, 1.0)]], begins


def _dikes(stream: Stream, levels: Sequence[float], beach: float) -> Dikes:
    """A starter dike and its raises, each from its outer foot, on the crest of the one below."""
    dikes: list[list[Point]] = []
    begins: list[tuple[float, float]] = []
    foot = 0.0
    for number, (low, high) in enumerate(zip(levels, levels[1:], strict=False)):
        crest = stream.uniform(*(RAISE_CREST if number else STARTER_CREST))
        face = stream.uniform(*(RAISE_FACE if number else STARTER_FACE))
        inner, bench = stream.uniform(*INNER_FACE), stream.uniform(*BENCH)
        outer_x = foot + face * (high - low)
        inner_x = outer_x + crest
        inner_foot = inner_x + inner * (high - low)
        # On the inner face of the last one the tailings end below the crest.
        ends = [(inner_x + inner * (high - beach), beach)] if high > beach else []
        dikes.append([(foot, low), (inner_foot, low), *ends, (inner_x, high), (outer_x, high)])
        begins.append((inner_foot, ends[0][0] if ends else inner_x))
        foot = outer_x + bench * crest
    return dikes, begins


def _soil(stream: Stream, name: str, residual: float, *, liquefies: bool) -> Soil:
    """The soil of a zone; every zone takes as many numbers from the stream."""
    chance, own, density = stream.unit(), stream.uniform(0.7, 1.4), stream.uniform(0.95, 1.05)
    slimes, friction = log_uniform(stream, *SLIMES), stream.uniform(*FRICTION)
    firm, cohesion = stream.uniform(*DIKE_FRICTION), stream.uniform(0.0, 0.01)
    if liquefies:
        return Soil(0.0, residual * own, liquefied=True, density=density)
    if not name.startswith("tailings"):
        return Soil(firm, cohesion, liquefied=False, density=density)
    if chance < SLIMES_SHARE:
        return Soil(0.0, slimes, liquefied=False, density=density)
    return Soil(friction, cohesion, liquefied=False, density=density)


def _line(
    stream: Stream, dike: tuple[float, float], starter: float, beach: Point, end: Point
) -> list[Point] | None:
    """Phreatic line from the firm ground in front to the far end [heights]; None: no water.

    Args:
        stream: five numbers are taken from it.
        dike: inner face of the starter dike, or of the shell: x at the bottom and at the top of
            the lowest layer of tailings.
        starter: top of that layer.
        beach: where the beach begins at the dike.
        end: and where it ends.
    """
    kind, begin, depth = stream.unit(), stream.uniform(*POND_FROM), stream.uniform(*TABLE)
    drained, share = stream.unit() < DRAINED_SHARE, stream.uniform(*UNDRAINED)
    if kind < DRY_SHARE:
        return None
    share = 0.0 if drained else share
    face = (dike[0] + share * (dike[1] - dike[0]), share * starter)
    line = [(-1.0, 0.0), (0.0, 0.0), face]
    if kind < DRY_SHARE + POND_SHARE:
        edge, level = between(beach, end, begin)
        return [*line, (edge, level), (end[0], level)]
    return [*line, (end[0], end[1] - depth)]
