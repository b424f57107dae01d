"""Checks on the polygons of a scene: simple, apart, above the ground, thick enough to be filled.

Everything here takes plain coordinates. A fault names the zone and the remedy, and says where it
is; `gaps` only reports, since a gap may be meant (template (e), a drain that is left out).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from shapely import (
    contains_xy,
    dwithin,
    get_coordinates,
    get_num_coordinates,
    intersection,
    linestrings,
    points,
    prepare,
)
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union
from shapely.validation import explain_validity

from pipeline.cli import InputError

Point = tuple[float, float]

#: Overlap of two zones, or part of a zone below the ground, taken for rounding; in point areas.
AREA_TOLERANCE = 0.5

#: By which a vertex on a wall may lie beyond it: units are converted in floating point [m].
ROUNDING = 1e-6

#: A zone must be wider than twice this share of the spacing: as wide as the spacing itself will do.
HALF = 0.499

#: Most pairs of vertices that lie in the same square of a spacing where an outline is shifted
#: inwards or outwards by half of one: the work and the memory that it takes grow with their number.
MOST_PAIRS = 100_000

#: Most places at which a zone is tried for being wide enough, before its outline is shifted.
MOST_TRIALS = 10_000

#: Most places for points in a domain: beyond it a laptop's memory ends.
MOST_PLACES = 5e7


@dataclass(frozen=True)
class Fault:
    """Something that is wrong with a section.

    Attributes:
        message: what, and the remedy.
        zones: names of those it concerns.
        places: where it is: outlines of one (a point) or more vertices [m].
    """

    message: str
    zones: tuple[str, ...] = ()
    places: tuple[tuple[Point, ...], ...] = ()


def ground_faults(points: Sequence[Point], y_max: float) -> Iterator[Fault]:
    """Points of the ground that reach the top of the domain."""
    for x, y in points:
        if y >= y_max:
            message = f"ground: point ({x:g}, {y:g}) is not below the domain's y_max {y_max:g}"
            yield Fault(message, places=(((x, y),),))


def zone_faults(
    polygons: Mapping[str, Sequence[Point]],
    *,
    box: tuple[float, float, float],
    ground: Sequence[Point],
    spacing: float,
) -> Iterator[Fault]:
    """Zones that cannot be filled: outside, not simple, a sliver, below the ground or on another.

    Args:
        polygons: zone name -> vertices in order [m].
        box: (x_min, x_max, y_max) of the domain [m].
        ground: polyline of the rigid base [m].
        spacing: distance between material points [m].
    """
    too_many = _too_many_places(box, ground, spacing)
    if too_many is not None:
        yield too_many
        return
    shapes = {}
    for name, vertices in polygons.items():
        outline = (tuple(vertices),)
        yield from _outside(name, vertices, box)
        shape = Polygon(vertices)
        if not shape.is_valid:
            reason = explain_validity(shape)
            place = re.search(r"\[(\S+) (\S+)\]", reason)
            places = outline if place is None else (((float(place[1]), float(place[2])),),)
            message = f"zones: zone {name!r} is not a simple polygon: {_in_words(reason)}"
            yield Fault(message, (name,), places)
        elif shape.area == 0:
            yield Fault(f"zones: zone {name!r} has no area", (name,), outline)
        else:
            shapes[name] = shape
            if not _is_wide(shape, spacing):
                yield Fault(_too_narrow(name, shape, spacing), (name,), outline)
    tolerance = AREA_TOLERANCE * spacing * spacing  # not a square, which may overflow
    yield from _below(shapes, ground, tolerance)
    yield from _overlapping(shapes, tolerance)


def _in_words(reason: str) -> str:
    """What GEOS says of an outline, as a person would."""
    what, _, place = reason.removesuffix("]").partition("[")
    at = f" at ({', '.join(f'{float(number):.6g}' for number in place.split())})" if place else ""
    known = {
        "Self-intersection": "it crosses itself",
        "Ring Self-intersection": "it touches itself",
    }
    return known.get(what, what) + at


def gaps(polygons: Mapping[str, Sequence[Point]], spacing: float) -> list[tuple[float, Point]]:
    """Find holes and cracks between zones.

    Args:
        polygons: zone name -> vertices in order [m].
        spacing: distance between material points [m]; cracks narrower than this are found.

    Returns:
        (area [m2], a point inside [m]) of each gap, the largest first.

    Raises:
        InputError: the outlines have too many vertices to look.
    """
    union = unary_union([Polygon(vertices) for vertices in polygons.values()])
    if is_crowded(union, spacing):
        raise InputError(
            f"gaps between zones: not looked for; the outlines have {get_num_coordinates(union)} "
            f"vertices, too many within one spacing of {spacing:g} m"
        )
    # Closing (grow, then shrink) fills holes and cracks up to one spacing wide and little else;
    # what it adds in concave outer corners stays below the tolerance.
    closed = union.buffer(0.5 * spacing, join_style="mitre").buffer(
        -0.5 * spacing, join_style="mitre"
    )
    added = closed.difference(union)
    holes = [Polygon(ring) for part in _parts(union) for ring in part.interiors]
    found = [*_parts(added), *holes]
    found = [part for part in _parts(unary_union(found)) if part.area > 0.01 * spacing**2]
    middles = [(part.area, part.representative_point()) for part in found]
    located = [(area, (float(place.x), float(place.y))) for area, place in middles]
    return sorted(located, key=lambda item: -item[0])


def is_crowded(shape: BaseGeometry, spacing: float) -> bool:
    """Whether an outline has more than `MOST_PAIRS` of vertices within squares of a spacing."""
    _, number = np.unique(np.floor(get_coordinates(shape) / spacing), axis=0, return_counts=True)
    return bool((number**2).sum() > MOST_PAIRS)


def _is_wide(shape: Polygon, spacing: float) -> bool:
    """Whether a zone is somewhere as wide as the spacing, and so can hold a point."""
    half, (x_min, y_min, x_max, y_max) = HALF * spacing, shape.bounds
    if shape.representative_point().distance(shape.boundary) > half:
        return True  # nearly all zones: a slider asks many times a second
    step = max(0.5 * spacing, ((x_max - x_min) * (y_max - y_min) / MOST_TRIALS) ** 0.5)
    grid = np.meshgrid(np.arange(x_min, x_max, step), np.arange(y_min, y_max, step))
    x, y, outline = grid[0].ravel(), grid[1].ravel(), shape.boundary
    for one in (shape, outline):
        prepare(one)
    within = contains_xy(shape, x, y)
    if not dwithin(outline, points(x[within], y[within]), half).all():
        return True
    return not is_crowded(shape, spacing) and not shape.buffer(-half).is_empty


def _too_narrow(name: str, shape: Polygon, spacing: float) -> str:
    if is_crowded(shape, spacing):
        return (
            f"zones: zone {name!r} is hardly as wide as the spacing {spacing:g} m, and its outline "
            f"has {get_num_coordinates(shape)} vertices, too many within one spacing: take fewer"
        )
    return (
        f"zones: zone {name!r} is a sliver, nowhere as wide as the spacing {spacing:g} m; give it "
        "width, join it to a neighbour or take a smaller spacing"
    )


def on_verticals(shape: BaseGeometry, x: np.ndarray) -> np.ndarray:
    """What of a shape lies on the verticals at places x (n,) [m]: n geometries, empty: nothing."""
    _, low, _, high = shape.bounds
    ends = [np.stack([x, np.full_like(x, y)], axis=1) for y in (low - 1.0, high + 1.0)]
    return np.asarray(intersection(linestrings(np.stack(ends, axis=1)), shape))


def area(vertices: Sequence[Point]) -> float:
    """Area of a polygon [m2], positive for either sense of rotation."""
    shifted = [*vertices[1:], vertices[0]]
    twice = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(vertices, shifted, strict=True))
    return 0.5 * abs(twice)


def _too_many_places(
    box: tuple[float, float, float], ground: Sequence[Point], spacing: float
) -> Fault | None:
    x_min, x_max, y_max = box
    places = (x_max - x_min) / spacing * ((y_max - min(y for _, y in ground)) / spacing)
    if places <= MOST_PLACES:
        return None
    return Fault(
        f"spacing: {spacing:g} m gives the domain {places:.2g} places for points; allowed are "
        f"{MOST_PLACES:.0e}: take a larger spacing or a smaller domain"
    )


def _outside(
    name: str, vertices: Sequence[Point], box: tuple[float, float, float]
) -> Iterator[Fault]:
    x_min, x_max, y_max = box
    for x, y in vertices:
        if not (x_min - ROUNDING <= x <= x_max + ROUNDING and y <= y_max + ROUNDING):
            message = (
                f"zones: zone {name!r} has a vertex ({x:g}, {y:g}) outside the domain "
                f"x {x_min:g} to {x_max:g}, y up to {y_max:g}"
            )
            yield Fault(message, (name,), (((x, y),),))


def _below(
    shapes: Mapping[str, Polygon], ground: Sequence[Point], tolerance: float
) -> Iterator[Fault]:
    if not shapes:
        return
    bounds = [shape.bounds for shape in shapes.values()]
    left = min(ground[0][0], min(b[0] for b in bounds)) - 1.0
    right = max(ground[-1][0], max(b[2] for b in bounds)) + 1.0
    bottom = min(min(y for _, y in ground), min(b[1] for b in bounds)) - 1.0
    rock = Polygon(
        [(left, bottom), (left, ground[0][1]), *ground, (right, ground[-1][1]), (right, bottom)]
    )
    for name, shape in shapes.items():
        buried = shape.intersection(rock)
        if buried.area > tolerance:
            message = (
                f"zones: zone {name!r} lies below the ground by {buried.area:.3g} m²; "
                f"allowed is {tolerance:.3g} m²"
            )
            yield Fault(message, (name,), _outlines(buried))


def _overlapping(shapes: Mapping[str, Polygon], tolerance: float) -> Iterator[Fault]:
    names = list(shapes)
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            if not shapes[first].intersects(shapes[second]):
                continue
            shared = shapes[first].intersection(shapes[second])
            if shared.area > tolerance:
                message = (
                    f"zones: zones {first!r} and {second!r} overlap by {shared.area:.3g} m²; "
                    f"allowed is {tolerance:.3g} m²"
                )
                yield Fault(message, (first, second), _outlines(shared))


def _outlines(shape: BaseGeometry) -> tuple[tuple[Point, ...], ...]:
    return tuple(
        tuple((float(x), float(y)) for x, y in part.exterior.coords[:-1]) for part in _parts(shape)
    )


def _parts(shape: BaseGeometry) -> list[Polygon]:
    if shape.is_empty:
        return []
    return [part for part in getattr(shape, "geoms", [shape]) if part.geom_type == "Polygon"]
