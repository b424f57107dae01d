"""The strength by every method, in one picture: bars for ranges, one panel for each slide.

In: a `ReportData`. Out: a chart of the material point method with other readings of the question,
the classical methods, and what others have published.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from inversion.engines.registry import engine_named
from report.back_analysis.data import ReportData
from report.charts.style import (
    CLASSICAL,
    NOTE,
    OTHERS,
    OURS,
    clean,
    new_figure,
    row_labels,
    save_figure,
    words,
)
from report.pictures.scene import HALO, TEXT_COLOUR

ROW, ABOVE, BELOW, LEFT, RIGHT = 0.27, 0.42, 0.55, 2.1, 0.95


@dataclass(frozen=True)
class Strength:
    """One row: a strength [kPa] with its range, and how it is drawn.

    Attributes:
        label: of the row.
        value: the strength; None: the method finds none.
        low: lower end of its range; None: no range.
        high: upper end.
        kind: ours, engine, variant, classical or others.
        wide: a second, wider range (95 %).
        hollow: the value is only recalled.
    """

    label: str
    value: float | None
    low: float | None
    high: float | None
    kind: str
    wide: tuple[float, float] | None = None
    hollow: bool = False


@dataclass(frozen=True)
class Slide:
    """One panel."""

    title: str
    rows: list[Strength]


def slides(data: ReportData) -> list[Slide]:
    """The panels: one for each side that has a strength sought."""
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
            *_published(data, names),
        ]
        found.append(Slide(_title(data, side), rows))
    return found


def draw_methods(data: ReportData, path: Path) -> Path | None:
    """Save the chart; None where no strength is sought."""
    panels = slides(data)
    if not panels:
        return None
    heights = [ROW * (len(panel.rows) + 0.4) for panel in panels]
    total = sum(heights) + len(panels) * (ABOVE + BELOW)
    figure = new_figure(total)
    width = figure.get_figwidth()
    end = 1.06 * max(_largest(panel) for panel in panels)
    top = total
    for panel, height in zip(panels, heights, strict=True):
        top -= ABOVE + height
        box = (LEFT / width, top / total, (width - LEFT - RIGHT) / width, height / total)
        _draw(figure.add_axes(box), panel, end)
        top -= BELOW
    return save_figure(figure, path)


def _ours(data: ReportData, names: list[str]) -> Iterator[Strength]:
    """Our answers with one standard deviation and 95 %, then other readings of the question."""
    engine = engine_named(data.result.engine).short
    several = len(names) > 1
    for p in data.strengths:
        if p.name in names:
            yield Strength(
                f"{engine}, zone {', '.join(p.zones)}" if several else f"{engine}, this analysis",
                p.value,
                max(p.value - p.std_total, 0.0),
                p.value + p.std_total,
                "ours",
                p.interval_95,
            )
    for variant in data.result.variants:
        for p in data.strengths:
            if p.name in names:
                zones = f", zone {', '.join(p.zones)}" if several else ""
                fitted = "" if variant.reached else " (not fitted)"
                label = f"{variant.name}{zones}{fitted}"
                yield Strength(label, variant.values[p.name], None, None, "variant")


def _engines(data: ReportData, names: list[str]) -> Iterator[Strength]:
    """What other engines, or this one without correction, have found to the same question."""
    own = {p.name: p.value for p in data.strengths}
    for row in data.result.engines:
        is_answer = row.engine == "gns" or bool(row.std)  # not the judge at another's answer
        if not is_answer or (row.engine == data.result.engine and row.std):
            continue
        for p in data.strengths:
            if p.name not in names or p.name not in own:
                continue
            zones = f", zone {', '.join(p.zones)}" if len(names) > 1 else ""
            value, std = row.values[p.name], row.std.get(p.name)
            low, high = (None, None) if std is None else (max(value - std, 0.0), value + std)
            label = f"{engine_named(row.engine).short}, {row.note}{zones}"
            yield Strength(label, value, low, high, "engine", hollow=std is None)


def _classical(analyses: Sequence[dict[str, Any]]) -> Iterator[Strength]:
    for analysis in analyses:
        several = f", {analysis['name']}" if len(analyses) > 1 else ""
        for method in analysis["methods"]:
            low, high = method["low_kpa"], method["high_kpa"]
            label = f"{method['title']}{several}"
            yield Strength(label, method["value_kpa"], low, high, "classical")


def _published(data: ReportData, names: list[str]) -> Iterator[Strength]:
    """What others found, for all of the case or for a zone of this panel."""
    zones = {zone for p in data.strengths if p.name in names for zone in p.zones}
    for key, entry in data.result.published.items():
        if "zones" in entry and not zones & set(map(str, entry["zones"])):
            continue
        if entry.get("value") is None:
            continue
        yield _other(key, entry)


def _other(key: str, entry: dict[str, Any]) -> Strength:
    confidence = entry.get("confidence", "")
    told = reference(key)
    label = f"{told} ({confidence})" if confidence == "recalled" else told
    return Strength(
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


def _title(data: ReportData, side: str) -> str:
    if data.case is None:
        return "S_r by every method"
    upstream = data.case.measurements.upstream == side
    return f"S_r of the {'upstream' if upstream else 'downstream'} slide"


def _largest(panel: Slide) -> float:
    ends = [end for row in panel.rows for end in (row.value, row.high, *(row.wide or ()))]
    return max(end for end in ends if end is not None)


def _draw(ax: Axes, panel: Slide, end: float) -> None:
    row_labels(ax, [row.label for row in panel.rows], width=31)
    ax.set_xlim(0.0, end)
    clean(ax)
    ours = next(row for row in panel.rows if row.kind == "ours")
    ax.axvspan(ours.low, ours.high, color=OURS, alpha=0.08, linewidth=0, zorder=0)
    for number, row in enumerate(panel.rows):
        _draw_row(ax, number, row)
    for tick, row in zip(ax.get_yticklabels(), panel.rows, strict=True):
        tick.set_color(_colour(row.kind))
        tick.set_fontweight("bold" if row.kind == "ours" else "normal")
        tick.set_fontstyle("italic" if row.kind == "variant" else "normal")
    ax.set_xlabel("$S_r$ (kPa)", fontsize=8.5)
    ax.set_title(words(panel.title), loc="left", fontsize=10, color=TEXT_COLOUR, fontweight="bold")


def _draw_row(ax: Axes, number: int, row: Strength) -> None:
    colour = _colour(row.kind)
    if row.value is None:
        ax.text(0.0, number, " finds none", fontsize=8, color=NOTE, va="center")
        return
    if row.wide is not None:
        ax.plot(row.wide, [number] * 2, color=colour, linewidth=1.2, zorder=2)
    if row.low is not None:
        ax.barh(number, row.high - row.low, left=row.low, height=0.52, color=colour, alpha=0.35,
                linewidth=0, zorder=2)  # fmt: skip
    hollow = row.hollow or row.kind == "variant"
    ax.plot(row.value, number, marker="D" if row.kind == "ours" else "o", linestyle="none",
            markersize=7 if row.kind == "ours" else 5.5, color=colour, zorder=4,
            markerfacecolor="white" if hollow else colour)  # fmt: skip
    right = max(end for end in (row.value, row.high, *(row.wide or ())) if end is not None)
    ax.annotate(_told(row), (right, number), xytext=(6, 0), textcoords="offset points",
                va="center", fontsize=8, color=colour, path_effects=HALO, zorder=5,
                fontweight="bold" if row.kind == "ours" else "normal",
                annotation_clip=False)  # fmt: skip


def _told(row: Strength) -> str:
    """The value, and its range or standard deviation where it has one."""
    if row.low is None:
        return f"{row.value:.1f}"
    if row.kind == "ours":
        return f"{row.value:.1f} ± {row.high - row.value:.1f}"
    return f"{row.value:.1f} ({row.low:.1f} to {row.high:.1f})"


def _colour(kind: str) -> str:
    return {"ours": OURS, "engine": OURS, "variant": OURS, "classical": CLASSICAL}.get(kind, OTHERS)
