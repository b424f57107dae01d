"""Random dams of hydraulic fill, around the sections of the San Fernando dams.

The shells were washed in between two starter dikes and settled in layers, the clay in the middle
became the core, and a rolled cap was put on top: so each shell is cut into layers of their own
strengths, of which some liquefy, behind a dike along the face that does not. Core and cap are clay
more often than not, some of it weak enough to move with a slide. A dam follows from (seed, index)
alone.
"""

from __future__ import annotations

from geometry.random_scenes.sketch import Point
from geometry.random_scenes.standing_dam import (
    HEIGHT,
    Soil,
    across,
    first_valid,
    log_uniform,
    materials_of,
    standing_dam,
)
from geometry.scenes.scene import Scene
from pipeline.random_numbers import Stream

#: Horizontal over vertical of either face, and of the core's; lengths in heights of the dam.
FACE, CORE_FACE = (1.4, 3.4), (0.1, 0.9)
#: Width of the crest, and of the core under the cap.
CREST, CORE_TOP = (0.1, 0.7), (0.1, 0.6)
#: Top of the hydraulic fill.
FILL = (0.45, 0.85)
#: Most layers of a shell, and the thinnest [spacings]: the coarse run must resolve it.
LAYERS, THINNEST = 5, 2.3
#: Share of the caps in two layers, where there is room.
TWO_CAPS_SHARE = 0.6
#: Share of the faces with a starter dike, and its horizontal width.
DIKE_SHARE, DIKE = 0.6, (0.12, 0.5)
#: Share of the dams with a berm against the right face, its height and its width.
BERM_SHARE, BERM, BERM_WIDTH = 0.3, (0.3, 0.9), (0.3, 1.2)
#: Left and right; a pool stands on the left.
SHELLS = ("first", "other")
#: Chance that a layer of a shell, and a dike, is liquefied.
LIQUEFIED = {"first": 0.75, "other": 0.3, "dike": 0.08}
#: Chance that the core, and a layer of the cap, is clay; its undrained strength [rho g height].
CLAYS, CLAY = {"core": 0.8, "cap": 0.6}, (0.02, 0.4)
#: Friction angle [deg] of what has neither liquefied nor is clay; of dikes and berm.
FRICTION, DIKE_FRICTION = (26.0, 42.0), (30.0, 45.0)

# Stream of these scenes, apart from those of other dams.
_HYDRAULIC = 72


def draw_hydraulic_fill_dam(seed: int, index: int, spacing: float) -> Scene:
    """Draw a dam of hydraulic fill.

    Args:
        seed: with the index, decides the scene entirely.
        index: number of the scene, from 0.
        spacing: between the material points [m]; everything scales with it. Each zone is wide
            enough for twice this spacing as well.
    """
    return first_valid(_drawn, (seed, _HYDRAULIC, index), spacing)


def _drawn(stream: Stream, index: int, spacing: float) -> Scene:
    height = spacing * log_uniform(stream, *HEIGHT)
    thinnest = THINNEST * spacing / height
    slopes = [stream.uniform(*FACE), stream.uniform(*FACE)]
    crest, top = stream.uniform(*CREST), stream.uniform(*CORE_TOP)
    core_slopes = [stream.uniform(*CORE_FACE), stream.uniform(*CORE_FACE)]
    fill = stream.uniform(*FILL)
    levels = _levels(stream, fill, thinnest)
    dikes = [_dike(stream, levels), _dike(stream, levels)]
    faces = [lambda y, s=slope: 0.5 * crest + (1.0 - y) * s for slope in slopes]
    behind = [lambda y, s=s: faces[s](y) - dikes[s][0] for s in (0, 1)]
    # At least a third of the way from the axis to the dike is fill.
    core = [
        lambda y, s=s: min(0.5 * top + max(fill - y, 0.0) * core_slopes[s], 0.67 * behind[s](y))
        for s in (0, 1)
    ]
    zones: list[tuple[str, list[Point]]] = []
    for side, name in enumerate(SHELLS):
        dike_top = dikes[side][1]
        for number, (low, high) in enumerate(zip(levels, levels[1:], strict=False)):
            outer = behind[side] if high <= dike_top else faces[side]
            zones.append((f"{name}_{number + 1}", across(side, low, high, core[side], outer)))
        if dike_top > 0.0:
            strip = across(side, 0.0, dike_top, behind[side], faces[side])
            zones.append((f"dike_{side + 1}", strip))
    inner = [(-core[0](y), y) for y in reversed(levels)] + [(core[1](y), y) for y in levels]
    zones.append(("core", inner))
    middle = fill + (1.0 - fill) * stream.uniform(0.35, 0.65)
    two = stream.unit() < TWO_CAPS_SHARE and 1.0 - fill > 3.0 * thinnest
    caps = [fill, middle, 1.0] if two else [fill, 1.0]
    for number, (low, high) in enumerate(zip(caps, caps[1:], strict=False)):
        left, right = faces
        whole = [(-left(low), low), (right(low), low), (right(high), high), (-left(high), high)]
        zones.append((f"cap_{number + 1}", whole))
    rise, width = stream.uniform(*BERM), stream.uniform(*BERM_WIDTH)
    if stream.unit() < BERM_SHARE:
        foot = faces[1](0.0)
        zones.append(("berm", [(foot, 0.0), (foot + width, 0.0), (faces[1](rise), rise)]))
    materials = materials_of(stream, height, zones, _soil)
    name = f"hydraulic_{index:05d}"
    return standing_dam(stream, name, spacing, height, zones, materials, core, faces)


def _levels(stream: Stream, top: float, thinnest: float) -> list[float]:
    """Limits of the layers of the shells, from the ground to the top of the fill [heights]."""
    count = stream.integer(1, max(1, min(LAYERS, int(top / thinnest))))
    spare = top - count * thinnest
    cuts = sorted(stream.unit() for _ in range(count - 1))
    return [0.0, *(spare * cut + (n + 1) * thinnest for n, cut in enumerate(cuts)), top]


def _dike(stream: Stream, levels: list[float]) -> tuple[float, float]:
    """Width and top of a starter dike, which ends with a layer [heights]; zeros: there is none."""
    there, width = stream.unit() < DIKE_SHARE, stream.uniform(*DIKE)
    reach = stream.integer(1, len(levels) - 1)
    return (width, levels[reach]) if there else (0.0, 0.0)


def _soil(stream: Stream, name: str, residual: float) -> Soil:
    kind = name.rpartition("_")[0] or name
    chance, own, density = stream.unit(), stream.uniform(0.6, 1.6), stream.uniform(0.94, 1.08)
    clay, friction = log_uniform(stream, *CLAY), stream.uniform(*FRICTION)
    firm, cohesion = stream.uniform(*DIKE_FRICTION), stream.uniform(0.0, 0.005)
    if chance < LIQUEFIED.get(kind, 0.0):
        return Soil(0.0, residual * own, liquefied=True, density=density)
    if chance < CLAYS.get(kind, 0.0):
        return Soil(0.0, clay, liquefied=False, density=density)
    angle = firm if kind in ("dike", "berm") else friction
    return Soil(angle, cohesion, liquefied=False, density=density)
