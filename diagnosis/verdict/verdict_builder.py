"""`compare.json`, `explain.json` and `verdict.json`.

In: the comparison, explanation, trials and decision. Out: documents of
`diagnosis.verdict.verdict`.
Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from diagnosis.adequacy.compare import Comparison
from diagnosis.adequacy.windows import worst_window
from diagnosis.diagnose import Diagnosis
from diagnosis.hypotheses.model import Candidate, Model
from diagnosis.options import Options
from diagnosis.reason import Reason
from diagnosis.selection.explain import Explanation
from diagnosis.selection.next_measurement import Suggestion
from diagnosis.selection.quoted_strength import (
    EXPLAINED,
    equal_weights,
    quoted,
    unexplained,
)
from diagnosis.selection.refit import FittedModel
from diagnosis.selection.tried_models import AdoptedModel
from diagnosis.selection.unknown_curve import FoundCurve
from diagnosis.track_record import beyond_list
from diagnosis.verdict import verdict
from diagnosis.verdict.fitted_models import (
    effect_answers,
    fitted_to_part,
    fitted_values,
    judge,
    measurement_lines,
    parameter_words,
    quoted_part,
    runs_part,
    stage,
    step_of,
)
from inversion.estimation.data import Data
from inversion.estimation.misfit import lower_bound, system
from pipeline.ties import largest


def compare_document(
    model: Model, comparison: Comparison, options: Options, *, case: str, title: str
) -> verdict.CompareDocument:
    """`compare.json`."""
    base = comparison.base
    return verdict.CompareDocument(
        case=case,
        title=title,
        alarm=alarm(comparison.adequacy.p_combined, options),
        parameters=parameter_words(model.parameters),
        fitted_to=fitted_to_part(base, model.targets),
        base=base_stage(model, comparison),
        measurements=measurement_lines(
            model.targets,
            comparison.places,
            base.data,
            base.covariance.survey,
            base.fit.prediction,
            None,
        ),
        runs=runs_part(base.runs),
    )


def explain_document(
    model: Model,
    comparison: Comparison,
    explanation: Explanation,
    options: Options,
    *,
    case: str,
    title: str,
    left_out: Mapping[str, str] | None = None,
) -> verdict.ExplainDocument:
    """`explain.json`; `left_out`: further candidates that were not tested, and why."""
    return verdict.ExplainDocument(
        case=case,
        title=title,
        parameters=parameter_words(model.parameters),
        base=base_stage(model, comparison, explanation),
        candidates=candidate_lines(model, explanation, options, left_out=left_out),
        confounding=confounding_part(explanation),
        signatures=signatures_part(model, comparison, explanation),
        hidden=hidden_part(explanation, model),
        runs=runs_part(comparison.base.runs),
    )


def alarm(p: float, options: Options) -> str:
    """adequate, suspect or alarm, by the combined p."""
    if p < options.alarm:
        return "alarm"
    return "suspect" if p < options.suspect else "adequate"


def base_stage(
    model: Model, comparison: Comparison, explanation: Explanation | None = None
) -> verdict.FittedModelSummary:
    """The base model; with an explanation the largest score is among its tests."""
    if explanation is None:
        return stage(
            comparison.base.data,
            comparison.base.fit,
            comparison.adequacy,
            comparison.window,
            model.targets,
        )
    found = stage(
        comparison.base.data,
        comparison.base.fit,
        explanation.adequacy,
        comparison.window,
        model.targets,
        stated(explanation),
    )
    mover, moved = moved_most(comparison, explanation)
    held_out = found.held_out.model_copy(update={"mover": mover, "moved": moved})
    return found.model_copy(update={"held_out": held_out})


def moved_most(comparison: Comparison, explanation: Explanation) -> tuple[str, float | None]:
    """The candidate that moves the held-out numbers most, and by how many standard deviations.

    Each with the amplitude that the fitted numbers would just show, as a larger one would have been
    seen, and the parameters moved to meet these.
    """
    base, linear = comparison.base, comparison.judged.system
    held = np.flatnonzero(base.split.held_out)
    moved: dict[str, float] = {}
    own = np.linalg.cholesky(base.data.covariance[np.ix_(held, held)])
    for name in explanation.names if held.size else ():
        seen = explanation.visible[name]
        change = seen.believed * explanation.signatures[name].changes[seen.rung]
        met = change - base.fit.derivative @ linear.imitating(linear.augmented(change))
        size = float(np.linalg.norm(np.linalg.solve(own, met[held])))
        if np.isfinite(size):
            moved[name] = size
    if not moved:
        return "", None
    mover = largest(moved, moved.__getitem__)
    return mover, moved[mover]


def _apart(std: float, amplitude: float) -> float:
    return abs(abs(amplitude) - std)


def stated(explanation: Explanation) -> dict[str, np.ndarray]:
    """Changes of all predictions by one standard deviation of what is assumed with one, by name."""
    found = {}
    for candidate in explanation.candidates:
        changes = explanation.signatures[candidate.name].changes
        if (std := candidate.prior_std) is not None:
            rung = min(changes, key=partial(_apart, std))
            found[candidate.name] = changes[rung] * (std / rung)
    return found


def candidate_lines(
    model: Model,
    explanation: Explanation,
    options: Options,
    *,
    refits: Mapping[str, verdict.Refit] | None = None,
    left_out: Mapping[str, str] | None = None,
) -> list[verdict.CandidateVerdict]:
    """Candidates, the best score first, then those that were not tested."""
    known = {candidate.name: candidate for candidate in model.candidates}
    why = {**explanation.left_out, **(left_out or {})}
    lines = [
        _tested(known[name], explanation, options, (refits or {}).get(name))
        for name in explanation.names
    ]
    return lines + [_untested(name, known.get(name), why[name]) for name in sorted(why)]


def _tested(
    candidate: Candidate, explanation: Explanation, options: Options, refit: verdict.Refit | None
) -> verdict.CandidateVerdict:
    name, scores = candidate.name, explanation.scores
    best, seen = scores.best(name), explanation.visible[name]
    cosines = explanation.signatures[name].cosines
    return verdict.CandidateVerdict(
        name=name,
        family=candidate.family,
        switch=candidate.switch,
        words=candidate.words,
        unit=candidate.unit,
        z=best.z,
        expected_drop=max(best.drop, 0.0),
        p_family=scores.p_family[name],
        amplitude_by_score=best.amplitude,
        visible_fraction=seen.fraction,
        smallest_detectable=(
            seen.smallest if candidate.low <= seen.smallest <= candidate.high else None
        ),
        strength_bias_if_missed=dict(seen.bias),
        resolved=(
            all(cosine >= options.same_signature for cosine in cosines.values())
            if cosines
            else None
        ),
        refit=refit,
        left_out="",
    )


def _untested(name: str, candidate: Candidate | None, why: str) -> verdict.CandidateVerdict:
    nothing = dict.fromkeys(
        (
            "z",
            "expected_drop",
            "p_family",
            "amplitude_by_score",
            "visible_fraction",
            "smallest_detectable",
            "resolved",
            "refit",
        )
    )
    return verdict.CandidateVerdict(
        name=name,
        family="physics" if candidate is None else candidate.family,
        switch=candidate is not None and candidate.switch,
        words="" if candidate is None else candidate.words,
        unit="" if candidate is None else candidate.unit,
        strength_bias_if_missed={},
        left_out=why,
        **nothing,
    )


def refit_part(
    name: str, data: Data, before: FittedModel, after: FittedModel, why_not: Reason | None
) -> verdict.Refit:
    """The model with an effect, against the model before."""
    fit = after.fit
    std = system(data, fit.space, fit.derivative, fit.x).spread_with(None)
    place = fit.names.index(name)
    amplitudes = fit.space.amplitudes(fit.x)
    values = fit.space.values(fit.x)
    return verdict.Refit(
        effects=amplitudes,
        amplitude=amplitudes[name],
        std=float((std * fit.space.per_unit(fit.x))[fit.space.p + place]),
        values={n: float(v) for n, v in zip(fit.space.parameters.names, values, strict=True)},
        chi2=fit.total,
        drop=before.fit.total - fit.total,
        ln_evidence=after.ln_evidence - before.ln_evidence,
        held_out_chi2=after.held_out.chi2 if after.held_out.n else None,
        accepted=why_not is None,
        why_not=why_not,
    )


def confounding_part(explanation: Explanation) -> verdict.Confounding:
    """Which candidates look alike."""
    return verdict.Confounding(names=list(explanation.names), cosine=explanation.cosine.tolist())


def signatures_part(
    model: Model, comparison: Comparison, explanation: Explanation
) -> verdict.Signatures:
    """Fingerprints: changes of all numbers, raw, standardised, and what a refit leaves of them."""
    base = comparison.base
    linear = comparison.judged.system
    total = np.sqrt(np.diag(base.data.covariance))
    entries = []
    for name in explanation.names:
        for amplitude, change in sorted(explanation.signatures[name].changes.items()):
            met = linear.imitating(linear.augmented(change))
            left = change - base.fit.derivative @ met
            entries.append(
                verdict.Signature(
                    name=name,
                    amplitude=float(amplitude),
                    change=_finite(change),
                    standardised=_finite(change / total),
                    left_after_refit=_finite(left / total),
                )
            )
    return verdict.Signatures(
        names=list(explanation.names), measurements=list(model.targets.names), entries=entries
    )


def hidden_part(explanation: Explanation, model: Model) -> dict[str, dict[str, float]]:
    """Parameter -> effect -> change [%] that it hides while undetected."""
    return {
        parameter: {
            name: explanation.visible[name].bias[parameter]
            for name in explanation.names
            if parameter in explanation.visible[name].bias
        }
        for parameter in model.parameters.names
    }


def _finite(values: np.ndarray) -> list[float]:
    """Numbers that a document can hold; what could not be read changes nothing."""
    return [float(value) for value in np.nan_to_num(values)]


def verdict_document(
    found: Diagnosis, *, case: str, title: str, left_out: Mapping[str, str] | None = None
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
        verdict=found.decision.verdict,
        tested=sorted(explanation.names),
        forbidden=sorted(found.options.forbidden),
        answer=_answer(found),
        parameters=parameter_words(model.parameters),
        fitted_to=fitted_to_part(base, model.targets),
        base=first,
        final=_stage_of(found, final) if has_effects else first,
        quoted=_quoted(found),
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
        refutation=None if found.refutation is None else _proposed(found.refutation),
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
    return [_proposed(one) for one in suggested]


def _proposed(one: Suggestion) -> verdict.NextMeasurement:
    return verdict.NextMeasurement(
        name=one.proposal.name,
        words=one.proposal.words,
        gain=one.gain,
        parts=list(one.proposal.parts),
        unit=one.proposal.unit,
        outcomes=[
            verdict.PredictedReading(
                names=list(said.names), values=said.values.tolist(), std=said.std.tolist()
            )
            for said in one.outcomes
        ],
    )


def _answer(found: Diagnosis) -> verdict.Answer:
    words = {c.name: (c.unit, c.words) for c in found.model.candidates}
    final = found.decision.final
    return verdict.Answer(
        effects=effect_answers(
            _data_of(found, final.model), final.model.fit, words, _error_of(found, final)
        ),
        set_90=_named(found, found.decision.sets),
        families=list(found.decision.families),
        members=list(found.decision.members),
        not_enough=found.decision.not_enough,
        by_chance=list(found.decision.by_chance),
        untried=[list(names) for names in found.decision.untried],
        chance=found.decision.chance,
    )


def _named(found: Diagnosis, shares: Mapping[tuple[str, ...], float]) -> list[verdict.NamedSet]:
    """Explanations with their shares of the probability, and the parameters that each gives."""
    named, error = [], found.tried_models.error
    for names, share in shares.items():
        model = found.tried_models.models[names]
        own = error if names and model.own is None else None
        values, ends = fitted_values(_data_of(found, model), model.fit, own)
        named.append(
            verdict.NamedSet(names=list(names), probability=share, values=values, interval_95=ends)
        )
    return named


def _data_of(found: Diagnosis, model: FittedModel) -> Data:
    """The measurements with a model's own error, where it was found, else that of the base."""
    return found.explanation.context.of(model).data


def _error_of(found: Diagnosis, adopted: AdoptedModel) -> np.ndarray | None:
    """The error that the effects of a model bring beyond C, C' - C; known of the last alone.

    None where the model has errors of its own in place of C.
    """
    last = adopted is found.tried_models.current and adopted.model.own is None
    return found.tried_models.error if last else None


def _quoted(found: Diagnosis) -> dict[str, verdict.QuotedValue]:
    """What to use of each parameter."""
    decision = found.decision
    models = found.tried_models.models
    explained = decision.verdict in EXPLAINED
    targets = found.model.targets
    # No slide of the record stood still: a bound has the errors that are known alone.
    beyond = 0.0 if targets.limits_alone else beyond_list(decision.verdict)
    weights = (
        equal_weights(decision.sets) if explained else unexplained(models, found.options.least_drop)
    )
    mixed = quoted(
        found.explanation.context,
        models,
        weights,
        error=found.tried_models.error,
        widened=not explained or decision.final.adequacy.p_combined < found.options.still_failing,
        beyond=beyond,
    )
    part = quoted_part(mixed, models[()].fit, beyond, _named(found, mixed.models))
    if not targets.limits_alone:
        return part
    assumed = _stage_of(found, found.tried_models.way[0]).std_assumed
    space = models[()].fit.space.parameters
    for name, strength, low in zip(space.names, space.strengths, space.low, strict=True):
        if strength:
            own = part[name]
            least = low  # nothing runs at any strength that is believed
            if targets.met is not None:
                least = max(low, lower_bound(own.value, max(own.std, assumed.get(name, 0.0))))
            part[name] = own.model_copy(update={"at_least": least})
    return part


def _stage_of(found: Diagnosis, adopted: AdoptedModel) -> verdict.FittedModelSummary:
    return stage(
        _data_of(found, adopted.model),
        adopted.model.fit,
        adopted.adequacy,
        worst_window(adopted.judged, found.comparison.places),
        found.model.targets,
        stated(found.explanation),
        _error_of(found, adopted),
    )


def _steps(found: Diagnosis) -> list[verdict.WaterfallStep]:
    """Every model that was adopted, in order."""
    way = found.tried_models.way
    return [
        step_of(
            "_".join(adopted.model.names) or "base",
            number,
            judge(_data_of(found, adopted.model), adopted.model.fit),
            note=adopted.note,
            ln_evidence=adopted.model.ln_evidence - way[0].model.ln_evidence,
        )
        for number, adopted in enumerate(way)
    ]


def _refits(found: Diagnosis) -> dict[str, verdict.Refit]:
    """Refits of the first round."""
    before = found.tried_models.way[0].model
    refits = {}
    for name, (after, why) in found.tried_models.first.items():
        if why is None and name in found.explanation.by_chance:
            why = Reason(kind="by_chance")
        refits[name] = refit_part(name, _data_of(found, after), before, after, why)
    return refits
