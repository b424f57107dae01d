"""Shared by the commands of a diagnosis: their options, and the session that these ask for."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
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
    options.add_engine(parser)
    options.add_spacing(parser)
    parser.add_argument(
        "--hypothesis",
        metavar="FILE",
        help="a hypothesis to start from, a file or its name in hypotheses/; default: base model",
    )
    options.add_effects(parser)
    options.add_measurements_code(parser)
    options.add_threads(parser)
    parser.add_argument(
        "--page", choices=("yes", "no"), default="yes", help="write the page; default: yes"
    )
    add_common(parser)


@contextmanager
def session_of(arguments: argparse.Namespace, what: str) -> Iterator[Session]:
    """The session that the options ask for, with a bar for the length of the `with` block."""
    from diagnosis.session import open_session
    from geometry.case import load_case
    from inversion.engines.registry import of_section
    from pipeline.config import load_config
    from pipeline.files import working_in
    from pipeline.progress import Progress, Watch

    config = load_config(arguments.config, arguments.overrides)
    case = load_case(arguments.case, config)
    with Progress(0, case.title, quiet=arguments.quiet) as bar:
        watch = Watch(bar.report)
        watch.plan({what: config.diagnosis.max_runs})
        session = open_session(
            case,
            out=arguments.out,
            hypothesis=arguments.hypothesis,
            spacing_m=arguments.spacing,
            engine=of_section(arguments.engine),
            threads=arguments.threads,
            say=bar.say,
            on_run=watch.run_done,
        )
        with working_in(session.folder):
            yield session


def write_page(arguments: argparse.Namespace, session: Session, composer: str) -> None:
    """Write the page with a function of `report.diagnosis`, where one is wanted."""
    if arguments.page == "yes":
        from report import diagnosis

        written: Path = getattr(diagnosis, composer)(session.folder)
        session.say(f"wrote {written}")
