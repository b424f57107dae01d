"""Where a model fails along its series: standardised residuals number by number.

In: a `DiagnosisData`. Out: a chart with a panel for each series with its residuals (measured minus
modelled) in total standard deviations, the worst stretch of the base model in yellow.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from diagnosis.verdict.verdict import Window
from report import style
from report.charts.profile import mark_of
from report.data.diagnosis import DiagnosisData, MeasurementSeries
from report.numbers import chance

ABOVE, LEFT, FOOT = 0.3, 0.6, 0.3
HEIGHT = 1.55


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
    style.legend(figure, _handles(data), columns=4)
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


def _handles(data: DiagnosisData) -> list[Line2D | Patch]:
    def one(colour: str, label: str, mark: str = "o", **more: str) -> Line2D:
        marked = {"marker": mark, "color": colour, "linestyle": "none", "markersize": 6}
        return Line2D([], [], label=label, **{**marked, **more})

    made: list[Line2D | Patch] = [
        one(style.BEFORE, "base model" if data.final is None else "before")
    ]
    if data.final is not None:
        made.append(one(style.AFTER, "after"))
    if any(m.role == "held out" for m in data.measurements):
        edge = {"markeredgecolor": style.TEXT_COLOUR}
        made.append(one("white", "diamond: held out", "D", **edge))
    if data.base.window is not None and data.base.window.x_from is not None:
        made.append(Patch(facecolor=style.WINDOW, alpha=0.6, label="worst"))
    return made
