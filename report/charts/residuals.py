"""Where a model fails: standardised residuals number by number, and by measurement.

In: a `DiagnosisData`. Out: three charts. The first has a panel for each series with its residuals
(measured minus modelled) in total standard deviations, the worst stretch of the base model in
yellow; the second a row for each single number; the third a bar for each measurement.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from diagnosis.verdict.verdict import Group, MeasurementVerdict, Window
from report import style
from report.charts.profile import mark_of
from report.data.diagnosis import DiagnosisData, MeasurementSeries
from report.numbers import chance, number

ABOVE, LEFT, FOOT = 0.3, 0.6, 0.3
HEIGHT, ROW = 1.55, 0.36
LONG_LEFT = 1.4
"""Room for the names of rows [inches]."""


def draw_residuals(data: DiagnosisData, path: Path) -> Path | None:
    """Save the residuals of all surveyed series; None where there is none."""
    shown = [
        series
        for series in data.series
        if any(m.residual_base is not None and m.role != "constructed" for m in series.lines)
    ]
    if not shown:
        return None
    figure, panels = style.chart([HEIGHT] * len(shown), above=ABOVE, left=LEFT, foot=FOOT)
    for ax, series in zip(panels, shown, strict=True):
        _draw_series(ax, data, series)
    style.legend(figure, _handles(data, window=True), columns=4)
    return style.save_figure(figure, path)


def _draw_series(ax: Axes, data: DiagnosisData, series: MeasurementSeries) -> None:
    style.quiet(ax, grid="x")
    ax.axhspan(-2, 2, color=style.LINE, alpha=0.55, linewidth=0, zorder=0)
    ax.axhline(0, color=style.TEXT_COLOUR, linewidth=0.9, zorder=2)
    reach = 3.0
    for line in series.lines:
        if line.residual_base is None:
            continue
        mark, _ = mark_of(line)
        if mark == "x":
            ax.plot([line.place], [line.residual_base], marker="x", color=style.GREY, markersize=5)
            continue
        ax.plot(
            [line.place] * 2, [0, line.residual_base], color=style.BEFORE, linewidth=1.2, zorder=3
        )
        marked = [(line.residual_base, style.BEFORE, 4)]
        if data.final is not None and line.residual_final is not None:
            marked.append((line.residual_final, style.AFTER, 5))
        for residual, colour, layer in marked:
            ax.plot(
                [line.place],
                [residual],
                marker=mark,
                color=colour,
                markersize=5.5,
                markeredgecolor="white",
                markeredgewidth=0.6,
                zorder=layer,
            )
            reach = max(reach, abs(residual))
    ax.set_ylim(-1.15 * reach, (1.45 if _shaded(data, series) else 1.15) * reach)
    _shade_window(ax, data, series)
    style.title(ax, style.wrapped(series.name, 52, 1))
    style.labels(ax, series.axis_label, "residual (std)")


def _shaded(data: DiagnosisData, series: MeasurementSeries) -> Window | None:
    """The worst stretch of the base model, where it lies in this series."""
    window = data.base.window
    here = window is not None and window.measurement == series.name and window.x_from is not None
    return window if here else None


def _shade_window(ax: Axes, data: DiagnosisData, series: MeasurementSeries) -> None:
    window = _shaded(data, series)
    if window is None:
        return
    half = 0.5 * float(np.median(np.diff(series.places)))
    left, right = window.x_from - half, window.x_to + half
    ax.axvspan(left, right, color=style.WINDOW, alpha=0.55, linewidth=0, zorder=0.5)
    low, high = ax.get_xlim()
    middle = 0.5 * (left + right)
    side = (
        "left"
        if middle < low + 0.3 * (high - low)
        else ("right" if middle > low + 0.7 * (high - low) else "center")
    )
    place = {"left": left, "right": right, "center": middle}[side]
    ax.text(
        place,
        0.98,
        f" worst stretch, {chance(window.p)} ",
        fontsize=style.SMALL,
        ha=side,
        va="top",
        transform=ax.get_xaxis_transform(),
        path_effects=style.HALO,
        zorder=6,
    )


def draw_singles(data: DiagnosisData, path: Path) -> Path | None:
    """Save single numbers before and after, a row each; None where there are none."""
    shown = [m for m in data.singles if m.residual_base is not None]
    if not shown:
        return None
    figure, (ax,) = style.chart([ROW * len(shown)], left=LONG_LEFT, foot=FOOT)
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, [_named(m) for m in shown], width=20)
    ax.axvspan(-2, 2, color=style.LINE, alpha=0.55, linewidth=0, zorder=0)
    ax.axvline(0, color=style.TEXT_COLOUR, linewidth=0.9, zorder=1)
    reach = 3.0
    for place, line in enumerate(shown):
        mark, _ = mark_of(line)
        known = [line.residual_base]
        if data.final is not None and line.residual_final is not None:
            known.append(line.residual_final)
            ax.annotate(
                "",
                (line.residual_final, place),
                (line.residual_base, place),
                zorder=2,
                arrowprops={"arrowstyle": "-", "color": "#aab4bc", "lw": 1.4},
            )
        for value, colour in zip(known, (style.BEFORE, style.AFTER), strict=False):
            colour = style.GREY if mark == "x" else colour
            edge = {} if mark == "x" else {"markeredgecolor": "white"}
            ax.plot([value], [place], marker=mark, color=colour, markersize=8, zorder=3, **edge)
        reach = max(reach, *map(abs, known))
    ax.set_xlim(-1.12 * reach, 1.12 * reach)
    style.labels(ax, "residual in std (shaded: within 2)")
    style.legend(figure, _handles(data, window=False), columns=3)
    return style.save_figure(figure, path)


def _named(line: MeasurementVerdict) -> str:
    return line.name if line.role == "fitted" else f"{line.name} ({line.role})"


def draw_groups(data: DiagnosisData, path: Path) -> Path | None:
    """Save a bar for each measurement as a whole; None where the document has no groups."""
    before = data.base.groups
    if not before:
        return None
    after = {} if data.final is None else {g.name: g for g in data.final.groups}
    row = 0.5 if after else ROW
    figure, (ax,) = style.chart([row * len(before)], left=LONG_LEFT, foot=FOOT)
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, [f"{g.name} ({g.n})" for g in before], width=20)
    reach = max(3.0, *(abs(g.z) for g in [*before, *after.values()]))
    least = min(-1.0, *(g.z for g in [*before, *after.values()]))
    ax.set_xlim(1.1 * least - 0.08 * reach, 1.22 * reach)
    ax.axvspan(ax.get_xlim()[0], 2, color=style.LINE, alpha=0.55, linewidth=0, zorder=0)
    ax.axvline(0, color=style.TEXT_COLOUR, linewidth=0.9, zorder=4)
    for place, group in enumerate(before):
        pair: list[tuple[Group, str, float]] = [(group, style.BEFORE, -0.2 if after else 0.0)]
        if group.name in after:
            pair.append((after[group.name], style.AFTER, 0.2))
        for one, colour, shift in pair:
            ax.barh(place + shift, one.z, height=0.36, color=colour, linewidth=0, zorder=3)
            style.tell(ax, max(one.z, 0), place + shift, number(one.z, 2), away=(4, 0))
    style.labels(ax, "excess of squares, in std (shaded: noise)")
    style.legend(figure, _handles(data, window=False, bars=True), columns=3)
    return style.save_figure(figure, path)


def _handles(data: DiagnosisData, *, window: bool, bars: bool = False) -> list[Line2D | Patch]:
    def one(colour: str, label: str, mark: str = "o") -> Line2D | Patch:
        if bars:
            return Patch(facecolor=colour, label=label)
        return Line2D(
            [], [], marker=mark, color=colour, linestyle="none", markersize=6, label=label
        )

    made = [one(style.BEFORE, "base model" if data.final is None else "before")]
    if data.final is not None:
        made.append(one(style.AFTER, "after"))
    if not bars and any(m.role == "held out" for m in data.measurements):
        made.append(
            Line2D(
                [],
                [],
                marker="D",
                color="white",
                markeredgecolor=style.TEXT_COLOUR,
                linestyle="none",
                markersize=6,
                label="diamond: held out",
            )
        )
    if window and data.base.window is not None and data.base.window.x_from is not None:
        made.append(Patch(facecolor=style.WINDOW, alpha=0.6, label="worst"))
    return made
