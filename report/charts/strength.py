"""The calibrated parameters before and after, and what an undetected effect could hide in them.

In: a `ReportData`. Out: two charts: each parameter with two standard deviations, by the base model
and by that of the answer; and the shift of a strength by each effect just too weak to be found.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from diagnosis.verdict.verdict import FittedModelSummary, ParameterWords
from report.charts.diagnosis_style import (
    AFTER,
    BEFORE,
    PALE_AFTER,
    SMALL,
    SURVEY,
    chart,
    label_x,
    quiet,
    rows,
    title,
)
from report.charts.style import LINE, save_figure, wrapped
from report.diagnosis.data import ReportData
from report.diagnosis.sentences import spoken, unit_of
from report.numbers import plus_minus, signed_percent
from report.pictures.scene import HALO, TEXT_COLOUR

ABOVE, BELOW, LEFT = 0.32, 0.5, 0.95
ROW = 0.42
BAR_ROW, BAR_LEFT = 0.3, 1.5
MOST, LEAST_PERCENT = 12, 0.5


def draw_strength(data: ReportData, path: Path) -> Path:
    """Save each parameter before and after with two standard deviations."""
    stages: list[tuple[str, FittedModelSummary, str]] = [("base model", data.base, BEFORE)]
    if data.final is not None:
        stages = [("before", data.base, BEFORE), ("after", data.final, AFTER)]
    shown = data.parameters
    figure, panels = chart([ROW * len(stages)] * len(shown), above=ABOVE, below=BELOW, left=LEFT)
    for ax, parameter in zip(panels, shown, strict=True):
        quiet(ax, grid="x", left=False)
        rows(ax, [label for label, *_ in stages], width=20)
        _draw_parameter(ax, parameter, stages)
    return save_figure(figure, path)


def _draw_parameter(
    ax: Axes, parameter: ParameterWords, stages: list[tuple[str, FittedModelSummary, str]]
) -> None:
    ends = []
    for place, (_, stage, colour) in enumerate(stages):
        value, std = stage.values[parameter.name], stage.std.get(parameter.name, 0.0)
        ax.plot([value - 2 * std, value + 2 * std], [place] * 2, color=colour, linewidth=7,
                alpha=0.45, solid_capstyle="butt", zorder=3)  # fmt: skip
        ax.plot([value], [place], marker="o", color=colour, markersize=9, markeredgecolor="white",
                zorder=4)  # fmt: skip
        ax.annotate(plus_minus(value, std, parameter.unit), (value, place), xytext=(0, 7),
                    textcoords="offset points", ha="center", va="bottom", fontsize=SMALL,
                    path_effects=HALO, zorder=5)  # fmt: skip
        ends += [value - 2 * std, value + 2 * std]
    room = 0.35 * (max(ends) - min(ends) or abs(ends[0]) or 1.0)
    ax.set_xlim(min(ends) - room, max(ends) + room)
    ax.set_ylim(len(stages) - 0.6, -0.75)
    title(ax, wrapped(parameter.words, 44, 1))
    label_x(ax, f"{unit_of(parameter)} (bar: ± 2 std)".strip())


def hidden_bars(data: ReportData, name: str) -> list[tuple[str, float]]:
    """(effect, change [%]) of a parameter, the largest first; what shifts nothing is left out."""
    found = sorted(data.hidden.get(name, {}).items(), key=lambda item: -abs(item[1]))
    return [item for item in found if abs(item[1]) >= LEAST_PERCENT][:MOST]


def _sure(data: ReportData, name: str) -> float:
    """Two standard deviations of a parameter [%]."""
    value = data.base.values[name]
    return 100 * 2 * data.base.std.get(name, 0.0) / abs(value) if value else 0.0


def _matters(data: ReportData, p: ParameterWords, bars: list[tuple[str, float]]) -> bool:
    return any(abs(change) > _sure(data, p.name) for _, change in bars)


def draw_hidden(data: ReportData, path: Path) -> Path | None:
    """Save the shifts that undetected effects could hide; None where there are none."""
    shown = [(p, hidden_bars(data, p.name)) for p in data.parameters]
    shown = [(p, bars) for p, bars in shown if bars and (p.strength or _matters(data, p, bars))]
    if not shown:
        return None
    survey = {c.name for c in data.candidates if c.kind == "survey"}
    figure, panels = chart(
        [BAR_ROW * len(bars) for _, bars in shown], above=ABOVE, below=BELOW, left=BAR_LEFT
    )
    for ax, (parameter, bars) in zip(panels, shown, strict=True):
        quiet(ax, grid="x", left=False)
        rows(ax, [spoken(name) for name, _ in bars], width=20)
        sure = _sure(data, parameter.name)
        ax.axvspan(-sure, sure, color=LINE, alpha=0.7, linewidth=0, zorder=0)
        ax.axvline(0, color=TEXT_COLOUR, linewidth=0.9, zorder=4)
        for place, (name, change) in enumerate(bars):
            colour = SURVEY if name in survey else PALE_AFTER if abs(change) < sure else AFTER
            ax.barh(place, change, height=0.6, linewidth=0, zorder=3, color=colour)
            away, side = (4, "left") if change > 0 else (-4, "right")
            ax.annotate(signed_percent(change), (change, place), xytext=(away, 0), ha=side,
                        textcoords="offset points", va="center", fontsize=SMALL,
                        path_effects=HALO, zorder=5)  # fmt: skip
        reach = max(sure, *(abs(change) for _, change in bars))
        ax.set_xlim(-1.45 * reach, 1.45 * reach)
        title(ax, wrapped(parameter.words, 36, 1))
        label_x(ax, "shift it hides, % (shaded: ± 2 std)")
    return save_figure(figure, path)
