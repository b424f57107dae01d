"""What a diagnosis has found, in a sentence or two: for pages, terminals and the studio alike.

In: a comparison, an explanation or a verdict, which holds numbers and keys alone. Out: sentences,
always with the set of effects they refer to.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from diagnosis.hypotheses.model import FAMILY_WORDS
from diagnosis.options import Options
from diagnosis.reason import Reason
from diagnosis.signatures.confounding import look_alike
from diagnosis.verdict.verdict import CompareDocument, FittedModelSummary, Verdict
from pipeline.ties import largest
from report.data.diagnosis import DiagnosisData, Document
from report.numbers import chance, number, percent
from report.sentences.diagnosis import (
    explanation,
    spoken,
    test_words,
    window_words,
    worst_test,
)

EXPLAINS = "The base model explains the measurements within their errors"
FAILS = "The base model does not explain the measurements"
#: Kind of a reason -> its words; `p`, `share`: its first number, `test`: what it is of.
REASONS = {
    "unread": "none of its runs could be read",
    "small_fall": "chi² falls by {0:.1f} only; {1:g} are asked for",
    "small_gain": "ln evidence rises by {0:.1f} only; {1:g} are asked for",
    "at_bound": "{of} is at its bound, where the evidence means nothing",
    "by_chance": "one random pattern of many",
    "tests_fail": "its tests still fail ({p}, by {test})",
    "misfit_left": "{share} of the misfit beyond noise is left",
    "held_out_rises": "the held-out misfit rises from {0:.1f} to {1:.1f}",
    "held_out_left": "{share} of the excess misfit of the held-out data is left",
    "others_would_do": "it takes several effects, and others would do",
    "too_often_wrong": "explanations like it were wrong too often",
    "told": "{of}",
}


def reason_words(reason: Reason | None) -> str:
    """Why a model is not accepted, or not the answer; empty: it is."""
    if reason is None:
        return ""
    first = next(iter(reason.numbers), 0.0)
    words = {"p": chance(first), "share": percent(first), "test": test_words(reason.of)}
    return REASONS[reason.kind].format(*reason.numbers, of=reason.of, **words)


def lead(data: DiagnosisData) -> str:
    """The finding as a page begins with it."""
    made = " The measurements are synthetic, made by a simulation." if data.synthetic else ""
    return headline(data.document) + made


def headline(document: Document) -> str:
    """The finding of a comparison, an explanation or a verdict."""
    if isinstance(document, CompareDocument):
        return _comparison(document)
    if isinstance(document, Verdict):
        return f"{_verdict(document)}{_chance(document)}"
    return candidate_sentence(DiagnosisData(Path(), document)) or "No effect was tested."


def _comparison(found: CompareDocument) -> str:
    base, window = found.base, found.base.window
    fit = f"chi² {base.chi2:.1f} on {base.dof} degrees of freedom, combined"
    if found.alarm == "adequate":
        return f"{EXPLAINS} ({fit} {chance(base.p_combined)})."
    where = ""
    if window is not None and window.p < Options.suspect:
        where = f"; it fails most along {window_words(window)}"
    elif base.groups and worst_test(base).name != "held_out":
        where = f"; farthest off is {largest(base.groups, lambda group: group.z).name}"
    said = FAILS.replace("does", "may") if found.alarm == "suspect" else FAILS
    return f"{said} ({fit} {_failing(base)}){where}."


def candidate_sentence(data: DiagnosisData) -> str:
    """Which effect promises most, and which look like it; empty: none was tested."""
    scored = [c for c in data.candidates if c.p_family is not None]
    if not scored:
        return ""
    best = largest(scored, lambda c: c.expected_drop or 0.0)
    name, fall, p = spoken(best.name), best.expected_drop or 0.0, best.p_family or 0.0
    if fall <= 0.0:
        return f"None of the {len(scored)} effects tested would reduce the misfit."
    if p >= Options.alarm:
        return (
            f"No effect stands out among the {len(scored)} tested: the best score, that of {name}, "
            f"comes of noise alone with {chance(p)}."
        )
    alike, found = [], data.confounding
    if found is not None:
        alike = look_alike(found.names, np.array(found.cosine), best.name, Options.inseparable)
    tail = f" These data cannot tell it from {', '.join(map(spoken, alike))}." if alike else ""
    return (
        f"Of {len(scored)} effects tested {name} promises most: {best.words} (chi² would fall by "
        f"{number(fall)}, family-wise {chance(p)}).{tail}"
    )


def _verdict(found: Verdict) -> str:
    answer, among = found.answer, f"among the {len(found.tested)} effects tested"
    name, base = explanation([one.name for one in answer.effects]), _failing(found.base)
    match found.verdict:
        case "adequate" if any(used.at_least is not None for used in found.quoted.values()):
            return (
                "Nothing ran. Any strength above the limit of flow explains that, so nothing can "
                f"be seen to be missing {among}."
            )
        case "adequate":
            return f"{EXPLAINS} ({chance(found.base.p_combined)}); nothing is missing {among}."
        case "suspect":
            return (
                f"The base model is suspect ({base}), but no effect {among} improves it enough to "
                "be named."
            )
        case "unknown_effect" if answer.by_chance:
            return (
                f"{FAILS} ({base}). Best {among} fits {explanation(answer.by_chance)}, "
                f"{REASONS['by_chance']}, which names nothing: what is missing varies from place "
                "to place."
            )
        case "unknown_effect" if answer.would_explain:
            return (
                f"{name.capitalize()} would explain the measurements, {fall_words(found)}, and is "
                f"not named {among}: {reason_words(answer.not_enough)}."
            )
        case "unknown_effect" if answer.effects:
            left = largest(found.final.groups, lambda group: group.z).name
            return (
                f"{name.capitalize()} improves the model, {fall_words(found)}, and does not "
                f"explain the measurements: {reason_words(answer.not_enough)}, {spoken(left)} "
                f"above all. Something else is missing as well, or instead, {among}; no name is "
                "given."
            )
        case "unknown_effect":
            return f"{FAILS} ({base}), and no effect {among} does."
        case "identified" if answer.families:
            doubted = " and ".join(FAMILY_WORDS[family] for family in answer.families)
            return (
                f"The measurements ask for {doubted}, {among}; these data cannot tell which: "
                f"{' or '.join(map(spoken, answer.members))}. With {name} {fall_words(found)}."
            )
        case "identified":
            return f"The measurements ask for {name}, {among}: {fall_words(found)}."
    rivals = [explanation(one.names) for one in answer.set_90]
    rivals += ["what could not be tried within the runs allowed"] * bool(answer.untried)
    return f"The measurements ask for one of {'; '.join(rivals)}, {among}: {fall_words(found)}."


def _failing(stage: FittedModelSummary) -> str:
    """Combined p, and the test that noise would pass least."""
    by = f", by {test_words(worst_test(stage).name)}" if stage.tests else ""
    return f"{chance(stage.p_combined)}{by}"


def fall_words(found: Verdict) -> str:
    """How far the error falls, on fitted and on held-out data, and what noise alone would leave."""
    before, after = found.base, found.final
    noise = f"noise {after.dof}"
    if min(before.dof, after.dof) < 1:
        noise = "as many parameters as data, so this says little"
    said = f"chi² falls from {before.chi2:.0f} to {after.chi2:.0f} ({noise})"
    if after.held_out.n:
        ends = f"{before.held_out.chi2:.1f} to {after.held_out.chi2:.1f}"
        said += f", on held-out data from {ends} (noise {after.held_out.n})"
    return said


def _chance(found: Verdict) -> str:
    """What explanations like this one were worth."""
    if found.answer.chance is None:
        return ""
    said = "explanations like this one were right"
    if found.verdict == "ambiguous":
        said = "it was among explanations like these"
    return f" Where the truth is known, {said} in {100 * found.answer.chance:.0f} of 100."
