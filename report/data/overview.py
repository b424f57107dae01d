"""What the one picture of a diagnosis shows: rows of measurements and rows of explanations.

In: a `DiagnosisData`. Out: an `Overview`; what a document lacks is empty.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from diagnosis.track_record import Worth, worth_of
from diagnosis.verdict.verdict import FittedModelSummary, NamedSet, ParameterWords, Verdict
from inversion.estimation.data import Role
from pipeline.ties import ranked
from report.data.diagnosis import DiagnosisData
from report.numbers import root_mean_square

#: Rows that a reader takes in; measurements beyond are one row, explanations beyond are left out.
MOST_MEASUREMENTS, MOST_NAMED, MOST_STRENGTHS = 9, 5, 2
BASE, NO_CHANCE = "base model: nothing is missing", "no chance known"

Range = tuple[float | None, float, float]
"""A value, where there is one, and both ends."""


@dataclass(frozen=True)
class MeasurementRow:
    """One measurement, or all those for which there was no room.

    Attributes:
        name: of the measurement.
        role: of its numbers.
        off: residual of each number (measured - modelled) [std], of the base model and, where
            there is one, of the model of the answer.
        asked: strength -> what it asks for, of the same models [kPa]; None: it does not notice it.
        joined: measurements that share this row.
    """

    name: str
    role: Role
    off: list[list[float]]
    asked: dict[str, list[Range | None]]
    joined: int = 1

    @property
    def sizes(self) -> list[float]:
        """Root mean square of the residuals, before and after [std]."""
        return [root_mean_square(sum(r * r for r in off), len(off)) for off in self.off]


@dataclass(frozen=True)
class ExplanationRow:
    """One explanation.

    Attributes:
        names: its effects; empty: the base model, or nothing that has a name.
        words: what it is where it has no effects.
        kind: base model, named, or something else.
        chance: that it is right, by slides whose truth is known; None: they tell nothing of it.
        note: what is said where there is no chance.
        strengths: strength -> what it is if this is right [kPa].
    """

    names: list[str]
    words: str
    kind: Literal["base", "named", "else"]
    chance: float | None
    note: str
    strengths: dict[str, Range]


@dataclass(frozen=True)
class Overview:
    """All rows.

    Attributes:
        measurements: in order of the document.
        explanations: named ones first, something else last.
        left_out: named explanations without a row.
        strengths: residual strengths that are drawn.
        bands: strength -> ends of the band [kPa]: the one to use, of a comparison that of the base
            model; an upper end of infinity: it is a lower bound.
    """

    measurements: list[MeasurementRow]
    explanations: list[ExplanationRow]
    left_out: int
    strengths: list[ParameterWords]
    bands: dict[str, tuple[float, float]]


def overview(data: DiagnosisData) -> Overview:
    """The rows of a document."""
    strengths = [p for p in data.parameters if p.strength][:MOST_STRENGTHS]
    named, rows = [], []
    if (found := data.verdict) is not None:
        named = _named_rows(found)
        rows = [*named[:MOST_NAMED], *_other_rows(found)]
    bands = {p.name: _band(data, p.name) for p in strengths}
    left_out = max(len(named) - MOST_NAMED, 0)
    return Overview(_joined(measurement_rows(data)), rows, left_out, strengths, bands)


def record_span(found: Verdict, name: str) -> tuple[float, float] | None:
    """Where a strength lay in nine of ten slides of such a verdict, had it been said of it [kPa].

    None: it is not quoted, or as a bound, which no slide on record was given.
    """
    used, worth = found.quoted.get(name), worth_of(found.verdict)
    if used is None or used.at_least is not None or worth is None:
        return None
    return worth.span(math.sqrt(math.prod(used.intervals["95%"])))


def _band(data: DiagnosisData, name: str) -> tuple[float, float]:
    used = None if data.verdict is None else data.verdict.quoted.get(name)
    if used is None:
        return data.base.interval_95.get(name, (data.base.values[name],) * 2)
    return used.intervals["95%"] if used.at_least is None else (used.at_least, math.inf)


# --- measurements ---


def measurement_rows(data: DiagnosisData) -> list[MeasurementRow]:
    """A row for each measurement and role of which the base model predicts every number."""
    stages = [stage for _, stage in data.stages]
    groups: dict[tuple[str, Role], list[list[float | None]]] = {}
    for m in data.measurements:
        if m.role != "constructed":
            both = [m.residual_base, m.residual_final][: len(stages)]
            groups.setdefault((m.measurement, m.role), []).append(both)
    rows = []
    for (name, role), numbers in groups.items():
        off = [[r for r in one if r is not None] for one in zip(*numbers, strict=True)]
        if all(len(one) == len(numbers) for one in off):
            rows.append(MeasurementRow(name, role, off, _asked(stages, name, role)))
    return rows


def _asked(
    stages: list[FittedModelSummary], name: str, role: Role
) -> dict[str, list[Range | None]]:
    """What a measurement asks for with each model, by strength."""
    found: list[dict[str, Range]] = [
        {
            one.parameter: (one.value, *one.interval_95)
            for one in stage.asked
            if (one.measurement, one.role) == (name, role)
        }
        for stage in stages
    ]
    names = dict.fromkeys(one.parameter for stage in stages for one in stage.asked)
    return {parameter: [asked.get(parameter) for asked in found] for parameter in names}


def _joined(rows: list[MeasurementRow]) -> list[MeasurementRow]:
    """Those farthest off, in their order, and one row for all others where there are too many."""
    if len(rows) <= MOST_MEASUREMENTS + 1:
        return rows
    order = ranked(range(len(rows)), lambda place: max(rows[place].sizes))
    kept = set(order[:MOST_MEASUREMENTS])
    rest = [row for place, row in enumerate(rows) if place not in kept]
    off = [sum(parts, []) for parts in zip(*(row.off for row in rest), strict=True)]
    last = replace(rest[0], name="others", role="fitted", off=off, asked={}, joined=len(rest))
    return [*(rows[place] for place in sorted(kept)), last]


# --- explanations ---


def _named_rows(found: Verdict) -> list[ExplanationRow]:
    """The explanations of an answer with their chances; where nothing explains what was tried.

    The chance of an answer is that of all its explanations together. They share it as they share
    the probability among those that were tried.
    """
    if not _explains(found):
        tried = {tuple(one.names): one for used in found.quoted.values() for one in used.models}
        named = [one for one in _best_first(found, tried.values()) if one.names]
        return [_row(one, None, "does not suffice") for one in named]
    sets, chance = found.answer.set_90, found.answer.chance
    total = sum(one.probability for one in sets)
    return [
        _row(one, None if chance is None else chance * one.probability / total)
        for one in sets
        if one.names
    ]


def _explains(found: Verdict) -> bool:
    return found.verdict in ("identified", "ambiguous") or found.answer.would_explain


def _best_first(found: Verdict, tried: Iterable[NamedSet]) -> list[NamedSet]:
    """The model that was adopted, then others by how far chi2 falls with them."""
    falls = {frozenset(c.refit.effects): c.refit.drop for c in found.candidates if c.refit}
    falls[frozenset(found.final.effects)] = math.inf
    return ranked(tried, lambda one: falls.get(frozenset(one.names), 0.0))


def _row(one: NamedSet, chance: float | None, note: str = NO_CHANCE) -> ExplanationRow:
    ranges: dict[str, Range] = {n: (one.values[n], *ends) for n, ends in one.interval_95.items()}
    return ExplanationRow(one.names, "", "named", chance, note, ranges)


def _other_rows(found: Verdict) -> list[ExplanationRow]:
    """The base model, and something else."""
    base = {n: (found.base.values[n], *ends) for n, ends in found.base.interval_95.items()}
    spans = {n: span for n in found.quoted if (span := record_span(found, n)) is not None}
    right, wrong = _chances(found, worth_of(found.verdict) if spans else None)
    note = "its tests fail" if _explains(found) else NO_CHANCE
    other = "something that does not show" if found.verdict == "adequate" else "something else"
    ranges: dict[str, Range] = {name: (None, *span) for name, span in spans.items()}
    return [
        ExplanationRow([], BASE, "base", right, note, base),
        ExplanationRow([], other, "else", wrong, NO_CHANCE, ranges),
    ]


def _chances(found: Verdict, worth: Worth | None) -> tuple[float | None, float | None]:
    """Of the base model, and of something else.

    Where something explains, the first has the share of the chance that it has of the probability.
    Where nothing does, it is right as often as nothing was hidden when the same was said.
    """
    answer = found.answer
    if answer.chance is not None:
        own = [one.probability for one in answer.set_90 if not one.names]
        total = sum(one.probability for one in answer.set_90)
        return (answer.chance * own[0] / total if own else None), 1.0 - answer.chance
    if _explains(found) or worth is None:
        return None, None
    hidden = worth.hidden / worth.slides
    return 1.0 - hidden, hidden
