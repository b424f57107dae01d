"""Files of GeoStudio (`.gsz`) as outlines: every region is a zone.

A `.gsz` is a zip that holds an XML document under the file's own name. Read of it are `Geometries`
(points, and regions by the numbers of their points), and which material each region has in the
first analysis (`Contexts`, `Materials`). Strengths, unit weights and water are not: the document
does not say their units, and they depend on the analysis. Everything that is not read is listed.
Structure after M. Rousseau, PyGeoStudio 0.4.3, which reads and writes these files.
"""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

from pipeline.cli import InputError

Point = tuple[float, float]

SUFFIX = ".gsz"
#: Bytes of a document beyond which it is no section: a small zip may hold any number.
MOST = 50_000_000
#: Parts of a document that say nothing of the section before the slide.
SILENT = {"FileInfo", "Analyses", "Geometries", "Contexts", "Materials", "View", "Views", "Graphs"}


@dataclass
class Regions:
    """What was read.

    Attributes:
        zones: name -> vertices, in the file's unit of length.
        materials: name of the zone -> name of its material, where the file gives one.
        left_out: what else the file holds, a line each.
    """

    zones: dict[str, list[Point]] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def read_gsz(path: Path) -> Regions:
    """Regions and their materials.

    Raises:
        InputError: no such file, several geometries, or a region that is none; one line.
    """
    root = _document(path)
    geometries = root.findall("Geometries/Geometry")
    if len(geometries) != 1:
        _refuse(path, f"holds {len(geometries)} geometries; save the one of the section alone")
    points = _points(geometries[0], path)
    materials, changed = _materials(root, path)
    found = Regions()
    for region in geometries[0].findall("Regions/Region"):
        number = _text(region, "ID", path)
        corners = [word.strip() for word in _text(region, "PointIDs", path).split(",")]
        if unknown := next((corner for corner in corners if corner not in points), None):
            _refuse(path, f"region {number}: there is no point {unknown}")
        material = materials.get(f"Regions-{number}")
        if material is None:
            found.left_out.append(f"region {number}: the first analysis gives it no material")
            continue
        name = f"{material}_region_{number}"
        found.zones[name] = [points[corner] for corner in corners]
        found.materials[name] = material
    found.left_out += changed
    found.left_out += [
        f"{count} of {kind}"
        for kind, count in sorted(
            Counter({one.tag: len(one) for one in root if one.tag not in SILENT}).items()
        )
        if count
    ]
    found.left_out.append("strengths, unit weights and water: give them by --materials and --water")
    return found


def _document(path: Path) -> ElementTree.Element:
    """The XML document in the zip."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with zipfile.ZipFile(path) as archive:
            names = [one for one in archive.infolist() if re.fullmatch(r"[^/]*\.xml", one.filename)]
            own = [one for one in names if one.filename == f"{path.stem}.xml"] or names
            if len(own) != 1:
                _refuse(path, f"holds {len(own)} documents, where one says what the section is")
            if own[0].file_size > MOST:
                _refuse(path, f"its document has {own[0].file_size / 1e6:.0f} MB; allowed are 50")
            with archive.open(own[0]) as file:
                text = file.read(MOST + 1)
    except (zipfile.BadZipFile, EOFError, RuntimeError, NotImplementedError) as error:
        _refuse(path, f"is no file of GeoStudio ({error})")
    if len(text) > MOST or b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        _refuse(path, "its document is none of GeoStudio")
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        _refuse(path, f"its document cannot be read ({error})")


def _points(geometry: ElementTree.Element, path: Path) -> dict[str, Point]:
    points: dict[str, Point] = {}
    for point in geometry.findall("Points/Point"):
        try:
            points[point.attrib["ID"]] = (float(point.attrib["X"]), float(point.attrib["Y"]))
        except (KeyError, ValueError):
            _refuse(path, f"a point has {point.attrib}; it needs ID, X and Y")
    return points


def _materials(root: ElementTree.Element, path: Path) -> tuple[dict[str, str], list[str]]:
    """Region -> name of its material in the first analysis; where later ones have another."""
    words = {
        _text(one, "ID", path): _word(_text(one, "Name", path))
        for one in root.findall("Materials/Material")
    }
    often = Counter(words.values())
    names = {key: word if often[word] == 1 else f"{word}_{key}" for key, word in words.items()}
    used: dict[str, str] = {}
    changed: list[str] = []
    for context in root.findall("Contexts/Context"):
        own = {}
        for entry in context.find("GeometryUsesMaterials") or ():
            region, number = entry.attrib.get("ID", ""), entry.attrib.get("Entry", "")
            if number not in names:
                _refuse(path, f"{region}: there is no material {number!r}")
            own[region] = names[number]
        if not used:
            used = own
            continue
        number = context.findtext("AnalysisID", "?")
        changed += [
            f"{region} is {name!r} in analysis {number}; {used[region]!r} was read"
            for region, name in own.items()
            if used.get(region, name) != name
        ]
    return used, changed


def _text(element: ElementTree.Element, tag: str, path: Path) -> str:
    text = element.findtext(tag)
    if not text:
        _refuse(path, f"a {element.tag} has no {tag}")
    return text.strip()


def _word(name: str) -> str:
    """A name as scenes have them."""
    return re.sub(r"\W+", "_", name).strip("_") or "soil"


def _refuse(path: Path, words: str) -> NoReturn:
    raise InputError(f"{path}: {words}")
