"""`python -m diagnosis track CASE`: the error over the models so far, those of a person marked."""

from __future__ import annotations

import argparse
from pathlib import Path

from diagnosis.hypotheses.hypothesis_file import ModelFile, load_model_file, model_files
from diagnosis.session import Session, add_arguments, open_session
from diagnosis.verdict.kept_steps import kept_step
from diagnosis.verdict.verdict import Step
from pipeline.cli import InputError
from report.diagnosis import terminal


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser(
        "track",
        help="the error over the models so far",
        description="Show the error of every model of CASE so far, on fitted and held-out data, "
        "against the noise. Nothing is simulated.",
    )
    return add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the way, write its page."""
    session = open_session(arguments)
    steps, notes = tracked(session)
    print(terminal.steps(steps, notes))
    waiting = [name for name in model_files(session.folder) if not kept_step(session.folder, name)]
    for name in waiting:
        print(f"\n{name}: not judged yet: python -m diagnosis compare {session.case.folder} "
              f"--model {name}")  # fmt: skip
    if session.write_page:
        session.say(f"wrote {page_of(session)}")
    return 0


def tracked(session: Session) -> tuple[list[Step], list[str]]:
    """Steps of all models that were judged, in their order, and a note for each.

    Raises:
        InputError: there is none.
    """
    steps, notes = [], []
    for name, path in model_files(session.folder).items():
        kept = kept_step(session.folder, name)
        if kept is None:
            continue
        model = load_model_file(path)
        told = model.notes.strip() or kept.step.note
        if by_hand(model):
            told = f"by hand: {told}"
        if kept.made_from != session.made_from(model):
            told += " (outdated: case or settings have changed since)"
        steps.append(kept.step)
        notes.append(told)
    if not steps:
        raise InputError(
            f"{session.folder}: no model has been judged; begin with python -m diagnosis compare "
            f"{session.case.folder}"
        )
    return steps, notes


def by_hand(model: ModelFile) -> bool:
    """A person has made the model, or asked for it by name."""
    return model.by in ("engineer", "extend")


def page_of(session: Session) -> Path:
    """Write the page of the way."""
    from report.diagnosis.page import write_track  # matplotlib takes its time

    steps, _ = tracked(session)
    hands = [
        name for name, path in model_files(session.folder).items() if by_hand(load_model_file(path))
    ]
    return write_track(session.folder, session.case.title, steps, by_hand=hands)
