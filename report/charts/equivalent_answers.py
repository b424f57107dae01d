"""Answers that fit equally well: one line across the parameters for each.

In: a `BackAnalysisData`. Out: a chart whose columns are the parameters. Parameters of one unit
share one scale; of different units, each column runs from its lower to its upper bound.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from inversion.back_analysis.result import ParameterAnswer
from report import style
from report.data.back_analysis import BackAnalysisData
from report.numbers import unit_of, with_unit

PAPER = "paper_zone_"
"""Keys of published values that belong to one zone each, so that together they are one answer."""


def draw_equally_good(data: BackAnalysisData, path: Path) -> Path | None:
    """Save the chart; None where nothing else fits as well, or there is one unknown."""
    stops, parameters = data.result.answer.equally_good, data.result.answer.parameters
    if not stops or len(parameters) < 2:
        return None
    figure, (ax,) = style.chart([2.4], left=0.6, right=0.95, below=0.6)
    shared = len({p.unit for p in parameters}) == 1
    answer = np.array([p.value for p in parameters])
    others = np.array([[stop.values[p.name] for p in parameters] for stop in stops])
    x = np.arange(len(parameters))

    def place(values: np.ndarray) -> np.ndarray:
        if shared:
            return values
        low = np.array([p.low for p in parameters])
        high = np.array([p.high for p in parameters])
        return (values - low) / (high - low)

    for line in others:
        ax.plot(x, place(line), color=style.PALE, linewidth=1.6, marker="o", markersize=5, zorder=2)
    ax.plot(x, place(answer), color=style.OURS, linewidth=2.4, marker="D", markersize=7, zorder=4)
    extreme = int(np.argmax(np.abs(place(others)[:, -1] - place(answer)[-1])))
    ends = [(place(answer)[-1], "this answer", style.OURS),
            (place(others)[extreme][-1], "equally good", "#3f7da6")]  # fmt: skip
    paper = papers_answer(data)
    if shared and paper is not None:
        ax.plot(x, paper, color=style.HELD_OUT, linewidth=1.6, linestyle="--", marker="s", zorder=3)
        ends.append((paper[-1], "the paper", style.HELD_OUT))
    _axes(ax, parameters, shared)
    heights = style.apart([y for y, *_ in ends], 0.08 * float(np.ptp(ax.get_ylim())))
    for y, (_, text, colour) in zip(heights, ends, strict=True):
        style.tell(ax, x[-1], y, text, away=(9, 0), color=colour)
    return style.save_figure(figure, path)


def papers_answer(data: BackAnalysisData) -> np.ndarray | None:
    """The paper's single answer (p,), where it gives one value for each of these zones."""
    values = []
    for p in data.result.answer.parameters:
        found = [data.result.published.get(f"{PAPER}{zone}") for zone in p.zones]
        if len(found) != 1 or found[0] is None:
            return None
        values.append(found[0]["value"])
    return np.array(values)


def _axes(ax: Axes, parameters: list[ParameterAnswer], shared: bool) -> None:
    style.tidy(ax)
    names = [style.wrapped(p.label, 20) for p in parameters]
    ax.set_xticks(range(len(parameters)), names, fontsize=style.SMALL)
    ax.set_xlim(-0.15, len(parameters) - 0.85)
    ax.tick_params(length=0)
    for number, p in enumerate(parameters):
        ax.axvline(number, color="#bbbbbb", linewidth=0.8, zorder=0)
        if not shared:
            for y, value in ((0, p.low), (1, p.high)):
                away, side = (-0.03, "right") if p is parameters[-1] else (0.03, "left")
                ax.text(number + away, y, with_unit(f"{value:g}", p.unit), fontsize=style.SMALL,
                        color=style.NOTE, va="center", path_effects=style.HALO,
                        ha=side, zorder=5)  # fmt: skip
    if shared:
        ax.set_ylim(bottom=0)
        style.labels(ax, "", unit_of(parameters[0].unit))
    else:
        ax.set_ylim(-0.06, 1.06)
        ax.set_yticks([0, 1], ["lower\nbound", "upper\nbound"], fontsize=style.SMALL)
