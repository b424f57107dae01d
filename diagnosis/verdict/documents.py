"""`compare.json` and `explain.json`, and the parts of a verdict that they share.

In: what `compare` and `explain` found. Out: documents of `diagnosis.verdict.verdict` with a
sentence in words.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from diagnosis.adequacy.compare import Comparison
from diagnosis.hypotheses.model import Candidate, Model
from diagnosis.options import Options
from diagnosis.selection.refit import FittedModel
from diagnosis.signatures.explain import Explanation
from diagnosis.verdict import verdict
from diagnosis.verdict.stages import (
    fitted_to_part,
    measurement_lines,
    parameter_words,
    runs_part,
    spread,
    stage,
)
from inversion.estimation.data import Data
from inversion.estimation.misfit import system


def compare_document(
    model: Model, comparison: Comparison, options: Options, *, case: str, title: str
) -> verdict.CompareDocument:
    """`compare.json`."""
    base = comparison.base
    told = alarm(comparison.adequacy.p_combined, options)
    return verdict.CompareDocument(
        case=case,
        title=title,
        sentence=comparison_sentence(comparison, options),
        alarm=told,
        parameters=parameter_words(model.parameters),
        fitted_to=fitted_to_part(base, model.targets),
        base=base_stage(model, comparison),
        measurements=measurement_lines(
            model.targets, comparison.places, base.data, base.covariance.survey,
            base.fit.prediction, None,
        ),
        runs=runs_part(base.runs),
    )  # fmt: skip


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
        sentence=explanation_sentence(explanation, options),
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


def comparison_sentence(comparison: Comparison, options: Options) -> str:
    """The finding of `compare`."""
    adequacy, window = comparison.adequacy, comparison.window
    told = alarm(adequacy.p_combined, options)
    numbers = f"chi2 {adequacy.chi2:.1f} on {adequacy.dof} degrees of freedom"
    p = f"combined p {adequacy.p_combined:.2g}"
    if told == "adequate":
        return f"The base model explains the measurements within their errors ({numbers}, {p})."
    worst = max(adequacy.groups, key=lambda group: group.z, default=None)
    where = "" if worst is None else f"; farthest off is {worst.name}"
    if window is not None and window.p < options.suspect:
        unit = {"x_m": "m", "time_s": "s"}.get(window.axis, "")
        where = (
            f"; it fails most along {window.measurement}, {window.begin:g} to {window.end:g} {unit}"
        )
    verb = "may not explain" if told == "suspect" else "does not explain"
    return f"The base model {verb} the measurements ({numbers}, {p}){where}."


def explanation_sentence(explanation: Explanation, options: Options) -> str:
    """The finding of `explain`."""
    scores = explanation.scores
    ranked = [name for name in explanation.names if scores.best(name).drop > 0.0]
    if not ranked:
        return "None of the effects tested would lower the misfit."
    best = ranked[0]
    words = {candidate.name: candidate.words for candidate in explanation.candidates}
    p = scores.p_family[best]
    if p >= options.alarm:
        return (
            f"No effect stands out among the {len(explanation.names)} tested: the best score, that "
            f"of {best}, comes of noise alone with p {p:.2g}."
        )
    alike = explanation.alike(best, options.inseparable)
    tail = f" These data cannot tell it from {', '.join(alike)}." if alike else ""
    return (
        f"Of {len(explanation.names)} effects tested {best} promises most: {words[best]} "
        f"(chi2 would fall by {scores.best(best).drop:.0f}, family-wise p {p:.2g}).{tail}"
    )


def base_stage(
    model: Model, comparison: Comparison, explanation: Explanation | None = None
) -> verdict.FittedModelSummary:
    """The base model; with an explanation the largest score is among its tests."""
    adequacy = comparison.adequacy if explanation is None else explanation.adequacy
    return stage(
        comparison.base.data, comparison.base.fit, adequacy, comparison.window, model.targets
    )


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
        kind=candidate.kind,
        words=candidate.words,
        unit=candidate.unit,
        z=best.z,
        expected_drop=max(best.drop, 0.0),
        p_family=scores.p_family[name],
        amplitude_by_score=best.amplitude,
        visible_fraction=seen.fraction,
        smallest_detectable=seen.smallest,
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
        ("z", "expected_drop", "p_family", "amplitude_by_score", "visible_fraction",
         "smallest_detectable", "resolved", "refit")
    )  # fmt: skip
    return verdict.CandidateVerdict(
        name=name,
        kind="physics" if candidate is None else candidate.kind,
        words="" if candidate is None else candidate.words,
        unit="" if candidate is None else candidate.unit,
        strength_bias_if_missed={},
        left_out=why,
        **nothing,
    )


def refit_part(
    name: str, data: Data, before: FittedModel, after: FittedModel, why_not: str
) -> verdict.Refit:
    """The model with an effect, against the model before."""
    fit = after.fit
    std = spread(fit, system(data, fit.space, fit.derivative, fit.x))
    place = fit.names.index(name)
    amplitudes = fit.space.amplitudes(fit.x)
    values = fit.space.values(fit.x)
    return verdict.Refit(
        effects=amplitudes,
        amplitude=amplitudes[name],
        std=float(std[fit.space.p + place] * fit.space.effects[place].unit),
        values={n: float(v) for n, v in zip(fit.space.parameters.names, values, strict=True)},
        chi2=fit.total,
        drop=before.fit.total - fit.total,
        ln_evidence=after.ln_evidence - before.ln_evidence,
        held_out_chi2=after.held_out.chi2 if after.held_out.n else None,
        accepted=not why_not,
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
