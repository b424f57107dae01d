"""Checks on the polygons of a scene: simple, apart, above the ground, thick enough to be filled.

Everything here takes plain coordinates. An error is a ValueError whose text names the zone and the
remedy; `gaps` only reports, since a gap may be meant (template (e), a drain that is left out).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shapely.geometry import Polygon
from shapely.ops import unary_union
from shapely.validation import explain_validity

Point = tuple[float, float]

#: Overlap of two zones, or part of a zone below the ground, taken for rounding; in point areas.
AREA_TOLERANCE = 0.5

#: A zone must be wider than twice this share of the spacing: as wide as the spacing itself will do.
HALF = 0.499

#: Most places for points in a domain: beyond it a laptop's memory ends.
MOST_PLACES = 5e7


def check_ground(points: Sequence[Point], y_max: float) -> None:
    """Refuse a ground that reaches the top of the domain."""
    for x, y in points:
        if y >= y_max:
            raise ValueError(
                f"ground: point ({x:g}, {y:g}) is not below the domain's y_max {y_max:g}"
            )


def check_zones(
    polygons: Mapping[str, Sequence[Point]],
    *,
    box: tuple[float, float, float],
    ground: Sequence[Point],
    spacing: float,
) -> None:
    """Refuse zones that cannot be filled.

    Args:
        polygons: zone name -> vertices in order [m].
        box: (x_min, x_max, y_max) of the domain [m].
        ground: polyline of the rigid base [m].
        spacing: distance between material points [m].

    Raises:
        ValueError: naming the first zone that is outside, not simple, a sliver, below the ground
            or on top of another zone.
    """
    _check_places(box, ground, spacing)
    shapes = {}
    for name, vertices in polygons.items():
        _check_inside(name, vertices, box)
        shapes[name] = _simple(name, vertices)
        if shapes[name].buffer(-HALF * spacing).is_empty:
            raise ValueError(
                f"zones: zone {name!r} is a sliver, nowhere as wide as the spacing {spacing:g} m; "
                "give it width, join it to a neighbour or take a smaller spacing"
            )
    tolerance = AREA_TOLERANCE * spacing * spacing  # not a square, which may overflow
    _check_above(shapes, ground, tolerance)
    _check_apart(shapes, tolerance)


def gaps(polygons: Mapping[str, Sequence[Point]], spacing: float) -> list[tuple[float, Point]]:
    """Find holes and cracks between zones.

    Args:
        polygons: zone name -> vertices in order [m].
        spacing: distance between material points [m]; cracks narrower than this are found.

    Returns:
        (area [m2], a point inside [m]) of each gap, the largest first.
    """
    union = unary_union([Polygon(vertices) for vertices in polygons.values()])
    # Closing (grow, then shrink) fills holes and cracks up to one spacing wide and little else;
    # what it adds in concave outer corners stays below the tolerance.
    closed = union.buffer(0.5 * spacing, join_style="mitre").buffer(
        -0.5 * spacing, join_style="mitre"
    )
    added = closed.difference(union)
    holes = [Polygon(ring) for part in _parts(union) for ring in part.interiors]
    found = [*_parts(added), *holes]
    found = [part for part in _parts(unary_union(found)) if part.area > 0.01 * spacing**2]
    located = [(part.area, part.representative_point().coords[0]) for part in found]
    return sorted(located, key=lambda item: -item[0])


def area(vertices: Sequence[Point]) -> float:
    """Area of a polygon [m2], positive for either sense of rotation."""
    shifted = [*vertices[1:], vertices[0]]
    twice = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(vertices, shifted, strict=True))
    return 0.5 * abs(twice)


def _check_places(box: tuple[float, float, float], ground: Sequence[Point], spacing: float) -> None:
    x_min, x_max, y_max = box
    places = (x_max - x_min) / spacing * ((y_max - min(y for _, y in ground)) / spacing)
    if not places <= MOST_PLACES:
        raise ValueError(
            f"spacing: {spacing:g} m gives the domain {places:.2g} places for points; allowed are "
            f"{MOST_PLACES:.0e}: take a larger spacing or a smaller domain"
        )


def _check_inside(name: str, vertices: Sequence[Point], box: tuple[float, float, float]) -> None:
    x_min, x_max, y_max = box
    for x, y in vertices:
        if not (x_min <= x <= x_max and y <= y_max):
            raise ValueError(
                f"zones: zone {name!r} has a vertex ({x:g}, {y:g}) outside the domain "
                f"x {x_min:g} to {x_max:g}, y up to {y_max:g}"
            )


def _simple(name: str, vertices: Sequence[Point]) -> Polygon:
    shape = Polygon(vertices)
    if not shape.is_valid:
        raise ValueError(f"zones: zone {name!r} is not a simple polygon: {explain_validity(shape)}")
    if shape.area == 0:
        raise ValueError(f"zones: zone {name!r} has no area")
    return shape


def _check_above(shapes: Mapping[str, Polygon], ground: Sequence[Point], tolerance: float) -> None:
    bounds = [shape.bounds for shape in shapes.values()]
    left = min(ground[0][0], min(b[0] for b in bounds)) - 1.0
    right = max(ground[-1][0], max(b[2] for b in bounds)) + 1.0
    bottom = min(min(y for _, y in ground), min(b[1] for b in bounds)) - 1.0
    rock = Polygon(
        [(left, bottom), (left, ground[0][1]), *ground, (right, ground[-1][1]), (right, bottom)]
    )
    for name, shape in shapes.items():
        buried = shape.intersection(rock).area
        if buried > tolerance:
            raise ValueError(
                f"zones: zone {name!r} lies below the ground by {buried:.3g} m2; "
                f"allowed is {tolerance:.3g} m2"
            )


def _check_apart(shapes: Mapping[str, Polygon], tolerance: float) -> None:
    names = list(shapes)
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            if not shapes[first].intersects(shapes[second]):
                continue
            shared = shapes[first].intersection(shapes[second]).area
            if shared > tolerance:
                raise ValueError(
                    f"zones: zones {first!r} and {second!r} overlap by {shared:.3g} m2; "
                    f"allowed is {tolerance:.3g} m2"
                )


def _parts(shape) -> list[Polygon]:
    if shape.is_empty:
        return []
    return [part for part in getattr(shape, "geoms", [shape]) if part.geom_type == "Polygon"]
