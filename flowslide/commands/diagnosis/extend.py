"""`flowslide diagnose extend CASE --add EFFECT`: a model with one effect more, by hand."""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import add_session_options, runs_line, session_of
from flowslide.commands.diagnosis.track import write_page_of_track

DESCRIPTION = (
    "Add an effect to the base model of CASE, or to the one that --hypothesis names, calibrate it "
    "again, write it to a new file in hypotheses/, and show the error before and after on fitted "
    "and held-out data."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "--add", metavar="EFFECT", required=True, help="name of the effect (docs/method/effects.md)"
    )
    parser.add_argument("--notes", metavar="TEXT", default="", help="why; kept in the model's file")
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Extend, write, print."""
    from flowslide import api
    from report.diagnosis import measurements_text
    from report.numbers import from_to, with_unit
    from report.sentences.finding import reason_words
    from report.table import plain
    from report.tables.diagnosis import steps_table

    with session_of(arguments, "extension") as session:
        done = api.extend(session, arguments.add, arguments.notes)
    for answer in done.effects:
        value = with_unit(answer.amplitude, answer.unit)
        print(f"{answer.name}: {value}, 95 % {from_to(*answer.interval_95, answer.unit)}")
    passes = plain(reason_words(done.why_not)) or "passes every condition of the loop"
    print(f"\n{steps_table([done.before, done.after]).text()}")
    print(f"\n{arguments.add}: {passes}")
    print(f"\n{measurements_text(done.measurements)}")
    print(f"\nwrote {done.file}")
    print(runs_line(done.asked))
    write_page_of_track(arguments, session)
