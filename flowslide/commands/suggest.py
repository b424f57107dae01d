"""`python -m diagnosis suggest CASE --n 2`: what to measure next."""

from __future__ import annotations

import argparse

from diagnosis.loop import find
from diagnosis.session import add_arguments, open_session
from diagnosis.verdict.verdict_document import next_part, sentence
from pipeline.cli import InputError
from report.diagnosis import terminal


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser(
        "suggest",
        help="what to measure next",
        description="Say which measurements would best tell apart what the measurements of CASE "
        "leave open, the first by itself, each further one beside those before it. Where the model "
        "is adequate: which would best have shown what may still hide.",
    )
    parser.add_argument(
        "--n", type=int, default=2, metavar="N", help="how many measurements; default: 2"
    )
    return add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Suggest, print."""
    if arguments.n < 1:
        raise InputError(f"--n {arguments.n}: at least 1")
    session = open_session(arguments)
    found = find(session.model, session.options, session.say, count=arguments.n)
    print(sentence(found))
    print()
    lines = next_part(found.next_measurement)
    print(terminal.next_measurements(lines) if lines else "Nothing can be suggested here.")
    print()
    print("gain: expected squared separation, in variances of the measurement and the models")
    print(session.runs_line())
    session.write_timing("suggest")
    return 0
