"""`verdict.json`: the whole of a diagnosis as one document, with its sentence.

In: what was compared, explained, tried and decided. Out: a `Verdict`. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from diagnosis.adequacy.compare import Comparison
from diagnosis.adequacy.windows import worst_window
from diagnosis.hypotheses.model import Model
from diagnosis.options import Options
from diagnosis.selection.decide import Decision
from diagnosis.selection.forward_selection import AdoptedModel, TriedModels
from diagnosis.selection.next_measurement import Suggestion
from diagnosis.selection.unknown_curve import FoundCurve
from diagnosis.signatures.explain import Explanation
from diagnosis.verdict import verdict
from diagnosis.verdict.documents import (
    base_stage,
    candidate_lines,
    confounding_part,
    hidden_part,
    refit_part,
    signatures_part,
)
from diagnosis.verdict.kept_steps import judge, step_of
from diagnosis.verdict.stages import (
    effect_answers,
    fitted_to_part,
    measurement_lines,
    parameter_words,
    runs_part,
    stage,
)


@dataclass(frozen=True)
class Diagnosed:
    """All that a diagnosis found.

    Attributes:
        model: what was diagnosed.
        options: what was asked for.
        comparison: of the base model.
        explanation: of its misfit.
        tried_models: all models that were tried.
        decision: the verdict.
        curve: the unknown strength curve, where one was sought.
        next_measurement: what would tell the surviving explanations apart.
    """

    model: Model
    options: Options
    comparison: Comparison
    explanation: Explanation
    tried_models: TriedModels
    decision: Decision
    curve: FoundCurve | None = None
    next_measurement: Sequence[Suggestion] = ()


def verdict_document(
    found: Diagnosed, *, case: str, title: str, left_out: Mapping[str, str] | None = None
) -> verdict.Verdict:
    """The document.

    Args:
        found: by the diagnosis.
        case: name of the case.
        title: the name in words.
        left_out: further candidates that were not tested, and why.
    """
    model, comparison, explanation = found.model, found.comparison, found.explanation
    base, final = comparison.base, found.decision.final
    has_effects = bool(final.model.names)
    first = base_stage(model, comparison, explanation)
    return verdict.Verdict(
        case=case,
        title=title,
        sentence=sentence(found),
        verdict=found.decision.verdict,
        tested=sorted(explanation.names),
        forbidden=sorted(found.options.forbidden),
        answer=_answer(found),
        parameters=parameter_words(model.parameters),
        fitted_to=fitted_to_part(base, model.targets),
        base=first,
        final=_stage_of(found, final) if has_effects else first,
        steps=_steps(found),
        candidates=candidate_lines(
            model, explanation, found.options, refits=_refits(found), left_out=left_out
        ),
        confounding=confounding_part(explanation),
        signatures=signatures_part(model, comparison, explanation),
        measurements=measurement_lines(
            model.targets,
            comparison.places,
            base.data,
            base.covariance.survey,
            base.fit.prediction,
            final.model.fit.prediction if has_effects else None,
        ),
        hidden=hidden_part(explanation, model),
        unknown_curve=None if found.curve is None else curve_part(found.curve),
        next_measurement=next_part(found.next_measurement),
        runs=runs_part(base.runs),
        seconds=None,
        hashes={},
        manifest={},
    )


def curve_part(found: FoundCurve) -> verdict.UnknownCurve:
    """The unknown strength curve with its band."""
    low, high = found.band
    return verdict.UnknownCurve(
        variable=found.curve.variable,
        words=found.curve.words,
        unit=found.curve.unit,
        knots=list(found.curve.knots),
        multiplier=found.multiplier.tolist(),
        low=low.tolist(),
        high=high.tolist(),
        chi2=dict(found.chi2),
        ln_evidence=dict(found.ln_evidence),
    )


def next_part(suggested: Sequence[Suggestion]) -> list[verdict.NextMeasurement]:
    """What to measure next."""
    return [
        verdict.NextMeasurement(name=one.proposal.name, words=one.proposal.words, gain=one.gain)
        for one in suggested
    ]


def sentence(found: Diagnosed) -> str:
    """The verdict in one sentence."""
    decision, final = found.decision, found.decision.final
    p = found.tried_models.way[0].adequacy.p_combined
    among = f"among the {len(found.explanation.names)} effects tested"
    match decision.verdict:
        case "adequate":
            return (
                f"The base model explains the measurements within their errors (p {p:.2g}); "
                f"nothing is missing {among}."
            )
        case "suspect":
            return (
                f"The base model is suspect (p {p:.2g}), but no effect {among} improves it enough "
                "to be named."
            )
        case "unknown_effect" if decision.by_chance:
            return (
                f"The base model does not explain the measurements (p {p:.2g}). Best {among} fits "
                f"{_joined(decision.by_chance)}, one random pattern of many, which names nothing: "
                "what is missing varies from place to place."
            )
        case "unknown_effect" if final.model.names:
            return (
                f"With {_joined(final.model.names)} the model still fails: something else is "
                f"missing that is not {among}."
            )
        case "unknown_effect":
            return (
                f"The base model does not explain the measurements (p {p:.2g}), and no effect "
                f"{among} does."
            )
        case "identified":
            return (
                f"The measurements ask for {_joined(final.model.names)}, {among}: {_fall(found)}."
            )
        case _:
            rivals = [_joined(names) if names else "none" for names in decision.sets]
            if decision.untried:
                rivals.append("what could not be tried within the runs allowed")
            return f"The measurements ask for one of {'; '.join(rivals)}, {among}: {_fall(found)}."


def _fall(found: Diagnosed) -> str:
    """How far the error falls."""
    before, after = found.tried_models.way[0], found.decision.final
    text = (
        f"chi2 falls from {before.adequacy.chi2:.0f} to {after.adequacy.chi2:.0f} "
        f"(noise {after.adequacy.dof})"
    )
    if after.adequacy.held_out.n:
        text += (
            f", on held-out data from {before.adequacy.held_out.chi2:.1f} to "
            f"{after.adequacy.held_out.chi2:.1f} (noise {after.adequacy.held_out.n})"
        )
    return text


def _joined(names: Sequence[str]) -> str:
    return " and ".join(name.replace("_", " ") for name in names)


def _answer(found: Diagnosed) -> verdict.Answer:
    words = {c.name: (c.unit, c.words) for c in found.model.candidates}
    final = found.decision.final
    return verdict.Answer(
        effects=effect_answers(found.comparison.base.data, final.model.fit, words),
        set_90=[
            verdict.NamedSet(names=list(names), probability=share)
            for names, share in found.decision.sets.items()
        ],
    )


def _stage_of(found: Diagnosed, adopted: AdoptedModel) -> verdict.FittedModelSummary:
    return stage(
        found.comparison.base.data,
        adopted.model.fit,
        adopted.adequacy,
        worst_window(adopted.judged, found.comparison.places),
        found.model.targets,
    )


def _steps(found: Diagnosed) -> list[verdict.WaterfallStep]:
    """Every model that was adopted, in order."""
    data, way = found.comparison.base.data, found.tried_models.way
    return [
        step_of(
            "_".join(adopted.model.names) or "base",
            number,
            judge(data, adopted.model.fit),
            note=adopted.note,
            ln_evidence=adopted.model.ln_evidence - way[0].model.ln_evidence,
        )
        for number, adopted in enumerate(way)
    ]


def _refits(found: Diagnosed) -> dict[str, verdict.Refit]:
    """Refits of the first round."""
    data, before = found.comparison.base.data, found.tried_models.way[0].model
    refits = {}
    for name, (after, why) in found.tried_models.first.items():
        if not why and name in found.explanation.by_chance:
            why = "one random pattern of many"
        refits[name] = refit_part(name, data, before, after, why)
    return refits
