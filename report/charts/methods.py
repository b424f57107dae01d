"""The strength by every method: bars for ranges, one panel for each slide.

In: a `BackAnalysisData`. Out: a chart of the material point method with the variants of the
question, the classical methods and published values.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from report import style
from report.data.back_analysis import BackAnalysisData
from report.data.methods import MethodsPanel, StrengthRow, slides
from report.numbers import fixed, span

ROW, ABOVE, LEFT, RIGHT = 0.28, 0.36, 2.0, 1.15


def draw_methods(data: BackAnalysisData, path: Path) -> Path | None:
    """Save the chart; None where no strength was calibrated."""
    panels = slides(data)
    if not panels:
        return None
    heights = [ROW * (len(panel.rows) + 0.4) for panel in panels]
    figure, axes = style.chart(heights, above=ABOVE, left=LEFT, right=RIGHT)
    end = 1.06 * max(_largest(panel) for panel in panels)
    for ax, panel in zip(axes, panels, strict=True):
        _draw(ax, panel, end)
    return style.save_figure(figure, path)


def _largest(panel: MethodsPanel) -> float:
    ends = [end for row in panel.rows for end in (row.value, row.high, *(row.wide or ()))]
    return max(end for end in ends if end is not None)


def _draw(ax: Axes, panel: MethodsPanel, end: float) -> None:
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, [row.label for row in panel.rows], width=28)
    ax.set_xlim(0.0, end)
    ours = next(row for row in panel.rows if row.kind == "ours")
    ax.axvspan(ours.low, ours.high, color=style.OURS, alpha=0.08, linewidth=0, zorder=0)
    for number, row in enumerate(panel.rows):
        _draw_row(ax, number, row)
    for tick, row in zip(ax.get_yticklabels(), panel.rows, strict=True):
        tick.set_color(_colour(row.kind))
        tick.set_fontweight("bold" if row.kind == "ours" else "normal")
        tick.set_fontstyle("italic" if row.kind == "variant" else "normal")
    style.labels(ax, "$S_r$ (kPa)")
    style.title(ax, style.words(panel.title))


def _draw_row(ax: Axes, number: int, row: StrengthRow) -> None:
    colour = _colour(row.kind)
    if row.value is None:
        style.tell(ax, 0.0, number, "finds none", color=style.NOTE)
        return
    if row.wide is not None:
        ax.plot(row.wide, [number] * 2, color=colour, linewidth=1.2, zorder=2)
    if row.low is not None:
        ax.barh(
            number,
            row.high - row.low,
            left=row.low,
            height=0.52,
            color=colour,
            alpha=0.35,
            linewidth=0,
            zorder=2,
        )
    hollow = row.hollow or row.kind == "variant"
    ours = ">" if row.bound else "D"
    ax.plot(
        row.value,
        number,
        marker=ours if row.kind == "ours" else "o",
        linestyle="none",
        markersize=7 if row.kind == "ours" else 5.5,
        color=colour,
        zorder=4,
        markerfacecolor="white" if hollow else colour,
    )
    right = max(end for end in (row.value, row.high, *(row.wide or ())) if end is not None)
    style.tell(
        ax,
        right,
        number,
        _label(row),
        color=colour,
        fontweight="bold" if row.kind == "ours" else "normal",
    )


def _label(row: StrengthRow) -> str:
    """The value, and its range or standard deviation where it has one."""
    if row.low is None:
        return fixed(row.value)
    if row.bound:
        return f"≥ {fixed(row.value)} (95 %)"
    if row.kind == "ours":
        return f"{fixed(row.value)} ± {fixed(row.high - row.value)}"
    return f"{fixed(row.value)} ({span(row.low, row.high)})"


def _colour(kind: str) -> str:
    return {
        "ours": style.OURS,
        "engine": style.OURS,
        "variant": style.OURS,
        "classical": style.CLASSICAL,
        "relation": style.HELD_OUT,
    }.get(kind, style.OTHERS)
