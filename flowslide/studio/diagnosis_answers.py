"""What a diagnosis has found, as its line in the page's list: the finding, and its effects.

In: documents of `diagnosis`. Out: as `flowslide.studio.job_answers`, with `effects`, which the page
switches on and off. The picture next to them is that of the report.
"""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.verdict.verdict import (
    CandidateVerdict,
    CompareDocument,
    EffectAnswer,
    ExplainDocument,
    FittedModelSummary,
    Refit,
    Verdict,
)
from flowslide.studio.job_answers import Found, as_found, strength_found
from report.numbers import number, with_unit
from report.sentences.diagnosis import UNEXPLAINED, quoted_value, refuted_sentence
from report.sentences.finding import headline

MOST_NEXT, MOST_TRIED = 2, 5
"""Measurements to make next that a line names; effects besides the answer that can be switched."""
LEAST_PROMISE = 1.0
"""Fall of chi2 from which on an effect that was only scored can be switched."""


def comparison(document: CompareDocument) -> Found:
    """The finding, and the values that fit best."""
    return as_found(
        [headline(document)],
        effects=_switched(document.base, document.base, is_result=document.alarm != "alarm"),
    )


def explanation(document: ExplainDocument) -> Found:
    """The finding, and the effects whose scores promise most."""
    promising = [
        _effect(one, one.amplitude_by_score or 0.0, document.base, "by its score")
        for one in document.candidates
        if number(one.amplitude_by_score or 0.0) != "0"
        and (one.expected_drop or 0.0) > LEAST_PROMISE
    ]
    return as_found(
        [headline(document)], effects=_switched(document.base, document.base, promising)
    )


def verdict(document: Verdict) -> Found:
    """The verdict, the strength to use, and what to measure next."""
    lines = [f"{document.verdict.replace('_', ' ').capitalize()}. {headline(document)}"]
    strengths = []
    for p in document.parameters:
        used = document.quoted.get(p.name)
        if used is None:
            continue
        low, high = used.intervals["95%"]
        value = quoted_value(document, p.name, p.unit)
        only = document.verdict in UNEXPLAINED
        if used.at_least is not None:
            lines.append(f"{p.words}: {value}")
            if p.strength:
                ends = (used.at_least, None)
                strengths.append(
                    strength_found("diagnosis", p.words, used.at_least, ends, "at least, 95 %")
                )
            continue
        if only:
            lines.append(f"{p.words}: only a range, no result: 95 % {value}")
        else:
            lines.append(f"{p.words}: {value}, 95 % {number(low)} to {with_unit(high, p.unit)}")
        if p.strength:
            method = f"diagnosis, {'only a range' if only else 'all explanations'}"
            strengths.append(strength_found(method, p.words, used.value, (low, high), "95 %"))
    best = [
        f"{one.words} (gain {number(one.gain, 2)}{' with that before' if place else ''})"
        for place, one in enumerate(document.next_measurement[:MOST_NEXT])
    ]
    if best:
        lines.append(f"Measure next: {'; '.join(best)}")
    if refuted := refuted_sentence(document):
        lines.append(refuted)
    return as_found(lines, strengths, effects=effects(document))


def effects(document: Verdict) -> Found:
    """What was named, and what was calibrated besides, with the values that go with each."""
    final = document.final
    named = [_effect(one, one.amplitude, final, "named") for one in document.answer.effects]
    there = {one["name"] for one in named}
    tried = [
        _effect(one, one.refit.amplitude, one.refit, "tried alone")
        for one in document.candidates
        if one.refit is not None and one.name not in there and number(one.refit.amplitude) != "0"
    ]
    is_result = document.verdict not in UNEXPLAINED
    return _switched(document.base, final, [*named, *tried[:MOST_TRIED]], is_result=is_result)


def _switched(
    base: FittedModelSummary,
    final: FittedModelSummary,
    each: Sequence[Found] = (),
    *,
    is_result: bool = False,
) -> Found:
    """Effects that can be switched, with the values of parameters, by name, that go with them.

    Returns:
        `base`: without any effect; `final`: with all that is named; `each`: an effect or hypothesis
        with its amplitude as found; `is_result`: the strengths are worth keeping.
    """
    return {
        "base": base.values,
        "final": final.values,
        "each": list(each)[: MOST_TRIED + len(final.effects)],
        "is_result": is_result,
    }


def _effect(
    one: EffectAnswer | CandidateVerdict,
    amplitude: float,
    found: FittedModelSummary | Refit,
    how: str,
) -> Found:
    return {
        "name": one.name,
        "words": one.words,
        "unit": one.unit,
        "amplitude": amplitude,
        "told": with_unit(amplitude, one.unit),
        "values": found.values,
        "how": how,
    }
