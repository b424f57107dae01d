"""Extend: a model with one effect more, calibrated again, against the model before.

    extension = extend(model, comparison, options, before=("weak_base",), add="shaking")

An engineer names the effect; the loop is not asked. The same conditions are reported, but the model
is made whether it passes them or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from diagnosis.adequacy.adequacy import Adequacy, ProjectedFit, assess, judged
from diagnosis.adequacy.compare import Comparison
from diagnosis.hypotheses.model import Model, Seeking
from diagnosis.options import Options
from diagnosis.reason import Reason
from diagnosis.selection.explain import Explanation, explain, tested_candidates
from diagnosis.selection.refit import FittedModel, judge, refit, weighed, with_own_derivative
from diagnosis.selection.tried_models import why_not
from inversion.estimation.response_surface import Surface
from pipeline.cli import InputError, WorkFailed


@dataclass(frozen=True)
class Extension:
    """A model and the same with an effect more.

    Attributes:
        before: the model.
        after: with the effect.
        judged: residual and noise of the model after.
        adequacy: its tests.
        why_not: the condition for acceptance that fails; None if none does.
        explanation: of the effects involved, against the base model.
    """

    before: FittedModel
    after: FittedModel
    judged: ProjectedFit
    adequacy: Adequacy
    why_not: Reason | None
    explanation: Explanation


def check_addition(model: Model, before: Sequence[str], add: str) -> None:
    """Refuse an effect that cannot be added.

    Raises:
        InputError: the model does not know the effect, or has it already.
    """
    if isinstance(model, Seeking):
        there = {candidate.name for candidate in model.candidates}
        for name in {*before, add} - there:
            model.add_placed(name)
    known = [candidate.name for candidate in model.candidates]
    if add not in known:
        raise InputError(f"--add {add}: no such effect here; there are {', '.join(known)}")
    if add in before:
        raise InputError(f"--add {add}: the model has it already")


def extend(
    model: Model, comparison: Comparison, options: Options, *, before: Sequence[str], add: str
) -> Extension:
    """Add an effect to a model.

    Args:
        model: the model to diagnose.
        comparison: of `compare` with the same model and options.
        options: vetoes do not bind here: the engineer asks for the effect.
        before: effects that the model has already.
        add: the effect that is added.

    Raises:
        InputError: the model does not know the effect, or has it already.
        WorkFailed: no run with it could be read, or the allowance does not cover it.
    """
    check_addition(model, before, add)
    names = tuple(sorted({*before, add}))
    asked = replace(options, effects=names, forbidden=())
    explanation = explain(model, comparison, asked)
    # The odds are those of one effect among all that could have been asked for.
    count = max(len(tested_candidates(model, replace(options, effects=None))[0]), 1)
    explanation = replace(explanation, context=replace(explanation.context, count=count))
    missing = [name for name in names if name not in explanation.signatures]
    if missing:
        raise WorkFailed(f"{missing[0]}: none of its runs could be read")
    ladders = {name: signature.ladder for name, signature in explanation.signatures.items()}
    ground = comparison.base.surface.with_ladders(ladders)
    old = weighed(explanation.context, comparison.base.fit, ground)
    if before:
        old = _fitted(explanation, comparison, ground, tuple(sorted(before)))
    new = _fitted(explanation, comparison, ground, names)
    found = judged(comparison.base.data, new.fit, draws=options.draws, seed=options.seed)
    return Extension(
        old, new, found, assess(found, comparison.places), why_not(old, new, options), explanation
    )


def _fitted(
    explanation: Explanation, comparison: Comparison, ground: Surface, names: tuple[str, ...]
) -> FittedModel:
    """A model with effects at its fit, judged by fresh jitters and with a derivative of its own."""
    context = explanation.context
    found = refit(context, ground, names, seeds=comparison.base.seeds)
    if found is None:
        raise WorkFailed(
            f"{' + '.join(names)}: no run of the refit could be read, or the allowance of "
            f"{context.runs.allowance} runs does not cover it (diagnosis.max_runs)"
        )
    found = judge(context, found)
    if found.unread:
        raise WorkFailed(f"{' + '.join(names)}: no run at its fit could be read")
    return with_own_derivative(context, found)
