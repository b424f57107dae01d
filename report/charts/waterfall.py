"""The way from another reading to the answer: a waterfall chart.

In: a `BackAnalysisData`. Out: one row for each change, with a bar from the value before to the
value after; next to it what each row predicts of a measurement that was not fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from inversion.back_analysis.result import MeasurementAnswer, WaterfallAnswer
from report import style
from report.data.back_analysis import BackAnalysisData
from report.numbers import places_of, signed, unit_of

ROW, LEFT, BELOW, ABOVE = 0.3, 1.55, 0.45, 0.32
JUDGE, GAP, RIGHT = 0.85, 0.18, 0.12
"""Width of the second panel, between the panels and at the right [inches]."""


def draw_waterfall(data: BackAnalysisData, path: Path) -> Path | None:
    """Save the chart; None where there is no waterfall."""
    found = data.result.waterfall
    if found is None:
        return None
    (p,) = [p for p in data.result.answer.parameters if p.name == found.parameter]
    names, values = rows_of(found)
    judge = _judge(data)
    height = ROW * len(names)
    figure = style.new_figure(ABOVE + height + BELOW)
    room = 0.0 if judge is None else JUDGE + GAP
    wide = style.WIDTH - LEFT - RIGHT - room
    ax = style.panel(figure, LEFT, BELOW, wide, height)
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, names, width=23)
    _bars(ax, values, places_of(p.unit))
    style.title(ax, style.wrapped(p.label, 40, 1))
    style.labels(ax, unit_of(p.unit))
    if judge is not None:
        side = style.panel(figure, LEFT + wide + GAP, BELOW, JUDGE, height)
        _predictions(side, found, judge, len(names))
    return style.save_figure(figure, path)


def rows_of(found: WaterfallAnswer) -> tuple[list[str], list[float]]:
    """Names and values of the rows, the stated one first."""
    rows = [(bar.name, bar.value) for bar in found.bars]
    if found.stated is not None:
        rows = [(found.stated.name, found.stated.value), *rows]
    return [name for name, _ in rows], [value for _, value in rows]


def _bars(ax: Axes, values: Sequence[float], places: int) -> None:
    last = len(values) - 1
    for place, value in enumerate(values):
        before = values[place - 1] if place else 0.0
        whole = place in (0, last)
        colour = (
            style.BEFORE
            if place == 0
            else style.AFTER
            if whole
            else style.HELD_OUT
            if value > before
            else style.PALE
        )
        start = 0.0 if whole else before
        ax.barh(place, value - start, left=start, height=0.62, color=colour, linewidth=0, zorder=3)
        if place < last:
            ax.plot(
                [value] * 2, [place - 0.31, place + 1.31], color=style.GREY, linewidth=0.8, zorder=4
            )
        change = f" ({signed(value - before, places)})" if place else ""
        style.tell(ax, max(value, start), place, f"{value:.{places}f}{change}")
    ax.set_xlim(0, 1.32 * max(values))


def _judge(data: BackAnalysisData) -> MeasurementAnswer | None:
    """What was measured and not fitted, held out if there is such a number; None: nothing."""
    alone = [m for m in data.result.measurements if m.measured is not None and m.group == m.name]
    by_role = [m for role in ("held out", "compared") for m in alone if m.role == role]
    return by_role[0] if by_role else None


def _predictions(ax: Axes, found: WaterfallAnswer, judge: MeasurementAnswer, rows: int) -> None:
    style.quiet(ax, grid="x", left=False)
    ax.set_yticks([])
    ax.set_ylim(rows - 0.42, -0.58)
    ax.axvspan(
        judge.measured - judge.std,
        judge.measured + judge.std,
        color=style.LINE,
        alpha=0.9,
        linewidth=0,
        zorder=0,
    )
    ax.axvline(judge.measured, color=style.TEXT_COLOUR, linewidth=1.0, linestyle=style.DASHED)
    first = rows - len(found.bars)
    for place, bar in enumerate(found.bars, start=first):
        if judge.name in bar.predicted:
            ax.plot([bar.predicted[judge.name]], [place], **_mark(judge.role))
    ax.margins(x=0.15)
    ax.xaxis.set_major_locator(MaxNLocator(nbins=3, integer=True))
    style.title(ax, style.wrapped(judge.name, 16, 1))
    style.labels(ax, unit_of(judge.unit))


def _mark(role: str) -> dict:
    marker, colour = style.ROLES[role]
    return {
        "marker": marker,
        "color": colour,
        "markersize": 6,
        "markeredgecolor": "white",
        "zorder": 5,
    }
