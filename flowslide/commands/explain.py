"""`python -m diagnosis explain CASE`: which effects would explain the misfit?"""

from __future__ import annotations

import argparse

from diagnosis.adequacy.compare import compare
from diagnosis.session import Session, add_arguments, open_session
from diagnosis.signatures.explain import explain
from diagnosis.verdict.documents import explain_document
from diagnosis.verdict.verdict import EXPLAIN_FILE, ExplainDocument, save_document
from report.diagnosis import terminal

#: |cos| from which on two effects are hardly told apart.
WEAKLY = 0.8


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser(
        "explain",
        help="rank the effects; what looks alike, what could be hidden",
        description="Run every effect at several amplitudes at the base model's fit of CASE, and "
        "say which would lower the misfit, which cannot be told apart, and how much of a strength "
        "each could be while it remains undetected.",
    )
    return add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Explain, write, print."""
    session = open_session(arguments)
    document = explained(session)
    print(document.sentence)
    print()
    print(terminal.candidates(document.candidates))
    print()
    print(terminal.alike(document.confounding.names, document.confounding.cosine, WEAKLY))
    print()
    print(session.runs_line())
    session.write_timing("explain")
    if session.write_page:
        from report.diagnosis.page import write_explain  # matplotlib takes its time

        session.say(f"wrote {write_explain(session.folder)}")
    return 0


def explained(session: Session) -> ExplainDocument:
    """Rank the effects against the misfit of a session's model, and write what was found."""
    model, options = session.model, session.options
    comparison = compare(model, options)
    session.say(f"base model: combined p {comparison.adequacy.p_combined:.2g}")
    document = explain_document(
        model,
        comparison,
        explain(model, comparison, options),
        options,
        case=session.case.name,
        title=session.case.title,
        left_out=session.case.left_out(model),
    )
    document = session.timeless(document)
    save_document(document, session.folder / EXPLAIN_FILE)
    fit = comparison.base.fit
    session.write_sections(fit.space.state(fit.x), fit.space.state(fit.x))
    return document
