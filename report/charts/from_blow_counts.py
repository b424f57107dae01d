"""Numbers predicted from blow counts: one panel for each number, one row for each relation.

In: the document of `inversion.prediction.from_blow_counts`. Out: a chart.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from report import style
from report.numbers import fixed, unit_of

ROW, ABOVE, LEFT, RIGHT = 0.3, 0.34, 2.0, 0.75


def draw_quantities(document: dict[str, Any], path: Path) -> Path:
    """Save the chart."""
    relations = document["relations"]
    count = len(relations[0]["quantities"])
    figure, axes = style.chart(
        [ROW * (len(relations) + 0.3)] * count, above=ABOVE, left=LEFT, right=RIGHT
    )
    for number, ax in enumerate(axes):
        _draw(
            ax,
            [one["label"] for one in relations],
            [one["quantities"][number] for one in relations],
        )
    return style.save_figure(figure, path)


def _draw(ax: Axes, labels: list[str], entries: list[dict[str, Any]]) -> None:
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, labels, width=28)
    first = entries[0]
    for number, entry in enumerate(entries):
        low, high = entry["quantiles"]["5"], entry["quantiles"]["95"]
        ax.barh(number, high - low, left=low, height=0.5, color=style.OURS, alpha=0.3, linewidth=0)
        ax.plot([entry["at_median"]], [number], marker="o", markersize=6, color=style.OURS)
        style.tell(ax, max(high, entry["at_median"]), number, fixed(entry["at_median"]))
    measured = first["measured"]
    words = ""
    if measured is not None:
        ax.axvline(measured, color=style.TEXT_COLOUR, linewidth=1.2)
        if first["censored"]:
            words = f", measured < {measured:g}"
            ax.axvspan(min(ax.get_xlim()[0], 0.0), measured, color=style.LINE, alpha=0.6, zorder=0)
        else:
            words = f", measured {measured:g} ± {first['std']:g}"
            ax.axvspan(
                measured - first["std"],
                measured + first["std"],
                color=style.LINE,
                alpha=0.6,
                zorder=0,
            )
    style.title(ax, style.words(f"{first['name']}{words} {unit_of(first['unit'])}"))
