"""The types of measurement there are.

A new type of the library is one file in this folder and its class in `LIBRARY`. A user's own type
is a class in a file of its own (`--measurements-code FILE`): it is code, and is run only when it is
named.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache, reduce
from operator import or_
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import Field, PlainValidator, TypeAdapter

from geometry.survey.crest_settlement import CrestSettlement
from geometry.survey.final_slope import FinalSlope
from geometry.survey.freeboard import Freeboard
from geometry.survey.heave import Heave
from geometry.survey.marker_displacement import MarkerDisplacement
from geometry.survey.measured import REQUIRED, REQUIRED_FIELDS, Measured
from geometry.survey.no_flow import NoFlow
from geometry.survey.slide_duration import SlideDuration
from geometry.survey.slip_depth import SlipDepth
from geometry.survey.surface_profile import SurfaceProfile
from geometry.survey.toe_history import ToeHistory
from geometry.survey.toe_runout import ToeRunout
from geometry.survey.velocity import Velocity
from pipeline.cli import InputError
from pipeline.user_code import load_user_code

#: The order is that in which further measurements are proposed.
LIBRARY: tuple[type[Measured], ...] = (
    SurfaceProfile,
    MarkerDisplacement,
    ToeHistory,
    ToeRunout,
    CrestSettlement,
    Velocity,
    SlideDuration,
    Freeboard,
    Heave,
    SlipDepth,
    FinalSlope,
    NoFlow,
)

_users: dict[str, type[Measured]] = {}


def type_name(kind: type[Measured]) -> str:
    """The word after `type:` that means a type.

    Raises:
        TypeError: the type lacks something that every type must give.
    """
    field = kind.model_fields.get("type")
    names = get_args(field.annotation) if field and get_origin(field.annotation) is Literal else ()
    if len(names) != 1:
        raise TypeError(f'{kind.__name__}: needs a field `type: Literal["its_name"]`')
    missing = [
        name
        for name in REQUIRED
        if not hasattr(kind, name) or name in getattr(kind, "__abstractmethods__", ())
    ]
    if "unit" not in missing:
        missing += [key for key in map(kind.key, REQUIRED_FIELDS) if key not in kind.model_fields]
    if missing:
        raise TypeError(f"{kind.__name__}: lacks {', '.join(missing)}")
    unknown = [name for name in kind.history or () if name not in kind.model_fields]
    if unknown:
        raise TypeError(f"{kind.__name__}: history names no field {', '.join(unknown)}")
    return str(names[0])


@cache
def _library() -> dict[str, type[Measured]]:
    return {type_name(kind): kind for kind in LIBRARY}


def measurement_types() -> dict[str, type[Measured]]:
    """Name -> type, of the library and of users."""
    return {**_library(), **_users}


@cache
def _adapter(kinds: tuple[type[Measured], ...]) -> TypeAdapter[Measured]:
    entry: Any = Annotated[reduce(or_, kinds), Field(discriminator="type")]
    return TypeAdapter(entry)


def measurement_of(entry: Any) -> Measured:
    """An entry of `measurements.yaml` as what its `type` says.

    Raises:
        ValidationError: pydantic's; an unknown type, or an entry that does not hold together.
    """
    return _adapter(tuple(measurement_types().values())).validate_python(entry)


Measurement = Annotated[Any, PlainValidator(measurement_of)]
"""A field of a document that holds a measurement of any type that is known when it is read."""


def load_measurements_code(path: str | Path) -> list[type[Measured]]:
    """Run a Python file and register every type of measurement that it defines.

    Loading the same file again changes nothing; a changed file replaces its types.

    Returns:
        the types of the file, in the order in which it defines them.

    Raises:
        InputError: no such file, an error in it, no type in it, a type that lacks something that
            every type must give, or whose name the library has; one line.
    """
    module, version = load_user_code(path, "flowslide_measurements")
    kinds = [
        value
        for value in vars(module).values()
        if isinstance(value, type)
        and issubclass(value, Measured)
        and value.__module__ == module.__name__
    ]
    if not kinds:
        raise InputError(f"{path}: defines no type of measurement; see docs/how-to/extend.md")
    found: dict[str, type[Measured]] = {}
    for kind in kinds:
        try:
            name = type_name(kind)
        except TypeError as error:
            raise InputError(f"{path}: {error}") from None
        if name in _library() or name in found:
            owner = "the library" if name in _library() else "the file already"
            raise InputError(f"{path}: {kind.__name__}: {owner} has a measurement type {name!r}")
        kind.code = version
        found[name] = kind
    _users.update(found)
    return kinds


@contextmanager
def given_measurements(paths: Iterable[str | Path]) -> Iterator[None]:
    """Load files of types for the length of a `with` block; see `load_measurements_code`."""
    before = dict(_users)
    try:
        for path in paths:
            load_measurements_code(path)
        yield
    finally:
        _users.clear()
        _users.update(before)
