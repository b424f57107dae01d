"""Sections drawn elsewhere: CSV, GeoJSON, DXF, GeoStudio and grids of FLAC2D become scenes.

All give zones (closed outlines with a name) and, by the names `ground` and `water`, the base and
the water table, which are not closed. Strengths come with the zones (CSV columns, GeoJSON
properties) or from a file of materials. Nothing is made up: a zone without a strength is refused.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geometry.scenes.dxf_drawings import read_dxf
from geometry.scenes.flac_grids import read_grid
from geometry.scenes.geostudio_files import read_gsz
from geometry.scenes.scene import Material, Scene, scene_from_mapping
from pipeline.cli import InputError
from pipeline.files import read_json, read_yaml

Point = tuple[float, float]

GROUND, WATER = "ground", "water"
#: Metres in a unit of length.
UNITS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "km": 1e3,
         "ft": 0.3048, "in": 0.0254, "yd": 0.9144, "us_ft": 1200.0 / 3937.0}  # fmt: skip
FORMATS = (".csv", ".geojson", ".json", ".dxf", ".f2grid", ".gsz")
#: Files of programs whose form is nowhere described -> the program.
CLOSED = {
    **dict.fromkeys((".slmd", ".slmm", ".slim", ".sli"), "Slide2"),
    **dict.fromkeys((".p2dx", ".plx"), "Plaxis"),
    **dict.fromkeys((".dwg", ".dgn"), "CAD"),
}
MATERIAL_FIELDS = tuple(name for name in Material.model_fields if name != "pre_failure")


@dataclass
class DrawnSection:
    """Content of a drawing, in its own unit of length."""

    zones: dict[str, list[Point]] = field(default_factory=dict)
    properties: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Zone name -> `material` and fields of `Material`, as far as the drawing gives them."""
    ground: list[Point] | None = None
    water: list[Point] | None = None
    unit: str | None = None
    """Unit that the file itself names: one of UNITS, or what it says."""
    left_out: list[str] = field(default_factory=list)
    """What the file holds beside: kind, layer and reason, a line each."""


def read_section(path: str | Path, kind: str | None = None) -> DrawnSection:
    """Read the outlines of a CSV, GeoJSON, DXF or GeoStudio file, or of a grid of FLAC2D.

    Args:
        path: the drawing.
        kind: csv, geojson, dxf, f2grid or gsz; None: as its suffix says.

    Raises:
        InputError: unknown suffix, unreadable file, or a row or shape that is not a zone.
    """
    path = Path(path)
    suffix = path.suffix.lower() if kind is None else f".{kind}"
    if suffix in CLOSED:
        raise InputError(
            f"{path}: files of {CLOSED[suffix]} cannot be read; export the section there as DXF, "
            "each zone as a closed polyline on a layer with its name"
        )
    if suffix not in FORMATS:
        raise InputError(f"{path}: sections end in {', '.join(FORMATS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    readers = {
        ".csv": _read_csv,
        ".dxf": _read_dxf,
        ".f2grid": _read_grid,
        ".gsz": _read_geostudio,
    }
    reader = readers.get(suffix, _read_geojson)
    section = reader(path)
    if not section.zones:
        lines = [f"an open line {name!r}" for name in (GROUND, WATER) if getattr(section, name)]
        seen = ", ".join([*lines, *section.left_out]) or "nothing"
        raise InputError(f"{path}: no closed outline was found, so there is no zone; found: {seen}")
    return section


def reading(section: DrawnSection, unit: str | None = None) -> list[str]:
    """What was read of a drawing, a line each: its size, its unit, what was left out.

    Args:
        section: from `read_section`.
        unit: as for `section_scene`.
    """
    factor = _factor(section, unit, "the drawing")
    x, y = (
        [factor * point[k] for ring in section.zones.values() for point in ring] for k in (0, 1)
    )
    taken = unit or section.unit or "m"
    source = "as given" if unit else "as the file says" if section.unit else "the file names none"
    lines = [
        f"read {len(section.zones)} zones, {max(x) - min(x):.4g} m long and "
        f"{max(y) - min(y):.4g} m high (x {min(x):g} to {max(x):g}, y {min(y):g} to {max(y):g} m); "
        f"unit {taken}, {source}"
        + ("; --unit m if it was drawn in metres" if not unit and taken != "m" else "")
    ]
    lines += [
        f"read the line {name}, x {factor * line[0][0]:g} to {factor * line[-1][0]:g} m"
        for name, line in ((GROUND, section.ground), (WATER, section.water))
        if line
    ]
    return lines + [f"left out: {entry}" for entry in section.left_out]


def section_scene(
    section: DrawnSection,
    *,
    source: str,
    name: str,
    spacing: float | None = None,
    unit: str | None = None,
    materials: Mapping[str, Any] | None = None,
    snap: float = 0.0,
    ends: Mapping[str, str] | None = None,
) -> Scene:
    """Make a scene of a section.

    Args:
        section: from `read_section`.
        source: the file's name, for messages and for the description.
        name: name of the scene.
        spacing: distance between material points [m]; None: a 25th of the height, rounded.
        unit: unit of the coordinates; None = the file's own, or metres.
        materials: material name, or zone name where the zone names no material -> fields.
        snap: vertices nearer than this become one [m].
        ends: side -> "far" or "free", as in `Domain`; absent: by the outline.

    Returns:
        A scene with open walls, room for a slide on both sides and, unless the drawing has a
        ground, a level base at its lowest vertex.
    """
    document = section_document(
        section, source=source, name=name, unit=unit, materials=materials, snap=snap
    )
    for zone in document["zones"]:
        name, material = zone["name"], zone["material"]
        for key in ("friction_deg", "cohesion_kpa"):
            if key not in document["materials"][material]:
                raise InputError(
                    f"{source}: zone {name!r} (material {material!r}) has no {key}; give it in "
                    "the drawing or with --materials FILE"
                )
    document = with_room({**document, "spacing": spacing})
    document["domain"].update(ends or {})
    return scene_from_mapping(document, source)


def section_document(
    section: DrawnSection,
    *,
    source: str,
    name: str,
    unit: str | None = None,
    materials: Mapping[str, Any] | None = None,
    snap: float = 0.0,
) -> dict[str, Any]:
    """The document of a scene as far as a drawing gives it; arguments as `section_scene`.

    Strengths, spacing, domain and base may be missing.
    """
    factor = _factor(section, unit, source)
    snapped = _Snap(snap)
    zones = {
        zone: [snapped((factor * x, factor * y)) for x, y in ring]
        for zone, ring in section.zones.items()
    }
    chosen, definitions = _materials(section, materials or {}, source)
    ground, water = (
        None
        if line is None
        else _ascending([(factor * x, factor * y) for x, y in line], name, source)
        for name, line in ((GROUND, section.ground), (WATER, section.water))
    )
    return {
        "name": name,
        "description": f"Imported from {Path(source).name}.",
        "ground": None if ground is None else {"points": ground},
        "zones": [
            {"name": zone, "polygon": _open(ring), "material": chosen[zone]}
            for zone, ring in zones.items()
        ],
        "materials": definitions,
        "water_level": max(y for _, y in water) if water else None,
        "phreatic_line": water if water and len({y for _, y in water}) > 1 else None,
    }


def with_room(document: Mapping[str, Any], places: Sequence[float] = ()) -> dict[str, Any]:
    """A section with what its outlines leave open: spacing, domain, base.

    Args:
        document: of a scene; `spacing`, `domain` and `ground` may be absent or null.
        places: x of what the domain must hold in addition to the zones [m].

    Returns:
        The document with a spacing of a 25th of its height, rounded; with open walls, room for a
        slide on both sides and for `places`; and with a level base at its lowest vertex. What it
        has is kept, but that open walls give way where something lies outside.
    """
    found = dict(document)
    rings = [zone["polygon"] for zone in found["zones"]]
    lowest, highest = (pick(y for ring in rings for _, y in ring) for pick in (min, max))
    spacing = found.get("spacing") or _round_spacing((highest - lowest) / 25.0)
    cell = math.isqrt(found.get("points_per_cell", 4)) * spacing
    wanted = _room(rings, lowest, cell, places)
    domain = found.get("domain")
    if domain is None:
        left, right, top = wanted
        domain = {"x_min": left, "x_max": right, "y_max": top, "walls": "open"}
    elif domain.get("walls") == "open":
        domain = _widened(domain, rings, wanted, places)
    level = [[domain["x_min"], lowest], [domain["x_max"], lowest]]
    found["spacing"], found["domain"] = spacing, domain
    found["ground"] = {"points": level, **(found.get("ground") or {})}
    return found


def _widened(
    domain: Mapping[str, Any],
    rings: Sequence[Sequence[Point]],
    wanted: tuple[float, float, float],
    places: Sequence[float],
) -> dict[str, Any]:
    """A domain that holds what lies outside of it, with room there."""
    x = [*(x for ring in rings for x, _ in ring), *places]
    found = dict(domain)
    if min(x) < domain["x_min"]:
        found["x_min"] = min(domain["x_min"], wanted[0])
    if max(x) > domain["x_max"]:
        found["x_max"] = max(domain["x_max"], wanted[1])
    if max(y for ring in rings for _, y in ring) > domain["y_max"]:
        found["y_max"] = max(domain["y_max"], wanted[2])
    return found


def _round_spacing(length: float) -> float:
    """The next smaller of 0.1, 0.25, 0.5, 1, 2, ... [m]."""
    steps = [step * 10.0**power for power in range(-2, 3) for step in (1.0, 2.5, 5.0)]
    return max([step for step in steps if step <= length], default=steps[0])


def read_materials(path: str | Path) -> dict[str, Any]:
    """Read a YAML file: name -> fields of `Material`, at top level or under the key `materials`."""
    document = read_yaml(path)
    if isinstance(document, Mapping) and isinstance(document.get("materials"), Mapping):
        document = document["materials"]
    if not isinstance(document, Mapping) or not all(
        isinstance(value, Mapping) for value in document.values()
    ):
        raise InputError(f"{path}: must hold materials (name: {{friction_deg: ..., ...}})")
    return {str(key): dict(value) for key, value in document.items()}


def _materials(
    section: DrawnSection, given: Mapping[str, Any], source: str
) -> tuple[dict[str, str], dict[str, dict[str, Any]]]:
    """Material name of every zone, and the fields of every material that is used."""
    chosen: dict[str, str] = {}
    definitions: dict[str, dict[str, Any]] = {}
    for zone in section.zones:
        properties = dict(section.properties.get(zone, {}))
        material = str(properties.pop("material", zone))
        fields = {**given.get(material, {}), **properties}
        if material in definitions and definitions[material] != fields:
            raise InputError(
                f"{source}: zone {zone!r} gives material {material!r} other values than a zone "
                "before; use two names"
            )
        chosen[zone], definitions[material] = material, fields
    return chosen, definitions


def _room(
    rings: Sequence[Sequence[Point]], lowest: float, cell: float, places: Sequence[float]
) -> tuple[float, float, float]:
    """Walls and top of the domain, whole cells: a slide may run twice the height to either side."""
    x = [x for ring in rings for x, _ in ring]
    height = max(y for ring in rings for _, y in ring) - lowest
    left = min([min(x) - 2.0 * height, *places])
    right = max([max(x) + 2.0 * height, *places])
    top = lowest + cell * math.ceil(1.3 * height / cell)
    left, right = cell * math.floor(left / cell), cell * math.ceil(right / cell)
    return round(left, 9), round(right, 9), round(top, 9)  # 7.8, not 7.800000000000001


class _Snap:
    """Gives a vertex the place of the first earlier one that is not farther away than `reach`."""

    def __init__(self, reach: float) -> None:
        self._reach = reach
        # By squares as wide as the reach, of which each holds few: their number and place.
        self._known: dict[Point, list[tuple[int, Point]]] = {}
        self._number = 0

    def __call__(self, point: Point) -> Point:
        if not self._reach:
            return point
        column, row = (place // self._reach for place in point)
        near = [
            known
            for across in (-1, 0, 1)
            for up in (-1, 0, 1)
            for known in self._known.get((column + across, row + up), ())
            if math.dist(known[1], point) <= self._reach
        ]
        if near:
            return min(near)[1]
        self._known.setdefault((column, row), []).append((self._number, point))
        self._number += 1
        return point


def _factor(section: DrawnSection, unit: str | None, source: str) -> float:
    """Metres in the unit of a drawing."""
    factor = UNITS.get(unit or section.unit or "m")
    if factor is None:
        raise InputError(
            f"{source}: states its unit of length as {section.unit}, which is none of "
            f"{', '.join(UNITS)}; give the unit (--unit)"
        )
    return factor


def _ascending(line: list[Point], name: str, source: str) -> list[Point]:
    """A line from left to right; one that was drawn from right to left is turned round as a whole.

    Raises:
        InputError: it turns back or rises vertically: the order of its points is part of a drawing.
    """
    line = [point for point, before in zip(line, [None, *line], strict=False) if point != before]
    if line[0][0] > line[-1][0]:
        line = line[::-1]
    for (x, y), (x1, y1) in zip(line, line[1:], strict=False):
        if x1 < x:
            raise InputError(
                f"{source}: the line {name!r} turns back from ({x:g}, {y:g}) to ({x1:g}, {y1:g}) "
                "m; it goes from left to right, without an overhang"
            )
        if x1 == x:
            raise InputError(
                f"{source}: the line {name!r} is vertical from ({x:g}, {y:g}) to ({x1:g}, {y1:g}) "
                f"m; move one of the points by a millimetre{_exchanged(line)}"
            )
    return line


def _exchanged(line: list[Point]) -> str:
    """A line that rises farther than it goes is hardly a ground or a water table."""
    (left, right), (low, high) = ((min(one), max(one)) for one in zip(*line, strict=True))
    return ", or are x and y exchanged?" if high - low > right - left else ""


def _open(ring: list[Point]) -> list[Point]:
    """Without repeated neighbours, the closing vertex among them."""
    following = [*ring[1:], ring[0]]
    return [point for point, after in zip(ring, following, strict=True) if point != after]


def _add(
    section: DrawnSection, name: str, line: list[Point], where: str, closed: bool | None = None
) -> None:
    """Put a line in its place by its name, which ground and water have where it is not closed.

    Whether a row of vertices is closed (None) its name alone says.
    """
    if name.lower() in (GROUND, WATER) and not closed:
        if getattr(section, name.lower()) is not None:
            raise InputError(f"{where}: two lines are called {name!r}; join them into one")
        setattr(section, name.lower(), line)
    elif closed is False:
        raise InputError(
            f"{where}: the line {name!r} is not closed; zones are closed, other lines are called "
            f"{GROUND!r} or {WATER!r} (a frozen layer of a DXF is left out)"
        )
    elif name in section.zones:
        raise InputError(f"{where}: two outlines are called {name!r}; names must be unique")
    else:
        section.zones[name] = line


def _read_csv(path: Path) -> DrawnSection:
    """One vertex a row: zone, x, y, and optionally material and fields of `Material`."""
    section = DrawnSection()
    lines: dict[str, list[Point]] = {}
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text in UTF-8") from None
    uncommented = (line for line in text.splitlines() if not line.lstrip().startswith("#"))
    rows = csv.DictReader(uncommented)
    columns = [name.strip() for name in rows.fieldnames or []]
    _check_columns(columns, path)
    rows.fieldnames = columns
    for number, row in enumerate(rows, start=2):
        where = f"{path}: row {number}"
        if row.get(None):
            raise InputError(f"{where}: has more values than there are columns ({len(columns)})")
        name = (row["zone"] or "").strip()
        if not name:
            raise InputError(f"{where}: the zone has no name")
        point = (_number(row["x"], "x", where), _number(row["y"], "y", where))
        lines.setdefault(name, []).append(point)
        _note_properties(section, name, row, where)
    for name, line in lines.items():
        _add(section, name, line, str(path))
    return section


def _check_columns(columns: list[str], path: Path) -> None:
    known = ("zone", "x", "y", "material", *MATERIAL_FIELDS)
    for column in ("zone", "x", "y"):
        if column not in columns:
            hint = ", with commas between them" if any(";" in one for one in columns) else ""
            raise InputError(f"{path}: no column {column!r}; needed are zone, x, y{hint}")
        if columns.count(column) > 1:
            raise InputError(f"{path}: two columns are called {column!r}")
    for column in columns:
        if column not in known:
            raise InputError(f"{path}: unknown column {column!r}; allowed are {', '.join(known)}")


def _note_properties(section: DrawnSection, name: str, row: Mapping[str, Any], where: str) -> None:
    """Keep a row's material and strengths; empty cells say nothing, others must agree."""
    for key in ("material", *MATERIAL_FIELDS):
        text = (row.get(key) or "").strip()
        if not text:
            continue
        value = _value(key, text, where)
        kept = section.properties.setdefault(name, {}).setdefault(key, value)
        if kept != value:
            raise InputError(f"{where}: {key} is {text}, but {kept} in a row before of {name!r}")


def _value(key: str, text: str, where: str) -> str | bool | float:
    if key in ("material", "source"):
        return text
    if key == "liquefied":
        if text.lower() not in ("true", "false"):
            raise InputError(f"{where}: liquefied is {text!r}; allowed are true and false")
        return text.lower() == "true"
    return _number(text, key, where)


def _number(text: Any, what: str, where: str) -> float:
    try:
        value = float(text)
    except (TypeError, ValueError):
        raise InputError(f"{where}: {what} is {text!r}, not a number") from None
    if not math.isfinite(value):
        raise InputError(f"{where}: {what} is {text}; numbers must be finite")
    return value


def _read_geojson(path: Path) -> DrawnSection:
    """A FeatureCollection: polygons with the property `name`; lines named ground or water."""
    document = read_json(path)
    features = document.get("features") if isinstance(document, Mapping) else None
    if not isinstance(features, list):
        raise InputError(f"{path}: not a GeoJSON FeatureCollection (no list of features)")
    section = DrawnSection()
    for number, feature in enumerate(features):
        where = f"{path}: feature {number}"
        geometry = feature.get("geometry") if isinstance(feature, Mapping) else None
        if not isinstance(geometry, Mapping):
            raise InputError(f"{where}: has no geometry")
        properties = feature.get("properties") or {}
        if not isinstance(properties, Mapping):
            raise InputError(f"{where}: properties must be a mapping")
        properties = dict(properties)
        name = str(properties.pop("name", properties.pop("zone", f"zone_{number + 1}")))
        line, closed = _geojson_line(geometry, where)
        _add(section, name, line, where, closed)
        if name in section.zones:
            section.properties[name] = _geojson_properties(properties, where)
    return section


def _geojson_line(geometry: Mapping[str, Any], where: str) -> tuple[list[Point], bool]:
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind not in ("Polygon", "LineString"):
        raise InputError(f"{where}: is a {kind}; allowed are Polygon and LineString")
    places = coordinates
    if kind == "Polygon" and isinstance(coordinates, list) and coordinates:
        if len(coordinates) > 1:
            raise InputError(f"{where}: has a hole; cut the zone so that it needs none")
        places = coordinates[0]
    if (
        not isinstance(places, list)
        or not places
        or not all(isinstance(place, list) and len(place) >= 2 for place in places)
    ):
        raise InputError(f"{where}: coordinates must be a list of [x, y]")
    line = [(_number(place[0], "x", where), _number(place[1], "y", where)) for place in places]
    return line, kind == "Polygon"


def _geojson_properties(properties: Mapping[str, Any], where: str) -> dict[str, Any]:
    kept = {key: value for key, value in properties.items() if value is not None}
    for key in kept:
        if key not in ("material", *Material.model_fields):
            known = ", ".join(("name", "material", *Material.model_fields))
            raise InputError(f"{where}: unknown property {key!r}; allowed are {known}")
    return kept


def _read_grid(path: Path) -> DrawnSection:
    """The groups of a grid."""
    section = DrawnSection()
    for name, line in read_grid(path).items():
        _add(section, name, line, str(path), closed=True)
    return section


def _read_geostudio(path: Path) -> DrawnSection:
    """The regions of a file of GeoStudio, each with the name of its material."""
    found = read_gsz(path)
    section = DrawnSection(left_out=found.left_out, unit=found.unit or None)
    for name, line in found.zones.items():
        _add(section, name, line, str(path), closed=True)
        section.properties[name] = {"material": found.materials[name]}
    return section


def _read_dxf(path: Path) -> DrawnSection:
    """Closed outlines are zones, named by their layer; layers ground and water hold open lines."""
    drawn = read_dxf(path)
    section = DrawnSection(unit=drawn.unit, left_out=drawn.left_out)
    for line in drawn.lines:
        _add(section, line.layer, line.points, f"{path}: layer {line.layer}", line.closed)
    return section
