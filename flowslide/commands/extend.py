"""`python -m diagnosis extend CASE --add EFFECT`: a model with one effect more, by hand."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from diagnosis.adequacy.compare import Comparison, compare
from diagnosis.hypotheses.hypothesis_file import (
    BASE,
    FOLDER,
    ModelEffect,
    ModelFile,
    model_files,
    new_name,
)
from diagnosis.selection.extend import Extension, check_addition, extend
from diagnosis.session import Session, add_arguments, open_session
from diagnosis.verdict.kept_steps import judge, keep, step_of
from diagnosis.verdict.stages import effect_answers, measurement_lines
from diagnosis.verdict.verdict import Step
from flowslide.commands.track import page_of
from report.diagnosis import terminal


def add_parser(commands: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Add the command."""
    parser = commands.add_parser(
        "extend",
        help="add an effect by hand: error before and after",
        description="Add an effect to the base model of CASE, or to the model that --model names, "
        "calibrate it anew, write it to a new file in models/, and show the error before and after "
        "on fitted and held-out data.",
    )
    parser.add_argument(
        "--add", metavar="EFFECT", required=True, help="name of the effect (docs/method/effects.md)"
    )
    parser.add_argument("--notes", metavar="TEXT", default="", help="why; kept in the model's file")
    return add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Extend, write, print."""
    session = open_session(arguments)
    done = extended(session, arguments.add, arguments.notes)
    found, data = done.found, done.comparison.base.data
    words = {c.name: (c.unit, c.words) for c in done.asked.model.candidates}
    for answer in effect_answers(data, found.after.fit, words):
        low, high = answer.interval_95
        unit = f" {answer.unit}" if answer.unit else ""
        print(f"{answer.name}: {answer.amplitude:.3g}{unit}, 95 % {low:.3g} to {high:.3g}")
    print()
    print(terminal.steps([done.before, done.after]))
    print()
    passes = "passes every condition of the loop" if not found.why_not else found.why_not
    print(f"{arguments.add}: {passes}")
    print()
    print(
        terminal.measurements(
            measurement_lines(
                done.asked.model.targets,
                done.comparison.places,
                data,
                done.comparison.base.covariance.survey,
                found.before.fit.prediction,
                found.after.fit.prediction,
            )
        )
    )
    print()
    print(f"wrote {session.folder / FOLDER / done.after.model}.yaml")
    print(done.asked.runs_line())
    done.asked.write_timing("extend")
    if session.write_page:
        session.say(f"wrote {page_of(session)}")
    return 0


@dataclass(frozen=True)
class Extended:
    """An extension that was written.

    Attributes:
        asked: the session whose model was extended; effects that were fitted are sought again.
        comparison: of its base model.
        found: the extension.
        before: error of the model before.
        after: error of the new model.
    """

    asked: Session
    comparison: Comparison
    found: Extension
    before: Step
    after: Step


def extended(session: Session, add: str, notes: str) -> Extended:
    """Add an effect; write the new model and its step."""
    fitted = _fitted_effects(session.model_file)
    asked = session.without(fitted) if fitted else session
    check_addition(asked.model, fitted, add)  # before the first simulation
    comparison = compare(asked.model, asked.options)
    found = extend(asked.model, comparison, asked.options, before=fitted, add=add)
    data = comparison.base.data
    before = step_of(
        session.model_name, _place(session, session.model_name), judge(data, found.before.fit),
        note="base model" if session.is_base else "",
    )  # fmt: skip
    if session.is_base:
        base = ModelFile(by="compare")
        keep(session.folder, BASE, base, before, session.made_from(base))
    model = _new_model(asked, session.model_name, comparison, found, notes)
    name = new_name(session.folder, add)
    after = step_of(
        name,
        len(model_files(session.folder)),
        judge(data, found.after.fit),
        note=notes or f"{add} added by hand",
        effects={n: e.amplitude for n, e in model.effects.items() if e.std is None},
        ln_evidence=found.after.ln_evidence - found.before.ln_evidence,
    )
    keep(session.folder, name, model, after, session.made_from(model))
    asked.write_sections(
        found.before.fit.space.state(found.before.fit.x),
        found.after.fit.space.state(found.after.fit.x),
    )
    return Extended(asked, comparison, found, before, after)


def _new_model(
    asked: Session, parent: str, comparison: Comparison, found: Extension, notes: str
) -> ModelFile:
    """The model as a file: effects that are sought with their sizes, others as they were."""
    old = asked.model_file
    effects = {} if old is None else dict(old.effects)
    words = {c.name: (c.unit, c.words) for c in asked.model.candidates}
    for answer in effect_answers(comparison.base.data, found.after.fit, words):
        effects[answer.name] = ModelEffect(
            amplitude=round(answer.amplitude, 6),
            std=round(answer.std, 6),
            parameters=asked.case.question.parameters.get(answer.name, {}),
        )
    return ModelFile(
        parent=parent,
        by="extend",
        notes=notes,
        effects=effects,
        scene_changes={} if old is None else old.scene_changes,
    )


def _fitted_effects(model: ModelFile | None) -> tuple[str, ...]:
    """Effects whose size was found by a fit, and is sought again; others stay as they are."""
    if model is None:
        return ()
    return tuple(name for name, effect in model.effects.items() if effect.std is not None)


def _place(session: Session, name: str) -> int:
    """How many models were before one."""
    names = list(model_files(session.folder))
    return names.index(name) if name in names else 0
