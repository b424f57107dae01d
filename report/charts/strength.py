"""The calibrated parameters before and after, and how far an undetected effect could shift them.

In: a `DiagnosisData`. Out: two charts: each parameter with two standard deviations, for the base
model and that of the answer; and the shift by each effect just too weak to be detected.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from diagnosis.verdict.verdict import FittedModelSummary, ParameterWords
from pipeline.ties import ranked
from report import style
from report.data.diagnosis import DiagnosisData
from report.numbers import plus_minus, signed_percent, unit_of
from report.sentences.diagnosis import spoken

ABOVE, LEFT = 0.32, 0.95
ROW = 0.42
BAR_ROW, BAR_LEFT = 0.3, 1.5
MOST, LEAST_PERCENT = 12, 0.5


def draw_strength(data: DiagnosisData, path: Path) -> Path:
    """Save each parameter before and after with two standard deviations."""
    shown, stages = data.parameters, data.stages
    figure, panels = style.chart([ROW * len(stages)] * len(shown), above=ABOVE, left=LEFT)
    for ax, parameter in zip(panels, shown, strict=True):
        style.quiet(ax, grid="x", left=False)
        style.rows(ax, [label for label, _ in stages], width=20)
        _draw_parameter(ax, parameter, stages)
    return style.save_figure(figure, path)


def _draw_parameter(
    ax: Axes, parameter: ParameterWords, stages: list[tuple[str, FittedModelSummary]]
) -> None:
    ends = []
    for place, ((_, stage), colour) in enumerate(
        zip(stages, (style.BEFORE, style.AFTER), strict=False)
    ):
        value, std = stage.values[parameter.name], stage.std.get(parameter.name, 0.0)
        ax.plot(
            [value - 2 * std, value + 2 * std],
            [place] * 2,
            color=colour,
            linewidth=7,
            alpha=0.45,
            solid_capstyle="butt",
            zorder=3,
        )
        ax.plot(
            [value],
            [place],
            marker="o",
            color=colour,
            markersize=9,
            markeredgecolor="white",
            zorder=4,
        )
        style.tell(ax, value, place, plus_minus(value, std, parameter.unit), away=(0, 7))
        wide = max(std, stage.std_assumed.get(parameter.name, 0.0))
        ax.plot(
            [value - 2 * wide, value + 2 * wide], [place] * 2, color=colour, linewidth=1.2, zorder=3
        )
        ends += [value - 2 * wide, value + 2 * wide]
    room = 0.35 * (max(ends) - min(ends) or abs(ends[0]) or 1.0)
    ax.set_xlim(min(ends) - room, max(ends) + room)
    ax.set_ylim(len(stages) - 0.6, -0.75)
    style.title(ax, style.wrapped(parameter.words, 44, 1))
    style.labels(
        ax, f"{unit_of(parameter.unit)} (bar: ± 2 std; line: with what is assumed)".strip()
    )


def hidden_bars(data: DiagnosisData, name: str) -> list[tuple[str, float]]:
    """(effect, change [%]) of a parameter, the largest first; negligible ones are left out."""
    found = ranked(data.hidden.get(name, {}).items(), lambda item: abs(item[1]))
    return [item for item in found if abs(item[1]) >= LEAST_PERCENT][:MOST]


def _sure(data: DiagnosisData, name: str) -> float:
    """Two standard deviations of a parameter [%]."""
    value = data.base.values[name]
    return 100 * 2 * data.base.std.get(name, 0.0) / abs(value) if value else 0.0


def _matters(data: DiagnosisData, p: ParameterWords, bars: list[tuple[str, float]]) -> bool:
    return any(abs(change) > _sure(data, p.name) for _, change in bars)


def draw_hidden(data: DiagnosisData, path: Path) -> Path | None:
    """Save the shifts that undetected effects could cause; None where there are none."""
    shown = [(p, hidden_bars(data, p.name)) for p in data.parameters]
    shown = [(p, bars) for p, bars in shown if bars and (p.strength or _matters(data, p, bars))]
    if not shown:
        return None
    assumed = {c.name for c in data.candidates if c.family != "physics"}
    figure, panels = style.chart(
        [BAR_ROW * len(bars) for _, bars in shown], above=ABOVE, left=BAR_LEFT
    )
    for ax, (parameter, bars) in zip(panels, shown, strict=True):
        style.quiet(ax, grid="x", left=False)
        style.rows(ax, [spoken(name) for name, _ in bars], width=20)
        sure = _sure(data, parameter.name)
        ax.axvspan(-sure, sure, color=style.LINE, alpha=0.7, linewidth=0, zorder=0)
        ax.axvline(0, color=style.TEXT_COLOUR, linewidth=0.9, zorder=4)
        for place, (name, change) in enumerate(bars):
            colour = (
                style.ASSUMED
                if name in assumed
                else style.PALE_AFTER
                if abs(change) < sure
                else style.AFTER
            )
            ax.barh(place, change, height=0.6, linewidth=0, zorder=3, color=colour)
            style.tell(ax, change, place, signed_percent(change), away=(4 if change > 0 else -4, 0))
        reach = max(sure, *(abs(change) for _, change in bars))
        ax.set_xlim(-1.45 * reach, 1.45 * reach)
        style.title(ax, style.wrapped(parameter.words, 36, 1))
        style.labels(ax, "undetected shift, % (shaded: ± 2 std)")
    return style.save_figure(figure, path)
