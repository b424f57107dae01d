"""Forms of the page: the fields of materials and of every type of measurement.

They are made from the documents' own models, so that a type or a field that is added there is in
the page as well.
"""

from __future__ import annotations

from types import NoneType
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from geometry.scenes.scene import Material
from geometry.survey.registry import measurement_types
from pipeline.units import with_signs

#: Fields of a material that need a form of their own.
_LEFT_OUT = ("pre_failure",)


def material_fields() -> list[dict[str, Any]]:
    """Fields of a material, in order."""
    fields = Material.model_fields.items()
    return [_field(name, info) for name, info in fields if name not in _LEFT_OUT]


def measurement_forms() -> list[dict[str, Any]]:
    """Every type of measurement: name, unit and fields; what it must have comes first."""
    forms = []
    for name, kind in measurement_types().items():
        fields = [_field(key, info) for key, info in kind.model_fields.items() if key != "type"]
        fields.sort(key=_rank)
        forms.append({"type": name, "unit": with_signs(kind.unit), "fields": fields})
    return forms


def _rank(field: dict[str, Any]) -> tuple[bool, bool, bool, bool]:
    """The name, what was measured, how well, where it is written; then what may be left out."""
    key = field["key"]
    return (
        key != "name",
        not field["required"],
        key in ("source", "confidence"),
        key.startswith("std_"),
    )


def _field(key: str, info: FieldInfo) -> dict[str, Any]:
    kind, choices = _kind(info.annotation)
    return {
        "key": key,
        "kind": kind,
        "choices": choices,
        "required": info.is_required(),
        "default": None if info.is_required() else info.default,
        "meaning": with_signs(info.description or ""),
    }


def _kind(annotation: Any) -> tuple[str, list[str]]:
    """number, numbers, choice, switch or text; and what can be chosen."""
    options = [one for one in get_args(annotation) if one is not NoneType]
    if get_origin(annotation) is Literal:
        return "choice", [str(one) for one in options]
    if get_origin(annotation) in (list, tuple):
        return "numbers", []
    if NoneType in get_args(annotation):
        return _kind(options[0])
    return {bool: "switch", float: "number", int: "number"}.get(annotation, "text"), []
