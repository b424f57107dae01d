"""Cases in three dimensions as the page has them: folders with `scene3d.yaml`, which it only reads.

In: the folders of the workspace and those that ship. Out: their documents, what follows from them,
and copies for jobs. They are drawn elsewhere (rasters, a section), so nothing here writes to them.
Files that a scene names lie in its folder: a scene from a stranger leads nowhere else.
"""

from __future__ import annotations

import shutil
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Literal

import numpy as np

from flowslide.studio.body_maps import ground_message, measured_surface
from flowslide.studio.workspace import NAME, Workspace, listed, misnamed
from geometry.case import SCENE_FILE as SECTION_FILE
from geometry.scenes3d.scene3d import FILE_NAME as SCENE_FILE
from geometry.scenes3d.scene3d import Scene3d, load_scene_3d, read_document
from geometry.survey.measurements import FILE_NAME as SECTION_SURVEY_FILE
from geometry.survey3d.deposit import threshold
from geometry.survey3d.deposit_edge import DepositEdge
from geometry.survey3d.measured import MapMeasured
from geometry.survey3d.surface_after import SurfaceAfter
from geometry.survey3d.survey import FILE_NAME as SURVEY_FILE
from geometry.survey3d.survey import Survey3d, load_survey
from geometry.terrain.raster import BESIDE
from inversion.problem.question import FILE_NAME as QUESTION_FILE
from mpm_taichi.readings3d import maps_of, paths_of
from mpm_taichi.solver3d.problem import Problem3d, has_sloping_water, problem_of
from pipeline.cli import InputError
from pipeline.files import content_hash, make_folder, read_text, read_yaml
from pipeline.places import CASES, shipped
from report.numbers import unit_of

#: Before the name of a body in the list of cases of the page, and in its address.
BODY = "3d/"
#: Kinds of jobs that a body can be asked for.
Asks = Literal["simulate", "back_analyse", "posterior", "predict"]
ASKS: tuple[Asks, ...] = ("simulate", "back_analyse", "posterior", "predict")
#: Points that the page fills a scene with, about a minute of one core: others are for commands.
MOST_POINTS = 2_000_000
#: Scenes that are kept filled.
KEPT = 3
DOCUMENTS = (SCENE_FILE, SURVEY_FILE, QUESTION_FILE)


@dataclass(frozen=True)
class Filled:
    """A scene with its points."""

    scene: Scene3d
    problem: Problem3d


class Bodies:
    """The cases in three dimensions of a workspace.

    Args:
        workspace: of the folders.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._filled: OrderedDict[tuple[str, str, float | None], Filled] = OrderedDict()
        self._filling = Lock()

    def listed(self) -> list[dict[str, Any]]:
        """Name and origin of every one, those of the workspace first."""
        folder = self.workspace.folder
        own = sorted(path.parent.name for path in folder.glob(f"*/{SCENE_FILE}"))
        return listed([name for name in own if NAME.fullmatch(name)], SCENE_FILE)

    def left_out(self) -> list[str]:
        """Folders with a body whose names cannot be those of cases."""
        return misnamed(self.workspace.folder, SCENE_FILE)

    def source(self, name: str) -> Path:
        """The folder that one is read from: of the workspace, else as shipped.

        Raises:
            InputError: there is none.
        """
        for place in (self.workspace.place(name), shipped(CASES) / name):
            if (place / SCENE_FILE).is_file():
                return place
        raise InputError(
            f"case {name!r}: no {SCENE_FILE} in {self.workspace.folder / name}, and none ships"
        )

    def is_shipped(self, name: str) -> bool:
        """It comes with the program."""
        return self.source(name) != self.workspace.place(name)

    def revision(self, name: str) -> str:
        """What changes with every edit of its documents, and where a raster is another."""
        return revision_of(self.source(name))

    def read(self, name: str) -> dict[str, Any]:
        """One as the page has it: its documents, what is wrong with them, what follows."""
        folder = self.source(name)
        found: dict[str, Any] = {
            "name": name,
            "shipped": self.is_shipped(name),
            "revision": self.revision(name),
            "asks": {kind: lacking(folder, kind) for kind in ASKS},
            "inversion": _document(folder, QUESTION_FILE),
        }
        try:
            filled = self.filled(name)
            found |= {"faults": [], **_described(filled)}
        except InputError as error:
            return {**found, "faults": [_fault(SCENE_FILE, error, folder)], "derived": None}
        try:
            found["marks"] = _marks(load_survey_of(folder, filled.scene))
        except InputError as error:
            found |= {"marks": [], "faults": [_fault(SURVEY_FILE, error, folder)]}
        return found

    def ground(self, name: str, spacing_m: float | None = None) -> bytes:
        """The message of one before the slide, see `body_maps`.

        Raises:
            InputError: there is none, or its files do not hold together; one line.
        """
        filled, entries = self.filled(name, spacing_m), []
        with suppress(InputError):  # the page tells what is wrong with it
            survey = load_survey_of(self.source(name), filled.scene)
            entries = [] if survey is None else survey.chosen()
        measured = measured_surface(filled.scene, entries)
        return ground_message(filled.scene, filled.problem, measured)

    def filled(self, name: str, spacing_m: float | None = None) -> Filled:
        """One with its points at a spacing [m]; None: its own.

        Raises:
            InputError: as `ground`; or it would be too many points.
        """
        folder = self.source(name)
        key = (name, revision_of(folder), spacing_m)
        with self._filling:  # two tabs that open one fill it once
            if key not in self._filled:
                self._filled[key] = fill(folder, spacing_m)
            self._filled.move_to_end(key)
            while len(self._filled) > KEPT:
                self._filled.popitem(last=False)
            return self._filled[key]

    def snapshot(self, name: str, folder: Path) -> Path:
        """The files of one as they are now, for a job that later edits do not reach.

        Args:
            name: of the case.
            folder: in which the copy is made, under the name of the case.

        Returns:
            the copy; of a case that ships its own folder.

        Raises:
            InputError: there is none, or a file that it names is not there.
        """
        source = self.source(name)
        if self.is_shipped(name):
            return source
        if (source / SECTION_FILE).is_file():
            return self.workspace.snapshot(name, folder)
        for path in files_of(source):
            if not path.is_file():
                raise InputError(f"{path.relative_to(source)}: no such file in {source}")
            target = folder / name / path.relative_to(source)
            make_folder(target.parent)
            shutil.copy2(path, target)
        return folder / name


def fill(folder: Path, spacing_m: float | None) -> Filled:
    """Read a scene and fill it.

    Raises:
        InputError: its files do not hold together, or it would be too many points; one line.
    """
    files_of(folder)  # none of them leads elsewhere
    try:
        scene = load_scene_3d(folder, spacing=spacing_m)
    except InputError as error:
        raise InputError(str(error).replace(f"{folder}/", "")) from None
    about = _volume(scene) / scene.spacing**3
    if about > MOST_POINTS:
        raise InputError(
            f"about {about:,.0f} points at a spacing of {scene.spacing:g} m: the page takes "
            f"{MOST_POINTS:,}; a coarser spacing, or `flowslide simulate`"
        )
    return Filled(scene, problem_of(scene))


def lacking(folder: Path, kind: Asks) -> str:
    """What a question needs that a folder does not have; empty: it can be asked."""
    if kind in ("simulate", "predict"):
        return ""
    over_width = (folder / SECTION_FILE).is_file() and (folder / SECTION_SURVEY_FILE).is_file()
    if not (folder / SURVEY_FILE).is_file() and not over_width:
        return f"needs what was measured: {SURVEY_FILE}"
    return "" if (folder / QUESTION_FILE).is_file() else f"needs the question: {QUESTION_FILE}"


def files_of(folder: Path) -> list[Path]:
    """Documents of a body, and the files that they name with those beside them.

    Raises:
        InputError: no `scene3d.yaml`, or a file that is named leads out of the folder; one line.
    """
    found = [folder / name for name in DOCUMENTS if (folder / name).is_file()]
    for place, name in _named(folder):
        path = folder / name
        if not path.resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{place}: {name}: leads out of the folder of the case; put it there")
        besides = [path.with_suffix(end) for end in BESIDE]
        found += [path, *(one for one in besides if one.is_file())]
    return list(dict.fromkeys(found))


def _named(folder: Path) -> Iterator[tuple[str, str]]:
    """Files that the documents of a body name: where they are named, and how."""
    document = read_document(folder / SCENE_FILE)
    if document.section is not None:
        yield f"{SCENE_FILE}: section.file", document.section.file
    if (terrain := document.terrain) is not None:
        entries: list[str | float | None] = [terrain.surface, terrain.base, terrain.after]
        entries += [end for zone in terrain.zones for end in (zone.bottom, zone.top)]
        for entry in entries:
            if isinstance(entry, str):
                yield f"{SCENE_FILE}: terrain", entry
    survey = _document(folder, SURVEY_FILE)
    groups = survey.get("sets") if isinstance(survey, Mapping) else None
    for group in groups.values() if isinstance(groups, Mapping) else ():
        for one in group if isinstance(group, list) else ():
            if isinstance(one, Mapping) and isinstance(one.get("file"), str):
                yield f"{SURVEY_FILE}: {one.get('name')}", one["file"]


def revision_of(folder: Path) -> str:
    """A hash of the documents of a body, and of size and time of the files that they name."""
    try:
        paths = files_of(folder)
    except InputError as error:
        return content_hash(str(error))
    kept: dict[str, Any] = {}
    for path in paths:
        name = str(path.relative_to(folder))
        if path.name in DOCUMENTS or path.name == SECTION_FILE:
            kept[name] = read_text(path) if path.is_file() else None
        elif path.is_file():
            kept[name] = [path.stat().st_size, path.stat().st_mtime_ns]
    return content_hash(kept)


def load_survey_of(folder: Path, scene: Scene3d) -> Survey3d | None:
    """What was measured in plan; None: nothing.

    Raises:
        InputError: it does not hold together; one line.
    """
    return load_survey(folder, scene) if (folder / SURVEY_FILE).is_file() else None


def _volume(scene: Scene3d) -> float:
    """Volume of the soil, about [m3]: that between the rasters, or of the section."""
    if scene.ground is None:
        section, width = scene.section, scene.document.section
        assert section is not None and width is not None  # a document has one or the other
        heights = section.extent[1] - section.ground.lowest
        return (section.domain.x_max - section.domain.x_min) * heights * width.width_m * 0.5
    surface, base = scene.ground.surface, scene.ground.base
    x, y = surface.axes
    thick = surface.values - base.at(*np.meshgrid(x, y, indexing="ij"))
    return float(np.maximum(thick, 0.0).sum()) * surface.spacing**2


def _document(folder: Path, file: str) -> Any:
    return read_yaml(folder / file) if (folder / file).is_file() else None


def _fault(document: str, error: InputError, folder: Path) -> dict[str, Any]:
    return {"document": document, "message": str(error).replace(f"{folder}/", "")}


def _described(filled: Filled) -> dict[str, Any]:
    """Soil, places and numbers of a body without faults."""
    scene, problem = filled.scene, filled.problem
    document, soil = scene.document, scene.soil
    x_min, x_max, y_min, y_max, _ = problem.domain
    maps = maps_of(scene, problem)
    return {
        "title": scene.name.replace("_", " "),
        "description": document.description,
        "scene": {
            "materials": {key: one.model_dump() for key, one in soil.materials.items()},
            "zones": [{"name": zone.name, "material": zone.material} for zone in soil.zones],
        },
        "derived": {
            "kind": "terrain" if scene.ground is not None else "section",
            "spacing_m": scene.spacing,
            "points": len(problem.position),
            "volume_m3": float(problem.volume.sum()),
            "size_m": [x_max - x_min, y_max - y_min],
            "origin": list(scene.origin),
            "side": document.side,
            "duration_s": document.duration_s,
            "least_m": threshold(scene.spacing),
            "water_level": soil.water_level,
            "sloping_water": has_sloping_water(scene),
            "paths": {name: way.tolist() for name, way in paths_of(scene, maps).items()},
            "lines": {name: [list(end) for end in line] for name, line in document.lines.items()},
        },
    }


def _marks(survey: Survey3d | None) -> list[dict[str, Any]]:
    """What was measured, as places and lines in plan."""
    return [] if survey is None else [_mark(entry) for entry in survey.chosen()]


def _mark(entry: MapMeasured) -> dict[str, Any]:
    found: dict[str, Any] = {"name": entry.name, "held_out": entry.held_out, "places": []}
    if isinstance(entry, SurfaceAfter):
        places = entry.places.round(2).tolist()
        return {**found, "kind": "squares", "places": places, "every_m": entry.every_m}
    if isinstance(entry, DepositEdge):
        return {**found, "kind": "edge", "places": entry.places.round(2).tolist()}
    return {**found, "kind": "number", "value": float(entry.values[0]), "unit": unit_of(entry.unit)}
