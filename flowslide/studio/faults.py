"""What is wrong with the documents of a case, in an engineer's words and at the field.

Faults of fields are those that pydantic finds, said with the names that the page gives the fields.
How the parts go together is judged by the same checks as in `flowslide check`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from geometry.case import SCENE_FILE
from geometry.scenes.scene import (
    Problem,
    Scene,
    document_problems,
    problem_line,
    scene_faults,
    scene_from_mapping,
    scene_problems,
    zones_at,
)
from geometry.survey.blow_counts import FILE_NAME as BLOW_COUNTS_FILE
from geometry.survey.blow_counts import BlowCounts, load_blow_counts
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import Measurements
from inversion.problem.question import Question
from pipeline.cli import InputError

DOCUMENTS = {
    "scene": SCENE_FILE,
    "measurements": MEASUREMENTS_FILE,
    "inversion": "inversion.yaml",
    "diagnosis": "diagnosis.yaml",
    "blow_counts": BLOW_COUNTS_FILE,
}
"""Part of a case that the page edits -> its file."""
Place = tuple[str | int, ...]


@dataclass(frozen=True)
class DocumentFault:
    """What is wrong with a document.

    Attributes:
        document: part of the case.
        message: one line.
        zones: names of those it concerns.
        places: where it is in the section: outlines of one or more vertices [m].
        field: keys and numbers that lead to the field; empty: it is of no single one.
    """

    document: str
    message: str
    zones: tuple[str, ...] = ()
    places: tuple[tuple[tuple[float, float], ...], ...] = ()
    field: Place = ()


def section_faults(documents: Mapping[str, Any]) -> list[DocumentFault]:
    """All that is wrong with the section."""
    document = documents.get("scene")
    if not isinstance(document, dict):
        return [DocumentFault("scene", "must be a mapping of keys")]
    if not document.get("zones"):
        return [DocumentFault("scene", "no zone is drawn yet")]
    problems = scene_problems(document)
    if any(one["loc"][:1] == ("zones",) for one in problems):
        # Without sound outlines none of these can be made, and nobody has left them out.
        problems = [one for one in problems if one["loc"] not in _MADE]
    found = [_fault("scene", document, one) for one in problems]
    together = scene_faults(document, problems)
    return found + [DocumentFault("scene", one.message, one.zones, one.places) for one in together]


def field_faults(documents: Mapping[str, Any]) -> list[DocumentFault]:
    """All that is wrong with the fields of the other documents, whatever the section is."""
    faults = []
    for part, model in _MODELS.items():
        document = documents.get(part)
        if document is None:
            continue
        problems = document_problems(model, document)
        if all(one["loc"] and one["type"] not in _OF_FILES for one in problems):
            faults += [_fault(part, document, one) for one in problems]
    return faults


def other_faults(folder: Path, documents: Mapping[str, Any]) -> list[DocumentFault]:
    """The first thing in each other document that does not go together; the section is right.

    Args:
        folder: that has the documents as files.
        documents: the parts of the case.
    """
    scene, faults = scene_from_mapping(documents["scene"], SCENE_FILE), []
    for part, check in _CHECKS.items():
        if documents.get(part) is None:
            continue
        try:
            check(folder, scene)
        except InputError as error:
            message = str(error).removeprefix(f"{folder / DOCUMENTS[part]}: ")
            faults.append(_of_entry(part, documents, message.replace(f"{folder}/", "")))
    return faults


def _of_entry(part: str, documents: Mapping[str, Any], message: str) -> DocumentFault:
    """A fault at the value of the measurement that it names, where it names one."""
    found = _OF_ENTRY.fullmatch(message) if part == "measurements" else None
    if not found:
        return DocumentFault(part, message)
    group, name, said = found.groups()
    for number, entry in enumerate(documents[part]["sets"][group]):
        value = next((key for key in entry if key.startswith("value_")), None)
        if entry["name"] == name and value is not None:
            place: Place = ("sets", group, number, entry["type"], value)
            return DocumentFault(part, f"{_words(name)}: {said}", field=place)
    return DocumentFault(part, f"{_words(name)}: {said}")


def _check_measurements(folder: Path, scene: Scene) -> None:
    from geometry.survey.measurements import load_measurements

    load_measurements(folder, scene)


def _check_question(folder: Path, scene: Scene) -> None:
    from inversion.problem.question import load_question

    load_question(folder, scene)


def _check_diagnosis(folder: Path, scene: Scene) -> None:
    from diagnosis.question import load_diagnosis_question

    load_diagnosis_question(folder)


_MODELS: dict[str, type[BaseModel]] = {
    "measurements": Measurements,
    "inversion": Question,
    "blow_counts": BlowCounts,
}
_CHECKS: dict[str, Callable[[Path, Scene], object]] = {
    "measurements": _check_measurements,
    "inversion": _check_question,
    "diagnosis": _check_diagnosis,
    "blow_counts": load_blow_counts,
}
_MADE: tuple[Place, ...] = (("domain",), ("ground",), ("spacing",), ("ground", "points"))
#: Slips that only who writes a file can make; their messages name keys and their page.
_OF_FILES = ("extra_forbidden", "union_tag_invalid", "union_tag_not_found")


# --- words ---

LABELS = {
    "friction_deg": "friction angle",
    "youngs_modulus_mpa": "Young's modulus",
    "poisson_ratio": "Poisson's ratio",
    "density": "density",
    "polygon": "outline",
    "ground": "base",
    "phreatic_line": "water table",
    "water_level": "pool level",
    "n1_60": "blow count N1,60",
    "n1_60cs": "blow count N1,60cs",
    "std_is": "what the standard deviation is",
    "low": "lower bound",
    "start": "first guess",
    "high": "upper bound",
    "fit": "what is fitted",
    "loss": "what is fitted by",
}
"""Key of a field -> its name, where that is not the key itself without its unit."""
#: A problem of several fields together: their names come first.
_OF_FIELDS = re.compile(r"Value error, (\w+(?:(?:, | and )\w+)*): (.+)", re.DOTALL)
#: A problem of a measurement with the section.
_OF_ENTRY = re.compile(r"sets\.(\w+): '([^']+)': (.+)", re.DOTALL)
_UNIT = re.compile(r"_(m|kpa|mpa|deg|s|m_per_s)$")
_LIMITS = {
    "greater_than": ("must be more than", "gt"),
    "greater_than_equal": ("must be at least", "ge"),
    "less_than": ("must be less than", "lt"),
    "less_than_equal": ("must be at most", "le"),
}


def _fault(part: str, document: Mapping[str, Any], problem: Problem) -> DocumentFault:
    place = tuple(problem["loc"]) + _named(problem)[0][:1]
    zones = zones_at(document, place) if part == "scene" else ()
    return DocumentFault(part, problem_words(part, document, problem), zones, field=place)


def problem_words(part: str, document: Mapping[str, Any], problem: Problem) -> str:
    """A problem of a field in words: of what, which field, and what is wanted."""
    if problem["type"] in _OF_FILES:
        return problem_line(problem, DOCUMENTS[part])
    subject, rest = _subject(part, document, tuple(problem["loc"]))
    keys, wanted = _named(problem)
    if keys:
        labels = ", ".join(_label((key,), document, subject) for key in keys)
        return ": ".join(filter(None, (subject, labels, _words(wanted))))
    label, wanted = _label(rest, document, subject), _wanted(problem, rest)
    said = wanted if not label or wanted.startswith("say ") else f"{label} {wanted}"
    return f"{subject}: {said}" if subject else said


def _named(problem: Problem) -> tuple[tuple[str, ...], str]:
    """Fields that a problem of an entry names, as in `dx_m, dy_m: give ...`, and what is wanted."""
    found = _OF_FIELDS.fullmatch(str(problem["msg"])) if problem["type"] == "value_error" else None
    return (tuple(re.split(", | and ", found[1])), found[2]) if found else ((), "")


def _subject(part: str, document: Mapping[str, Any], place: Place) -> tuple[str, Place]:
    """What a field belongs to, and the rest of the way to it."""
    match part, place:
        case "scene", ("materials", str(name), *rest):
            return _words(name), tuple(rest)
        case "scene", ("zones", int(number), *rest):
            return f"zone {_name(document['zones'][number], number)}", tuple(rest)
        case "measurements", ("sets", str(group), int(number), _, *rest):
            return _name(document["sets"][group][number], number), tuple(rest)
        case "inversion", ("parameters", int(number), *rest):
            asked = document["parameters"][number]
            label = asked.get("label") if isinstance(asked, Mapping) else None
            return str(label or _name(asked, number)), tuple(rest)
        case "blow_counts", ("layers", int(number), *rest):
            return _words(
                ", ".join(map(str, document["layers"][number].get("zones") or []))
            ), tuple(rest)
    return "", place


def _name(entry: Any, number: int) -> str:
    name = entry.get("name") if isinstance(entry, Mapping) else None
    return _words(str(name or number + 1))


def _label(place: Place, document: Mapping[str, Any], subject: str) -> str:
    """Name of a field; of a vertex: its number and axis."""
    if not place:
        return ""
    if len(place) > 2 and isinstance(place[-2], int) and place[-1] in (0, 1):
        return f"{'xy'[int(place[-1])]} of vertex {place[-2] + 1}"
    key = next(str(one) for one in reversed(place) if isinstance(one, str))
    if key == "cohesion_kpa" and _is_liquefied(document, subject):
        return "residual strength S_r"
    if key.startswith("std_") and key not in LABELS:
        return "standard deviation"
    return LABELS.get(key, _words(_UNIT.sub("", key)))


def _is_liquefied(document: Mapping[str, Any], subject: str) -> bool:
    materials = document.get("materials")
    if not isinstance(materials, Mapping):
        return False
    return any(
        _words(str(name)) == subject and isinstance(soil, Mapping) and bool(soil.get("liquefied"))
        for name, soil in materials.items()
    )


def _wanted(problem: Problem, place: Place) -> str:
    """What is wanted of a field, and what it has now."""
    kind, value = problem["type"], problem.get("input")
    now = f" (is {value:g})" if isinstance(value, int | float) else ""
    if kind in ("missing", "string_too_short") and place and place[-1] == "source":
        return "say where the number is from"
    if kind in ("missing", "string_too_short"):
        return "is missing"
    if kind in _LIMITS:
        words, key = _LIMITS[kind]
        return f"{words} {problem['ctx'][key]:,g}{now}"
    message = str(problem["msg"]).removeprefix("Value error, ")
    return message.replace("Input should be", "must be") + now


def _words(name: str) -> str:
    return name.replace("_", " ")
