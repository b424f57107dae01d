"""Measured against modelled: the surface of the deposit, and what was measured in time.

In: a `DiagnosisData`. Out: a chart with a panel before (base model) and one after (model of the
answer) for each series. The band is two total standard deviations (survey and model) on either side
of the model: 95 % of the marks lie within it if the model is adequate.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from diagnosis.verdict.verdict import MeasurementVerdict
from report import style
from report.data.diagnosis import DiagnosisData, MeasurementSeries
from report.numbers import unit_of
from report.sentences.diagnosis import explanation

ABOVE, LEFT, HEIGHT, FOOT = 0.3, 0.6, 1.75, 0.45
LONGEST = 50
"""Characters of a heading."""


def draw_profile(data: DiagnosisData, path: Path, *, axis: str = "x_m") -> Path | None:
    """Save the chart of the series along an axis, x_m or time_s; None where there is none."""
    chosen = [series for series in data.series if series.axis == axis]
    shown = [(series, after) for series in chosen for after in _models(data)]
    shown = [(s, after) for s, after in shown if any(_predicted(m, after) for m in s.lines)]
    if not shown:
        return None
    figure, panels = style.chart([HEIGHT] * len(shown), above=ABOVE, left=LEFT, foot=FOOT)
    for ax, (series, after) in zip(panels, shown, strict=True):
        _draw(ax, data, series, after)
    for first, second in zip(panels, panels[1:], strict=False):
        if len(_models(data)) > 1 and panels.index(first) % 2 == 0:
            _same_limits(first, second)
    style.legend(figure, _handles(data, chosen), columns=3)
    return style.save_figure(figure, path)


def mark_of(line: MeasurementVerdict) -> tuple[str, str]:
    """Mark and colour of a measured number; black where the model next to it has a colour."""
    mark, colour = style.ROLES[line.role]
    return mark, style.TEXT_COLOUR if line.role in ("fitted", "compared") else colour


def _models(data: DiagnosisData) -> list[bool]:
    """The base model alone, or before and after."""
    return [False] if data.final is None else [False, True]


def _predicted(line: MeasurementVerdict, after: bool) -> bool:
    return (line.predicted_final if after else line.predicted_base) is not None


def heading(data: DiagnosisData, series: MeasurementSeries, after: bool) -> str:
    """Title of a panel; several effects are counted where there is no room for their names."""
    if not after:
        return f"{series.name}: base model"
    effects = list(data.final.effects)
    named = f"{series.name}: after, with {explanation(effects)}"
    return named if len(named) <= LONGEST else f"{series.name}: after, with {len(effects)} effects"


def _draw(ax: Axes, data: DiagnosisData, series: MeasurementSeries, after: bool) -> None:
    style.quiet(ax)
    if series.axis == "x_m" and series.unit == "m" and data.sections is not None:
        _draw_section(ax, data, series, after)
    lines = [m for m in series.lines if _predicted(m, after)]
    place = np.array([m.place for m in lines])
    model = np.array([m.predicted_final if after else m.predicted_base for m in lines])
    wide = 2.0 * np.array([m.std_total for m in lines])
    colour, pale = (style.AFTER, style.PALE_AFTER) if after else (style.BEFORE, style.PALE_BEFORE)
    ax.fill_between(
        place, model - wide, model + wide, color=pale, alpha=0.85, linewidth=0, zorder=4
    )
    ax.plot(place, model, color=colour, linewidth=2.0, zorder=5)
    for line in series.lines:
        mark, ink = mark_of(line)
        edge = {"markeredgecolor": "white", "markeredgewidth": 0.6}
        ax.plot(
            [line.place],
            [line.measured],
            marker=mark,
            color=ink,
            markersize=5.5,
            zorder=6,
            **(edge if mark != "x" else {}),
        )
    style.title(
        ax,
        style.wrapped(heading(data, series, after), 52, 1),
        colour=colour if after else "#50575e",
    )
    quantity = "elevation" if series.axis == "x_m" and series.unit == "m" else "value"
    style.labels(ax, series.axis_label, f"{quantity} ({unit_of(series.unit)})")


def _draw_section(ax: Axes, data: DiagnosisData, series: MeasurementSeries, after: bool) -> None:
    """Ground, the surface before the slide, and the simulated one beyond what was measured."""
    section = data.sections
    surface = section.final if after else section.base
    there = np.isfinite(surface) | np.isfinite(section.initial)
    toes = [
        (line, section.toes[line.name].place(line.measured))
        for line in data.singles
        if line.name in section.toes
    ]
    shown = [*section.x[there], *series.places, *(place for _, place in toes)]
    margin = 0.03 * (max(shown) - min(shown))
    top = np.nanmax([np.nanmax(section.initial), *(m.measured for m in series.lines)])
    low = float(section.ground[there].min())
    room = 0.06 * (top - low)
    ax.set(xlim=(min(shown) - margin, max(shown) + margin), ylim=(low - 2 * room, top + 2 * room))
    ax.fill_between(
        section.x, low - 3 * room, section.ground, color=style.GROUND_COLOUR, linewidth=0, zorder=3
    )
    ax.plot(section.x, section.ground, color=style.GROUND_LINE, linewidth=0.8, zorder=3)
    ax.plot(
        section.x,
        section.initial,
        color=style.TEXT_COLOUR,
        linewidth=1.0,
        linestyle=style.DASHED,
        zorder=3,
    )
    ax.plot(
        section.x, surface, color=style.AFTER if after else style.BEFORE, linewidth=0.9, zorder=4
    )
    for line, place in toes:
        height = float(np.interp(place, section.x, section.ground))
        ax.plot(
            [place],
            [height],
            marker="^",
            markersize=9,
            color=mark_of(line)[1],
            markeredgecolor="white",
            zorder=7,
            clip_on=False,
        )


def _same_limits(first: Axes, second: Axes) -> None:
    for get, put in (("get_xlim", "set_xlim"), ("get_ylim", "set_ylim")):
        ends = [getattr(ax, get)() for ax in (first, second)]
        low, high = min(e[0] for e in ends), max(e[1] for e in ends)
        for ax in (first, second):
            getattr(ax, put)(low, high)


def _handles(data: DiagnosisData, chosen: list[MeasurementSeries]) -> list[Line2D | Patch]:
    first = {line.role: line for series in chosen for line in series.lines}
    made: list[Line2D | Patch] = []
    for role in (role for role in style.ROLES if role in first):
        mark, colour = mark_of(first[role])
        made.append(
            Line2D(
                [],
                [],
                marker=mark,
                color=colour,
                linestyle="none",
                markersize=5.5,
                label="measured" if role == "fitted" else role,
            )
        )
    pale = (
        [(style.PALE_BEFORE, style.BEFORE)]
        if data.final is None
        else [(style.PALE_BEFORE, style.BEFORE), (style.PALE_AFTER, style.AFTER)]
    )
    for (band, line), label in zip(pale, ("model ± 2 std", "after ± 2 std"), strict=False):
        made.append(Patch(facecolor=band, edgecolor=line, label=label))
    if data.sections is not None and chosen[0].axis == "x_m":
        made.append(
            Line2D(
                [],
                [],
                color=style.TEXT_COLOUR,
                linewidth=1.0,
                linestyle=style.DASHED,
                label="before the slide",
            )
        )
        if data.sections.toes:
            made.append(
                Line2D(
                    [],
                    [],
                    marker="^",
                    color=style.TEXT_COLOUR,
                    linestyle="none",
                    markersize=8,
                    label="toe",
                )
            )
    return made
