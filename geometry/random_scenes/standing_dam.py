"""A dam that stands free on open ground: what all random dams of this kind share.

In: outlines and materials of a dam, in heights from its axis. Out: its scene, on level or sloping
ground, with or without a pool, as drawn or as its mirror image.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pydantic import ValidationError

from geometry.random_scenes.materials import GRAVITY, POISSON_RATIO
from geometry.random_scenes.sketch import Point
from geometry.scenes.scene import Scene
from pipeline.cli import InputError
from pipeline.random_numbers import Stream

#: Height over spacing; lengths below in heights.
HEIGHT = (10.0, 26.0)
#: Share of the dams with a pool; its level over the height.
POOL_SHARE, POOL = 0.75, (0.3, 0.93)
#: Share of the dams on sloping ground, and the steepest slope there.
SLOPING_SHARE, SLOPE = 0.3, 0.05
#: Density [kg/m3]; Young's modulus [MPa].
DENSITY, STIFFNESS = (1700.0, 2200.0), (20.0, 60.0)
#: Residual strength of liquefied soil [rho g height], evenly over its logarithm.
RESIDUAL = (0.01, 0.25)
#: Draws after which something is wrong with the ranges.
MOST_DRAWS = 200

#: Half-width at a level, left and right of the axis [heights].
Width = Callable[[float], float]
Sides = Sequence[Width]


@dataclass(frozen=True)
class Soil:
    """What a zone is made of.

    Attributes:
        friction_deg: angle [deg].
        cohesion: [rho g height].
        liquefied: it is; cohesion is its residual strength.
        density: over that of the dam.
    """

    friction_deg: float
    cohesion: float
    liquefied: bool
    density: float = 1.0


#: Draws a scene from a stream, its number and the spacing [m].
Draw = Callable[[Stream, int, float], Scene]


def first_valid(
    draw: Draw,
    key: tuple[int, ...],
    spacing: float,
    suits: Callable[[Scene], bool] | None = None,
    hint: str = "",
) -> Scene:
    """The first draw that is a section at the spacing and at twice that.

    Args:
        draw: a scene from a stream, its number and the spacing; the stream is named by the key and
            the number of the try.
        key: whole numbers; the last is that of the scene.
        spacing: between the material points [m].
        suits: what else a section must be; None: nothing.
        hint: of the error, for the user.

    Raises:
        InputError: none in `MOST_DRAWS` draws.
    """
    for attempt in range(MOST_DRAWS):
        try:
            scene = draw(Stream(*key, attempt), key[-1], spacing)
            if suits is not None and not suits(scene):
                continue
            scene.changed(spacing=2.0 * spacing)
        except ValidationError:  # a zone is a sliver
            continue
        return scene
    raise InputError(f"section {key[-1]}: none of {MOST_DRAWS} draws is valid{hint}")


def log_uniform(stream: Stream, low: float, high: float) -> float:
    """A number evenly spread over its logarithm."""
    return math.exp(stream.uniform(math.log(low), math.log(high)))


def across(side: int, low: float, high: float, near: Width, far: Width) -> list[Point]:
    """Outline of a zone between two levels and two half-widths, on the left (0) or right (1)."""
    sign = 1.0 if side else -1.0
    points = [(near(low), low), (far(low), low), (far(high), high), (near(high), high)]
    points = [(sign * x, y) for x, y in points]
    return points if side else points[::-1]


def materials_of(
    stream: Stream,
    height: float,
    zones: list[tuple[str, list[Point]]],
    soil_of: Callable[[Stream, str, float], Soil],
    residual_range: tuple[float, float] = RESIDUAL,
) -> dict[str, dict]:
    """Materials of the zones of a dam, by their names.

    Args:
        stream: that they are drawn from.
        height: of the dam [m].
        zones: names and outlines.
        soil_of: draws the soil of a zone, from its name and the residual strength of the dam's
            liquefied soil [rho g height].
        residual_range: of that strength, evenly over its logarithm [rho g height].
    """
    density = stream.uniform(*DENSITY)
    stiffness = log_uniform(stream, *STIFFNESS)
    unit_kpa = density * GRAVITY * height / 1000.0
    residual = log_uniform(stream, *residual_range)
    soils = {name: soil_of(stream, name, residual) for name, _ in zones}
    return {
        name: {
            "friction_deg": round(soil.friction_deg, 3),
            "cohesion_kpa": round(unit_kpa * soil.cohesion, 4),
            "density": round(density * soil.density, 1),
            "youngs_modulus_mpa": round(stiffness, 2),
            "poisson_ratio": POISSON_RATIO,
            "liquefied": soil.liquefied,
        }
        for name, soil in soils.items()
    }


def standing_dam(
    stream: Stream,
    name: str,
    spacing: float,
    height: float,
    zones: list[tuple[str, list[Point]]],
    materials: dict[str, dict],
    core: Sides,
    faces: Sides,
) -> Scene:
    """The scene of a dam.

    Args:
        stream: that ground, side and water are drawn from.
        name: of the scene: what kind of dam, and its number.
        spacing: between the material points [m].
        height: of the dam [m].
        zones: names and outlines [heights from the axis and from the ground].
        materials: of the zones, by their names.
        core: half-widths of the core, where the water falls.
        faces: half-widths of the dam.
    """
    tilt = stream.uniform(-SLOPE, SLOPE) if stream.unit() < SLOPING_SHARE else 0.0
    mirror = -1.0 if stream.unit() < 0.5 else 1.0
    base = [(-faces[0](0.0) - 12.0, 0.0), (faces[1](0.0) + 12.0, 0.0)]
    line = _line(stream, core, faces, -faces[0](0.0) - 8.0, faces[1](0.0) + 8.0)

    def placed(point: Point, *, tilted: bool = True) -> Point:
        x, y = mirror * point[0], point[1]
        y += tilt * x if tilted else 0.0
        return round(height * (x + 15.0), 4), round(height * (y + 2.0), 4)

    def turned(points: list[Point]) -> list[Point]:
        return points if mirror > 0 else points[::-1]

    return Scene.model_validate(
        {
            "name": name,
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
    )


def _line(
    stream: Stream, core: Sides, faces: Sides, left: float, right: float
) -> list[Point] | None:
    """Phreatic line of a pool on the left, or on both sides, in heights; None: no water."""
    wet, level = stream.unit() < POOL_SHARE, stream.uniform(*POOL)
    kind, tail = stream.unit(), stream.uniform(0.0, 0.25)
    if not wet:
        return None
    start = -core[0](level)
    if kind < 0.15:
        return [(left, level), (right, level)]
    tail = min(tail if kind < 0.4 else 0.0, 0.9 * level)
    end = core[1](tail) if kind < 0.7 else faces[1](tail)
    return [(left, level), (start, level), (end, tail), (right, tail)]
