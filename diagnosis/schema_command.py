"""`python -m diagnosis schema`: print or write the JSON schema of `verdict.json`."""

from __future__ import annotations

import argparse

from diagnosis.verdict import SCHEMA_FILE, schema_text
from pipeline.files import write_text


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser("schema", help="print the JSON schema of verdict.json")
    parser.add_argument(
        "--write", action="store_true", help=f"write it to {SCHEMA_FILE} instead of printing it"
    )
    return parser


def run(arguments: argparse.Namespace) -> int:
    """Print or write it."""
    if arguments.write:
        write_text(SCHEMA_FILE, schema_text())
        print(f"wrote {SCHEMA_FILE}")
    else:
        print(schema_text(), end="")
    return 0
