"""Random embankment dams around the sections of case histories.

The templates (a) to (e) of the paper have one density, half of them lean on a wall, and few have a
pool. These dams stand free: layered shells on both sides of a core, a cap, sometimes a starter dike
at the foot; one or several of the lower zones are liquefied; a pool on one side, whose line falls
through the core or through the dam. Slopes, core, levels and strengths hold those of the San
Fernando dams and of La Marquesa; none of them is copied. What these have besides, layers and dikes
along the faces, is in `hydraulic_fill_dam`. A dam follows from (seed, index) alone.
"""

from __future__ import annotations

from geometry.random_scenes.sketch import Point
from geometry.random_scenes.standing_dam import (
    HEIGHT,
    Soil,
    Width,
    across,
    first_valid,
    log_uniform,
    materials_of,
    standing_dam,
)
from geometry.scenes.scene import Scene
from pipeline.random_numbers import Stream

#: Horizontal over vertical of either face, and of the core's; lengths in heights of the dam.
FACE, CORE_FACE = (1.2, 3.4), (0.1, 0.8)
#: Width of the crest, and of the core at its top.
CREST, CORE_TOP = (0.1, 0.7), (0.08, 0.4)
#: Strength of a clay core or cap [rho g height], evenly over its logarithm.
CLAY = (0.05, 0.5)
#: Friction angle of a shell [deg].
FRICTION = (26.0, 44.0)
#: Chance that a zone is liquefied.
LIQUEFIED = {
    "first_lower": 0.85,
    "first_upper": 0.45,
    "other_lower": 0.35,
    "other_upper": 0.12,
    "core": 0.15,
}

# Stream of these scenes, apart from those of the templates.
_DAM = 71


def draw_dam(seed: int, index: int, spacing: float) -> Scene:
    """Draw an embankment dam.

    Args:
        seed: with the index, decides the scene entirely.
        index: number of the scene, from 0.
        spacing: between the material points [m]; everything scales with it. Each zone is wide
            enough for twice this spacing as well.
    """
    return first_valid(_drawn, (seed, _DAM, index), spacing)


def _drawn(stream: Stream, index: int, spacing: float) -> Scene:
    height = spacing * log_uniform(stream, *HEIGHT)
    faces = [stream.uniform(*FACE), stream.uniform(*FACE)]
    crest, top = stream.uniform(*CREST), stream.uniform(*CORE_TOP)
    core_faces = [stream.uniform(*CORE_FACE), stream.uniform(*CORE_FACE)]
    cap, middle = stream.uniform(0.5, 0.85), stream.uniform(0.2, 0.45)
    dike = stream.unit() < 0.4
    dike_width, dike_height = stream.uniform(0.25, 0.7), stream.uniform(0.3, 1.0)
    shift = stream.uniform(-0.3, 0.3) * crest
    # Half-widths at a level y, left and right of the core's axis.
    core_at = [lambda y, s=s: 0.5 * top + (cap - y) * core_faces[s] for s in (0, 1)]
    sign = (-1.0, 1.0)
    face_at = [lambda y, s=s: 0.5 * crest + sign[s] * shift + (1.0 - y) * faces[s] for s in (0, 1)]
    # A core never comes nearer to a face than this share of the face's way from the axis.
    inner = [lambda y, s=s: min(core_at[s](y), 0.72 * face_at[s](y)) for s in (0, 1)]

    zones: list[tuple[str, list[Point]]] = []
    for side, name in enumerate(("first", "other")):
        outer: Width = face_at[side]
        if side == 0 and dike:
            reach = min(dike_height, 1.0) * middle
            slope = dike_width * (face_at[0](0.0) - inner[0](0.0)) / max(reach, 0.1)
            outer = _behind_dike(face_at[0], inner[0], slope, reach)
            foot = [(-face_at[0](0.0), 0.0), (-outer(0.0), 0.0), (-face_at[0](reach), reach)]
            zones.append(("dike", foot))
        lower = across(side, 0.0, middle, inner[side], outer)
        if side == 0 and dike and reach < middle:
            corner = (-face_at[0](reach), reach)
            lower.insert(_place_of_face(lower), corner)
        zones.append((f"{name}_lower", lower))
        zones.append((f"{name}_upper", across(side, middle, cap, inner[side], face_at[side])))
    zones.append(
        (
            "core",
            [
                (-inner[0](0.0), 0.0),
                (inner[1](0.0), 0.0),
                (inner[1](middle), middle),
                (inner[1](cap), cap),
                (-inner[0](cap), cap),
                (-inner[0](middle), middle),
            ],
        )
    )
    zones.append(
        (
            "cap",
            [
                (-face_at[0](cap), cap),
                (-inner[0](cap), cap),
                (inner[1](cap), cap),
                (face_at[1](cap), cap),
                (face_at[1](1.0), 1.0),
                (-face_at[0](1.0), 1.0),
            ],
        )
    )
    materials = materials_of(stream, height, zones, _soil)
    name = f"dam_{index:05d}"
    return standing_dam(stream, name, spacing, height, zones, materials, inner, face_at)


def _behind_dike(face: Width, core: Width, slope: float, reach: float) -> Width:
    """Outer limit of the fill behind a dike that ends at the face at `reach`."""
    return lambda y: (
        face(y) - max(reach - y, 0.0) * min(slope, 0.75 * (face(0.0) - core(0.0)) / reach)
    )


def _place_of_face(points: list[Point]) -> int:
    """Where in the outline of the lower fill of the first side the end of its dike belongs."""
    far = max(range(len(points)), key=lambda i: (points[i][1], -points[i][0]))
    return far + 1


def _soil(stream: Stream, name: str, residual: float) -> Soil:
    chance, clay, own = stream.unit(), stream.unit(), stream.uniform(0.7, 1.4)
    strong, friction = log_uniform(stream, *CLAY), stream.uniform(*FRICTION)
    cohesion = stream.uniform(0.0, 0.01)
    if chance < LIQUEFIED.get(name, 0.0):
        return Soil(0.0, residual * own, liquefied=True)
    if (name == "core" and clay < 0.75) or (name == "cap" and clay < 0.4):
        return Soil(0.0, strong, liquefied=False)
    return Soil(friction, cohesion, liquefied=False)
