"""`flowslide diagnose explain CASE`: which effects would explain the misfit?"""

from __future__ import annotations

import argparse

from flowslide.commands.diagnosis.session_options import (
    add_session_options,
    session_of,
    write_page,
)

DESCRIPTION = (
    "Run every effect at several amplitudes at the base model's fit of CASE, and say which would "
    "lower the misfit, which cannot be told apart, and how much of a strength each could be while "
    "it remains undetected."
)

#: |cos| from which on two effects are hardly told apart.
WEAKLY = 0.8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Explain, write, print."""
    from diagnosis.answers import explained
    from report.diagnosis import terminal

    with session_of(arguments, "explanation") as session:
        document = explained(session)
    parts = [
        document.sentence,
        terminal.candidates(document.candidates),
        terminal.alike(document.confounding.names, document.confounding.cosine, WEAKLY),
        session.runs_line(),
    ]
    print("\n\n".join(parts))
    session.write_timing("explain")
    write_page(arguments, session, "write_explain")
