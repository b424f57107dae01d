"""Shared by the commands of a diagnosis: their options, and the session that these ask for."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flowslide.commands import options
from pipeline.cli import add_common

if TYPE_CHECKING:
    from diagnosis.session import Session


def add_session_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that every question about a case has."""
    options.add_case(parser)
    options.add_out(
        parser,
        "folder of the results; default: results/<case>/diagnosis, of a body diagnosis_on_maps",
    )
    options.add_engine(parser, default=None)
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
    from flowslide import api
    from geometry.scenes3d.scene3d import is_body
    from inversion.engines.registry import engine_named
    from pipeline.config import load_config
    from pipeline.progress import Progress

    settings = load_config(arguments.config, arguments.overrides)
    own = f"diagnosis{engine_named(arguments.engine).suffix if arguments.engine else ''}"
    case: Any
    if is_body(arguments.case):
        options.refuse_in_3d(arguments, {})
        case, own = api.load_question(arguments.case, settings=settings), "diagnosis_on_maps"
    else:
        case = api.load_case(arguments.case, settings=settings)
    with (
        Progress(0, case.title, quiet=arguments.quiet) as bar,
        api.open_session(
            what,
            case,
            out=arguments.out or Path(settings.results_folder) / case.name / own,
            hypothesis=arguments.hypothesis,
            engine=arguments.engine,
            spacing_m=arguments.spacing,
            threads=arguments.threads,
            progress=bar.report,
        ) as session,
    ):
        session.say = bar.say
        yield session


def runs_line(session: Session) -> str:
    """How many forward runs it took."""
    model, most = session.model, session.config.diagnosis.max_runs
    return (
        f"{model.runs} forward runs (at most {most}), {model.computed} of them simulated now, "
        f"{session.seconds:.0f} s"
    )


def write_page(arguments: argparse.Namespace, session: Session, composer: str) -> None:
    """Write the page with a function of `report.diagnosis`, where one is wanted."""
    if arguments.page == "yes":
        from report import diagnosis

        written: Path = getattr(diagnosis, composer)(session.folder)
        session.say(f"wrote {written}")
