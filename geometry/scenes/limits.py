"""Limits of a section's values, so wide that they catch only slips, such as a wrong unit.

A density of 1.8 is one in t/m3, a pool 500 m above a dam of 40 m an elevation above the sea.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

Point = tuple[float, float]

#: Densities [kg/m3]: from light ash to a block so heavy that it keeps its speed (a piston).
DENSITY = (100.0, 1.0e8)

#: Farthest that a place may lie from the origin of the axes [m]: kilometre 1000 of a road. Drawings
#: in millimetres, or in the coordinates of a country, lie beyond.
FARTHEST_M = 1.0e6

#: A pool may stand this many heights of the section above its top, or this many metres if that is
#: more.
POOL_ABOVE, POOL_ABOVE_M = 5.0, 50.0

#: The same below its lowest point.
POOL_BELOW, POOL_BELOW_M = 1.0, 10.0


def check_density(name: str, value: float) -> None:
    """Refuse what is not a density in kg/m3.

    Raises:
        ValueError: what is allowed.
    """
    low, high = DENSITY
    if not low <= value <= high:
        hint = f"; {value:g} t/m³ are {1000 * value:g} kg/m³" if 0.1 <= value < 10 else ""
        raise ValueError(f"{name} {value:g} kg/m³: allowed are {low:g} to {high:g}{hint}")


def extent(polygons: Iterable[Sequence[Point]]) -> tuple[float, float]:
    """Lowest and highest elevation of outlines [m]."""
    y = [place for polygon in polygons for _, place in polygon]
    return min(y), max(y)


def pool_range(bottom: float, top: float) -> tuple[float, float]:
    """Elevations between which a pool or groundwater can stand.

    Args:
        bottom: lowest point of the section [m].
        top: its highest point [m].

    Returns:
        lowest and highest level [m].
    """
    height = top - bottom
    return (
        bottom - max(POOL_BELOW * height, POOL_BELOW_M),
        top + max(POOL_ABOVE * height, POOL_ABOVE_M),
    )


def check_level(name: str, level: float, bottom: float, top: float) -> None:
    """Refuse a level of water that has nothing to do with the section.

    Raises:
        ValueError: what is allowed.
    """
    low, high = pool_range(bottom, top)
    if not low <= level <= high:
        raise ValueError(
            f"{name} {level:g} m: the section lies between {bottom:g} and {top:g} m; allowed are "
            f"levels from {low:g} to {high:g} m"
        )
