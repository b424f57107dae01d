"""JSON schemas of our documents, for editors and other tools."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def text_of(schema: Mapping[str, Any]) -> str:
    """A schema as the text of its file."""
    return json.dumps({"$schema": DIALECT, **schema}, indent=2) + "\n"


def document_schema(model: type[BaseModel], title: str) -> str:
    """The schema of documents that we write, as the text of its file."""
    return text_of({**model.model_json_schema(mode="serialization"), "title": title})
