"""`python -m gns schema`: print or write the JSON schema of `card.yaml`."""

from __future__ import annotations

import argparse

from pipeline.files import write_text


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser("schema", help="print the JSON schema of card.yaml")
    parser.add_argument(
        "--write", action="store_true", help="write config/card.schema.json instead of printing it"
    )
    return parser


def run(arguments: argparse.Namespace) -> int:
    """Print or write it."""
    from gns.card import SCHEMA_FILE, schema_text

    if arguments.write:
        write_text(SCHEMA_FILE, schema_text())
        print(f"wrote {SCHEMA_FILE}")
    else:
        print(schema_text(), end="")
    return 0
