"""How certain the answer is: what moves it (a tornado chart), and what the data have added.

In: a `BackAnalysisData`. Out: three charts. The tornado has a bar for each changed assumption, the
strongest on top. The second compares each parameter before and after the data. The third has a line
across the parameters for each answer that fits equally well; parameters of one unit share one
scale, of different units each column runs from its lower to its upper bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from inversion.back_analysis.result import ParameterAnswer
from inversion.back_analysis.result_builder import NOISE_SOURCE
from inversion.engines.small_cells import NAME as CELLS
from pipeline.ties import largest_place, ranked
from report import style
from report.data.back_analysis import BackAnalysisData
from report.numbers import MINUS, fixed, places_of, unit_of, with_unit
from report.sentences.back_analysis import answer_words
from report.style import (
    HELD_OUT,
    NOTE,
    OURS,
    PALE,
    SMALL,
    TEXT_COLOUR,
    chart,
    labels,
    quiet,
    rows,
    save_figure,
    tell,
    title,
    words,
)

ROW, ABOVE, LEFT, RIGHT = 0.3, 0.36, 1.95, 0.3
MOVED = 1e-3
"""A parameter that no assumption moves by this share of its value has no chart."""


@dataclass(frozen=True)
class Bar:
    """One source of uncertainty: what it adds [unit of the parameter].

    Attributes:
        label: of the row.
        changes: signed changes, one for each side tried.
        std: its contribution to the total; None: reported, not added.
    """

    label: str
    changes: tuple[float, ...]
    std: float | None


def bars(data: BackAnalysisData, parameter: ParameterAnswer) -> list[Bar]:
    """The sources for one parameter, the strongest first."""
    name = parameter.name
    found = [Bar("survey", (-parameter.std_data, parameter.std_data), parameter.std_data)]
    if data.result.noise is not None:
        std = data.result.noise.answer_std[name]
        found.append(Bar(NOISE_SOURCE, (-std, std), std))
    if (cells := parameter.std_by_source.get(CELLS)) is not None:
        found.append(Bar(CELLS, (-cells, cells), cells))
    for entry in data.result.sensitivities:
        changes = tuple(side.change[name] for side in entry.sides)
        std = None if entry.kind == "target" else entry.std[name]
        found.append(Bar(entry.name, changes, std))
    return ranked(found, lambda bar: max(map(abs, bar.changes), default=0.0))


def tornado_parameters(data: BackAnalysisData) -> list[ParameterAnswer]:
    """The parameters that an assumption moves."""
    if not data.result.sensitivities:
        return []
    return [
        p
        for p in data.result.answer.parameters
        if any(
            abs(side.change[p.name]) > MOVED * abs(p.value)
            for entry in data.result.sensitivities
            for side in entry.sides
        )
    ]


def draw_tornado(data: BackAnalysisData, path: Path) -> Path | None:
    """Save the tornado chart; None where no assumption was changed or none moves anything."""
    shown = tornado_parameters(data)
    if not shown:
        return None
    panels = [bars(data, p) for p in shown]
    heights = [ROW * len(panel) for panel in panels]
    figure, axes = chart(heights, above=ABOVE, below=0.55, left=LEFT, right=RIGHT)
    for ax, p, panel in zip(axes, shown, panels, strict=True):
        _draw_tornado(ax, p, panel)
    return save_figure(figure, path)


def _draw_tornado(ax: Axes, p: ParameterAnswer, panel: Sequence[Bar]) -> None:
    quiet(ax, grid="x", left=False)
    rows(ax, [bar.label for bar in panel], width=30)
    reach = 1.45 * max(abs(change) for bar in panel for change in bar.changes)
    ax.set_xlim(p.value - reach, p.value + reach)
    ax.axvspan(p.value - p.std_total, p.value + p.std_total, color=OURS, alpha=0.08, linewidth=0)
    ax.axvline(p.value, color=TEXT_COLOUR, linewidth=1.0, zorder=4)
    for number, bar in enumerate(panel):
        low, high = min(0.0, *bar.changes), max(0.0, *bar.changes)
        style = {"height": 0.62, "linewidth": 0, "zorder": 3}
        ax.barh(number, low, left=p.value, color=OURS, **style)
        ax.barh(number, high, left=p.value, color=HELD_OUT, **style)
        for change, side in ((low, -4), (high, 4)):
            if round(abs(change), places_of(p.unit) + 1) > 0:
                tell(
                    ax,
                    p.value + change,
                    number,
                    f"{change:+.2g}".replace("-", MINUS),
                    away=(side, 0),
                )
    labels(ax, words(f"{p.label} ({unit_of(p.unit)})" if p.unit else p.label))
    title(ax, words(f"{answer_words(p)} (shaded)"), loc="right")


def draw_before_after(data: BackAnalysisData, path: Path) -> Path:
    """Save what was known of each parameter before the data and what is known after."""
    parameters = data.result.answer.parameters
    figure, (ax,) = chart([0.62 * len(parameters)], left=1.85, right=0.3, below=0.42)
    rows(ax, [p.label for p in parameters], width=26)
    ax.set_xlim(-0.02, 1.02)
    ax.set_xticks([0, 1], ["lower bound", "upper bound"], fontsize=SMALL)
    ax.spines[["top", "right", "left", "bottom"]].set_visible(False)
    for number, p in enumerate(parameters):
        _draw_before_after(ax, number, p, data.prior_mean(p))
    return save_figure(figure, path)


def _draw_before_after(ax: Axes, number: int, p: ParameterAnswer, prior_mean: float | None) -> None:
    def share(value: float) -> float:
        return min(max((value - p.low) / (p.high - p.low), 0.0), 1.0)

    ax.plot([0, 1], [number + 0.12] * 2, color=NOTE, linewidth=0.8, zorder=1)
    before = (0.0, 1.0)
    if prior_mean is not None:
        before = share(prior_mean - p.prior_std), share(prior_mean + p.prior_std)
    after = share(p.value - p.std_data), share(p.value + p.std_data)
    if p.lower_bound_95 is not None:
        after = share(p.lower_bound_95), 1.0
    if not p.determined and not p.has_prior:
        after = before
    colour = OURS if p.determined else HELD_OUT
    ax.barh(
        number + 0.12,
        before[1] - before[0],
        left=before[0],
        height=0.34,
        color=PALE,
        linewidth=0,
        zorder=2,
    )
    ax.barh(
        number + 0.12,
        after[1] - after[0],
        left=after[0],
        height=0.16,
        color=colour,
        linewidth=0,
        zorder=3,
    )
    ax.plot(
        [share(p.value)] * 2,
        [number - 0.1, number + 0.34],
        color=TEXT_COLOUR,
        linewidth=1.6,
        zorder=4,
    )
    before_words = "" if prior_mean is None else f" (before ± {p.prior_std:.2g})"
    known = f"± {p.std_data:.2g} from the data" if p.determined else "no narrower than before"
    value = with_unit(fixed(p.value, places_of(p.unit)), p.unit)
    text = f"{value}, {known} {before_words}"
    if p.lower_bound_95 is not None:
        bound = with_unit(fixed(p.lower_bound_95, places_of(p.unit)), p.unit)
        text = f"≥ {bound} (95 %), limit of flow {value}{before_words}"
    place, side = (0.0, "left") if share(p.value) < 0.6 else (1.0, "right")
    ax.text(place, number - 0.28, words(text), fontsize=SMALL, color=colour, ha=side, va="center")
    for x, value in ((0, p.low), (1, p.high)):
        ax.text(
            x, number + 0.41, f"{value:g}", fontsize=SMALL, color=NOTE, ha="center", va="center"
        )


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
    extreme = largest_place(np.abs(place(others)[:, -1] - place(answer)[-1]))
    ends = [
        (place(answer)[-1], "this answer", style.OURS),
        (place(others)[extreme][-1], "equally good", "#3f7da6"),
    ]
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
                ax.text(
                    number + away,
                    y,
                    with_unit(f"{value:g}", p.unit),
                    fontsize=style.SMALL,
                    color=style.NOTE,
                    va="center",
                    path_effects=style.HALO,
                    ha=side,
                    zorder=5,
                )
    if shared:
        ax.set_ylim(bottom=0)
        style.labels(ax, "", unit_of(parameters[0].unit))
    else:
        ax.set_ylim(-0.06, 1.06)
        ax.set_yticks([0, 1], ["lower\nbound", "upper\nbound"], fontsize=style.SMALL)
