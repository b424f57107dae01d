"""`python -m gns schema`: print or write the JSON schema of `card.yaml`."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.schemas import add_schema_parser, run_schema

SCHEMA_FILE = Path("config/card.schema.json")


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    return add_schema_parser(commands, "card.yaml", SCHEMA_FILE)


def run(arguments: argparse.Namespace) -> int:
    """Print or write it."""
    from gns.evaluation.card import schema_text  # imports torch

    return run_schema(arguments, SCHEMA_FILE, schema_text)
