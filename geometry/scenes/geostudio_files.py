"""Files of GeoStudio (`.gsz`) as outlines: every region is a zone.

A `.gsz` is a zip that holds an XML document under the file's own name. Read of it are `Geometries`
(points, and regions by the numbers of their points), the system of units (`Coordinates`), and which
material each region has in the first analysis (`Contexts`, `Materials`). Strengths, unit weights
and water depend on the analysis and are not read. Everything that is left out is listed. Structure
after M. Rousseau, PyGeoStudio 0.4.3, which reads and writes these files.
"""

from __future__ import annotations

import lzma
import math
import re
import zipfile
import zlib
from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

from pipeline.cli import InputError

Point = tuple[float, float]

#: Bytes of a document beyond which it is no section: a small zip may hold any number.
MOST = 50_000_000
#: Parts of a document that say nothing of the section before the slide.
SILENT = {
    "FileInfo",
    "Analyses",
    "Geometries",
    "Contexts",
    "Materials",
    "View",
    "Views",
    "Graphs",
    "Coordinates",
}
#: System of units -> unit of length.
SYSTEMS = {"metric": "m", "imperial": "ft"}


@dataclass
class Regions:
    """What was read.

    Attributes:
        zones: name -> vertices, in the file's unit of length.
        materials: name of the zone -> name of its material, where the file gives one.
        left_out: what else the file holds, a line each.
        unit: of length; empty: the file does not say.
    """

    zones: dict[str, list[Point]] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    unit: str = ""


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
    for system in root.findall("Coordinates/EngCoords"):
        word = system.attrib.get("UnitSystem", "")
        found.unit = SYSTEMS.get(word.lower(), word)
    numbers: set[str] = set()
    for region in geometries[0].findall("Regions/Region"):
        number = _text(region, "ID", path)
        corners = [word.strip() for word in _text(region, "PointIDs", path).split(",")]
        _once(number, numbers, "regions", path)
        numbers.add(number)
        if unknown := [corner for corner in corners if corner not in points]:
            _refuse(path, f"region {number}: there is no point {unknown[0]!r}")
        if len(set(corners)) < 3:
            _refuse(path, f"region {number}: has fewer than three points")
        material = materials.get(f"Regions-{number}")
        if material is None:
            found.left_out.append(f"region {number}: the first analysis gives it no material")
            continue
        name = f"{material}_region_{number}"
        found.zones[name] = [points[corner] for corner in corners]
        found.materials[name] = material
    found.left_out += changed
    found.left_out += [
        f"{len(one)} of {one.tag}"
        for one in sorted(root, key=lambda part: part.tag)
        if len(one) and one.tag not in SILENT
    ]
    found.left_out.append("strengths, unit weights and water: see --materials, and scene.yaml")
    return found


def _document(path: Path) -> ElementTree.Element:
    """The XML document in the zip."""
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
    except RuntimeError:  # what is in it is encrypted
        _refuse(path, "is locked by a password")
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError) as error:
        _refuse(path, f"is no file of GeoStudio, or is damaged ({error})")
    # Zeros are of another encoding, in which a declaration would not be seen.
    if len(text) > MOST or any(word in text for word in (b"<!DOCTYPE", b"<!ENTITY", b"\0")):
        _refuse(path, "its document is none of GeoStudio")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        _refuse(path, f"its document cannot be read ({error})")


def _points(geometry: ElementTree.Element, path: Path) -> dict[str, Point]:
    points: dict[str, Point] = {}
    for point in geometry.findall("Points/Point"):
        try:
            place = (float(point.attrib["X"]), float(point.attrib["Y"]))
            number = point.attrib["ID"]
        except (KeyError, ValueError):
            _refuse(path, f"a point has {point.attrib}; it needs ID, X and Y")
        if not all(map(math.isfinite, place)):
            _refuse(path, f"point {number}: lies at {place}")
        _once(number, points, "points", path)
        points[number] = place
    return points


def _materials(root: ElementTree.Element, path: Path) -> tuple[dict[str, str], list[str]]:
    """Region -> name of its material in the first analysis; where later ones have another."""
    words: dict[str, str] = {}
    for one in root.findall("Materials/Material"):
        number = _text(one, "ID", path)
        _once(number, words, "materials", path)
        words[number] = _word(_text(one, "Name", path))
    alike = len(set(words.values())) < len(words)
    names = {key: f"{word}_{key}" if alike else word for key, word in words.items()}
    used: dict[str, str] = {}
    read = ""
    changed: list[str] = []
    for context in root.findall("Contexts/Context"):
        own = {}
        for entry in context.find("GeometryUsesMaterials") or ():
            region, number = entry.attrib.get("ID", ""), entry.attrib.get("Entry", "")
            if not number:
                continue
            if number not in names:
                _refuse(path, f"{region}: there is no material {number!r}")
            own[region] = names[number]
        number = context.findtext("AnalysisID", "?")
        if not used:
            used, read = own, number
            continue
        changed += [
            f"{region} is {name!r} in analysis {number}; {used[region]!r}, of analysis {read}, was "
            "read"
            for region, name in own.items()
            if used.get(region, name) != name
        ]
    return used, changed


def _once(number: str, there: Container[str], what: str, path: Path) -> None:
    if number in there:
        _refuse(path, f"two {what} have the number {number}")


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
