"""Random embankment dams around the sections of case histories.

The templates (a) to (e) of the paper have one density, half of them lean on a wall, and few have a
pool. These dams stand free: layered shells on both sides of a core, a cap, sometimes a starter dike
at the foot; one or several of the lower zones are liquefied; a pool on one side, whose line falls
through the core or through the dam. Slopes, core, levels and strengths hold the San Fernando dams
and La Marquesa well inside; none of them is copied. A dam follows from (seed, index) alone.
"""

from __future__ import annotations

import math

from pydantic import ValidationError

from geometry.random_scenes.sketch import Point
from geometry.scenes.scene import Scene
from pipeline.cli import InputError
from pipeline.random_numbers import Stream

GRAVITY = 9.81
#: Height over spacing; lengths below in heights.
HEIGHT = (10.0, 26.0)
#: Horizontal over vertical of either face, and of the core's.
FACE, CORE_FACE = (1.2, 3.4), (0.1, 0.8)
#: Width of the crest, and of the core at its top.
CREST, CORE_TOP = (0.1, 0.7), (0.08, 0.4)
#: Residual strength of a liquefied zone [rho g height], evenly over its logarithm.
RESIDUAL = (0.01, 0.25)
#: Strength of a clay core or cap [rho g height], likewise.
CLAY = (0.05, 0.5)
#: Friction angle of a shell [deg]; density [kg/m3]; Young's modulus [MPa].
FRICTION, DENSITY, STIFFNESS = (26.0, 44.0), (1700.0, 2200.0), (20.0, 60.0)
#: Share of the dams with a pool; its level over the height.
POOL_SHARE, POOL = 0.75, (0.3, 0.93)
#: Share of the dams on sloping ground, and the steepest slope there.
SLOPING_SHARE, SLOPE = 0.3, 0.05
#: Chance that a zone is liquefied.
LIQUEFIED = {
    "first_lower": 0.85, "first_upper": 0.45, "other_lower": 0.35, "other_upper": 0.12,
    "core": 0.15,
}  # fmt: skip

#: Draws after which something is wrong with the ranges above.
MOST_DRAWS = 200

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
    for attempt in range(MOST_DRAWS):
        try:
            scene = _drawn(Stream(seed, _DAM, index, attempt), index, spacing)
            scene.changed(spacing=2.0 * spacing)
        except ValidationError:  # a zone is a sliver
            continue
        return scene
    raise InputError(f"dam {index}: no valid section in {MOST_DRAWS} draws")


def _drawn(stream: Stream, index: int, spacing: float) -> Scene:
    height = spacing * _log(stream, *HEIGHT)
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

    def across(side: int, low: float, high: float, near, far) -> list[Point]:
        points = [(near(low), low), (far(low), low), (far(high), high), (near(high), high)]
        points = [(sign[side] * x, y) for x, y in points]
        return points if side else points[::-1]

    zones: list[tuple[str, list[Point]]] = []
    for side, name in enumerate(("first", "other")):
        outer = face_at[side]
        if side == 0 and dike:
            reach = min(dike_height, 1.0) * middle
            slope = dike_width * (face_at[0](0.0) - inner[0](0.0)) / max(reach, 0.1)
            outer = _behind_dike(face_at[0], inner[0], slope, reach)
            foot = [
                (-face_at[0](0.0), 0.0), (-outer(0.0), 0.0), (-face_at[0](reach), reach)
            ]  # fmt: skip
            zones.append(("dike", foot))
        lower = across(side, 0.0, middle, inner[side], outer)
        if side == 0 and dike and reach < middle:
            corner = (-face_at[0](reach), reach)
            lower.insert(_place_of_face(lower), corner)
        zones.append((f"{name}_lower", lower))
        zones.append((f"{name}_upper", across(side, middle, cap, inner[side], face_at[side])))
    zones.append(("core", [
        (-inner[0](0.0), 0.0), (inner[1](0.0), 0.0), (inner[1](middle), middle),
        (inner[1](cap), cap), (-inner[0](cap), cap), (-inner[0](middle), middle),
    ]))  # fmt: skip
    zones.append(("cap", [
        (-face_at[0](cap), cap), (-inner[0](cap), cap), (inner[1](cap), cap),
        (face_at[1](cap), cap), (face_at[1](1.0), 1.0), (-face_at[0](1.0), 1.0),
    ]))  # fmt: skip
    materials = _materials(stream, height, [name for name, _ in zones])
    tilt = stream.uniform(-SLOPE, SLOPE) if stream.unit() < SLOPING_SHARE else 0.0
    mirror = -1.0 if stream.unit() < 0.5 else 1.0
    base = [(-face_at[0](0.0) - 12.0, 0.0), (face_at[1](0.0) + 12.0, 0.0)]
    left, right = -face_at[0](0.0) - 8.0, face_at[1](0.0) + 8.0
    line = _line(stream, inner, face_at, left, right)

    def placed(point: Point, *, tilted: bool = True) -> Point:
        x, y = mirror * point[0], point[1]
        y += tilt * x if tilted else 0.0
        return round(height * (x + 15.0), 4), round(height * (y + 2.0), 4)

    def turned(points: list[Point]) -> list[Point]:
        return points if mirror > 0 else points[::-1]

    return Scene.model_validate(
        {
            "name": f"dam_{index:05d}",
            "domain": {
                "x_min": 0.0,
                "x_max": round(height * 30.0, 4),
                "y_max": round(height * 5.0, 4),
                "walls": "open",
            },
            "ground": {"points": [placed(p) for p in turned(base)]},
            "zones": [
                {"name": name, "polygon": [placed(p) for p in turned(polygon)], "material": name}
                for name, polygon in zones
            ],
            "materials": materials,
            "water_level": None if line is None else placed(line[0], tilted=False)[1],
            "phreatic_line": None
            if line is None
            else [placed(p, tilted=False) for p in turned(line)],
            "spacing": spacing,
        }
    )  # fmt: skip


def _log(stream: Stream, low: float, high: float) -> float:
    return math.exp(stream.uniform(math.log(low), math.log(high)))


def _behind_dike(face, core, slope: float, reach: float):
    """Outer limit of the fill behind a dike that ends at the face at `reach`."""
    return lambda y: (
        face(y) - max(reach - y, 0.0) * min(slope, 0.75 * (face(0.0) - core(0.0)) / reach)
    )


def _place_of_face(points: list[Point]) -> int:
    """Where in the outline of the lower fill of the first side the end of its dike belongs."""
    far = max(range(len(points)), key=lambda i: (points[i][1], -points[i][0]))
    return far + 1


def _materials(stream: Stream, height: float, names: list[str]) -> dict[str, dict]:
    density = stream.uniform(*DENSITY)
    stiffness = _log(stream, *STIFFNESS)
    unit_kpa = density * GRAVITY * height / 1000.0
    residual = _log(stream, *RESIDUAL)
    found = {}
    for name in names:
        chance, clay, own = stream.unit(), stream.unit(), stream.uniform(0.7, 1.4)
        strong, friction = _log(stream, *CLAY), stream.uniform(*FRICTION)
        cohesion = stream.uniform(0.0, 0.01)
        liquefied = chance < LIQUEFIED.get(name, 0.0)
        if liquefied:
            friction, cohesion = 0.0, residual * own
        elif (name == "core" and clay < 0.75) or (name == "cap" and clay < 0.4):
            friction, cohesion = 0.0, strong
        found[name] = {
            "friction_deg": round(friction, 3),
            "cohesion_kpa": round(unit_kpa * cohesion, 4),
            "density": round(density, 1),
            "youngs_modulus_mpa": round(stiffness, 2),
            "poisson_ratio": 0.3,
            "liquefied": liquefied,
        }
    return found


def _line(stream: Stream, inner, face_at, left: float, right: float) -> list[Point] | None:
    """Phreatic line of a pool on the first side, or on both, in heights; None: no water."""
    wet, level = stream.unit() < POOL_SHARE, stream.uniform(*POOL)
    kind, tail = stream.unit(), stream.uniform(0.0, 0.25)
    if not wet:
        return None
    start = -inner[0](level)
    if kind < 0.15:
        return [(left, level), (right, level)]
    tail = min(tail if kind < 0.4 else 0.0, 0.9 * level)
    end = inner[1](tail) if kind < 0.7 else face_at[1](tail)
    return [(left, level), (start, level), (end, tail), (right, tail)]
