"""`flowslide diagnose compare CASE`: is the model adequate, and where does it fail?"""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import (
    add_session_options,
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
    from diagnosis.answers import compared
    from report.diagnosis import terminal
    from report.two_strengths import two_strengths

    with session_of(arguments, "comparison") as session:
        document = compared(session)
    parts = [
        document.sentence,
        terminal.parameters(document.parameters, [("fitted", document.base)]),
        terminal.groups(document.base),
        terminal.measurements(document.measurements),
        session.runs_line(),
    ]
    both = two_strengths(session.folder)
    if both is not None:
        parts.insert(2, both.text)
    print("\n\n".join(parts))
    session.write_timing("compare")
    write_page(arguments, session, "write_compare")
