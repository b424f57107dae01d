"""`flowslide diagnose suggest CASE --n 2`: what to measure next."""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import add_session_options, runs_line, session_of
from pipeline.cli import at_least_one

DESCRIPTION = (
    "Say which measurements would best distinguish what the measurements of CASE leave open: the "
    "first by itself, each further one in addition to those before it. Where the model is "
    "adequate: which would best have shown what may still hide."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "--n", type=int, default=2, metavar="N", help="how many measurements; default: 2"
    )
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Suggest, print."""
    from flowslide import api
    from report.sentences.finding import headline
    from report.table import plain
    from report.tables.diagnosis import next_table, outcomes_table

    at_least_one("--n", arguments.n)
    with session_of(arguments, "suggestion") as session:
        found = api.suggest(session, arguments.n)
    print(f"{plain(headline(found))}\n")
    print(next_table(found.next_measurement).text() or "Nothing can be suggested here.")
    print("\ngain: expected squared separation, in variances of the measurement and the models")
    if readings := outcomes_table(found.next_measurement).text():
        print(f"\n{readings}")
    print(runs_line(session))
