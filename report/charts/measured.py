"""Measured against predicted: every measurement on one scale, in its own standard deviations.

In: a `BackAnalysisData`. Out: a chart with a row for each measurement; a profile of many points is
one row of many marks. Held-out, compared and constructed data differ by mark, colour and words.
"""

from __future__ import annotations

from pathlib import Path

from report import style
from report.data.back_analysis import BackAnalysisData, Series
from report.numbers import fixed

ROW, LEFT = 0.5, 1.35


def draw_measured(data: BackAnalysisData, path: Path) -> Path | None:
    """Save the chart; None where nothing was measured."""
    shown = data.series
    if not shown:
        return None
    figure, (ax,) = style.chart([ROW * len(shown)], left=LEFT)
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, [f"{one.name} ({one.role})" for one in shown], width=20)
    reach = max(3.0, *(abs(m.difference_in_std) for one in shown for m in one.lines)) * 1.12
    ax.set_xlim(-reach, reach)
    ax.axvspan(-2, 2, color=style.LINE, alpha=0.55, linewidth=0, zorder=0)
    ax.axvline(0, color=style.TEXT_COLOUR, linewidth=0.9, zorder=1)
    for number, (one, tick) in enumerate(zip(shown, ax.get_yticklabels(), strict=True)):
        for m in one.lines:
            mark, colour = style.ROLES[m.role]
            edge = {} if mark == "x" else {"markeredgecolor": "white"}
            ax.plot(
                [m.difference_in_std],
                [number + 0.12],
                marker=mark,
                color=colour,
                zorder=3,
                markersize=8 if len(one.lines) == 1 else 5,
                linestyle="none",
                **edge,
            )
        colour = style.ROLES[one.role][1] if one.role != "constructed" else style.NOTE
        tick.set_color(colour)
        style.over_row(ax, number, style.words(_summary(one)), colour)
    style.labels(ax, "predicted minus measured, in std (shaded: within 2)")
    return style.save_figure(figure, path)


def _summary(one: Series) -> str:
    """Measured and predicted in words."""
    m = one.lines[0]
    if len(one.lines) > 1:
        square = sum((m.predicted - m.measured) ** 2 for m in one.lines) / len(one.lines)
        return f"{len(one.lines)} points, off by {square**0.5:.1f} {m.unit} (root mean square)"
    return (
        f"measured {'< ' * m.censored}{m.measured:g} ± {m.std:.3g} {m.unit}, "
        f"predicted {fixed(m.predicted)} {m.unit}"
    )
