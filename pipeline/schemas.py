"""JSON schemas of our documents, for editors and other tools, and the command that writes them."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from pipeline.files import write_text

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def text_of(schema: Mapping[str, Any]) -> str:
    """A schema as the text of its file."""
    return json.dumps({"$schema": DIALECT, **schema}, indent=2) + "\n"


def document_schema(model: type[BaseModel], title: str) -> str:
    """The schema of documents that we write, as the text of its file."""
    return text_of({**model.model_json_schema(mode="serialization"), "title": title})


def add_schema_parser(
    commands: argparse._SubParsersAction, document: str, file: Path
) -> argparse.ArgumentParser:
    """Add the command `schema`, which prints the schema of `document` or writes it to `file`."""
    parser = commands.add_parser("schema", help=f"print the JSON schema of {document}")
    parser.add_argument(
        "--write", action="store_true", help=f"write it to {file} instead of printing it"
    )
    return parser


def run_schema(arguments: argparse.Namespace, file: Path, text: Callable[[], str]) -> int:
    """Do what `add_schema_parser` has read."""
    if arguments.write:
        write_text(file, text())
        print(f"wrote {file}")
    else:
        print(text(), end="")
    return 0
