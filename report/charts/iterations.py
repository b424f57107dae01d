"""The way to the answer: the simulated section at each iteration, and loss, values and toes.

In: a `ReportData`. Out: a picture of sections one below the other, as the paper's figures have it,
and a chart of the history. A long search is shown by its most telling looks, the last one always.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from geometry.survey.measured import Measured
from inversion.back_analysis.result import Iteration
from mpm_taichi.trajectory import Run
from report.back_analysis.data import ReportData
from report.charts.style import (
    HELD_OUT,
    OURS,
    clean,
    new_figure,
    save_figure,
    words,
    wrapped,
)
from report.pictures.case_history import line_overlay
from report.pictures.colouring import colouring_of
from report.pictures.frame import LAYER, Overlay, draw_frame, overlays, view_limits
from report.pictures.scene import HALO, TEXT_COLOUR

MOST = 8
"""Sections in the picture; a search with more looks leaves some in the middle out."""
WIDTH, LEFT, RIGHT, BOTTOM, GAP = 9.5, 0.55, 0.15, 0.5, 0.34
LONGEST = 120
"""Characters of a heading that fit beside each other; longer ones take two lines."""
LINES = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (6, 2, 1.2, 2)))
COLOURS = (OURS, HELD_OUT, "#009e73", "#8a5a00")


def draw_iterations(data: ReportData, path: Path) -> Path | None:
    """Save the sections; None where they, or the section before, are not at hand."""
    kept, run = data.sections, data.run
    if kept is None or run is None or kept.final.shape[1:] != run.positions.shape[1:]:
        return None
    looks = shown_looks(np.isfinite(kept.final).all(axis=(1, 2)), kept.accepted, kept.answer)
    shown = _as_run(run, np.concatenate([kept.initial[None], kept.final[looks]]))
    marks = overlays(*_marks(data)) if data.case is not None else None
    limits = view_limits(shown, marks)
    width = WIDTH - LEFT - RIGHT
    panel = width * (limits[1][1] - limits[1][0]) / (limits[0][1] - limits[0][0])
    headings = [_heading(data, look) for look in looks]
    gap = GAP + (0.14 if any("\n" in heading for heading in headings) else 0.0)
    total = len(looks) * (panel + gap) + BOTTOM
    figure = new_figure(total, WIDTH)
    colouring = colouring_of(shown, "material")
    for number, look in enumerate(looks):
        bottom = total - (number + 1) * (panel + gap)
        box = (LEFT / WIDTH, bottom / total, width / WIDTH, panel / total)
        ax = figure.add_axes(box)
        draw_frame(ax, shown, number + 1, colouring=colouring, overlay=marks, limits=limits)
        _predicted_toes(ax, data, data.result.iterations[look])
        ax.set_title(headings[number], loc="left", fontsize=8.2, color=TEXT_COLOUR, pad=3)
        if number < len(looks) - 1:
            ax.set_xlabel("")
            ax.set_xticklabels([])
    return save_figure(figure, path)


def shown_looks(whole: np.ndarray, accepted: np.ndarray, answer: int) -> list[int]:
    """At most `MOST` looks: the first and the answer, and evenly from what lies between.

    Args:
        whole: (K,) the run finished.
        accepted: (K,) the step was kept.
        answer: the look that is the answer; nothing after it is shown.
    """
    usable = [k for k in range(answer + 1) if k == answer or (whole[k] and accepted[k])]
    if len(usable) <= MOST:
        return usable
    chosen = np.unique(np.linspace(0, len(usable) - 1, MOST).round().astype(int))
    return [usable[place] for place in chosen]


def _as_run(run: Run, positions: np.ndarray) -> Run:
    """The looks as if they were the frames of a run (T, N, 2)."""
    return replace(run, positions=positions, time=np.arange(float(len(positions))))


def _marks(data: ReportData) -> list[Overlay]:
    """The measured surface, the measured toe and its stated range."""
    return [line_overlay(data.case), *(_toe(data, toe) for toe in data.toes)]


def _toe(data: ReportData, toe: Measured) -> Overlay:
    def draw(ax: Axes) -> None:
        x = data.toe_place(toe.toe_side, toe.values[0])
        y = float(data.case.scene.ground.height(x))
        order = LAYER["overlay"] + 2
        if toe.stated_range is not None:
            ends = [data.toe_place(toe.toe_side, end) for end in toe.stated_range]
            ax.plot(ends, [y, y], color="white", linewidth=5, zorder=order, solid_capstyle="butt")
            ax.plot(ends, [y, y], color="black", linewidth=2, zorder=order, solid_capstyle="butt")
        ax.plot([x], [y], marker="^", color="black", markersize=8, markeredgecolor="white",
                linestyle="none", zorder=order, label="measured toe")  # fmt: skip

    return draw


def _predicted_toes(ax: Axes, data: ReportData, line: Iteration) -> None:
    for toe in data.toes:
        runout = line.predicted.get(toe.name)
        if runout is not None:
            x = data.toe_place(toe.toe_side, runout)
            y = float(data.case.scene.ground.height(x))
            ax.plot([x], [y], marker="v", color=OURS, markersize=8, markeredgecolor="white",
                    linestyle="none", zorder=LAYER["overlay"] + 3)  # fmt: skip


def _heading(data: ReportData, look: int) -> str:
    line = data.result.iterations[look]
    kind = {"start": "start", "scan": "scan"}.get(line.kind, f"iteration {line.iteration}")
    values = ", ".join(
        f"{_where(p.zones)}: {line.values[p.name]:.3g} {p.unit.replace('deg', '°')}"
        for p in data.result.answer.parameters
    )
    toes = ", ".join(
        f"{toe.name} {line.predicted[toe.name]:.1f} m (measured {toe.values[0]:g})"
        for toe in data.toes
        if toe.name in line.predicted
    )
    last = " (the answer)" if data.sections is not None and look == data.sections.answer else ""
    first = f"{kind.capitalize()}{last}   {values}"
    apart = "   " if len(first) + len(toes) < LONGEST else "\n"
    return words(f"{first}{apart}{toes}")


def draw_history(data: ReportData, path: Path) -> Path:
    """Save the history: loss, values and fitted quantities by the number of the look."""
    result = data.result
    fitted = [m for m in result.measurements if m.role == "fitted"][:4]
    parameters = (data.strengths or result.answer.parameters)[:4]
    figure = new_figure(1.75 * 3 + 0.45)
    axes = figure.subplots(3, 1, sharex=True)
    figure.subplots_adjust(left=0.12, right=0.68, top=0.94, bottom=0.09, hspace=0.34)
    _draw_loss(axes[0], data)
    kept = [line for line in result.iterations if line.accepted]
    places = [number for number, line in enumerate(result.iterations) if line.accepted]
    for number, p in enumerate(parameters):
        _line(axes[1], places, [line.values[p.name] for line in kept], number)
    axes[1].set_title("Values sought", **_title())
    axes[1].set_ylabel(parameters[0].unit, fontsize=8.5)
    axes[1].set_ylim(bottom=0)
    told = [f"{p.label}: {p.value:.3g} {p.unit}" for p in parameters]
    _end_labels(axes[1], [p.value for p in parameters], told, axes[1].get_ylim())
    series = [[line.predicted.get(m.name, np.nan) for line in kept] for m in fitted]
    for number, (m, y) in enumerate(zip(fitted, series, strict=True)):
        _line(axes[2], places, y, number)
        axes[2].axhline(m.measured, color=COLOURS[number], linewidth=0.8, zorder=1)
        ends_of = (m.measured - m.std, m.measured + m.std) if m.low is None else (m.low, m.high)
        axes[2].axhspan(*ends_of, color=COLOURS[number], alpha=0.1, linewidth=0, zorder=0)
    axes[2].set_title("Simulated; line and band: measured, with its range", **_title())
    axes[2].set_ylabel("m", fontsize=8.5)
    told = [f"{m.name}: {m.predicted:.1f}, measured {m.measured:g} {m.unit}" for m in fitted]
    _end_labels(axes[2], [m.predicted for m in fitted], told, axes[2].get_ylim())
    axes[2].set_xlabel("step of the search (0: the first guess)", fontsize=8.5)
    axes[2].xaxis.set_major_locator(MaxNLocator(integer=True))
    return save_figure(figure, path)


def _draw_loss(ax: Axes, data: ReportData) -> None:
    answer = data.result.answer
    for number, line in enumerate(data.result.iterations):
        if line.loss is not None and line.loss > 0:
            ax.plot([number], [line.loss], marker="o" if line.accepted else "x", color=OURS,
                    markersize=5.5, zorder=3)  # fmt: skip
    pairs = [(n, it.loss) for n, it in enumerate(data.result.iterations) if it.accepted and it.loss]
    ax.plot(*zip(*pairs, strict=True), color=OURS, linewidth=1.4, zorder=2) if pairs else None
    ax.set_yscale("log")
    ax.axhline(answer.tolerance, color=HELD_OUT, linewidth=1.1, linestyle="--", zorder=1)
    unit = "m²" if answer.loss_unit == "m2" else ""
    ax.annotate(f"tolerance {answer.tolerance:g} {unit}", (1.0, answer.tolerance),
                xycoords=("axes fraction", "data"), xytext=(6, 0), textcoords="offset points",
                va="center", fontsize=8.5, color=HELD_OUT)  # fmt: skip
    if pairs:
        ax.annotate(f"answer {answer.loss:.2g} {unit}", (1.0, pairs[-1][1]),
                    xycoords=("axes fraction", "data"), xytext=(6, 0), va="center",
                    textcoords="offset points", fontsize=8.5, color=OURS)  # fmt: skip
    ax.set_ylabel(f"loss ({unit})" if unit else "loss", fontsize=8.5)
    told = "squared error of the runouts" if unit else "standardised misfit"
    ax.set_title(f"Loss: {told}; crosses were taken back", **_title())
    clean(ax, grid="y", left=True)


def _line(ax: Axes, x: list[int], y: list[float], number: int) -> None:
    ax.plot(x, y, color=COLOURS[number], linestyle=LINES[number], marker="o", markersize=4,
            linewidth=1.5, zorder=3)  # fmt: skip
    clean(ax, grid="y", left=True)


def _title() -> dict:
    return {"loc": "left", "fontsize": 9, "color": TEXT_COLOUR}


def _end_labels(
    ax: Axes, ends: list[float], labels: list[str], limits: tuple[float, float]
) -> None:
    """Name the lines at their right ends, moved apart where they would cover each other."""
    apart = 0.3 * (limits[1] - limits[0])
    order = np.argsort(ends)
    places: dict[int, float] = {}
    last = -np.inf
    for number in order:
        last = max(ends[number], last + apart)
        places[int(number)] = last
    excess = max(last - limits[1], 0.0) if len(ends) else 0.0
    for number, label in enumerate(labels):
        ax.annotate(wrapped(label, 26, 4), (1.0, places[number] - excess),
                    xycoords=("axes fraction", "data"), xytext=(6, 0), annotation_clip=False,
                    textcoords="offset points", va="center", fontsize=8, linespacing=1.1,
                    color=COLOURS[number], path_effects=HALO)  # fmt: skip


def _where(zones: list[str]) -> str:
    return f"zone {', '.join(zones)}" if zones else "pool"
