"""`flowslide diagnose track CASE`: the error over the models so far, those of a person marked."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from flowslide.commands.diagnosis.session_options import add_session_options, session_of

if TYPE_CHECKING:
    from diagnosis.session import Session

DESCRIPTION = (
    "Show the error of every model of CASE so far, on fitted and held-out data, against the noise. "
    "Nothing is simulated."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Print the way, write its page."""
    from flowslide import api
    from report.tables.diagnosis import steps_table

    with session_of(arguments, "track") as session:
        track = api.track(session)
    print(steps_table(track.steps, track.by_hand, track.notes, track.outdated).text())
    for name in track.not_judged:
        print(
            f"\n{name}: not judged yet: flowslide diagnose compare {session.case.folder} "
            f"--hypothesis {name}"
        )
    write_page_of_track(arguments, session)


def write_page_of_track(arguments: argparse.Namespace, session: Session) -> None:
    """Write the page of all models so far, where one is wanted."""
    if arguments.page == "yes":
        from flowslide import api
        from report.diagnosis import write_track

        track = api.track(session)
        page = write_track(session.folder, session.case.title, track.steps, by_hand=track.by_hand)
        session.say(f"wrote {page}")
