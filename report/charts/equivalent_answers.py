"""Answers that fit as well: one line across the parameters for each, side by side.

In: a `ReportData`. Out: a chart whose columns are the parameters. Parameters of one unit share one
scale; of different units, each column runs from its lower to its upper bound.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from inversion.back_analysis.result import ParameterAnswer
from report.back_analysis.data import ReportData
from report.charts.style import HELD_OUT, NOTE, OURS, PALE, new_figure, save_figure, wrapped
from report.pictures.scene import HALO, TEXT_COLOUR

PAPER = "paper_zone_"
"""Keys of published values that belong to one zone each, so that together they are one answer."""


def draw_equally_good(data: ReportData, path: Path) -> Path | None:
    """Save the chart; None where nothing else fits as well, or one number is sought."""
    stops, parameters = data.result.answer.equally_good, data.result.answer.parameters
    if not stops or len(parameters) < 2:
        return None
    figure = new_figure(3.3)
    ax = figure.add_axes((0.11, 0.2, 0.7, 0.75))
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
        ax.plot(x, place(line), color=PALE, linewidth=1.6, marker="o", markersize=5, zorder=2)
    ax.plot(x, place(answer), color=OURS, linewidth=2.4, marker="D", markersize=7, zorder=4)
    _end(ax, place(answer)[-1], "this answer", OURS)
    extreme = int(np.argmax(np.abs(place(others)[:, -1] - place(answer)[-1])))
    _end(ax, place(others)[extreme][-1], "as good", "#3f7da6")
    paper = papers_answer(data)
    if shared and paper is not None:
        ax.plot(x, paper, color=HELD_OUT, linewidth=1.6, linestyle="--", marker="s", zorder=3)
        _end(ax, paper[-1], "the paper", HELD_OUT)
    _axes(ax, parameters, shared)
    return save_figure(figure, path)


def papers_answer(data: ReportData) -> np.ndarray | None:
    """The paper's single answer (p,), where it gives one value for each of these zones."""
    values = []
    for p in data.result.answer.parameters:
        found = [data.result.published.get(f"{PAPER}{zone}") for zone in p.zones]
        if len(found) != 1 or found[0] is None:
            return None
        values.append(found[0]["value"])
    return np.array(values)


def _end(ax: Axes, y: float, text: str, colour: str) -> None:
    ax.annotate(text, (ax.get_lines()[-1].get_xdata()[-1], y), xytext=(9, 0), va="center",
                textcoords="offset points", fontsize=8.5, color=colour, path_effects=HALO,
                annotation_clip=False, zorder=6)  # fmt: skip


def _axes(ax: Axes, parameters: list[ParameterAnswer], shared: bool) -> None:
    names = [wrapped(p.label, 22) for p in parameters]
    ax.set_xticks(range(len(parameters)), names, fontsize=8.5)
    ax.set_xlim(-0.15, len(parameters) - 0.85)
    for number, p in enumerate(parameters):
        ax.axvline(number, color="#bbbbbb", linewidth=0.8, zorder=0)
        if not shared:
            unit = p.unit.replace("deg", "°")
            for y, value in ((0, p.low), (1, p.high)):
                ax.text(number + 0.03, y, f"{value:g} {unit}", fontsize=7.5, color=NOTE,
                        va="center", path_effects=HALO, zorder=5)  # fmt: skip
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8.5, colors=TEXT_COLOUR, length=0)
    if shared:
        ax.set_ylim(bottom=0)
        ax.set_ylabel(f"{parameters[0].unit.replace('deg', '°')}", fontsize=8.5)
    else:
        ax.set_ylim(-0.06, 1.06)
        ax.set_yticks([0, 1], ["lower\nbound", "upper\nbound"], fontsize=8)
