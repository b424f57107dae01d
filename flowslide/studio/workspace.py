"""The folder that the studio works in: its cases, their drafts, and the journal of their edits.

A case is a folder with `scene.yaml`, as the command line has it. The page sends whole documents:
without faults they are written to these files, with faults they are kept as a draft, so that a
browser or a server that is killed loses nothing. Cases that ship with the program are read; they
are copied before they can be edited. Under `.studio/<case>/`: `draft.json`, `journal.jsonl` (every
accepted edit, with its time), `first/` (the files as they were before the first edit, comments and
all), `view.json` (what the page remembers), `jobs/`.
"""

from __future__ import annotations

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

from geometry.case import SCENE_FILE, Case, load_case
from geometry.scenes.fill import fill
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from pipeline.cli import InputError
from pipeline.files import (
    atomic_path,
    content_hash,
    make_folder,
    read_json,
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
HIDDEN = ".studio"
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


@dataclass(frozen=True)
class Fault:
    """What is wrong with a document, in the words of `flowslide check`."""

    document: str
    message: str


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
        if (place / SCENE_FILE).is_file():
            return place
        if (shipped(CASES) / name / SCENE_FILE).is_file():
            return shipped(CASES) / name
        raise InputError(f"case {name!r}: there is none in {self.folder}, and none ships")

    def is_shipped(self, name: str) -> bool:
        """It can be read alone."""
        return self.source(name) != self.place(name)

    def cases(self) -> list[dict[str, Any]]:
        """Name and origin of every case, those of the workspace first."""
        own = sorted(path.parent.name for path in self.folder.glob(f"*/{SCENE_FILE}")
                     if NAME.fullmatch(path.parent.name))  # fmt: skip
        ready = [name for name in names_of(CASES, SCENE_FILE)
                 if (shipped(CASES) / name / SCENE_FILE).is_file() and name not in own]  # fmt: skip
        return [{"name": name, "shipped": False} for name in own] + [
            {"name": name, "shipped": True} for name in ready
        ]

    # --- reading ---

    def read(self, name: str) -> dict[str, Any]:
        """A case as the page has it: its documents, what is wrong with them, what follows."""
        source = self.source(name)
        files = _documents(source)
        documents, is_shipped = files, self.is_shipped(name)
        draft = self.hidden(name, "draft.json")
        if draft.is_file() and not is_shipped:
            documents = read_json(draft)["documents"]
        faults = self.faults(name, documents)
        return {
            "name": name,
            "shipped": is_shipped,
            "revision": content_hash(files),
            "draft": documents != files,
            **documents,
            "faults": [vars(fault) for fault in faults],
            "derived": None if faults else self._derived(name, documents),
        }

    def revision(self, name: str) -> str:
        """Hash of what the files of a case say."""
        return content_hash(_documents(self.source(name)))

    def faults(self, name: str, documents: Mapping[str, Any]) -> list[Fault]:
        """What is wrong; the first fault of each document."""
        try:
            scene = scene_from_mapping(documents.get("scene"), SCENE_FILE)
        except InputError as error:
            return [Fault("scene", _shown(error, SCENE_FILE))]
        found = []
        with self._as_folder(name, documents) as folder:
            for part, check in _CHECKS.items():
                if documents.get(part) is None:
                    continue
                try:
                    check(folder, scene)
                except InputError as error:
                    found.append(Fault(part, _shown(error, str(folder / DOCUMENTS[part]))))
        return found

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
            _write_documents(folder, {part: documents.get(part) for part in DOCUMENTS})
            yield folder

    # --- writing ---

    def create(self, name: str, copy_of: str | None, scene: Mapping[str, Any] | None) -> None:
        """Make a case: a copy of another one, or of a section.

        Raises:
            InputError: there is one of that name, or the section does not hold together.
        """
        place = self.place(name)
        if place.exists():
            raise InputError(f"case {name!r}: is there already")
        if (copy_of is None) == (scene is None):
            raise InputError(f"case {name!r}: give the case to copy, or a section")
        if copy_of is not None:
            source = self.source(copy_of)
            temporary = make_folder(self.folder / HIDDEN) / f"new_{name}"
            shutil.rmtree(temporary, ignore_errors=True)
            shutil.copytree(source, temporary, ignore=shutil.ignore_patterns(HIDDEN))
            temporary.rename(place)
            return
        scene_from_mapping(scene, SCENE_FILE)
        _write_documents(make_folder(place), {"scene": scene})

    def save(self, name: str, revision: str, documents: Mapping[str, Any]) -> bool:
        """Keep an edit: in the files, or as a draft where something is wrong.

        Returns:
            whether the files were still at `revision`; if not, nothing was written.

        Raises:
            InputError: the case ships with the program, or there is none.
        """
        if self.is_shipped(name):
            raise InputError(f"case {name!r}: ships with the program; copy it to edit it")
        folder = self.place(name)
        files = _documents(folder)
        if content_hash(files) != revision:
            return False
        documents = {part: documents.get(part) for part in DOCUMENTS}
        first = self.hidden(name, "first")
        if not first.is_dir():
            shutil.copytree(folder, first, ignore=shutil.ignore_patterns(HIDDEN))
        draft = self.hidden(name, "draft.json")
        if self.faults(name, documents):
            write_json(draft, {"documents": documents})
        else:
            changed = {k: v for k, v in documents.items() if v != files[k]}
            _write_documents(folder, changed)
            draft.unlink(missing_ok=True)
        with self.hidden(name, "journal.jsonl").open("a", encoding="utf-8") as journal:
            journal.write(json.dumps({"time": time.time(), "documents": documents}) + "\n")
        return True

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
    return {
        part: read_yaml(folder / file) if (folder / file).is_file() else None
        for part, file in DOCUMENTS.items()
    }


def _write_documents(folder: Path, documents: Mapping[str, Any]) -> None:
    for part, document in documents.items():
        path = folder / DOCUMENTS[part]
        if document is None:
            path.unlink(missing_ok=True)
        else:
            write_text(path, yaml_text(document, width=100, default_flow_style=None))


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
