"""How the answer was found: the simulated section at each iteration, and loss, values and toes.

In: a `BackAnalysisData`. Out: a picture of sections one below the other, as in the paper's figures,
and a chart of the history. A long search is thinned; its last evaluation is always shown.
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
from report import style
from report.data.back_analysis import BackAnalysisData
from report.numbers import fixed, unit_of, with_unit
from report.numbers import number as number_of
from report.pictures.case_history import line_overlay
from report.pictures.colouring import colouring_of
from report.pictures.frame import LAYER, Overlay, draw_frame, overlays, view_limits

MOST = 8
"""Sections in the picture; a longer search leaves some in the middle out."""
WIDE, LEFT, RIGHT, BOTTOM, GAP = 9.5, 0.55, 0.15, 0.5, 0.34
LONGEST = 120
"""Characters of a heading that fit on one line."""
LINES = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (6, 2, 1.2, 2)))
COLOURS = (style.OURS, style.HELD_OUT, style.CLASSICAL, "#8a5a00")


def draw_iterations(data: BackAnalysisData, path: Path) -> Path | None:
    """Save the sections; None where they, or the section before the slide, are not known."""
    kept, run = data.sections, data.run
    if kept is None or run is None or kept.final.shape[1:] != run.positions.shape[1:]:
        return None
    if not np.isfinite(kept.final).any():  # the engine simulates no slide
        return None
    looks = shown_looks(np.isfinite(kept.final).all(axis=(1, 2)), kept.accepted, kept.answer)
    shown = _as_run(run, np.concatenate([kept.initial[None], kept.final[looks]]))
    marks = overlays(*_marks(data)) if data.case is not None else None
    limits = view_limits(shown, marks)
    width = WIDE - LEFT - RIGHT
    height = width * (limits[1][1] - limits[1][0]) / (limits[0][1] - limits[0][0])
    headings = [_heading(data, look) for look in looks]
    gap = GAP + (0.14 if any("\n" in heading for heading in headings) else 0.0)
    total = len(looks) * (height + gap) + BOTTOM
    figure = style.new_figure(total, WIDE)
    colouring = colouring_of(shown, "material")
    for number, look in enumerate(looks):
        ax = style.panel(figure, LEFT, total - (number + 1) * (height + gap), width, height)
        draw_frame(ax, shown, number + 1, colouring=colouring, overlay=marks, limits=limits)
        _predicted_toes(ax, data, data.result.iterations[look])
        ax.set_title(headings[number], loc="left", fontsize=8.2, color=style.TEXT_COLOUR, pad=3)
        if number < len(looks) - 1:
            ax.set_xlabel("")
            ax.set_xticklabels([])
    return style.save_figure(figure, path)


def shown_looks(whole: np.ndarray, accepted: np.ndarray, answer: int) -> list[int]:
    """At most `MOST` evaluations: the first, the answer, and evenly spread ones between.

    Args:
        whole: (K,) the run finished.
        accepted: (K,) the step was kept.
        answer: the evaluation that is the answer; nothing after it is shown.
    """
    usable = [k for k in range(answer + 1) if k == answer or (whole[k] and accepted[k])]
    if len(usable) <= MOST:
        return usable
    chosen = np.unique(np.linspace(0, len(usable) - 1, MOST).round().astype(int))
    return [usable[place] for place in chosen]


def _as_run(run: Run, positions: np.ndarray) -> Run:
    """The evaluations as if they were the frames of a run (T, N, 2)."""
    return replace(run, positions=positions, time=np.arange(float(len(positions))))


def _marks(data: BackAnalysisData) -> list[Overlay]:
    """The measured surface, the measured toe and its stated range."""
    return [line_overlay(data.case), *(_toe(data, toe) for toe in data.toes)]


def _toe(data: BackAnalysisData, toe: Measured) -> Overlay:
    def draw(ax: Axes) -> None:
        x = data.toe_place(toe.toe_side, toe.values[0])
        y = float(data.case.scene.ground.height(x))
        order = LAYER["overlay"] + 2
        if toe.stated_range is not None:
            ends = [data.toe_place(toe.toe_side, end) for end in toe.stated_range]
            ax.plot(ends, [y, y], color="white", linewidth=5, zorder=order, solid_capstyle="butt")
            ax.plot(ends, [y, y], color="black", linewidth=2, zorder=order, solid_capstyle="butt")
        ax.plot(
            [x],
            [y],
            marker="^",
            color="black",
            markersize=8,
            markeredgecolor="white",
            linestyle="none",
            zorder=order,
            label="measured toe",
        )

    return draw


def _predicted_toes(ax: Axes, data: BackAnalysisData, line: Iteration) -> None:
    for toe in data.toes:
        runout = line.predicted.get(toe.name)
        if runout is not None:
            x = data.toe_place(toe.toe_side, runout)
            y = float(data.case.scene.ground.height(x))
            ax.plot(
                [x],
                [y],
                marker="v",
                color=style.OURS,
                markersize=8,
                markeredgecolor="white",
                linestyle="none",
                zorder=LAYER["overlay"] + 3,
            )


def _heading(data: BackAnalysisData, look: int) -> str:
    line = data.result.iterations[look]
    kind = line.kind if line.kind in ("start", "scan") else f"iteration {line.iteration}"
    values = ", ".join(
        f"{_where(p.zones)}: {with_unit(line.values[p.name], p.unit)}"
        for p in data.result.answer.parameters
    )
    toes = ", ".join(
        f"{toe.name} {line.predicted[toe.name]:.1f} m "
        f"(measured {'< ' * toe.censored}{toe.values[0]:g})"
        for toe in data.toes
        if toe.name in line.predicted
    )
    last = " (the answer)" if data.sections is not None and look == data.sections.answer else ""
    first = f"{kind.capitalize()}{last}   {values}"
    between = "   " if len(first) + len(toes) < LONGEST else "\n"
    return style.words(f"{first}{between}{toes}")


def draw_history(data: BackAnalysisData, path: Path) -> Path:
    """Save the history: loss, values and fitted quantities by the number of the evaluation."""
    result = data.result
    fitted = data.few_fitted(4)
    parameters = data.answers[:4]
    figure, (loss, values, simulated) = style.chart(
        [1.3] * 3, above=0.3, below=0.35, left=0.6, right=1.6, foot=0.15
    )
    _draw_loss(loss, data)
    kept = [line for line in result.iterations if line.accepted]
    places = [number for number, line in enumerate(result.iterations) if line.accepted]
    for number, p in enumerate(parameters):
        _line(values, places, [line.values[p.name] for line in kept], number)
    style.title(values, "Values")
    style.labels(values, "", unit_of(parameters[0].unit))
    values.set_ylim(bottom=0)
    names = [f"{p.label}: {with_unit(p.as_run, p.unit)}" for p in parameters]
    _end_labels(values, [p.as_run for p in parameters], names)
    for number, m in enumerate(fitted):
        _line(simulated, places, [line.predicted.get(m.name, np.nan) for line in kept], number)
        simulated.axhline(m.measured, color=COLOURS[number], linewidth=0.8, zorder=1)
        ends = (m.measured - m.std, m.measured + m.std) if m.low is None else (m.low, m.high)
        ends = (0.0, m.measured) if m.censored else ends
        simulated.axhspan(*ends, color=COLOURS[number], alpha=0.1, linewidth=0, zorder=0)
    style.title(simulated, "Simulated; line and band: measured, with its range")
    names = [
        f"{m.name}: {fixed(m.predicted)}, measured {'< ' * m.censored}"
        f"{with_unit(f'{m.measured:g}', m.unit)}"
        for m in fitted
    ]
    _end_labels(simulated, [m.predicted for m in fitted], names)
    style.labels(simulated, "evaluation (0: the first guess)", fitted[0].unit if fitted else "")
    for ax in (loss, values, simulated):
        ax.set_xlim(-0.04 * len(result.iterations), 1.04 * len(result.iterations) - 1)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return style.save_figure(figure, path)


def _draw_loss(ax: Axes, data: BackAnalysisData) -> None:
    answer = data.result.answer
    unit = "m²" if answer.loss_unit == "m2" else ""
    for number, line in enumerate(data.result.iterations):
        if line.loss is not None and line.loss > 0:
            ax.plot(
                [number],
                [line.loss],
                marker="o" if line.accepted else "x",
                color=style.OURS,
                markersize=5.5,
                zorder=3,
            )
    pairs = [(n, it.loss) for n, it in enumerate(data.result.iterations) if it.accepted and it.loss]
    if pairs:
        ax.plot(*zip(*pairs, strict=True), color=style.OURS, linewidth=1.4, zorder=2)
    ax.set_yscale("log")
    style.quiet(ax, grid="y")
    ax.axhline(answer.tolerance, color=style.HELD_OUT, linewidth=1.1, linestyle="--", zorder=1)
    ends = [(answer.tolerance, f"tolerance {answer.tolerance:g} {unit}", style.HELD_OUT)]
    ends += [(loss, f"answer {number_of(loss, 2)} {unit}", style.OURS) for _, loss in pairs[-1:]]
    low, high = np.log10(ax.get_ylim())
    heights = style.apart([np.log10(y) for y, *_ in ends], 0.13 * (high - low), high)
    for height, (_, text, colour) in zip(heights, ends, strict=True):
        style.tell(ax, 1.0, 10.0**height, text, xycoords=("axes fraction", "data"), color=colour)
    words_ = "squared error of the runouts" if unit else "standardised misfit"
    style.title(ax, f"Loss: {words_}; crosses were rejected")
    style.labels(ax, "", f"loss ({unit})" if unit else "loss")


def _line(ax: Axes, x: list[int], y: list[float], number: int) -> None:
    style.quiet(ax, grid="y")
    ax.plot(
        x,
        y,
        color=COLOURS[number],
        linestyle=LINES[number],
        marker="o",
        markersize=4,
        linewidth=1.5,
        zorder=3,
    )


def _end_labels(ax: Axes, ends: list[float], names: list[str]) -> None:
    """Name the lines at their right ends, moved apart where they would overlap."""
    low, high = ax.get_ylim()
    heights = style.apart(ends, 0.3 * (high - low), high)
    for number, (height, name) in enumerate(zip(heights, names, strict=True)):
        style.tell(
            ax,
            1.0,
            height,
            style.wrapped(name, 25, 4),
            xycoords=("axes fraction", "data"),
            linespacing=1.1,
            color=COLOURS[number],
        )


def _where(zones: list[str]) -> str:
    return f"zone {', '.join(zones)}" if zones else "pool"
