"""Template (d): a slope with an inner quadrilateral of its own soil (Fig. 3d, Table A.1d)."""

from __future__ import annotations

from geometry.random_scenes.materials import SOILS, Soil
from geometry.random_scenes.sketch import (
    BASE,
    Frame,
    Outline,
    Point,
    Sketch,
    inside_convex,
    signed_area,
)
from pipeline.random_numbers import Stream

#: Corners at which the ring is cut, for every way of cutting it into two, three or four zones.
CUTS = ((0, 2), (1, 3), (0, 1, 2), (1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2, 3))


def sketch(stream: Stream, frame: Frame) -> Sketch:
    """Draw a random slope; the numbers in brackets are the vertices of Table A.1d.

    The inner corners [4] to [7] are put in order around their centre. The ring between the outer
    and the inner quadrilateral is cut at two to four corners into as many zones; every zone draws
    its soil. A sketch whose cuts cross the inner zone is not valid, and `templates` draws again.
    """
    p0, p1 = (stream.uniform(50.0, 70.0), BASE), (stream.uniform(170.0, 180.0), BASE)
    p2 = (stream.uniform(90.0, 110.0), stream.uniform(37.0, 47.0))
    p3 = (stream.uniform(130.0, 150.0), stream.uniform(37.0, 47.0))
    outer = [p0, p1, p3, p2]
    inner = _paired(outer, _in_order([_inside(stream, outer) for _ in range(4)]))
    cuts = CUTS[stream.integer(0, len(CUTS) - 1)]
    outlines = [Outline("inner", _any_soil(stream), inner)]
    for number, (start, end) in enumerate(zip(cuts, [*cuts[1:], cuts[0]], strict=True)):
        corners = [start]
        while corners[-1] != end:
            corners.append((corners[-1] + 1) % 4)
        ring = [outer[i] for i in corners] + [inner[i] for i in reversed(corners)]
        outlines.append(Outline(f"ring_{number + 1}", _any_soil(stream), ring))
    return Sketch(outlines=outlines, ground=frame.level_base, crest=min(p2[1], p3[1]))


def _any_soil(stream: Stream) -> Soil:
    return SOILS[stream.integer(1, 3) - 1]


def _inside(stream: Stream, polygon: list[Point]) -> Point:
    """A random point inside a convex polygon, every place equally likely."""
    x_values, y_values = [x for x, _ in polygon], [y for _, y in polygon]
    while True:
        point = (
            stream.uniform(min(x_values), max(x_values)),
            stream.uniform(min(y_values), max(y_values)),
        )
        if inside_convex(polygon, point):
            return point


def _in_order(points: list[Point]) -> list[Point]:
    """Points counter-clockwise around their mean, by comparing slopes within half planes."""
    centre = (sum(x for x, _ in points) / len(points), sum(y for _, y in points) / len(points))

    def angle_like(point: Point) -> float:
        # Grows with the angle from -1 to 3 without an arc tangent.
        x, y = point[0] - centre[0], point[1] - centre[1]
        size = abs(x) + abs(y)
        return 0.0 if size == 0.0 else (y / size if x >= 0.0 else 2.0 - y / size)

    return sorted(points, key=angle_like)


def _paired(outer: list[Point], inner: list[Point]) -> list[Point]:
    """Turn the inner corners so that each is as near as possible to the outer one of its number."""

    def distance(turned: list[Point]) -> float:
        return sum(
            (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 for a, b in zip(outer, turned, strict=True)
        )

    if signed_area(inner) < 0.0:
        return inner
    return min((inner[i:] + inner[:i] for i in range(4)), key=distance)
