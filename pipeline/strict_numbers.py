"""Numbers in documents are numbers: `spacing: true` is a slip, not 1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.cli import InputError


def refuse_words_for_numbers(raw: Any, made: Any, origin: str) -> None:
    """Refuse true and false where a number is wanted: pydantic takes them for 1 and 0.

    Args:
        raw: a document as it was read.
        made: what pydantic has made of it.
        origin: where it was read from.

    Raises:
        InputError: one line with the field.
    """
    for field, value in _words_for_numbers(raw, made):
        raise InputError(f"{origin}: {field}: {str(value).lower()}: a number is wanted here")


def _words_for_numbers(raw: Any, made: Any, place: str = "") -> Iterator[tuple[str, bool]]:
    """Fields in which true or false has been taken for the number 1 or 0."""
    if isinstance(raw, bool):
        if isinstance(made, int | float) and not isinstance(made, bool):
            yield place, raw
    elif isinstance(raw, Mapping):
        for key, value in raw.items():
            if isinstance(made, Mapping):
                inner = made.get(key)
            else:
                inner = getattr(made, key, None) if isinstance(key, str) else None
            yield from _words_for_numbers(value, inner, f"{place}.{key}" if place else str(key))
    elif isinstance(raw, list | tuple) and isinstance(made, list | tuple | set | frozenset):
        for number, (value, inner) in enumerate(zip(raw, made, strict=False)):
            yield from _words_for_numbers(value, inner, f"{place}.{number}")
