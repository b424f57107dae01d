"""`flowslide diagnose explain CASE`: which effects would explain the misfit?"""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import (
    add_session_options,
    runs_line,
    session_of,
    write_page,
)

DESCRIPTION = (
    "Run every effect at several amplitudes at the base model's fit of CASE, and say which would "
    "lower the misfit, which cannot be distinguished, and how much of a strength each could be "
    "while it remains undetected."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Explain, write, print."""
    from flowslide import api
    from report.diagnosis import summary

    with session_of(arguments, "explanation") as session:
        document = api.explain(session)
    print(f"{summary(document, session.folder)}\n\n{runs_line(session)}")
    write_page(arguments, session, "write_explain")
