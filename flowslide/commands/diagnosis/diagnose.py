"""`flowslide diagnose CASE`: the whole loop to a verdict."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands.diagnosis.session_options import (
    add_session_options,
    session_of,
    write_page,
)

if TYPE_CHECKING:
    from diagnosis.verdict.verdict import Verdict

DESCRIPTION = (
    "Compare, rank the effects, add them one after another until the model of CASE is adequate, "
    "and give a verdict. Started again after a kill, it goes on where it stopped and ends with the "
    "same verdict.json."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_session_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Diagnose, write, print."""
    from diagnosis.answers import diagnosed

    with session_of(arguments, "diagnosis") as session:
        verdict = diagnosed(session)
    print(f"{_text_of(verdict, session.folder)}\n\n{session.runs_line()}")
    session.write_timing("run")
    write_page(arguments, session, "write_report")


def _text_of(verdict: Verdict, folder: Path) -> str:
    """A verdict for a terminal."""
    from report.diagnosis import terminal
    from report.two_strengths import two_strengths

    both = two_strengths(folder)
    stages = [("base model", verdict.base)]
    if verdict.final.effects:
        stages.append(("with the effects", verdict.final))
    parts = [
        f"{verdict.verdict.replace('_', ' ').upper()}. {verdict.sentence}",
        terminal.answer(verdict),
        terminal.parameters(verdict.parameters, stages),
        "" if both is None else both.text,
        terminal.candidates(verdict.candidates),
        terminal.measurements(verdict.measurements),
        terminal.steps(verdict.steps),
    ]
    if verdict.validation_case is not None:
        check = verdict.validation_case
        parts.append(
            f"On {check.case}, which no fit has seen: chi2 {check.chi2_base:.1f} by the base "
            f"model, {check.chi2_final:.1f} by that of the answer (noise {check.n})."
        )
    if verdict.next_measurement:
        parts.append(terminal.next_measurements(verdict.next_measurement))
    if verdict.runs.cut_short:
        parts.append(f"Left out for want of runs: {', '.join(verdict.runs.cut_short)}.")
    return "\n\n".join(part for part in parts if part)
