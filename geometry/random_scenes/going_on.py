"""A section whose ground goes on beyond one end or both: what all random ones share.

In: outlines, materials and water of a section, in heights of its fill or dam. Out: its scene with
far boundaries, as drawn or as its mirror image.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from geometry.random_scenes.sketch import Point
from geometry.random_scenes.standing_dam import Draw, first_valid
from geometry.scenes.doubts import thin_layers
from geometry.scenes.fill import point_count
from geometry.scenes.scene import Scene
from geometry.sides import Side
from pipeline.random_numbers import Stream

#: Thinnest layer that may liquefy, and any other zone [spacings]: four rows of points, and as wide
#: as a run at twice the spacing needs.
LIQUEFIED_ROWS, THINNEST = 4.2, 2.3
#: Decimals of coordinates (0.1 mm).
DECIMALS = 4
#: Far ends lie so many spacings apart, times a whole number: whole cells at twice the spacing too.
END_STEP = 4


def first_sound(draw: Draw, key: tuple[int, ...], spacing: float, max_points: int) -> Scene:
    """`first_valid`, of no more material points, and with enough in what may liquefy.

    Args:
        draw: a scene from a stream, its number and the spacing.
        key: whole numbers; the last is that of the scene.
        spacing: between the material points [m].
        max_points: most material points of the scene.

    Raises:
        InputError: none in as many draws as are made.
    """

    def suits(scene: Scene) -> bool:
        return point_count(scene) <= max_points and not thin_layers(scene)

    hint = f" with at most {max_points} material points; see geometry.max_points"
    return first_valid(draw, key, spacing, suits, hint)


def thickness(
    stream: Stream, span: tuple[float, float], height: float, spacing: float, rows: float
) -> float:
    """Thickness of a layer [heights], of at least so many rows of points.

    Args:
        stream: one number is taken from it.
        span: least and most [heights].
        height: of the fill or dam [m].
        spacing: between the material points [m].
        rows: least thickness [spacings]; it wins over both limits.
    """
    least = max(span[0], rows * spacing / height)
    return stream.uniform(least, max(span[1], least))


def section_that_goes_on(
    stream: Stream,
    name: str,
    spacing: float,
    height: float,
    zones: list[tuple[str, list[Point]]],
    materials: dict[str, dict],
    line: list[Point] | None,
    far: Sequence[Side],
) -> Scene:
    """The scene of a section.

    Args:
        stream: one number is taken from it: whether it is mirrored.
        name: of the scene: what kind of section, and its number.
        spacing: between the material points [m].
        height: of the fill or dam [m].
        zones: names and outlines [heights]; the base is level at the lowest vertex.
        materials: of the zones, by their names.
        line: phreatic line, x ascending [heights]; None: no water.
        far: sides on which the ground goes on, before mirroring.
    """
    mirror = -1.0 if stream.unit() < 0.5 else 1.0
    corners = [(mirror * x, y) for _, polygon in zones for x, y in polygon]
    left, right = min(x for x, _ in corners), max(x for x, _ in corners)
    base = min(y for _, y in corners)

    def placed(point: Point) -> Point:
        """In metres from the left end of the section."""
        return round(height * (mirror * point[0] - left), DECIMALS), round(
            height * point[1], DECIMALS
        )

    def turned(points: list[Point]) -> list[Point]:
        return points if mirror > 0 else points[::-1]

    length = round(height * (right - left), DECIMALS)
    floor = round(height * base, DECIMALS)
    opposite: dict[Side, Side] = {"left": "right", "right": "left"}
    ends = [side if mirror > 0 else opposite[side] for side in far]
    # A free side has room for the deposit; open walls give way beyond it.
    room = round(5.0 * height, DECIMALS)
    x_min = 0.0 if "left" in ends else -room
    x_max = length if "right" in ends else length + room
    return Scene.model_validate(
        {
            "name": name,
            "domain": {
                "x_min": x_min,
                "x_max": x_max,
                "y_max": round(height * 5.0, DECIMALS),
                "walls": "open",
                **{side: "far" if side in ends else "free" for side in opposite},
            },
            "ground": {"points": [(x_min, floor), (x_max, floor)]},
            "zones": [
                {
                    "name": zone,
                    "polygon": [placed(p) for p in turned(polygon)],
                    "material": zone,
                }
                for zone, polygon in zones
            ],
            "materials": materials,
            "water_level": None
            if line is None
            else round(height * max(y for _, y in line), DECIMALS),
            "phreatic_line": None if line is None else [placed(p) for p in turned(line)],
            "spacing": spacing,
        }
    )


def whole_steps(length: float, height: float, spacing: float) -> float:
    """A length between two far ends, enlarged to whole `END_STEP` spacings [heights].

    Far boundaries lie whole cells apart (`Scene`); with such a length none is moved.
    """
    step = END_STEP * spacing / height
    return step * math.ceil(length / step - 1e-9)
