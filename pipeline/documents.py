"""Documents: the strict base of all that are read and written, and their JSON schemas."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

DIALECT = "https://json-schema.org/draft/2020-12/schema"

Place = tuple[str | int, ...]
_PLAIN = (float, int, str)


class StrictDocument(BaseModel):
    """Base of every document that is read or written.

    Unknown keys, numbers that are not finite and later changes are refused; so are true and false
    where a number belongs, which pydantic would take for 1 and 0: `spacing: true` is a slip.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

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
        if isinstance(raw, Mapping) and not (place and isinstance(made, StrictDocument)):
            for key, value in raw.items():
                if key in type(made).model_fields:
                    yield from _words_for_numbers(value, getattr(made, key), (*place, key))
    elif isinstance(raw, Mapping) and isinstance(made, Mapping):
        for key, value in raw.items():
            yield from _words_for_numbers(value, made.get(key), (*place, key))
    elif isinstance(raw, list | tuple) and isinstance(made, list | tuple | set | frozenset):
        for number, (value, inner) in enumerate(zip(raw, made, strict=False)):
            if type(value) in _PLAIN:  # coordinates: most of a document
                continue
            yield from _words_for_numbers(value, inner, (*place, number))


def schema_file_text(schema: Mapping[str, Any]) -> str:
    """A schema as the text of its file."""
    return json.dumps({"$schema": DIALECT, **schema}, indent=2) + "\n"


def document_schema(model: type[BaseModel], title: str) -> str:
    """The schema of documents that we write, as the text of its file."""
    return schema_file_text({**model.model_json_schema(mode="serialization"), "title": title})
