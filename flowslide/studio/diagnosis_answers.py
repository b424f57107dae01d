"""What a diagnosis has found, as its line in the page's list: the finding, and figures for charts.

In: documents of `diagnosis`. Out: as `flowslide.studio.job_answers`, with `misfit`, how far each
measurement is off before and after, and `effects`, which the page switches on and off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.verdict.verdict import (
    CandidateVerdict,
    CompareDocument,
    EffectAnswer,
    ExplainDocument,
    FittedModelSummary,
    MeasurementVerdict,
    Refit,
    Verdict,
)
from flowslide.studio.job_answers import Found, as_found, strength_found
from report.numbers import fixed, number, with_unit
from report.sentences.diagnosis import UNEXPLAINED, quoted_value, refuted_sentence

MOST_NEXT, MOST_TRIED = 2, 5
"""Measurements to make next that a line names; effects besides the answer that can be switched."""
LEAST_PROMISE = 1.0
"""Fall of chi2 from which on an effect that was only scored can be switched."""


def comparison(document: CompareDocument) -> Found:
    """The finding, how far each measurement is off, and the values that fit best."""
    return as_found(
        [document.sentence],
        misfit=misfit(document.measurements),
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
    return as_found([document.sentence], effects=_switched(document.base, document.base, promising))


def verdict(document: Verdict) -> Found:
    """The verdict, the strength to use, and what to measure next."""
    lines = [f"{document.verdict.replace('_', ' ').capitalize()}. {document.sentence}"]
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
    return as_found(
        lines, strengths, misfit=misfit(document.measurements), effects=effects(document)
    )


def misfit(measurements: Sequence[MeasurementVerdict]) -> list[Found]:
    """How far each measurement is off, before and after effects were added, in standard deviations.

    Predicted minus measured. A single number has an error bar of one standard deviation, a series
    its mean and its least and largest value.
    """
    groups: dict[tuple[str, str], list[MeasurementVerdict]] = {}
    for one in measurements:
        if one.role != "constructed":
            groups.setdefault((one.measurement, one.role), []).append(one)
    rows = []
    for (name, role), lines in groups.items():
        before = _bar([one.residual_base for one in lines])
        after = _bar([one.residual_final for one in lines])
        when = ("before", "after") if after else ("", "")
        told = [_off(bar, word) for bar, word in zip((before, after), when, strict=True) if bar]
        words = ", ".join(told) or "not read"
        if len(lines) > 1:
            words = f"{len(lines)} numbers, {words} (root mean square)"
        row = {"name": name, "role": role, "before": before, "after": after, "words": words}
        rows.append(row)
    return rows


def _bar(residuals: Sequence[float | None]) -> Found | None:
    """Mark and ends of a bar [std], and the root mean square; None: there is nothing to show."""
    off = np.array([-one for one in residuals if one is not None])
    if not len(off) or len(off) < len(residuals):
        return None
    reach = (-1.0, 1.0) if len(off) == 1 else (off.min() - off.mean(), off.max() - off.mean())
    at = float(off.mean())
    size = float(np.sqrt(np.mean(off**2)))
    return {"at": at, "low": at + reach[0], "high": at + reach[1], "size": size, "n": len(off)}


def _off(bar: Found, when: str) -> str:
    if bar["n"] > 1:
        return f"{fixed(bar['size'])} std off {when}".rstrip()
    way = "large" if bar["at"] > 0 else "small"
    return f"{fixed(abs(bar['at']))} std too {way} {when}".rstrip()


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
