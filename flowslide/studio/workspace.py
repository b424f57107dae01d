"""The folder that the studio works in: its cases, their drafts, and the journal of their edits.

A case is a folder with `scene.yaml`, as the command line has it. The page sends whole documents:
without faults they are written to these files, with faults they are kept as a draft, so that a
browser or a server that is killed loses nothing. Cases that ship with the program are read; they
are copied before they can be edited. Under `.studio/<case>/`: `draft.json`, `journal.jsonl` (every
accepted edit, with its time), `first/` (the files as they were before the first edit), `view.json`
(what the page remembers), `bases.json` (those that nobody drew), `jobs/`. A case that is drawn from
nothing has a draft alone until its section holds together; then it gets the files that `flowslide
new` would write.
"""

from __future__ import annotations

import json
import re
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock
from typing import Any

from flowslide.studio.case_documents import (
    base_of,
    marks_of,
    parts_of,
    read_documents,
    with_room_made,
    without_base,
    write_case,
    write_plain,
)
from flowslide.studio.faults import (
    DOCUMENTS,
    DocumentFault,
    field_faults,
    other_faults,
    section_faults,
)
from flowslide.studio.frames import doubt_message
from flowslide.studio.temporary import temporary_folder
from flowslide.studio.whole_files import append_line, copy_case
from geometry.case import SCENE_FILE, Case, load_case
from geometry.doubts import case_doubts
from geometry.scenes.fill import point_count
from geometry.scenes.scene import Scene
from geometry.sides import SIDES, Side
from inversion.joint.document import load_joint
from pipeline.cli import InputError
from pipeline.files import atomic_path, content_hash, make_folder, read_json, write_json
from pipeline.places import CASES, names_of, shipped

HIDDEN = ".studio"
#: Folder of a workspace with the joint relation of other slides.
JOINT = "joint"
REMOVED = "removed.cases"
"""Folder of cases that were taken out; the dot is in no name of a case."""
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
PICTURE = re.compile(r"[a-z_]{1,32}\.(png|jpg)")


def listed(own: Sequence[str], file: str) -> list[dict[str, Any]]:
    """Name and origin of cases with such a document: those of a workspace, then those that ship."""
    ready = [
        name
        for name in names_of(CASES, file)
        if (shipped(CASES) / name / file).is_file() and name not in own
    ]
    return [{"name": name, "shipped": False} for name in own] + [
        {"name": name, "shipped": True} for name in ready
    ]


def misnamed(folder: Path, file: str) -> list[str]:
    """Folders with such a document whose names cannot be those of cases."""
    names = (path.parent.name for path in folder.glob(f"*/{file}"))
    return sorted(name for name in names if not NAME.fullmatch(name))


class NotKept(Exception):
    """An edit could not be written, or not all of it, such as on a full disk.

    Attributes:
        words: that say why.
        revision: of the case as it is now.
    """

    def __init__(self, words: str, revision: str) -> None:
        super().__init__(words)
        self.words, self.revision = words, revision


class Workspace:
    """A folder of cases.

    Args:
        folder: of the cases.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self._loaded: dict[str, tuple[Any, Case]] = {}
        self._writing = RLock()

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
        with self._writing:
            source = self.source(name)
            if self._has_draft(name):
                found = self.read(name)
                for first in found["faults"]:
                    words = f"has a fault to mend first: {first['message']}"
                    raise InputError(f"case {name!r}: {words}")
                if found["beside"] is not None:
                    raise InputError(f"case {name!r}: its files were changed beside a draft")
            return source

    def _has_draft(self, name: str) -> bool:
        return not self.is_shipped(name) and self.hidden(name, "draft.json").is_file()

    def snapshot(self, name: str, folder: Path) -> Path:
        """The files of a case as they are now, for a job that later edits do not reach.

        Args:
            name: of the case.
            folder: in which the copy is made, under the name of the case.

        Returns:
            the copy; of a case that ships, which nobody edits, its own folder.

        Raises:
            InputError: there is none, or it has faults.
        """
        with self._writing:
            source = self.ready(name)
            if self.is_shipped(name):
                return source
            copy = folder / name
            copy_case(source, copy, without=[HIDDEN])
        question = read_documents(copy)["diagnosis"]
        other = question.get("validation_case") if isinstance(question, Mapping) else None
        beside = folder / str(other).removeprefix("../")  # where the question looks for it
        if other is not None and re.fullmatch(r"\.\./[^/.]+", str(other)) and not beside.exists():
            with suppress(FileNotFoundError):  # the job says that it is not there
                copy_case(source / other, beside, without=[HIDDEN])
        return copy

    def is_shipped(self, name: str) -> bool:
        """It can be read alone."""
        return self.source(name) != self.place(name)

    def cases(self) -> list[dict[str, Any]]:
        """Name and origin of every case, those of the workspace first."""
        places = [*self.folder.glob(f"*/{SCENE_FILE}"), *self.folder.glob(f"{HIDDEN}/*/draft.json")]
        own = sorted(
            {
                path.parent.name
                for path in places
                if NAME.fullmatch(path.parent.name) and (self.folder / path.parent.name).is_dir()
            }
        )
        return listed(own, SCENE_FILE)

    def left_out(self) -> list[str]:
        """Folders with a section whose names cannot be those of cases."""
        return misnamed(self.folder, SCENE_FILE)

    # --- reading ---

    def read(self, name: str) -> dict[str, Any]:
        """A case as the page has it: its documents, what is wrong with them, what follows.

        A draft without faults, whose writing has ended in between, is written first. `beside` are
        the documents of the files where somebody has changed these since the draft was made.

        Raises:
            InputError: there is none, or a file of it cannot be read.
            OSError: the draft cannot be written, or not all of it.
        """
        with self._writing:
            draft = self._draft(name) if self._has_draft(name) else None
            whole = None if draft is None else self._faultless(name, draft)
            is_apart = draft is not None and self._is_apart(name, whole)
            if draft is not None and whole is not None and not is_apart:
                self._keep(name, draft, whole)
        files = read_documents(self.source(name))
        documents, is_shipped = files, self.is_shipped(name)
        draft = None if is_shipped else self._draft(name)
        if draft is not None:
            documents = {**files, **draft}
        faults = self.faults(name, documents)
        return {
            "name": name,
            "shipped": is_shipped,
            "revision": revision_of(files, draft),
            "draft": draft is not None,
            "beside": files if is_apart else None,
            **documents,
            "faults": [vars(fault) for fault in faults],
            "derived": None if faults else self._derived(name, documents),
        }

    def _is_apart(self, name: str, whole: Mapping[str, Any] | None) -> bool:
        """The files are neither what they were when the draft was made, nor what it writes."""
        known = read_json(self.hidden(name, "draft.json")).get("files")
        if known is None:
            return False
        now, wanted = _hashes(read_documents(self.source(name))), _hashes(whole or {})
        return any(now[part] not in (known[part], wanted.get(part)) for part in now)

    def revision(self, name: str) -> str:
        """What changes with every edit of a case, in the page or in its files."""
        draft = None if self.is_shipped(name) else self._draft(name)
        return revision_of(read_documents(self.source(name)), draft)

    def _draft(self, name: str) -> dict[str, Any] | None:
        path = self.hidden(name, "draft.json")
        return read_json(path)["documents"] if path.is_file() else None

    def faults(self, name: str, documents: Mapping[str, Any]) -> list[DocumentFault]:
        """What is wrong: all of it in the section and in the fields of the other documents.

        How those go together with the section is judged as soon as it is right.
        """
        documents = self._whole(name, documents)
        section, fields = section_faults(documents), field_faults(documents)
        if section:
            return section + fields
        told = {one.document for one in fields}
        with self._as_folder(name, documents) as folder:
            together = other_faults(folder, documents)
        return fields + [one for one in together if one.document not in told]

    def _whole(self, name: str, documents: Mapping[str, Any]) -> dict[str, Any]:
        """The parts with what nobody drew, made for the section as it is now."""
        made = base_of(documents) in self._bases(name)
        return with_room_made(without_base(documents) if made else documents)

    def _bases(self, name: str) -> list[Any]:
        """The bases that were made for a case: its files state them, but nobody drew them."""
        path = self.hidden(name, "bases.json")
        return read_json(path) if path.is_file() else []

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

    @property
    def joint(self) -> Path:
        """Where `flowslide joint --out` leaves what other slides say, for predictions."""
        return self.folder / JOINT

    def joint_words(self) -> str | None:
        """The ratio of a dam without a slide; None: no joint relation is in the workspace."""
        try:
            ratio = load_joint(self.joint).ratio
        except InputError:
            return None
        low, high = ratio.interval_95
        return f"{ratio.median:.3f} ({low:.3f} to {high:.3f})"

    def _derived(self, name: str, documents: Mapping[str, Any]) -> dict[str, Any]:
        """What follows from a case without faults."""
        case = self.case(name, self._whole(name, documents))
        scene = case.scene
        return {
            "title": case.title,
            "spacing_m": scene.spacing,
            "points": point_count(scene),
            "duration_s": case.simulation.duration_s,
            "feet": dict(case.feet),
            "ends": {side: _end_of(scene, side) for side in SIDES},
            "doubts": [doubt_message(line) for line in case_doubts(scene, case.survey)],
            "marks": marks_of(case),
            "sets": [] if case.survey is None else list(case.survey.sets),
            "joint": self.joint_words(),
        }

    @contextmanager
    def _as_folder(self, name: str, documents: Mapping[str, Any]) -> Iterator[Path]:
        """A folder with these documents and with whatever other files the case has."""
        with temporary_folder() as folder:
            try:
                others = list(self.source(name).iterdir())
            except InputError:
                others = []
            for path in others:
                if path.is_file() and path.name not in DOCUMENTS.values():
                    (folder / path.name).symlink_to(path.resolve())
            write_plain(folder, documents)
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
        if not isinstance(scene or {}, Mapping):
            raise InputError(f"case {name!r}: its scene must be a mapping of keys")
        if copy_of is not None:
            source = self.source(copy_of)
            temporary = make_folder(self.folder / HIDDEN) / f"new_{name}"
            shutil.rmtree(temporary, ignore_errors=True)
            with self._writing:
                draft = None if self.is_shipped(copy_of) else self._draft(copy_of)
                copy_case(source, temporary, without=[HIDDEN])
            temporary.rename(place)
            if draft is not None:
                kept = {**read_documents(place), **draft}
                self._keep(name, kept, self._faultless(name, kept))
            return
        make_folder(place)
        empty = {"name": name, "description": "", "zones": [], "materials": {}}
        kept = parts_of({"scene": {**empty, **(scene or {}), "name": name}})
        self._keep(name, kept, self._faultless(name, kept))

    def rename(self, name: str, other: str) -> None:
        """Give a case of the workspace another name; drafts, journal and jobs go with it.

        Raises:
            InputError: it ships with the program, or there is one of that name.
        """
        with self._writing:
            place, target = self._own(name), self.place(other)
            if target.exists() or other in (one["name"] for one in self.cases()):
                raise InputError(f"case {other!r}: is there already")
            hidden, moved = self.hidden(name), self.hidden(other)
            shutil.rmtree(moved, ignore_errors=True)  # of a case that was there before
            place.rename(target)
            if hidden.is_dir():
                hidden.rename(moved)
            for path in moved.glob("jobs/*/job.json"):
                job = read_json(path)
                folder = Path(job["folder"])
                if folder.is_relative_to(hidden):
                    folder = moved / folder.relative_to(hidden)
                write_json(path, {**job, "case": other, "folder": str(folder)})

    def remove(self, name: str) -> Path:
        """Take a case out of the workspace.

        Returns:
            the folder of the studio in which its files are kept.

        Raises:
            InputError: it ships with the program, or there is none.
        """
        with self._writing:
            place, hidden = self._own(name), self.hidden(name)
            removed = make_folder(self.folder / HIDDEN / REMOVED)
            kept = removed / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}-{time.time_ns() % 10**6}"
            place.rename(kept)
            if hidden.is_dir():
                hidden.rename(kept / HIDDEN)
            return kept

    def _own(self, name: str) -> Path:
        """The folder of a case that is not one of the program's."""
        if self.is_shipped(name):
            raise InputError(f"case {name!r}: ships with the program and stays as it is")
        return self.place(name)

    def save(self, name: str, revision: str, documents: Mapping[str, Any]) -> bool:
        """Keep an edit: in the files, or as a draft where something is wrong.

        Returns:
            whether the case was still at `revision`; if not, nothing was written.

        Raises:
            InputError: the case ships with the program, there is none, or a table has a name that
                is none.
            NotKept: the disk is full, and the like.
        """
        if self.is_shipped(name):
            raise InputError(f"case {name!r}: ships with the program; copy it to edit it")
        folder = self.place(name)
        kept = parts_of(documents)
        # Before the look at the revision: it takes its time, in which others may write.
        whole = self._faultless(name, kept)
        with self._writing:
            if self.revision(name) != revision:
                return False
            first = self.hidden(name, "first")
            if not first.is_dir():
                make_folder(first.parent)
                copy_case(folder, first, without=[HIDDEN])
            try:
                self._keep(name, kept, whole)
            except OSError as error:
                raise NotKept(error.strerror or str(error), self.revision(name)) from error
        return True

    def _faultless(self, name: str, documents: Mapping[str, Any]) -> dict[str, Any] | None:
        """The parts as they are written; None: something is wrong with them."""
        return None if self.faults(name, documents) else self._whole(name, documents)

    def _keep(
        self, name: str, documents: Mapping[str, Any], whole: Mapping[str, Any] | None
    ) -> None:
        """Keep parts as a draft; without faults they are then written whole, and the draft goes.

        Killed in between, the draft has the whole edit.
        """
        draft = self.hidden(name, "draft.json")
        make_folder(draft.parent)
        with self._writing:
            if whole is not None:
                make_folder(self.place(name))  # where nothing may be written there is no draft
            files = _hashes(read_documents(self.place(name)))
            write_json(draft, {"documents": documents, "files": files})
            if whole is not None:
                if base_of(whole) != base_of(documents):
                    bases = [*self._bases(name), base_of(whole)]
                    write_json(self.hidden(name, "bases.json"), bases)
                write_case(self.place(name), name, whole)
                draft.unlink()
            edit = {"time": time.time(), "documents": documents}
            append_line(self.hidden(name, "journal.jsonl"), json.dumps(edit))

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
        place = self._picture_place(name, file)
        make_folder(place.parent)
        with atomic_path(place) as temporary:
            temporary.write_bytes(content)

    def picture(self, name: str, file: str) -> Path:
        """A file of the page's own.

        Raises:
            InputError: there is none.
        """
        place = self._picture_place(name, file)
        if not place.is_file():
            raise InputError(f"there is no picture {file!r}")
        return place

    def _picture_place(self, name: str, file: str) -> Path:
        if not PICTURE.fullmatch(file):
            raise InputError(f"file {file[:80]!r}: is no picture of the studio")
        return self.hidden(name, file)


def _end_of(scene: Scene, side: Side) -> dict[str, Any]:
    """Where the section ends on one side, and whether the ground goes on there."""
    heights = [y for zone in scene.zones for _, y in scene.at_end(zone, side)]
    return {
        "goes_on": scene.domain.goes_on(side),
        "x_m": scene.end(side),
        "low_m": min(heights),
        "top_m": max(heights),
    }


def revision_of(files: Mapping[str, Any], draft: Mapping[str, Any] | None = None) -> str:
    """A hash of the parts of a case; 34 and 34.0, which a browser cannot tell apart, are one."""
    return content_hash(_with_whole_numbers({"files": files, "draft": draft}))


def _hashes(files: Mapping[str, Any]) -> dict[str, str]:
    return {part: content_hash(_with_whole_numbers(one)) for part, one in files.items()}


def _with_whole_numbers(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _with_whole_numbers(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_with_whole_numbers(one) for one in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value
