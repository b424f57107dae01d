"""`flowslide diagnose compare CASE`: is the model adequate, and where does it fail?"""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import (
    add_session_options,
    runs_line,
    session_of,
    write_page,
)

DESCRIPTION = (
    "Calibrate the base model of CASE, measure its own numerical error, and test whether it "
    "explains the measurements. Started again after a kill, it goes on where it stopped."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Compare, write, print."""
    from flowslide import api
    from report.diagnosis import summary

    with session_of(arguments, "comparison") as session:
        document = api.compare(session)
    print(f"{summary(document, session.folder)}\n\n{runs_line(session)}")
    write_page(arguments, session, "write_compare")
