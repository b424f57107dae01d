"""`flowslide diagnose CASE`: the whole loop to a verdict."""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import (
    add_session_options,
    runs_line,
    session_of,
    write_page,
)

DESCRIPTION = (
    "Compare, rank the effects, add them one after another until the model of CASE is adequate, "
    "and give a verdict. Started again after a kill, it goes on where it stopped and ends with the "
    "same verdict.json."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Diagnose, write, print."""
    from flowslide import api
    from report.diagnosis import summary

    with session_of(arguments, "diagnosis") as session:
        verdict = api.diagnose(session)
    print(f"{summary(verdict, session.folder)}\n\n{runs_line(session)}")
    write_page(arguments, session, "write_report")
