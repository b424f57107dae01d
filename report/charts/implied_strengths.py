"""Which measurement asks for which strength: a row for each, and the answer as a band.

In: a `BackAnalysisData`. Out: a chart with a panel for each strength that was sought.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from inversion.back_analysis.implied_strengths import (
    ImpliedStrength,
    ImpliedStrengths,
    implied_strengths,
)
from report import style
from report.data.back_analysis import BackAnalysisData
from report.sentences.implied_strengths import answer_band, asked_words, label_words

ROW, LEFT, ABOVE = 0.5, 1.35, 0.34
BEYOND = 0.12
"""Room beyond the runs at either end, as a share of the axis."""


def draw_implied_strengths(data: BackAnalysisData, path: Path) -> Path | None:
    """Save the chart; None where no strength was sought or nothing was measured."""
    panels = [one for one in implied_strengths(data.result) if one.each]
    if not panels:
        return None
    heights = [ROW * len(panel.each) for panel in panels]
    figure, axes = style.chart(heights, left=LEFT, above=ABOVE)
    for ax, panel in zip(axes, panels, strict=True):
        _draw(ax, panel)
    return style.save_figure(figure, path)


def shown_range(panel: ImpliedStrengths) -> tuple[float, float]:
    """Ends of the axis [kPa]: the runs, the answer and the error bars that are known."""
    p = panel.parameter
    low, high, _ = answer_band(p)
    known = [*panel.tried, p.value, low, high]
    known += [end for one in panel.each for end in (one.value, one.low, one.high, *one.also)]
    ends = [end for end in known if end is not None]
    room = BEYOND * max(max(ends) - min(ends), 0.2 * p.value)
    return max(min(ends) - room, 0.0), max(ends) + room


def _draw(ax: Axes, panel: ImpliedStrengths) -> None:
    p, (low, high) = panel.parameter, shown_range(panel)
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, [label_words(one) for one in panel.each], width=20)
    ax.set_xlim(low, high)
    first, last, _ = answer_band(p)
    band = high if last is None else last
    ax.axvspan(first, band, color=style.OURS, alpha=0.1, linewidth=0, zorder=0)
    ax.axvline(p.value, color=style.OURS, linewidth=1.1, zorder=1)
    for place, (one, tick) in enumerate(zip(panel.each, ax.get_yticklabels(), strict=True)):
        mark, colour = style.ROLES[one.role]
        tick.set_color(colour)
        _draw_row(ax, place + 0.12, one, mark, colour)
        style.over_row(ax, place, asked_words(one), colour)
    style.labels(ax, f"strength that it asks for ({p.unit}); band: the answer, 95 %")
    style.title(ax, style.wrapped(p.label, 48, 1))


def _draw_row(ax: Axes, place: float, one: ImpliedStrength, mark: str, colour: str) -> None:
    if one.status == "nothing" or one.value is None:
        return
    left, right = ax.get_xlim()
    if one.status == "met":
        open_high = right if one.high is None else one.high
        ends = [one.value if one.is_limit else left if one.low is None else one.low, open_high]
        ax.plot(ends, [place] * 2, color=colour, linewidth=2.4, alpha=0.55, zorder=2)
        for value in one.also:
            ax.plot(value, place, marker=mark, color=colour, markerfacecolor="white", zorder=3)
    shape = {"met": ">" if one.is_limit else mark, "less": "<", "more": ">", "unmet": "x"}
    edge = {} if one.status == "unmet" else {"markeredgecolor": "white"}
    ax.plot(
        one.value, place, marker=shape[one.status], color=colour, markersize=8, zorder=3, **edge
    )
