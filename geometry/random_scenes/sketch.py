"""Sketch drawn by a template: outlines and soils, before materials are drawn and the size is set.

Lengths are template metres: those of Table A.1, for the large scale. `templates` scales them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from geometry.random_scenes.materials import Soil
from pipeline.config import BlockSettings
from pipeline.random_numbers import Stream

Point = tuple[float, float]

#: Elevation of the level base of templates (a) to (d), Table A.1.
BASE = 2.0


@dataclass(frozen=True)
class Frame:
    """The room a template draws in, in template metres."""

    width: float
    height: float
    spacing: float
    cell: float
    blocks: BlockSettings

    @property
    def level_base(self) -> list[Point]:
        """The base of templates (a) to (d), from wall to wall."""
        return [(0.0, BASE), (self.width, BASE)]

    @property
    def top(self) -> float:
        """Highest elevation of soil: one cell under the top of the domain."""
        return self.height - self.cell


@dataclass(frozen=True)
class Outline:
    """One zone: polygon counter-clockwise."""

    name: str
    soil: Soil
    polygon: list[Point]
    velocity: Point = (0.0, 0.0)


@dataclass(frozen=True)
class Sketch:
    """A drawn scene without materials."""

    outlines: list[Outline]
    ground: list[Point]
    crest: float | None = None
    """Elevation that a pool stays below; None = no pool (template (e))."""
    seepage: tuple[Point, Point] | None = None
    """Where the water table falls when the pool stands on the left alone: from the pool's level at
    x of the first point to the second."""


#: A template: from random numbers and a room to a sketch.
Template = Callable[[Stream, Frame], Sketch]


def between(start: Point, end: Point, share: float) -> Point:
    """The point at `share` of the way from `start` to `end`."""
    return (
        start[0] + share * (end[0] - start[0]),
        start[1] + share * (end[1] - start[1]),
    )


def signed_area(polygon: Sequence[Point]) -> float:
    """Area [m2], positive for a counter-clockwise polygon."""
    following = [*polygon[1:], polygon[0]]
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(polygon, following, strict=True))


def perimeter(polygon: Sequence[Point]) -> float:
    """Length of the outline [m]."""
    following = [*polygon[1:], polygon[0]]
    return sum(
        ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5
        for a, b in zip(polygon, following, strict=True)
    )


def is_simple(polygon: Sequence[Point]) -> bool:
    """Whether no two edges cross and no two neighbouring vertices coincide."""
    count = len(polygon)
    edges = [(polygon[i], polygon[(i + 1) % count]) for i in range(count)]
    if any(start == end for start, end in edges):
        return False
    for i in range(count):
        for j in range(i + 2, count):
            if (i, j) != (0, count - 1) and _cross(*edges[i], *edges[j]):
                return False
    return True


def inside_convex(polygon: Sequence[Point], point: Point) -> bool:
    """Whether a point lies inside a convex counter-clockwise polygon."""
    following = [*polygon[1:], polygon[0]]
    return all(_turn(a, b, point) > 0.0 for a, b in zip(polygon, following, strict=True))


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether the closed segments ab and cd meet."""
    return _turn(a, b, c) * _turn(a, b, d) <= 0.0 and _turn(c, d, a) * _turn(c, d, b) <= 0.0
