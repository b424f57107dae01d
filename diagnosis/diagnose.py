"""The whole loop: compare, explain, add effects until the model is adequate, decide.

    found = diagnose(model, options)
    verdict = verdict_document(found, case="my_dam", title="My dam")

It knows nothing of the model but `diagnosis.hypotheses.model.Model`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from diagnosis.adequacy.compare import Comparison, compare
from diagnosis.hypotheses.model import Model, Proposing
from diagnosis.options import Options
from diagnosis.ranking import Ranking
from diagnosis.selection.decide import Decision, decide
from diagnosis.selection.explain import Explanation, explain
from diagnosis.selection.forward_selection import run_rounds
from diagnosis.selection.next_measurement import Foresight, Suggestion
from diagnosis.selection.pair_search import search_pairs
from diagnosis.selection.selection import Selection
from diagnosis.selection.tried_models import TriedModels
from diagnosis.selection.unknown_curve import FoundCurve, find_curve

Say = Callable[[str], None]

#: Measurements that a verdict suggests. By judgement: who can make more asks for more (`count`).
NEXT = 3


@dataclass(frozen=True)
class Diagnosis:
    """All that a diagnosis found.

    Attributes:
        model: the model that was diagnosed.
        options: settings of the diagnosis.
        comparison: of the base model.
        explanation: of its misfit.
        tried_models: all models that were tried.
        decision: the verdict.
        curve: the unknown strength curve, where one was fitted.
        next_measurement: what would tell the surviving explanations apart.
        refutation: by which measurement the answer could be refuted; None: by none, or there is no
            answer.
    """

    model: Model
    options: Options
    comparison: Comparison
    explanation: Explanation
    tried_models: TriedModels
    decision: Decision
    curve: FoundCurve | None = None
    next_measurement: Sequence[Suggestion] = ()
    refutation: Suggestion | None = None


def diagnose(
    model: Model,
    options: Options,
    say: Say = lambda line: None,
    *,
    count: int = NEXT,
    ranking: Ranking | None = None,
) -> Diagnosis:
    """Run the loop.

    Args:
        model: the model to diagnose.
        options: what may be done otherwise.
        say: called for each stage in a line.
        count: measurements to suggest at most.
        ranking: receives how the hypotheses stand; None: it is not reported.

    Raises:
        WorkFailed: no run of the base model could be read.
        InputError: an option names what the model does not know.
    """
    ranking = ranking or Ranking()
    comparison = compare(model, options)
    say(
        f"base model: chi2 {comparison.adequacy.chi2:.1f} on {comparison.adequacy.dof} degrees of "
        f"freedom, combined p {comparison.adequacy.p_combined:.2g}"
    )
    explanation = explain(model, comparison, options, ranking)
    if explanation.names:
        best = explanation.names[0]
        fall = max(explanation.scores.best(best).drop + 0.0, 0.0)
        say(
            f"of {len(explanation.names)} effects {best} promises most: chi2 falls by {fall:.1f}, "
            f"p {explanation.scores.p_family[best]:.2g}"
        )
    selection = Selection(comparison, explanation, options, ranking)
    run_rounds(selection)
    search_pairs(selection)
    tried_models, explanation = selection.tried, selection.explanation
    for adopted in tried_models.way[1:]:
        say(f"{adopted.note}: chi2 {adopted.adequacy.chi2:.1f}")
    decision = decide(tried_models, explanation, options)
    found = Diagnosis(model, options, comparison, explanation, tried_models, decision)
    if decision.verdict == "unknown_effect" and model.curves:
        say("nothing in the list explains it: seeking a strength curve that would")
        final = decision.final.model
        curve = find_curve(explanation.context.of(final), final, model.curves)
        found = replace(found, curve=curve)
    ahead = _foresight(found)
    if ahead is None:
        return found
    return replace(found, next_measurement=ahead.suggest(count), refutation=ahead.refutation())


def next_measurements(found: Diagnosis, count: int) -> list[Suggestion]:
    """What to measure next, best first; none where the model proposes nothing."""
    ahead = _foresight(found)
    return [] if ahead is None else ahead.suggest(count)


def _foresight(found: Diagnosis) -> Foresight | None:
    """What could still be measured; None where the model proposes nothing."""
    if not isinstance(found.model, Proposing):
        return None
    return Foresight(
        found.model,
        found.comparison,
        found.explanation,
        found.tried_models,
        found.decision,
        found.options,
    )
