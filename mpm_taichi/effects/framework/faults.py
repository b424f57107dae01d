"""Faults in the description of an effect, found before use."""

from __future__ import annotations

import keyword
import re
import sys
from dataclasses import fields
from types import FunctionType
from typing import Any

import numpy as np

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter

_HOST_HOOKS = ("scene", "constants", "field", "between", "until", "applies")


def faults(one: Effect) -> str:
    """The fault of the description of an effect, or ""."""
    return _wrong_kind(one) or _wrong_numbers(one) or _wrong_words(one) or _wrong_hooks(one)


def _wrong_kind(one: Effect) -> str:
    """The first field that is not of the kind that is asked for."""
    if not isinstance(one.amplitude, Amplitude):
        return f"amplitude: {_shown(one.amplitude)} is not an Amplitude(...)"
    if not isinstance(one.parameters, tuple | list):
        return "parameters: a tuple is wanted: (Parameter(...),)"
    for parameter in one.parameters:
        if not isinstance(parameter, Parameter):
            return f"parameters: {_shown(parameter)} is not a Parameter(...)"
    for field in ("constant_names", "place"):
        names = getattr(one, field)
        if not isinstance(names, tuple | list) or not all(isinstance(name, str) for name in names):
            return f'{field}: a tuple of names is wanted: ("name",)'
    if not isinstance(one.amplitude.ladder, tuple | list):
        return f"ladder {_shown(one.amplitude.ladder)}: three positive amplitudes that ascend"
    wrong = _wrong_field("", one) or _wrong_field("amplitude: ", one.amplitude)
    for number in one.amplitude.ladder:
        wrong = wrong or _not_a_number("amplitude: ladder", number)
    for parameter in one.parameters:
        wrong = wrong or _wrong_field(f"parameter {parameter.name}: ", parameter)
    return wrong


def _wrong_field(where: str, one: Effect | Amplitude | Parameter) -> str:
    """The first plain field (a text, a number, yes or no) that is not what it should be."""
    for field in fields(one):
        value = getattr(one, field.name)
        if field.type == "str" and not isinstance(value, str):
            return f"{where}{field.name}: {_shown(value)} is not text"
        if field.type == "bool" and not isinstance(value, bool):
            return f"{where}{field.name}: {_shown(value)} is neither True nor False"
        if field.type == "float" and (wrong := _not_a_number(f"{where}{field.name}", value)):
            return wrong
    if not isinstance(one, Effect) and one.si == 0.0:
        return f"{where}si: 0 makes every number of it 0"
    return ""


def _not_a_number(where: str, value: Any) -> str:
    number = isinstance(value, int | float | np.integer | np.floating)
    if isinstance(value, bool) or not number or not abs(value) <= sys.float_info.max:
        return f"{where}: {_shown(value)} is not a finite number"
    return ""


def _shown(value: Any) -> str:
    """A value in a few words of one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _wrong_numbers(one: Effect) -> str:
    amplitude, ladder = one.amplitude, one.amplitude.ladder
    if len(ladder) != 3 or not 0.0 < ladder[0] < ladder[1] < ladder[2] <= amplitude.high:
        return f"ladder {ladder}: three positive amplitudes that ascend, none above high"
    if (amplitude.low < 0.0) != amplitude.two_signed or amplitude.low > 0.0:
        return f"low {amplitude.low:g}: 0, or below it exactly where two_signed"
    if amplitude.two_signed and -ladder[2] < amplitude.low:
        return f"ladder {ladder}: its negative must not fall below low"
    for parameter in one.parameters:
        if not parameter.low <= parameter.default <= parameter.high:
            return f"parameter {parameter.name}: default must lie between low and high"
    return ""


def _wrong_words(one: Effect) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_]*", one.name):
        return "a name is lower-case letters, digits and _"
    texts = (one.words, one.equation, one.source, one.looks_like, one.amplitude.meaning)
    if not all(text.strip() for text in texts):
        return "words, equation, source, looks_like and the amplitude's meaning must say something"
    for name in one.columns:
        if not name.isidentifier() or name.startswith("_") or keyword.iskeyword(name):
            return f"{name!r} cannot be written as effect.<name>: letters, digits and _"
    if len(set(one.columns)) != len(one.columns):
        return f"two of its numbers have one name: {', '.join(one.columns)}"
    if one.realisation and one.realisation not in {p.name for p in one.parameters}:
        return f"realisation {one.realisation!r} is none of its parameters"
    if strange := set(one.place) - {p.name for p in one.parameters}:
        return f"place: {min(strange)!r} is none of its parameters"
    return ""


def _wrong_hooks(one: Effect) -> str:
    if bool(one.constant_names) != (one.constants is not None):
        return "constant_names and constants belong together"
    for name in _HOST_HOOKS:
        hook = getattr(one, name)
        if not callable(hook) and (hook is not None or name == "applies"):
            return f"hook {name}: {_shown(hook)} is not a function"
    if one.width is not None and one.field is None:
        return "hook width: needs field, the same width at the start"
    if not one.on_device and one.scene is None:
        return "it has no hook that acts"
    for name in one.DEVICE_HOOKS:
        hook, wanted = getattr(one, name), one.HOOK_ARGUMENTS[name]
        if hook is None:
            continue
        if not isinstance(hook, FunctionType):
            return f"hook {name}: {_shown(hook)} is not a plain function"
        if hook.__code__.co_argcount != len(wanted):
            return f"hook {name}: its arguments are {', '.join(wanted)}"
    return ""
