"""The strength by every method: this analysis, other engines, classical methods, publications.

In: a `BackAnalysisData`. Out: `MethodsPanel`s, which a chart and a table show.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from inversion.engines.registry import engine_named
from report.data.back_analysis import BackAnalysisData

#: A classical method whose judgement calls leave a strength open by more than this factor does not
#: say what it is.
MOST_APART = 10.0


@dataclass(frozen=True)
class StrengthRow:
    """One row: a strength [kPa] with its range, and how it is drawn.

    Attributes:
        label: of the row.
        value: the strength; None: the method finds none.
        low: lower end of its range; None: no range.
        high: upper end.
        kind: ours, engine, variant, classical, relation or others.
        wide: a second range: 95 %; of a relation from the weakest to the strongest layer.
        hollow: the value is quoted from memory.
        bound: the value is a lower bound (95 %); `low` to `high` is the limit of flow.
    """

    label: str
    value: float | None
    low: float | None
    high: float | None
    kind: str
    wide: tuple[float, float] | None = None
    hollow: bool = False
    bound: bool = False


@dataclass(frozen=True)
class MethodsPanel:
    """One panel."""

    title: str
    rows: list[StrengthRow]


def slides(data: BackAnalysisData) -> list[MethodsPanel]:
    """The panels: one for each side with an unknown strength."""
    found = []
    sides = {p.name: data.side(p) for p in data.strengths}
    for side in sorted(set(sides.values())):
        names = [name for name, its in sides.items() if its == side]
        classical = [
            analysis
            for analysis in data.result.classical
            if analysis.get("side") == side or len(set(sides.values())) == 1
        ]
        rows = [
            *_ours(data, names),
            *_engines(data, names),
            *_classical(classical),
            *_relations(data, names),
            *_published(data, names),
        ]
        found.append(MethodsPanel(_title(data, side), rows))
    return found


def _ours(data: BackAnalysisData, names: list[str]) -> Iterator[StrengthRow]:
    """Our answers with one standard deviation and 95 %, then the variants of the question."""
    engine = engine_named(data.result.engine).short
    several = len(names) > 1
    for p in data.strengths:
        if p.name in names:
            yield StrengthRow(
                f"{engine}, zone {', '.join(p.zones)}" if several else f"{engine}, this analysis",
                p.value if p.lower_bound_95 is None else p.lower_bound_95,
                max(p.value - p.std_total, 0.0),
                p.value + p.std_total,
                "ours",
                p.interval_95,
                bound=p.lower_bound_95 is not None,
            )
    for variant in data.result.variants:
        for p in data.strengths:
            if p.name in names:
                zones = f", zone {', '.join(p.zones)}" if several else ""
                fitted = "" if variant.reached else " (not fitted)"
                label = f"{variant.name}{zones}{fitted}"
                yield StrengthRow(label, variant.values[p.name], None, None, "variant")


def _engines(data: BackAnalysisData, names: list[str]) -> Iterator[StrengthRow]:
    """The answers of other engines, or of this one without correction, to the same question."""
    own = {p.name: p.value for p in data.strengths}
    for row in data.result.engines:
        is_answer = row.engine == "gns" or bool(row.std)  # not a check of another engine's answer
        if not is_answer or (row.engine == data.result.engine and row.std):
            continue
        for p in data.strengths:
            if p.name not in names or p.name not in own:
                continue
            zones = f", zone {', '.join(p.zones)}" if len(names) > 1 else ""
            value, std = row.values[p.name], row.std.get(p.name)
            low, high = (None, None) if std is None else (max(value - std, 0.0), value + std)
            label = f"{engine_named(row.engine).short}, {row.note}{zones}"
            yield StrengthRow(label, value, low, high, "engine", hollow=std is None)


def undecided(method: Mapping[str, Any]) -> str:
    """Why a classical method says nothing about the strength of a slide; empty: it does."""
    if method["value_kpa"] is None:
        return method.get("reason") or "no answer"
    low, high = method["low_kpa"], method["high_kpa"]
    if low is None or high is None or high <= MOST_APART * low:
        return ""
    return f"{low:.1f} to {high:.1f} kPa by its judgement calls"


def _classical(analyses: Sequence[dict[str, Any]]) -> Iterator[StrengthRow]:
    for analysis in analyses:
        several = f", {analysis['name']}" if len(analyses) > 1 else ""
        for method in analysis["methods"]:
            if undecided(method):
                continue
            low, high = method["low_kpa"], method["high_kpa"]
            label = f"{method['title']}{several}"
            yield StrengthRow(label, method["value_kpa"], low, high, "classical")


def _relations(data: BackAnalysisData, names: list[str]) -> Iterator[StrengthRow]:
    """What relations give for the blow counts of the zones, within one standard deviation."""
    several = len(names) > 1
    for row in data.result.relations:
        if row.parameter in names:
            zones = f", zone {', '.join(row.zones)}" if several else ""
            label = f"{row.label}{zones}"
            hollow = "recalled" in row.confidence
            layers = (row.weakest_kpa, row.strongest_kpa) if len(row.zones) > 1 else None
            yield StrengthRow(
                label, row.value_kpa, row.low_kpa, row.high_kpa, "relation", layers, hollow
            )


def _published(data: BackAnalysisData, names: list[str]) -> Iterator[StrengthRow]:
    """Published values, for the whole case or for a zone of this panel."""
    zones = {zone for p in data.strengths if p.name in names for zone in p.zones}
    for key, entry in data.result.published.items():
        if "zones" in entry and not zones & set(map(str, entry["zones"])):
            continue
        if entry.get("value") is None:
            continue
        yield _other(key, entry)


def _other(key: str, entry: dict[str, Any]) -> StrengthRow:
    confidence = entry.get("confidence", "")
    cited = reference(key)
    label = f"{cited} ({confidence})" if confidence == "recalled" else cited
    return StrengthRow(
        label,
        entry["value"],
        entry.get("low"),
        entry.get("high"),
        "others",
        hollow=confidence == "recalled",
    )


def reference(key: str) -> str:
    """The key of a published value as it is cited: olson_stark_2002 -> Olson and Stark (2002)."""
    found = re.fullmatch(r"([a-z_]+?)_(\d{4}[a-z]?)(?:_(.+))?", key)
    if found is None:
        return re.sub(r"^paper(_|$)", r"the paper, ", key).replace("_", " ").strip(", ")
    authors = " and ".join(name.capitalize() for name in found[1].split("_"))
    more = f", {found[3].replace('_', ' ')}" if found[3] else ""
    return f"{authors} ({found[2]}){more.replace('imm', 'IMM')}"


def _title(data: BackAnalysisData, side: str) -> str:
    if data.case is None:
        return "S_r by every method"
    if data.case.scene.water_level is None:  # of a pile or a slope no side is upstream
        return f"S_r of the slide to the {side}"
    upstream = data.case.measurements.upstream == side
    return f"S_r of the {'upstream' if upstream else 'downstream'} slide"
