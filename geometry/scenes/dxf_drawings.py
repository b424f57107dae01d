"""The lines of a DXF drawing: every entity is read, listed as left out, or refused.

A section is what the drawing shows in its model space: curves become chords, blocks are taken
apart, mirrored entities stand where they are seen. Entities of frozen and switched-off layers, of
paper space, and those that have no line (texts, dimensions) are left out, and named.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.cli import InputError
from pipeline.extras import require

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities import DXFGraphic

#: DXF header code $INSUNITS -> unit; 0 is none.
DXF_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 10: "yd", 14: "dm", 21: "us_ft"}
CURVES = ("LINE", "LWPOLYLINE", "POLYLINE", "SPLINE", "ARC", "CIRCLE", "ELLIPSE")
AREAS = ("HATCH", "MPOLYGON", "SOLID", "TRACE", "3DFACE")
#: Kinds without a line of their own. What is in none of the three tuples may be soil: refused.
REMARKS = (
    "TEXT", "MTEXT", "ATTRIB", "ATTDEF", "DIMENSION", "ARC_DIMENSION", "LEADER", "MULTILEADER",
    "TOLERANCE", "POINT", "VIEWPORT", "IMAGE", "WIPEOUT", "OLE2FRAME", "ACAD_TABLE", "XLINE", "RAY",
    "UNDERLAY", "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY", "LIGHT", "SUN", "GEODATA",
)  # fmt: skip
MOST_ENTITIES, DEEPEST_BLOCK = 20_000, 16
#: Sagitta of a chord, and largest gap of a closed line, as shares of the size of the line.
SAGITTA, GAP = 1e-4, 1e-6
#: A filled area is that of an outline where they differ by at most this share of it.
SAME_AREA = 0.01
SPLINE_FRAME = 16  # flag of a POLYLINE's vertex that only controls the curve through others


@dataclass(frozen=True)
class DrawnLine:
    """A line as the drawing shows it.

    Attributes:
        layer: its name.
        points: x, y in the drawing's unit.
        closed: its end is its beginning.
    """

    layer: str
    points: list[tuple[float, float]]
    closed: bool


@dataclass(frozen=True)
class DrawnLines:
    """What was read of a drawing.

    Attributes:
        lines: of the model space.
        unit: that the header names, or its code where that is no length we know; None: none.
        left_out: what was not read, by kind, layer and reason.
    """

    lines: list[DrawnLine]
    unit: str | None
    left_out: list[str]


@dataclass(frozen=True)
class _Shape:
    """An entity with the layer on which it is seen, and why it is left out, if it is."""

    entity: Any
    layer: str
    hidden: str = ""

    @property
    def kind(self) -> str:
        return self.entity.dxftype()

    @property
    def filled(self) -> bool:
        return self.kind in AREAS


def read_dxf(path: Path) -> DrawnLines:
    """Read the lines of a drawing.

    Raises:
        InputError: no readable DXF file; one line with the layer and the kind of what cannot be
            read, or lies outside the x-y plane.
    """
    require("dxf", f"{path}: a DXF file")
    import ezdxf

    try:
        drawing = ezdxf.readfile(path)
    except (OSError, ezdxf.DXFError) as error:
        raise InputError(f"{path}: no readable DXF file: {error}") from None
    left_out = _paper_space(drawing)
    shapes: list[_Shape] = []
    for shape in _shapes(drawing, path):
        if shape.hidden or shape.kind in REMARKS:
            left_out[shape.kind, f"on layer {shape.layer}{shape.hidden}"] += 1
        else:
            shapes.append(shape)
    lines = [(shape, _line(shape, path)) for shape in shapes]
    _check_plane([place for _, (places, _) in lines for place in places], path)
    kept: list[DrawnLine] = []
    for shape, (places, closed) in lines:
        line = DrawnLine(shape.layer, [(float(x), float(y)) for x, y, _ in places], closed)
        outlines = [one for one in kept if one.layer == shape.layer and one.closed]
        if shape.filled and any(_same_area(line, one) for one in outlines):
            left_out[shape.kind, f"on layer {shape.layer} (fills the outline there)"] += 1
        else:
            kept.append(line)
    code = drawing.header.get("$INSUNITS", 0)
    return DrawnLines(
        kept,
        DXF_UNITS.get(code, f"$INSUNITS {code}") if code else None,
        [f"{count} {kind} {where}" for (kind, where), count in left_out.items()],
    )


def _paper_space(drawing: Drawing) -> Counter[tuple[str, str]]:
    """What lies in the layouts for printing."""
    return Counter(
        (entity.dxftype(), f"in paper space {layout.name}")
        for layout in drawing.layouts
        if not layout.is_modelspace
        for entity in layout
        if entity.dxftype() != "VIEWPORT"  # each layout has one
    )


def _shapes(drawing: Drawing, path: Path) -> Iterator[_Shape]:
    """The entities of the model space, those of blocks in their place; outlines before fills."""
    hidden = {layer.dxf.name.lower(): _hidden(layer) for layer in drawing.layers}
    found = []
    for entity, layer in _taken_apart(drawing.modelspace(), None, path):
        if any("\udc80" <= letter <= "\udcff" for letter in layer):
            raise InputError(
                f"{path}: the name of layer {layer!r} is not in the encoding of the drawing; save "
                "it anew"
            )
        why = " (hidden)" if entity.dxf.get("invisible", 0) else hidden.get(layer.lower(), "")
        found.append(_Shape(entity, layer, why))
        if len(found) > MOST_ENTITIES:
            raise InputError(
                f"{path}: more than {MOST_ENTITIES:,} entities; export the section alone"
            )
    return iter(sorted(found, key=lambda shape: shape.filled))


def _hidden(layer: Any) -> str:
    if layer.is_frozen():
        return " (frozen)"
    return " (switched off)" if layer.is_off() else ""


def _taken_apart(
    entities: Any, block_layer: str | None, path: Path, depth: int = 0
) -> Iterator[tuple[DXFGraphic, str]]:
    """Entities with the layer on which they are seen: layer 0 of a block is that of its place."""
    if depth > DEEPEST_BLOCK:
        raise InputError(f"{path}: blocks within blocks, more than {DEEPEST_BLOCK} deep")
    for entity in entities:
        layer = entity.dxf.get("layer", "0")
        layer = block_layer if layer == "0" and block_layer is not None else layer
        if entity.dxftype() != "INSERT":
            yield entity, layer
            continue
        block = entity.block()
        if block is None or block.block.is_xref or block.block.is_xref_overlay:
            raise InputError(
                f"{path}: layer {layer}: block {entity.dxf.name!r} lies in another drawing, which "
                "is not read; bind it, or delete it here"
            )
        yield from ((text, layer) for text in entity.attribs)
        for one in entity.multi_insert() if entity.mcount > 1 else [entity]:
            parts = one.virtual_entities(skipped_entity_callback=_refuse(layer, path))
            yield from _taken_apart(parts, layer, path, depth + 1)


def _refuse(layer: str, path: Path) -> Any:
    """What to do with an entity that cannot be moved to where its block stands."""

    def refuse(entity: DXFGraphic, reason: str) -> None:
        if entity.dxftype() not in REMARKS:
            raise InputError(f"{path}: layer {layer}: {entity.dxftype()} in a block: {reason}")

    return refuse


def _line(shape: _Shape, path: Path) -> tuple[np.ndarray, bool]:
    """Points (n, 3) of a shape in the drawing's own coordinates, and whether it is closed."""
    from ezdxf.path import from_hatch, make_path

    where, entity = f"{path}: layer {shape.layer}", shape.entity
    advice = "draw it as a polyline, or freeze its layer to leave it out"
    if shape.kind not in (*CURVES, *AREAS):
        raise InputError(f"{where}: a {shape.kind} cannot be read; {advice}")
    if shape.kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        raise InputError(f"{where}: a mesh cannot be read; {advice}")
    if shape.kind == "POLYLINE" and any(v.dxf.flags & SPLINE_FRAME for v in entity.vertices):
        entity = entity.copy()
        entity.vertices = [v for v in entity.vertices if not v.dxf.flags & SPLINE_FRAME]
    if shape.kind in ("HATCH", "MPOLYGON"):
        paths = list(from_hatch(entity))
        if len(paths) != 1:
            raise InputError(
                f"{where}: a {shape.kind} has {len(paths)} outlines, where a zone has one; {advice}"
            )
        drawn = paths[0]
    else:
        drawn = make_path(entity)
    corners = np.array([drawn.start, *drawn.control_vertices()], float).reshape(-1, 3)
    if not np.isfinite(corners).all():
        raise InputError(f"{where}: a {shape.kind} has coordinates that are not finite")
    size = float(np.ptp(corners, axis=0).max(initial=0.0)) or 1.0
    places = np.array(list(drawn.flattening(SAGITTA * size)), float).reshape(-1, 3)
    gap = float(np.linalg.norm(places[-1] - places[0])) if len(places) > 2 else np.inf
    closed = shape.filled or gap <= GAP * size
    return (places[:-1] if closed and gap <= GAP * size else places), closed


def _check_plane(places: list[np.ndarray], path: Path) -> None:
    """Sections lie in the x-y plane, whatever the elevation at which it was drawn."""
    if not places:
        return
    x, y, z = np.ptp(np.array(places), axis=0)
    if z <= GAP * max(x, y, z):
        return
    if y <= GAP * max(x, z):
        raise InputError(
            f"{path}: is drawn in the x-z plane; elevations are y in a section: turn it by 90 "
            "degrees about the x axis"
        )
    raise InputError(f"{path}: is not flat (z varies by {z:.4g}); a section lies in the x-y plane")


def _same_area(line: DrawnLine, outline: DrawnLine) -> bool:
    import shapely

    area, other = shapely.Polygon(line.points), shapely.Polygon(outline.points)
    if not (area.is_valid and other.is_valid):
        return False
    return area.symmetric_difference(other).area <= SAME_AREA * other.area
