"""The documents of a case as the page has them, and how they are written.

A case is a mapping of parts: `scene`, `measurements`, `inversion`, `diagnosis` (the contents of its
YAML files, None where there is no file) and `tables` (the texts of its CSV files by name).
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flowslide.studio.faults import DOCUMENTS
from flowslide.studio.yaml_edits import edited_yaml
from geometry.case import SCENE_FILE, Case
from geometry.scenes.drawings import with_room
from geometry.scenes.limits import FARTHEST_M
from geometry.scenes.scene import Scene, checked_document, scene_from_mapping
from geometry.survey.marks import Height
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import Measurements
from inversion.new_case.case_files import CaseWords, inversion_text, readme_text, scene_file_text
from pipeline.cli import InputError
from pipeline.files import parse_yaml, read_text, read_yaml, write_text, yaml_text

TABLES = "tables"
"""The part that holds the texts of a case's CSV files by their names."""
_TABLE = re.compile(r"[A-Za-z0-9_-]{1,64}\.csv")


def read_documents(folder: Path) -> dict[str, Any]:
    """The parts of a case's folder."""
    found: dict[str, Any] = {
        part: read_yaml(folder / file) if (folder / file).is_file() else None
        for part, file in DOCUMENTS.items()
    }
    tables = sorted(path for path in folder.glob("*.csv") if _is_table(path))
    return {**found, TABLES: {path.name: read_text(path) for path in tables}}


def _is_table(path: Path) -> bool:
    """A CSV file of the case's own; a link elsewhere is not shown."""
    return bool(_TABLE.fullmatch(path.name)) and path.resolve().parent == path.parent.resolve()


def parts_of(documents: Mapping[str, Any]) -> dict[str, Any]:
    """The parts alone of what was sent.

    Raises:
        InputError: a table has a name that is none.
    """
    found = {part: documents.get(part) for part in DOCUMENTS}
    return {**found, TABLES: {_table(name): text for name, text in _tables(documents)}}


def with_room_made(documents: Mapping[str, Any]) -> dict[str, Any]:
    """The parts; the section with spacing, domain and base that hold what is drawn and surveyed."""
    scene: Any = documents.get("scene")
    try:
        outlines = [
            value for zone in scene["zones"] for place in zone["polygon"] for value in place
        ]
        if all(abs(value) <= FARTHEST_M for value in outlines):
            scene = with_room(scene, _surveyed(documents))
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError):
        pass  # it is at fault, and the checks say how
    return {**documents, "scene": scene}


def base_of(documents: Mapping[str, Any]) -> Any:
    """Vertices of the base; None: none is drawn."""
    scene = documents.get("scene")
    ground = scene.get("ground") if isinstance(scene, Mapping) else None
    return ground.get("points") if isinstance(ground, Mapping) else None


def without_base(documents: Mapping[str, Any]) -> dict[str, Any]:
    """The parts without the vertices of the base, which `with_room_made` then makes."""
    scene = documents["scene"]
    ground = {key: value for key, value in scene["ground"].items() if key != "points"}
    return {**documents, "scene": {**scene, "ground": ground}}


def proposed_question(documents: Mapping[str, Any]) -> dict[str, Any]:
    """What `flowslide new` would ask of a section and its survey: the document `inversion.yaml`.

    Raises:
        InputError: the section does not hold together, or nothing in it is liquefied.
    """
    scene = scene_from_mapping(with_room_made(documents)["scene"] or {}, SCENE_FILE)
    if not any(material.liquefied for material in scene.materials.values()):
        raise InputError("no material is marked as liquefied, so there is no S_r to find")
    return parse_yaml(_question_text(scene, documents), name=DOCUMENTS["inversion"])


def write_plain(folder: Path, documents: Mapping[str, Any]) -> None:
    """Write the parts into a folder, to be checked or simulated."""
    for part, file in DOCUMENTS.items():
        if documents.get(part) is not None:
            write_text(folder / file, yaml_text(documents[part]))
    for name, text in _tables(documents):
        write_text(folder / _table(name), text)


def write_case(folder: Path, name: str, documents: Mapping[str, Any]) -> None:
    """Write what differs from the files of a case, whose comments stay.

    A part that is no longer there is removed. A new case gets the comments and the `README.md` that
    `flowslide new` would write.
    """
    files = read_documents(folder)
    if files["scene"] is None and not (folder / "README.md").exists():
        scene = scene_from_mapping(documents["scene"], SCENE_FILE)
        write_text(folder / "README.md", readme_text(scene, [], None, _words(name)))
    for part, file in DOCUMENTS.items():
        document, path = documents.get(part), folder / file
        if document == files[part]:
            continue
        if document is None:
            path.unlink(missing_ok=True)
        else:
            text = read_text(path) if path.is_file() else _first_text(part, name, documents)
            write_text(path, edited_yaml(text, document))
    for table, text in _tables(documents):
        if text != files[TABLES].get(table):
            write_text(folder / table, text)


def marks_of(case: Case) -> list[dict[str, Any]]:
    """What was measured, as lines and distances on the section, and heights over its surface."""
    found: list[dict[str, Any]] = []
    if case.survey is None:
        return found
    for entry in case.survey.chosen(case.measurement_set or None):
        for mark in entry.marks(case.feet):
            kind = type(mark).__name__.lower()
            values = {
                key: value.tolist() if hasattr(value, "tolist") else value
                for key, value in vars(mark).items()
            }
            if isinstance(mark, Height):
                values["surface"] = case.scene.surface(mark.x)
            found.append({"kind": kind, "name": entry.name, **values})
    return found


def _tables(documents: Mapping[str, Any]) -> list[tuple[str, str]]:
    tables = documents.get(TABLES) or {}
    if not isinstance(tables, Mapping) or not all(isinstance(one, str) for one in tables.values()):
        raise InputError(f"{TABLES}: must be the texts of CSV files by their names")
    return list(tables.items())


def _table(name: str) -> str:
    """The name of a CSV file, which leads nowhere else.

    Raises:
        InputError: it is none.
    """
    if not _TABLE.fullmatch(name):
        raise InputError(f"table {name[:80]!r}: letters, digits, _ and -, and .csv")
    return name


def _surveyed(documents: Mapping[str, Any]) -> list[float]:
    """Places x of the surveyed profiles [m]."""
    sets = (documents.get("measurements") or {}).get("sets") or {}
    files = {one.get("file") for entries in sets.values() for one in entries}
    found = []
    for name, text in _tables(documents):
        lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
        for row in csv.DictReader(lines) if name in files else ():
            found.append(float(row["x_m"]))
    return found


def _first_text(part: str, name: str, documents: Mapping[str, Any]) -> str:
    """A new file with the comments that `flowslide new` would write."""
    try:
        scene = scene_from_mapping(documents.get("scene") or {}, SCENE_FILE)
    except InputError:
        return ""
    if part == "scene":
        return scene_file_text(scene, _words(name))
    if part == "inversion" and any(one.liquefied for one in scene.materials.values()):
        return _question_text(scene, documents)
    return ""


def _words(name: str) -> CaseWords:
    return CaseWords(name, "a drawing in the studio", "left", None)


def _question_text(scene: Scene, documents: Mapping[str, Any]) -> str:
    toes = []
    if documents.get("measurements") is not None:
        survey = checked_document(Measurements, documents["measurements"], MEASUREMENTS_FILE)
        toes = [
            one.name for one in survey.chosen() if one.toe_side is not None and not one.held_out
        ]
    return inversion_text(scene, toes)
