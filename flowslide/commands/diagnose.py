"""`python -m diagnosis run CASE`: the whole loop to a verdict."""

from __future__ import annotations

import argparse

from diagnosis.hypotheses.hypothesis_file import (
    BASE,
    ModelEffect,
    ModelFile,
    load_model_file,
    model_files,
    new_name,
)
from diagnosis.loop import find
from diagnosis.session import Session, add_arguments, open_session
from diagnosis.verdict.kept_steps import judge, keep, step_of
from diagnosis.verdict.stages import effect_answers
from diagnosis.verdict.transfer_check import transfer_check
from diagnosis.verdict.verdict import FILE_NAME, Verdict, save_document
from diagnosis.verdict.verdict_document import Diagnosed, verdict_document
from report.diagnosis import terminal


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser(
        "run",
        help="the whole loop: which effect is missing?",
        description="Compare, rank the effects, add them one after another until the model of CASE "
        "is adequate, and give a verdict. Started again after a kill, it goes on where it stopped "
        "and ends with the same verdict.json.",
    )
    return add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Diagnose, write, print."""
    session = open_session(arguments)
    verdict = diagnosed(session)
    print(text_of(verdict))
    print()
    print(session.runs_line())
    session.write_timing("run")
    if session.write_page:
        from report.diagnosis.page import write_report  # matplotlib takes its time

        session.say(f"wrote {write_report(session.folder)}")
    return 0


def diagnosed(session: Session) -> Verdict:
    """Run the loop on a session's model, and write what was found."""
    found = find(session.model, session.options, session.say)
    verdict = verdict_document(
        found,
        case=session.case.name,
        title=session.case.title,
        left_out=session.case.left_out(session.model),
    )
    check = transfer_check(session, found)
    verdict = session.timeless(verdict.model_copy(update={"transfer_check": check}))
    base, final = found.comparison.base.fit, found.decision.final.model.fit
    session.write_sections(base.space.state(base.x), final.space.state(final.x))
    keep_models(session, found)
    save_document(verdict, session.folder / FILE_NAME)
    return verdict


def keep_models(session: Session, found: Diagnosed) -> None:
    """Write the models of the loop beside those of a person; those of an earlier loop give way."""
    data, way = found.comparison.base.data, found.register.way
    parent = session.model_name
    words = {c.name: (c.unit, c.words) for c in found.model.candidates}
    there = list(model_files(session.folder))
    for number, adopted in enumerate(way):
        name, model = parent, ModelFile(by="run")
        if number:
            effects = {
                answer.name: ModelEffect(
                    amplitude=round(answer.amplitude, 6),
                    std=round(answer.std, 6),
                    parameters=session.case.question.parameters.get(answer.name, {}),
                )
                for answer in effect_answers(data, adopted.model.fit, words)
            }
            model = ModelFile(parent=parent, by="run", notes=adopted.note, effects=effects)
            if session.model_file is not None:
                model = model.model_copy(update={"scene_changes": session.model_file.scene_changes})
            name = _same_model(session, model) or new_name(
                session.folder, " ".join(adopted.model.names)
            )
        elif not session.is_base:
            model = None
        step = step_of(
            name,
            there.index(name) if name in there else len(there),
            judge(data, adopted.model.fit),
            note=adopted.note if number or not session.is_base else "base model",
            ln_evidence=adopted.model.ln_evidence - way[0].model.ln_evidence,
        )
        keep(session.folder, name, model, step, session.made_from(model or session.model_file))
        there = list(model_files(session.folder))
        parent = name


def _same_model(session: Session, wanted: ModelFile) -> str | None:
    """The model of an earlier loop with the same parent and effects, which is written anew."""
    for name, path in model_files(session.folder).items():
        other = load_model_file(path)
        if (
            name != BASE
            and (other.by, other.parent) == ("run", wanted.parent)
            and set(other.effects) == set(wanted.effects)
        ):
            return name
    return None


def text_of(verdict: Verdict) -> str:
    """A verdict for a terminal."""
    stages = [("base model", verdict.base)]
    if verdict.final.effects:
        stages.append(("with the effects", verdict.final))
    parts = [
        f"{verdict.verdict.replace('_', ' ').upper()}. {verdict.sentence}",
        terminal.answer(verdict),
        terminal.parameters(verdict.parameters, stages),
        terminal.candidates(verdict.candidates),
        terminal.measurements(verdict.measurements),
        terminal.steps(verdict.steps),
    ]
    if verdict.transfer_check is not None:
        check = verdict.transfer_check
        parts.append(
            f"On {check.case}, which no fit has seen: chi2 {check.chi2_base:.1f} by the base "
            f"model, {check.chi2_final:.1f} by that of the answer (noise {check.n})."
        )
    if verdict.next_measurement:
        parts.append(terminal.next_measurements(verdict.next_measurement))
    if verdict.runs.cut_short:
        parts.append(f"Left out for want of runs: {', '.join(verdict.runs.cut_short)}.")
    return "\n\n".join(part for part in parts if part)
