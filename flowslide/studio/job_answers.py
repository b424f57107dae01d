"""What a job has found, as its line in the page's list: sentences and strengths.

In: what the functions of `flowslide` return. Out: `answer`, lines in the words and digits of the
reports; `strengths`, those found with their ranges in full digits, for the table of all methods;
`values`, whatever was found, as a section can have it; `ratios`, those of strength to stress, for a
prediction; `implied`, which measurement asks for which
strength.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from flowslide.api import Simulation, Simulation3d
from inversion.back_analysis.implied_strengths import (
    STRENGTHS,
    ImpliedStrengths,
    implied_strengths,
)
from inversion.back_analysis.result import ParameterAnswer, Result
from inversion.posterior.document import PosteriorDocument
from inversion.problem.question import STRENGTH_RATIO
from inversion.problem.question import STRENGTHS as ALL_STRENGTHS
from mpm_taichi.readings3d import named
from pipeline.ties import ranked
from report import classical as classical_report
from report import from_blow_counts as blow_counts_report
from report import prediction as prediction_report
from report.numbers import at_least, fixed, places_of, span, unit_of, with_unit
from report.posterior import answer_sentence
from report.sentences.back_analysis import answer_words, meant_words
from report.sentences.implied_strengths import answer_band, asked_words, how_words
from report.sentences.small_cells import cells_words
from report.simulation3d import warning

Found = dict[str, Any]
MOST_MOVERS = 3
"""Assumptions that a line names."""


def as_found(
    lines: Iterable[str],
    strengths: Iterable[Found] = (),
    values: Iterable[Found] = (),
    **more: Any,
) -> Found:
    """What a job has found, as its line in the list has it."""
    return {
        "answer": [line for line in lines if line],
        "strengths": list(strengths),
        "values": list(values),
        **more,
    }


def _value(property: str, zones: Sequence[str], value: float) -> Found:
    """A value that zones of the section get, or its pool."""
    return {"property": property, "zones": list(zones), "value": value}


def _ratio(method: str, label: str, value: float, std: float | None, zones: Sequence[str]) -> Found:
    """A ratio S_r / sigma'_v0 as it was found; std None: it has a lower bound alone."""
    found = _value(STRENGTH_RATIO, zones, value)
    return {**found, "method": method, "label": label, "std": std}


def strength_found(
    method: str,
    label: str,
    value: float,
    ends: Sequence[float | None],
    words: str,
    *,
    std: float | None = None,
    zones: Sequence[str] = (),
) -> Found:
    """A strength [kPa] with the ends of its range; `words`: what the range is."""
    return {
        "method": method,
        "label": label,
        "value": value,
        "low": ends[0],
        "high": ends[1],
        "range": words,
        "std": std,
        "zones": list(zones),
    }


def simulation(done: Simulation) -> Found:
    """What was read from the deposit."""
    return as_found(
        f"{one.name}: {fixed(one.simulated)} {unit_of(one.unit)}"
        for one in done.readings
        if one.simulated is not None
    )


def simulation_3d(done: Simulation3d) -> Found:
    """What was read from the deposit in plan, and whether soil has reached a wall."""
    read = [(*named(name), value) for name, value in done.readings.items()]
    lines = [f"{words}: {with_unit(value, unit)}" for words, unit, value in read if value == value]
    return as_found([*lines[1:], warning(done.walls, done.readings)])


def back_analysis(result: Result) -> Found:
    """Every parameter with its 95 % interval."""
    reached = result.answer.reached
    lines = [
        line for p in result.answer.parameters for line in (_parameter(p, reached), _movers(p))
    ]
    if len(result.answer.parameters) > 1:  # of a single one its own line says so
        lines += [f"Not determined: {one.words}." for one in result.answer.undetermined]
    if not result.sensitivities and result.noise is None:
        lines.append(
            "Standard deviation of survey, points and cells; the full back-analysis has the rest."
        )
    if not reached:
        lines.append(f"Not fitted: {result.answer.words}.")
    strengths = []
    for p in result.answer.parameters:
        if p.property in STRENGTHS and p.lower_bound_95 is not None:
            ends = p.lower_bound_95, None
            strengths.append(
                strength_found("back-analysis", p.label, ends[0], ends, "at least, 95 %")
            )
        elif p.property in STRENGTHS:
            strengths.append(
                strength_found(
                    "back-analysis",
                    p.label,
                    p.value,
                    p.interval_95,
                    "95 %" if reached else "not fitted",
                    std=p.std_total,
                    zones=p.zones,
                )
            )
    cells = result.answer.small_cells
    if cells is not None:
        lines.append(cells_words(cells))
    return as_found(
        lines,
        strengths,
        (_value(p.property, p.zones, p.as_run) for p in result.answer.parameters),
        implied=[_implied(one) for one in implied_strengths(result) if one.each],
        ratios=[
            _ratio("back-analysis", p.label, p.value, p.std_total, p.zones)
            for p in result.answer.parameters
            if p.property == STRENGTH_RATIO and p.lower_bound_95 is None
        ],
    )


def _implied(found: ImpliedStrengths) -> Found:
    """Which measurement asks for which strength [kPa], in numbers and in words."""
    low, high, words = answer_band(found.parameter)
    return {
        "label": found.parameter.label,
        "value": found.parameter.value,
        "low": low,
        "high": high,
        "words": words,
        "how": how_words(found),
        "tried": list(found.tried),
        "rows": [
            {
                "name": one.name,
                "role": one.role,
                "status": one.status,
                "value": one.value,
                "low": one.low,
                "high": one.high,
                "also": list(one.also),
                "is_limit": one.is_limit,
                "words": asked_words(one),
            }
            for one in found.each
        ],
    }


def _parameter(p: ParameterAnswer, reached: bool) -> str:
    if p.lower_bound_95 is not None:
        return f"{p.label} {at_least(p.lower_bound_95, p.std_total, p.unit)}: nothing ran"
    doubt = "" if p.determined else "; not determined by the data"
    interval = f", 95 % {span(*p.interval_95, places_of(p.unit))} {unit_of(p.unit)}".rstrip()
    within = interval if reached else ""
    meant = "" if p.strength_kpa is None else f"; {meant_words(p)}"
    return f"{answer_words(p)}{within}{meant}{doubt}"


def _movers(p: ParameterAnswer) -> str:
    """What adds most to the standard deviation, apart from the survey."""
    largest = ranked(p.std_by_source.items(), lambda pair: pair[1])[:MOST_MOVERS]
    places = places_of(p.unit) + 1
    named = ", ".join(f"{name} (± {fixed(std, places)})" for name, std in largest if std > 0)
    return f"moved most by {named} {unit_of(p.unit)}".rstrip() if named else ""


def posterior(document: PosteriorDocument) -> Found:
    """Every parameter with its 95 % interval."""
    strengths = [
        strength_found(
            "posterior",
            one.label,
            one.after.median,
            one.after.interval_95,
            "95 %",
            std=one.after.std,
            zones=one.zones,
        )
        for one in document.parameters
        if one.property in STRENGTHS
    ]
    cells = document.small_cells
    factor = {} if cells is None else dict.fromkeys(ALL_STRENGTHS, cells.factor)
    values = (
        _value(one.property, one.zones, one.after.median / factor.get(one.property, 1.0))
        for one in document.parameters
    )
    lines = [answer_sentence(document)]
    if cells is not None:
        lines.append(cells_words(cells))
    ratios = [
        _ratio("posterior", one.label, one.after.median, one.after.std, one.zones)
        for one in document.parameters
        if one.property == STRENGTH_RATIO
    ]
    return as_found(lines, strengths, values, ratios=ratios)


def prediction(document: Found) -> Found:
    """Every predicted number with its range."""
    lines = [
        f"{one['name']}: {fixed(one['mean'])} ± {fixed(one['std'])} {unit_of(one['unit'])}, "
        f"5 to 95 % {span(one['quantiles']['5'], one['quantiles']['95'])}"
        for one in document["quantities"]
    ]
    return as_found([prediction_report.strength_words(document), *lines])


def from_blow_counts(document: Found) -> Found:
    """How many relations predict what was measured, and doubts."""
    return as_found(blow_counts_report.remarks(document))


def classical(document: Found) -> Found:
    """The strength of every method, slide by slide."""
    strengths = [
        strength_found(
            method["title"],
            f"{slide['name']} slide",
            method["value_kpa"],
            (method["low_kpa"], method["high_kpa"]),
            "over the judgement calls",
        )
        for slide in document["analyses"]
        for method in slide["methods"]
        if method["value_kpa"] is not None
    ]
    refused = [f"Not analysed: {reason}" for reason in document["not_analysed"]]
    return as_found([classical_report.lead(document), *refused], strengths)
