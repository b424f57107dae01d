"""Numbers in documents are numbers: `spacing: true` is a slip, not 1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Self

from pydantic import BaseModel, ModelWrapValidatorHandler, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

Place = tuple[str | int, ...]


class StrictNumbers(BaseModel):
    """Base of every document: true and false are no numbers; pydantic takes them for 1 and 0."""

    @model_validator(mode="wrap")
    @classmethod
    def _refuse_words_for_numbers(cls, raw: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        made = handler(raw)
        problems = [
            InitErrorDetails(
                type=PydanticCustomError("word_for_number", "Input should be a number"),
                loc=place,
                input=word,
            )
            for place, word in _words_for_numbers(raw, made)
        ]
        if problems:
            raise ValidationError.from_exception_data(cls.__name__, problems)
        return made


def _words_for_numbers(raw: Any, made: Any, place: Place = ()) -> Iterator[tuple[Place, bool]]:
    """Places at which true or false has been taken for the number 1 or 0."""
    if isinstance(raw, bool):
        if isinstance(made, int | float) and not isinstance(made, bool):
            yield place, raw
    elif isinstance(made, BaseModel):
        # A document within has looked at its own fields.
        if isinstance(raw, Mapping) and not (place and isinstance(made, StrictNumbers)):
            for key, value in raw.items():
                if key in type(made).model_fields:
                    yield from _words_for_numbers(value, getattr(made, key), (*place, key))
    elif isinstance(raw, Mapping) and isinstance(made, Mapping):
        for key, value in raw.items():
            yield from _words_for_numbers(value, made.get(key), (*place, key))
    elif isinstance(raw, list | tuple) and isinstance(made, list | tuple | set | frozenset):
        for number, (value, inner) in enumerate(zip(raw, made, strict=False)):
            yield from _words_for_numbers(value, inner, (*place, number))
