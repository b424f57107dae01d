"""What the commands of a diagnosis share: their options, and the session that these ask for."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import add_common

if TYPE_CHECKING:
    from diagnosis.session import Session


def add_session_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that every question about a case has."""
    options.add_case(parser)
    options.add_out(parser, "folder of the results; default: results/<case>/diagnosis")
    options.add_spacing(parser)
    parser.add_argument(
        "--model",
        metavar="FILE",
        help="a model to go on from, a file or its name in models/; default: the base model",
    )
    options.add_effects(parser)
    options.add_measurements_code(parser)
    options.add_threads(parser)
    parser.add_argument(
        "--page", choices=("yes", "no"), default="yes", help="write the page; default: yes"
    )
    add_common(parser)


def session_of(arguments: argparse.Namespace) -> Session:
    """The session that the options ask for."""
    from diagnosis.session import open_session
    from geometry.case import load_case
    from pipeline.batch_lines import BatchLines
    from pipeline.config import load_config

    def say(line: str) -> None:
        if not arguments.quiet:
            print(line, file=sys.stderr, flush=True)

    return open_session(
        load_case(arguments.case, load_config(arguments.config, arguments.overrides)),
        out=arguments.out,
        hypothesis=arguments.model,
        spacing_m=arguments.spacing,
        threads=arguments.threads,
        say=say,
        on_run=BatchLines(quiet=arguments.quiet),
    )


def write_page(arguments: argparse.Namespace, session: Session, composer: str) -> None:
    """Write the page with a function of `report.diagnosis.page`, where one is wanted."""
    if arguments.page == "yes":
        from report.diagnosis import page

        written: Path = getattr(page, composer)(session.folder)
        session.say(f"wrote {written}")
