"""`python -m diagnosis compare CASE`: is the model adequate, and where does it fail?"""

from __future__ import annotations

import argparse

from diagnosis.adequacy.compare import Comparison, compare
from diagnosis.hypotheses.hypothesis_file import ModelFile, model_files
from diagnosis.session import Session, add_arguments, open_session
from diagnosis.verdict.documents import compare_document
from diagnosis.verdict.kept_steps import judge, judge_anew, keep, step_of
from diagnosis.verdict.verdict import COMPARE_FILE, CompareDocument, save_document
from report.diagnosis import terminal


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser(
        "compare",
        help="fit the base model: is it adequate, where does it fail?",
        description="Calibrate the base model of CASE, measure its own numerical error, and test "
        "whether it explains the measurements. Started again after a kill, it goes on where it "
        "stopped.",
    )
    return add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Compare, write, print."""
    session = open_session(arguments)
    document = compared(session)
    print(document.sentence)
    print()
    print(terminal.parameters(document.parameters, [("fitted", document.base)]))
    print()
    print(terminal.groups(document.base))
    print()
    print(terminal.measurements(document.measurements))
    print()
    print(session.runs_line())
    session.write_timing("compare")
    if session.write_page:
        from report.diagnosis.page import write_compare  # matplotlib takes its time

        session.say(f"wrote {write_compare(session.folder)}")
    return 0


def compared(session: Session) -> CompareDocument:
    """Compare the model of a session with the measurements, and write what was found."""
    found = compare(session.model, session.options)
    document = compare_document(
        session.model, found, session.options, case=session.case.name, title=session.case.title
    )
    document = session.timeless(document)
    save_document(document, session.folder / COMPARE_FILE)
    state = found.base.fit.space.state(found.base.fit.x)
    session.write_sections(state, state)
    keep_comparison(session, found)
    return document


def keep_comparison(session: Session, found: Comparison) -> None:
    """Keep the error of the model, under the covariance of the base model."""
    model: ModelFile | None = ModelFile(by="compare")
    note = "base model"
    effects: dict[str, float] = {}
    judged = judge(found.base.data, found.base.fit)
    if not session.is_base:
        root = compare(session.root.model, session.root.options)
        judged = judge_anew(root.base.data, found.base.fit)
        model, note = None, session.model_file.notes.strip() or "by hand"
        effects = {name: effect.amplitude for name, effect in session.model_file.effects.items()}
    step = step_of(
        session.model_name,
        list(dict.fromkeys([*model_files(session.folder), session.model_name])).index(
            session.model_name
        ),
        judged,
        note=note,
        effects=effects,
    )
    made_from = session.made_from(session.model_file or model)
    keep(session.folder, session.model_name, model, step, made_from)
