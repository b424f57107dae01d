"""`python -m inversion invert CASE`: the back-analysis of a case folder."""

from __future__ import annotations

import argparse

from pipeline.cli import WorkFailed, add_common


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser("invert", help="find the strengths of a case history")
    parser.add_argument("case", metavar="CASE", help="case folder, with inversion.yaml")
    return add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Not wired up yet: says so and fails, rather than pretending."""
    raise WorkFailed(f"{arguments.case}: the search is not part of this version yet")
