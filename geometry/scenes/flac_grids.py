"""Grids of FLAC2D (`.f2grid`) as outlines: the union of the elements of every group is a zone.

The text format has lines `G id x y` (gridpoints), `Z kind id gridpoints...` (elements, Q4 or T3),
and `ZGROUP "name" SLOT "slot"` followed by the ids of the group's elements. An element may be in a
group of every slot. The section is read from the slot that covers the most elements; of several
that cover as many, from the one with the most groups.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely

from pipeline.cli import InputError
from pipeline.files import read_text

Point = tuple[float, float]

SUFFIX = ".f2grid"
#: Elements that are in no group.
NO_GROUP = "no_group"
_GROUP = re.compile(r'ZGROUP\s+"?([^"]+?)"?(?:\s+SLOT\s+"?([^"]+?)"?)?\s*$', re.IGNORECASE)
#: Kind of element -> its corners in order around it; those of a quadrilateral are written in rows.
_CORNERS = {"Q4": (0, 1, 3, 2), "T3": (0, 1, 2)}
#: Vertices that bend an outline by less than this share of an element's edge are left out.
_STRAIGHT = 0.02


def read_grid(path: Path) -> dict[str, list[Point]]:
    """Outlines of the groups of a grid, in its own unit of length.

    A group in several pieces is several zones: `name`, `name_2`, ...

    Raises:
        InputError: no readable grid, or a group that surrounds another one; one line.
    """
    points: dict[int, Point] = {}
    elements: dict[int, list[Point]] = {}
    slots: dict[str, dict[str, list[int]]] = {}
    group: list[int] | None = None
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("*"):
            continue
        try:
            if words[0] == "G":
                points[int(words[1])] = (float(words[2]), float(words[3]))
                group = None
            elif words[0] == "Z":
                corners = (int(words[3 + place]) for place in _CORNERS[words[1]])
                elements[int(words[2])] = [points[corner] for corner in corners]
                group = None
            elif words[0].upper() == "ZGROUP":
                if (found := _GROUP.match(line.strip())) is None:
                    raise ValueError(f"ZGROUP: {line.strip()!r}")
                name, slot = found.groups()
                group = slots.setdefault(slot or "Default", {}).setdefault(name.strip(), [])
            elif group is not None and words[0].isdigit():
                group += [int(word) for word in words]
            else:
                group = None  # faces and what else there is
        except (LookupError, ValueError, AttributeError):
            raise InputError(
                f"{path}: line {number}: no line of a FLAC2D grid: {line[:60]!r}"
            ) from None
    if not elements:
        raise InputError(f"{path}: no element was found; a grid has lines 'Z Q4 ...'")
    if not np.all(np.isfinite(list(points.values()))):
        raise InputError(f"{path}: coordinates must be finite")
    return dict(_outlines(path, elements, _section(slots, elements)))


def _section(
    slots: dict[str, dict[str, list[int]]], elements: dict[int, list[Point]]
) -> dict[str, list[int]]:
    """Groups of the slot that covers the most elements, and what it leaves without a group."""

    def rank(groups: dict[str, list[int]]) -> tuple[int, int]:
        held = set().union(*groups.values()) & elements.keys()
        return len(held), len(groups)

    groups = max(slots.values(), key=rank, default={})
    held = set().union(*groups.values())
    rest = [number for number in elements if number not in held]
    return {**groups, **({NO_GROUP: rest} if rest else {})}


def _outlines(
    path: Path, elements: dict[int, list[Point]], groups: dict[str, list[int]]
) -> Iterator[tuple[str, list[Point]]]:
    names, parts = [], []
    for group, numbers in groups.items():
        shapes = [shapely.Polygon(elements[one]) for one in numbers if one in elements]
        # Corners that differ in the last digit leave no slits.
        union = shapely.union_all(shapes, grid_size=1e-6)
        for k, part in enumerate(shapely.get_parts(union), start=1):
            names.append(re.sub(r"\W+", "_", group) + (f"_{k}" if k > 1 else ""))
            parts.append(part)
    area = sum(part.area for part in parts) / len(elements)
    straight = shapely.coverage_simplify(parts, _STRAIGHT * area**0.5)
    for name, part in zip(names, straight, strict=True):
        if part.interiors:
            raise InputError(f"{path}: the group {name!r} surrounds another one; cut it in two")
        yield name, [(float(x), float(y)) for x, y in part.exterior.coords[:-1]]
