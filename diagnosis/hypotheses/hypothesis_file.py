"""A hypothesis as a file: the effects added to a model, by whom, and why.

`hypotheses/00_base.yaml` is the base model; `extend` writes `NN_name.yaml` next to it, and you
may write one by hand (a changed section, an effect of a known size). Files are numbered in the
order in which they were made, which is the order of `track`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator

from geometry.scenes.scene import (
    Document,
    Scene,
    checked_document,
    scene_from_mapping,
)
from mpm_taichi.effects import effects
from pipeline.cli import InputError
from pipeline.files import read_yaml, write_text, yaml_text

FOLDER = "hypotheses"
BASE = "00_base"
_NAME = re.compile(r"\d\d_[a-z0-9_]+")


class HypothesisEffect(Document):
    """An effect of a hypothesis."""

    amplitude: float = Field(description="its size, in the effect's unit; where a model begins")
    std: float | None = Field(None, ge=0, description="standard deviation found by a fit")
    parameters: dict[str, float] = Field(
        default_factory=dict, description="further numbers of the effect, as in a scene"
    )

    @property
    def entry(self) -> float | dict[str, float]:
        """The effect as a scene has it."""
        if not self.parameters:
            return self.amplitude
        return {"amplitude": self.amplitude, **self.parameters}


class Hypothesis(Document):
    """The whole of a hypothesis's file."""

    parent: str | None = Field(None, description="name of the hypothesis it changes; null: none")
    by: Literal["engineer", "extend", "run", "compare"] = Field(
        "engineer", description="who made it: a person, or a command"
    )
    notes: str = Field("", description="why; free text")
    effects: dict[str, HypothesisEffect] = Field(
        default_factory=dict, description="all effects of the model, those of its parents too"
    )
    scene_changes: dict[str, Any] = Field(
        default_factory=dict,
        description="keys of scene.yaml that differ: mappings are merged, zones by their name, all "
        "else is replaced; changes of the parents too",
    )

    @field_validator("effects", mode="before")
    @classmethod
    def _plain_amplitudes(cls, given: Any) -> Any:
        """`weak_base: 0.3` is short for an amplitude."""
        if not isinstance(given, Mapping):
            return given
        return {
            name: {"amplitude": entry} if isinstance(entry, int | float) else entry
            for name, entry in given.items()
        }

    def scene(self, scene: Scene, source: str = "hypothesis") -> Scene:
        """The section of the hypothesis, with its effects of the solver.

        Raises:
            InputError: the changes do not fit the scene.
        """
        document = merged(scene.model_dump(mode="json"), self.scene_changes, source)
        own = {n: effect.entry for n, effect in self.effects.items() if n in effects()}
        if isinstance(document["effects"], Mapping):  # the scene says what else it must be
            document["effects"] = {**document["effects"], **own}
        changed = scene_from_mapping(document, source)
        there = {zone.name for zone in changed.zones}
        for zone in scene.zones:
            if zone.name not in there:
                raise InputError(
                    f"{source}: scene_changes: zones: {zone.name!r} is gone; a model keeps the "
                    "names of the zones"
                )
        return changed


def merged(document: dict[str, Any], changes: Mapping[str, Any], source: str) -> dict[str, Any]:
    """A scene document with changes laid over it; zones are identified by name.

    Raises:
        InputError: a zone that does not exist, a part that is not a mapping.
    """
    result = dict(document)
    for key, change in changes.items():
        old = result.get(key)
        if key == "zones" and isinstance(change, Mapping):
            result[key] = _zones(document["zones"], change, source)
        elif isinstance(change, Mapping) and isinstance(old, Mapping):
            result[key] = merged(dict(old), change, f"{source}: {key}")
        else:
            result[key] = change
    return result


def _zones(zones: list[dict], changes: Mapping[str, Any], source: str) -> list[dict]:
    names = [zone["name"] for zone in zones]
    for name, change in changes.items():
        if name not in names or not isinstance(change, Mapping):
            raise InputError(
                f"{source}: scene_changes: zones: {name!r}: keys of one of the zones "
                f"{', '.join(names)} are allowed"
            )
    return [{**zone, **changes.get(zone["name"], {})} for zone in zones]


def load_hypothesis(path: str | Path) -> Hypothesis:
    """Read a hypothesis.

    Raises:
        InputError: no such file, or a document that does not hold together; one line.
    """
    return checked_document(Hypothesis, read_yaml(path), path, "docs/method/diagnosis.md")


def save_hypothesis(hypothesis: Hypothesis, path: str | Path) -> None:
    """Write a hypothesis; the file appears when whole."""
    document = hypothesis.model_dump(mode="json", exclude_none=True)
    document = {key: value for key, value in document.items() if value not in ({}, "")}
    head = "# A hypothesis of this diagnosis; keys: docs/method/diagnosis.md.\n"
    write_text(path, head + yaml_text(document, width=100))


def hypothesis_files(folder: str | Path) -> dict[str, Path]:
    """Hypotheses of a diagnosis in their order, by name."""
    found = sorted((Path(folder) / FOLDER).glob("*.yaml"))
    return {path.stem: path for path in found if _NAME.fullmatch(path.stem)}


def find_hypothesis(folder: str | Path, text: str) -> tuple[str, Path]:
    """A hypothesis given by its file or its name in the folder of a diagnosis: name and file.

    Raises:
        InputError: there is none.
    """
    path = Path(text)
    if path.is_file():
        return path.stem, path
    known = hypothesis_files(folder)
    if text in known:
        return text, known[text]
    there = f"there are {', '.join(known)}" if known else "there are none yet: begin with compare"
    raise InputError(f"--hypothesis {text}: no such file, and no hypothesis of {folder}; {there}")


def check_parent(hypothesis: Hypothesis, path: Path, folder: str | Path) -> None:
    """Refuse a parent that a person has given and that is not there; those we wrote may be gone.

    Args:
        hypothesis: the contents of the file.
        path: the file.
        folder: of the diagnosis.

    Raises:
        InputError: there is none.
    """
    if hypothesis.by != "engineer" or hypothesis.parent in (None, BASE):
        return
    neighbours = {other.stem for other in path.parent.glob("*.yaml")}
    known = {BASE, *neighbours, *hypothesis_files(folder)} - {path.stem}
    if hypothesis.parent not in known:
        raise InputError(
            f"{path}: parent: no hypothesis {hypothesis.parent!r}; there are "
            f"{', '.join(sorted(known))}"
        )


def new_name(folder: str | Path, what: str) -> str:
    """Name of the next hypothesis: the number after the last, and what it is."""
    last = max((int(name[:2]) for name in hypothesis_files(folder)), default=0)
    slug = re.sub(r"[^a-z0-9]+", "_", what.lower()).strip("_")
    return f"{last + 1:02d}_{slug}"
