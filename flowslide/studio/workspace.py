"""The folder that the studio works in: its cases, their drafts, and the journal of their edits.

A case is a folder with `scene.yaml`, as the command line has it. The page sends whole documents:
without faults they are written to these files, with faults they are kept as a draft, so that a
browser or a server that is killed loses nothing. Cases that ship with the program are read; they
are copied before they can be edited. Under `.studio/<case>/`: `draft.json`, `journal.jsonl` (every
accepted edit, with its time), `first/` (the files as they were before the first edit), `view.json`
(what the page remembers), `jobs/`. A case that is drawn from nothing has a draft alone until its
section holds together; then it gets the files that `flowslide new` would write.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from flowslide.studio.yaml_edits import edited_yaml
from geometry.case import SCENE_FILE, Case, load_case
from geometry.scenes.drawings import with_room
from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene, checked_document, scene_faults, scene_from_mapping
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import Measurements
from inversion.new_case.case_files import CaseWords, inversion_text, readme_text, scene_file_text
from pipeline.cli import InputError
from pipeline.files import (
    atomic_path,
    content_hash,
    make_folder,
    parse_yaml,
    read_json,
    read_text,
    read_yaml,
    write_json,
    write_text,
    yaml_text,
)
from pipeline.places import CASES, names_of, shipped

DOCUMENTS = {
    "scene": SCENE_FILE,
    "measurements": MEASUREMENTS_FILE,
    "inversion": "inversion.yaml",
    "diagnosis": "diagnosis.yaml",
}
"""Part of a case that the page edits -> its file."""
TABLES = "tables"
"""The part that holds the texts of a case's CSV files by their names."""
HIDDEN = ".studio"
TABLE_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}\.csv")
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


@dataclass(frozen=True)
class Fault:
    """What is wrong with a document, in the words of `flowslide check`.

    Attributes:
        document: part of the case.
        message: one line.
        zones: names of those it concerns.
        places: where it is in the section: outlines of one or more vertices [m].
    """

    document: str
    message: str
    zones: tuple[str, ...] = ()
    places: tuple[tuple[tuple[float, float], ...], ...] = ()


class Workspace:
    """A folder of cases.

    Args:
        folder: of the cases.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self._loaded: dict[str, tuple[Any, Case]] = {}

    # --- places ---

    def place(self, name: str) -> Path:
        """Folder of a case of the workspace, which need not be there.

        Raises:
            InputError: the name is none, or leads out of the workspace by a link.
        """
        if not NAME.fullmatch(name):
            raise InputError(f"case {name[:80]!r}: letters, digits, _ and -, at most 64")
        place = self.folder / name
        if place.resolve().parent != self.folder:
            raise InputError(f"case {name!r}: is a link that leads out of {self.folder}")
        return place

    def hidden(self, name: str, *parts: str) -> Path:
        """A place of the studio's own for a case.

        Raises:
            InputError: as `place`; or it leads out of the workspace by a link.
        """
        place = self.folder.joinpath(HIDDEN, self.place(name).name, *parts)
        if not place.resolve().is_relative_to(self.folder / HIDDEN):
            raise InputError(f"case {name!r}: {place} is a link that leads elsewhere")
        return place

    def source(self, name: str) -> Path:
        """The folder that a case is read from: of the workspace, else as shipped.

        Raises:
            InputError: there is none.
        """
        place = self.place(name)
        if (place / SCENE_FILE).is_file() or self._is_drawn(name):
            return place
        if (shipped(CASES) / name / SCENE_FILE).is_file():
            return shipped(CASES) / name
        raise InputError(f"case {name!r}: there is none in {self.folder}, and none ships")

    def _is_drawn(self, name: str) -> bool:
        """It is drawn here, and its section does not hold together yet."""
        return self.place(name).is_dir() and self.hidden(name, "draft.json").is_file()

    def ready(self, name: str) -> Path:
        """The folder of a case whose files are what the page shows.

        Raises:
            InputError: there is none, or it has faults.
        """
        source = self.source(name)
        if not self.is_shipped(name) and self.hidden(name, "draft.json").is_file():
            first = self.read(name)["faults"][0]
            raise InputError(f"case {name!r}: has a fault to mend first: {first['message']}")
        return source

    def is_shipped(self, name: str) -> bool:
        """It can be read alone."""
        return self.source(name) != self.place(name)

    def cases(self) -> list[dict[str, Any]]:
        """Name and origin of every case, those of the workspace first."""
        places = [*self.folder.glob(f"*/{SCENE_FILE}"), *self.folder.glob(f"{HIDDEN}/*/draft.json")]
        own = sorted({path.parent.name for path in places
                      if NAME.fullmatch(path.parent.name)
                      and (self.folder / path.parent.name).is_dir()})  # fmt: skip
        ready = [name for name in names_of(CASES, SCENE_FILE)
                 if (shipped(CASES) / name / SCENE_FILE).is_file() and name not in own]  # fmt: skip
        return [{"name": name, "shipped": False} for name in own] + [
            {"name": name, "shipped": True} for name in ready
        ]

    # --- reading ---

    def read(self, name: str) -> dict[str, Any]:
        """A case as the page has it: its documents, what is wrong with them, what follows."""
        files = _documents(self.source(name))
        documents, is_shipped = files, self.is_shipped(name)
        draft = None if is_shipped else self._draft(name)
        if draft is not None:
            documents = {**files, **draft}
        faults = self.faults(name, documents)
        return {
            "name": name,
            "shipped": is_shipped,
            "revision": _revision(files, draft),
            "draft": draft is not None,
            **documents,
            "faults": [vars(fault) for fault in faults],
            "derived": None if faults else self._derived(name, documents),
        }

    def revision(self, name: str) -> str:
        """What changes with every edit of a case, in the page or in its files."""
        draft = None if self.is_shipped(name) else self._draft(name)
        return _revision(_documents(self.source(name)), draft)

    def _draft(self, name: str) -> dict[str, Any] | None:
        path = self.hidden(name, "draft.json")
        return read_json(path)["documents"] if path.is_file() else None

    def faults(self, name: str, documents: Mapping[str, Any]) -> list[Fault]:
        """What is wrong: all of it in the section, else the first of each other document."""
        document = _roomy(documents)
        if not isinstance(document, dict):
            return [Fault("scene", "must be a mapping of keys")]
        if not document.get("zones"):
            return [Fault("scene", "no zone is drawn yet")]
        documents = {**documents, "scene": document}
        found = scene_faults(document)
        if found:
            return [Fault("scene", one.message, one.zones, one.places) for one in found]
        scene = scene_from_mapping(document, SCENE_FILE)
        faults = []
        with self._as_folder(name, documents) as folder:
            for part, check in _CHECKS.items():
                if documents.get(part) is None:
                    continue
                try:
                    check(folder, scene)
                except InputError as error:
                    shown = _shown(error, str(folder / DOCUMENTS[part]))
                    faults.append(Fault(part, shown.replace(f"{folder}/", "")))
        return faults

    def proposed(self, name: str, documents: Mapping[str, Any]) -> dict[str, Any]:
        """What `flowslide new` would ask of a section and its survey.

        Returns:
            the document of `inversion.yaml`.

        Raises:
            InputError: the section does not hold together, or nothing in it is liquefied.
        """
        scene = scene_from_mapping(_roomy(documents) or {}, SCENE_FILE)
        if not any(material.liquefied for material in scene.materials.values()):
            raise InputError("no material is marked as liquefied, so there is no S_r to find")
        return parse_yaml(_question_text(scene, documents), name=DOCUMENTS["inversion"])

    def case(self, name: str, documents: Mapping[str, Any] | None = None) -> Case:
        """A case to simulate: as its files have it, or with documents of the page.

        Raises:
            InputError: a document does not hold together; one line.
        """
        if documents is None:
            source = self.source(name)
            # A slider asks many times a second, and reading takes a tenth of one.
            files = [path.stat() for path in sorted(source.iterdir()) if path.is_file()]
            key = [source, *((one.st_ino, one.st_mtime_ns, one.st_size) for one in files)]
            if self._loaded.get(name, (None,))[0] != key:
                self._loaded[name] = key, load_case(source)
            return self._loaded[name][1]
        with self._as_folder(name, documents) as folder:
            return load_case(folder)

    def _derived(self, name: str, documents: Mapping[str, Any]) -> dict[str, Any]:
        """What follows from a case without faults."""
        case = self.case(name, documents)
        scene = case.scene
        return {
            "title": case.title,
            "spacing_m": scene.spacing,
            "points": len(fill(scene)),
            "duration_s": case.simulation.duration_s,
            "feet": dict(case.feet),
            "marks": [] if case.survey is None else _marks(case),
            "sets": [] if case.survey is None else list(case.survey.sets),
        }

    @contextmanager
    def _as_folder(self, name: str, documents: Mapping[str, Any]) -> Iterator[Path]:
        """A folder with these documents and with whatever other files the case has."""
        with TemporaryDirectory(prefix="flowslide_studio_") as temporary:
            folder = Path(temporary)
            try:
                others = list(self.source(name).iterdir())
            except InputError:
                others = []
            for path in others:
                if path.is_file() and path.name not in DOCUMENTS.values():
                    shutil.copy(path, folder / path.name)
            for part, file in DOCUMENTS.items():
                if documents.get(part) is not None:
                    write_text(folder / file, yaml_text(documents[part]))
            for table, text in (documents.get(TABLES) or {}).items():
                write_text(folder / _table(table), text)
            yield folder

    # --- writing ---

    def create(self, name: str, copy_of: str | None, scene: Mapping[str, Any] | None) -> None:
        """Make a case: a copy of another one, of an imported section, or to be drawn from nothing.

        Raises:
            InputError: there is one of that name.
        """
        place = self.place(name)
        if place.exists() or name in (one["name"] for one in self.cases()):
            raise InputError(f"case {name!r}: is there already")
        if copy_of is not None:
            source = self.source(copy_of)
            temporary = make_folder(self.folder / HIDDEN) / f"new_{name}"
            shutil.rmtree(temporary, ignore_errors=True)
            shutil.copytree(source, temporary, ignore=shutil.ignore_patterns(HIDDEN))
            temporary.rename(place)
            return
        make_folder(place)
        empty = {"name": name, "description": "", "zones": [], "materials": {}}
        self._keep(name, {"scene": {**empty, **(scene or {}), "name": name}})

    def save(self, name: str, revision: str, documents: Mapping[str, Any]) -> bool:
        """Keep an edit: in the files, or as a draft where something is wrong.

        Returns:
            whether the case was still at `revision`; if not, nothing was written.

        Raises:
            InputError: the case ships with the program, there is none, or a table has a name that
                is none.
        """
        if self.is_shipped(name):
            raise InputError(f"case {name!r}: ships with the program; copy it to edit it")
        folder = self.place(name)
        if self.revision(name) != revision:
            return False
        for table in documents.get(TABLES) or {}:
            _table(table)
        first = self.hidden(name, "first")
        if not first.is_dir():
            shutil.copytree(folder, first, ignore=shutil.ignore_patterns(HIDDEN))
        self._keep(name, documents)
        return True

    def _keep(self, name: str, documents: Mapping[str, Any]) -> None:
        kept = {part: documents.get(part) for part in DOCUMENTS}
        kept[TABLES] = dict(documents.get(TABLES) or {})
        draft = self.hidden(name, "draft.json")
        make_folder(draft.parent)
        if self.faults(name, kept):
            write_json(draft, {"documents": kept})
        else:
            folder = self.place(name)
            is_new = not (folder / SCENE_FILE).is_file()
            kept["scene"] = _roomy(kept)
            _write_documents(folder, name, kept)
            if is_new and not (folder / "README.md").exists():
                scene = scene_from_mapping(kept["scene"], SCENE_FILE)
                write_text(folder / "README.md", readme_text(scene, [], None, _words(name)))
            draft.unlink(missing_ok=True)
        with self.hidden(name, "journal.jsonl").open("a", encoding="utf-8") as journal:
            journal.write(json.dumps({"time": time.time(), "documents": kept}) + "\n")

    def view(self, name: str) -> Any:
        """What the page remembers of a case; None: nothing."""
        path = self.hidden(name, "view.json")
        return read_json(path) if path.is_file() else None

    def save_view(self, name: str, view: Any) -> None:
        """Keep what the page remembers of a case."""
        make_folder(self.hidden(name))
        write_json(self.hidden(name, "view.json"), view)

    def save_file(self, name: str, file: str, content: bytes) -> None:
        """Keep a file of the page's own, such as a picture to draw on."""
        if not re.fullmatch(r"[a-z_]{1,32}\.(png|jpg)", file):
            raise InputError(f"file {file[:80]!r}: is no picture of the studio")
        make_folder(self.hidden(name))
        with atomic_path(self.hidden(name, file)) as temporary:
            temporary.write_bytes(content)


def _documents(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = {
        part: read_yaml(folder / file) if (folder / file).is_file() else None
        for part, file in DOCUMENTS.items()
    }
    tables = sorted(path for path in folder.glob("*.csv") if TABLE_NAME.fullmatch(path.name))
    return {**found, TABLES: {path.name: read_text(path) for path in tables}}


def _table(name: str) -> str:
    """The name of a CSV file, which leads nowhere else.

    Raises:
        InputError: it is none.
    """
    if not TABLE_NAME.fullmatch(name):
        raise InputError(f"table {name[:80]!r}: letters, digits, _ and -, and .csv")
    return name


def _revision(files: Mapping[str, Any], draft: Mapping[str, Any] | None) -> str:
    return content_hash({"files": files, "draft": draft})


def _roomy(documents: Mapping[str, Any]) -> Any:
    """The section with spacing, domain and base that hold what is drawn and surveyed."""
    scene = documents.get("scene")
    try:
        return with_room(scene, _surveyed(documents))
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError):
        return scene  # it is at fault, and the checks say how


def _surveyed(documents: Mapping[str, Any]) -> list[float]:
    """Places x of the surveyed profiles [m]."""
    sets = (documents.get("measurements") or {}).get("sets") or {}
    files = {one.get("file") for entries in sets.values() for one in entries}
    found = []
    for name, text in (documents.get(TABLES) or {}).items():
        lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
        for row in csv.DictReader(lines) if name in files else ():
            found.append(float(row["x_m"]))
    return found


def _write_documents(folder: Path, name: str, documents: Mapping[str, Any]) -> None:
    """Write what differs from the files; what is no longer there is removed."""
    files = _documents(folder)
    for part, file in DOCUMENTS.items():
        document, path = documents.get(part), folder / file
        if document == files[part]:
            continue
        if document is None:
            path.unlink(missing_ok=True)
        else:
            text = read_text(path) if path.is_file() else _first_text(part, name, documents)
            write_text(path, edited_yaml(text, document))
    for table, text in (documents.get(TABLES) or {}).items():
        if text != files[TABLES].get(table):
            write_text(folder / table, text)


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
        toes = [one.name for one in survey.chosen()
                if one.toe_side is not None and not one.held_out]  # fmt: skip
    return inversion_text(scene, toes)


def _marks(case: Case) -> list[dict[str, Any]]:
    """What was measured, as lines and distances on the section."""
    found = []
    for entry in case.survey.chosen(case.measurement_set or None):
        for mark in entry.marks(case.feet):
            kind = type(mark).__name__.lower()
            values = {key: value.tolist() if hasattr(value, "tolist") else value
                      for key, value in vars(mark).items()}  # fmt: skip
            found.append({"kind": kind, "name": entry.name, **values})
    return found


def _check_measurements(folder: Path, scene: Scene) -> None:
    from geometry.survey.measurements import load_measurements

    load_measurements(folder, scene)


def _check_question(folder: Path, scene: Scene) -> None:
    from inversion.problem.question import load_question

    load_question(folder, scene)


def _check_diagnosis(folder: Path, scene: Scene) -> None:
    from diagnosis.question import load_diagnosis_question

    load_diagnosis_question(folder)


_CHECKS = {
    "measurements": _check_measurements,
    "inversion": _check_question,
    "diagnosis": _check_diagnosis,
}


def _shown(error: InputError, source: str) -> str:
    """The message without the temporary folder's name."""
    return str(error).removeprefix(f"{source}: ")
