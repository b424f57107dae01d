"""What a session answers: one function for each question, which also writes the documents.

In: a `Session`. Out: `compare.json`, `explain.json`, `verdict.json` and hypotheses in its folder,
and the same as objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from diagnosis.adequacy.compare import Comparison, compare
from diagnosis.diagnose import Diagnosis, diagnose
from diagnosis.hypotheses.hypothesis_file import (
    BASE,
    FOLDER,
    Hypothesis,
    HypothesisEffect,
    hypothesis_files,
    load_hypothesis,
    new_name,
)
from diagnosis.hypotheses.model import Proposing
from diagnosis.reason import Reason
from diagnosis.selection.explain import explain
from diagnosis.selection.extend import check_addition, extend
from diagnosis.session import Session
from diagnosis.verdict.fitted_models import (
    effect_answers,
    judge,
    judge_again,
    keep,
    kept_step,
    measurement_lines,
    step_of,
)
from diagnosis.verdict.validation_case import validated
from diagnosis.verdict.verdict import (
    COMPARE_FILE,
    EXPLAIN_FILE,
    FILE_NAME,
    CompareDocument,
    EffectAnswer,
    ExplainDocument,
    MeasurementVerdict,
    Verdict,
    WaterfallStep,
    save_document,
)
from diagnosis.verdict.verdict_builder import (
    compare_document,
    explain_document,
    verdict_document,
)
from inversion.back_analysis.deviations import LEFT_OUT
from pipeline.cli import InputError


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
    _keep_comparison(session, found)
    return document


def _keep_comparison(session: Session, found: Comparison) -> None:
    """Keep the error of the model, under the covariance of the base model."""
    base, given = Hypothesis(by="compare"), session.hypothesis
    model: Hypothesis | None = base
    note = "base model"
    effects: dict[str, float] = {}
    judged = judge(found.base.data, found.base.fit)
    if given is not None:
        root = compare(session.root.model, session.root.options)
        # A hypothesis may move what was measured, where it says that the survey erred.
        moved = replace(root.base.data, measured=found.base.data.measured)
        judged = judge_again(moved, found.base.fit)
        model, note = None, given.notes.strip() or "by hand"
        effects = {name: effect.amplitude for name, effect in given.effects.items()}
    step = step_of(
        session.hypothesis_name,
        list(dict.fromkeys([*hypothesis_files(session.folder), session.hypothesis_name])).index(
            session.hypothesis_name
        ),
        judged,
        note=note,
        effects=effects,
    )
    made_from = session.made_from(given or base)
    keep(session.folder, session.hypothesis_name, model, step, made_from)


def explained(session: Session) -> ExplainDocument:
    """Rank the effects against the misfit of a session's model, and write what was found."""
    model, options = session.model, session.options
    comparison = compare(model, options)
    session.say(f"base model: combined p {comparison.adequacy.p_combined:.2g}")
    document = explain_document(
        model,
        comparison,
        explain(model, comparison, options, session.ranking),
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


def diagnosed(session: Session) -> Verdict:
    """Run the loop on a session's model, and write what was found."""
    found = diagnose(session.model, session.options, session.say, ranking=session.ranking)
    if session.model.wide_runs:
        session.say(f"{session.model.wide_runs} simulations in three dimensions")
    verdict = verdict_document(
        found,
        case=session.case.name,
        title=session.case.title,
        left_out=session.case.left_out(session.model),
    )
    check = validated(session, found)
    verdict = session.timeless(verdict.model_copy(update={"validation_case": check}))
    base, final = found.comparison.base.fit, found.decision.final.model.fit
    session.write_sections(base.space.state(base.x), final.space.state(final.x))
    _keep_models(session, found)
    save_document(verdict, session.folder / FILE_NAME)
    return verdict


def _keep_models(session: Session, found: Diagnosis) -> None:
    """Write the models of the loop next to a person's, replacing those of an earlier loop."""
    way, context = found.tried_models.way, found.explanation.context
    parent = session.hypothesis_name
    words = {c.name: (c.unit, c.words) for c in found.model.candidates}
    there = list(hypothesis_files(session.folder))
    given = {} if session.hypothesis is None else dict(session.hypothesis.effects)
    for number, adopted in enumerate(way):
        name, data = parent, context.of(adopted.model).data
        model: Hypothesis | None = Hypothesis(by="run")
        if number:
            effects = {
                answer.name: HypothesisEffect(
                    amplitude=round(answer.amplitude, 6),
                    std=round(answer.std, 6),
                    parameters=session.case.question.parameters.get(answer.name, {}),
                )
                for answer in effect_answers(data, adopted.model.fit, words)
            }
            model = Hypothesis(
                parent=parent, by="run", notes=adopted.note, effects={**given, **effects}
            )
            if session.hypothesis is not None:
                model = model.model_copy(update={"scene_changes": session.hypothesis.scene_changes})
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
            effects={name: effect.amplitude for name, effect in given.items()},
            ln_evidence=adopted.model.ln_evidence - way[0].model.ln_evidence,
        )
        keep(session.folder, name, model, step, session.made_from(model or session.hypothesis))
        there = list(hypothesis_files(session.folder))
        parent = name


def _same_model(session: Session, wanted: Hypothesis) -> str | None:
    """The model of an earlier loop with the same parent and effects, which is overwritten."""
    for name, path in hypothesis_files(session.folder).items():
        other = load_hypothesis(path)
        if (
            name != BASE
            and (other.by, other.parent) == ("run", wanted.parent)
            and set(other.effects) == set(wanted.effects)
        ):
            return name
    return None


@dataclass(frozen=True)
class Extended:
    """An extension that was written.

    Attributes:
        asked: the session whose model was extended; effects that were fitted are fitted again.
        effects: of the new model, with their amplitudes.
        measurements: by the model before and by the new one.
        why_not: the condition for acceptance that fails; None if none does.
        before: error of the model before.
        after: error of the new model.
        file: of the new model.
    """

    asked: Session
    effects: list[EffectAnswer]
    measurements: list[MeasurementVerdict]
    why_not: Reason | None
    before: WaterfallStep
    after: WaterfallStep
    file: Path


def extended(session: Session, add: str, notes: str) -> Extended:
    """Add an effect; write the new model and its step."""
    fitted = _fitted_effects(session.hypothesis)
    asked = session.without(fitted) if fitted else session
    check_addition(asked.model, fitted, add)  # before the first simulation
    comparison = compare(asked.model, asked.options)
    found = extend(asked.model, comparison, asked.options, before=fitted, add=add)
    data = comparison.base.data
    before = step_of(
        session.hypothesis_name,
        _place(session, session.hypothesis_name),
        judge(data, found.before.fit),
        note="base model" if session.is_base else "",
    )
    if session.is_base:
        base = Hypothesis(by="compare")
        keep(session.folder, BASE, base, before, session.made_from(base))
    words = {c.name: (c.unit, c.words) for c in asked.model.candidates}
    answers = effect_answers(data, found.after.fit, words)
    model = _new_model(asked, session.hypothesis_name, answers, notes)
    name = new_name(session.folder, add)
    after = step_of(
        name,
        len(hypothesis_files(session.folder)),
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
    lines = measurement_lines(
        asked.model.targets,
        comparison.places,
        data,
        comparison.base.covariance.survey,
        found.before.fit.prediction,
        found.after.fit.prediction,
    )
    file = session.folder / FOLDER / f"{name}.yaml"
    return Extended(asked, answers, lines, found.why_not, before, after, file)


def _new_model(
    asked: Session, parent: str, answers: Sequence[EffectAnswer], notes: str
) -> Hypothesis:
    """The model as a file: fitted effects with their sizes, others unchanged."""
    old = asked.hypothesis
    effects = {} if old is None else dict(old.effects)
    for answer in answers:
        effects[answer.name] = HypothesisEffect(
            amplitude=round(answer.amplitude, 6),
            std=round(answer.std, 6),
            parameters=asked.case.question.parameters.get(answer.name, {}),
        )
    return Hypothesis(
        parent=parent,
        by="extend",
        notes=notes,
        effects=effects,
        scene_changes={} if old is None else old.scene_changes,
    )


def _fitted_effects(model: Hypothesis | None) -> tuple[str, ...]:
    """Effects whose size was found by a fit and is fitted again; others stay as they are."""
    if model is None:
        return ()
    return tuple(name for name, effect in model.effects.items() if effect.std is not None)


def _place(session: Session, name: str) -> int:
    """How many models were before one."""
    names = list(hypothesis_files(session.folder))
    return names.index(name) if name in names else 0


@dataclass(frozen=True)
class Track:
    """The models that were judged, in their order.

    Attributes:
        steps: their errors.
        notes: a note for each.
        by_hand: names of those that a person made, or asked for by name.
        not_judged: names of models whose error is not known yet.
        outdated: names of those judged before the case or the settings changed.
    """

    steps: list[WaterfallStep]
    notes: list[str]
    by_hand: list[str]
    not_judged: list[str]
    outdated: list[str]


def tracked(session: Session) -> Track:
    """The error over the models so far. Nothing is simulated.

    Raises:
        InputError: none has been judged.
    """
    steps, notes, hands, waiting, outdated = [], [], [], [], []
    for name, path in hypothesis_files(session.folder).items():
        model, kept = load_hypothesis(path), kept_step(session.folder, name)
        if model.by in ("engineer", "extend"):
            hands.append(name)
        if kept is None:
            waiting.append(name)
            continue
        if kept.made_from != session.made_from(model):
            outdated.append(name)
        steps.append(kept.step)
        notes.append(model.notes.strip() or kept.step.note)
    if not steps:
        raise InputError(
            f"{session.folder}: no model has been judged; begin with flowslide diagnose compare "
            f"{session.case.folder}"
        )
    return Track(steps, notes, hands, waiting, outdated)


def suggested(session: Session, count: int) -> Verdict:
    """The verdict with the `count` measurements that would tell most; nothing is written.

    Raises:
        InputError: none is proposed of a body in three dimensions.
    """
    if not isinstance(session.model, Proposing):
        raise InputError(f"suggest: {session.case.folder}: {LEFT_OUT}")
    found = diagnose(session.model, session.options, session.say, count=count)
    return verdict_document(found, case=session.case.name, title=session.case.title)
