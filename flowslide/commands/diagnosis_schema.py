"""`python -m diagnosis schema`: print or write the JSON schema of `verdict.json`."""

from __future__ import annotations

import argparse

from diagnosis.verdict.verdict import SCHEMA_FILE, schema_text
from pipeline.schemas import add_schema_parser, run_schema


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    return add_schema_parser(commands, "verdict.json", SCHEMA_FILE)


def run(arguments: argparse.Namespace) -> int:
    """Print or write it."""
    return run_schema(arguments, SCHEMA_FILE, schema_text)
