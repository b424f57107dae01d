"""`flowslide diagnose extend CASE --add EFFECT`: a model with one effect more, by hand."""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import add_session_options, session_of
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
    from diagnosis.hypotheses.hypothesis_file import FOLDER
    from diagnosis.verdict.fitted_models import effect_answers, measurement_lines
    from flowslide import api
    from report.diagnosis import measurements_text
    from report.numbers import from_to, with_unit
    from report.tables.diagnosis import steps_table

    with session_of(arguments, "extension") as session:
        done = api.extend(session, arguments.add, arguments.notes)
    found, data = done.found, done.comparison.base.data
    words = {c.name: (c.unit, c.words) for c in done.asked.model.candidates}
    for answer in effect_answers(data, found.after.fit, words):
        value = with_unit(answer.amplitude, answer.unit)
        print(f"{answer.name}: {value}, 95 % {from_to(*answer.interval_95, answer.unit)}")
    lines = measurement_lines(
        done.asked.model.targets,
        done.comparison.places,
        data,
        done.comparison.base.covariance.survey,
        found.before.fit.prediction,
        found.after.fit.prediction,
    )
    passes = "passes every condition of the loop" if not found.why_not else found.why_not
    print(f"\n{steps_table([done.before, done.after]).text()}")
    print(f"\n{arguments.add}: {passes}")
    print(f"\n{measurements_text(lines)}")
    print(f"\nwrote {session.folder / FOLDER / done.after.hypothesis}.yaml")
    print(done.asked.runs_line())
    write_page_of_track(arguments, session)
