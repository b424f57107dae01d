"""A picture of one slide: sections, slip surface, slices, path of the centre, velocities, values.

In: `Analysis`. Out: a PNG, SVG or PDF of four panels, with the labels that say what is constructed.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from inversion.classical.analysis import Analysis
from inversion.classical.document import labels as notes
from inversion.classical.document import published
from inversion.classical.morph import Stage
from inversion.classical.sections_of_case import CaseSections
from report import style
from report.pictures.scene import material_colour

WIDTH = 11.0
SLIP, CENTRE = "#8c0b3c", "#000000"
#: Apart for every kind of colour vision, and by line style as well.
COLOURS = {"kinetics": "#0b3c8c", "zif": "#d55e00", "imm": "#00796b"}
SHORT = {"kinetics": "Kinetics", "zif": "ZIF", "imm": "IMM"}
STYLES = {"kinetics": "-", "zif": ":", "imm": "--"}


def save_picture(case: CaseSections, analysis: Analysis, path: Path) -> None:
    """Save the picture of one slide; the suffix chooses the format."""
    limits = _limits(analysis)
    inner = WIDTH - 0.75 - 0.2
    height = inner * (limits[1][1] - limits[1][0]) / (limits[0][1] - limits[0][0])
    height = min(max(height, 1.2), 3.4)
    options = max(len(answer.options) for answer in analysis.answers)
    lower = max(2.4, 0.17 * options)
    total = 0.95 + 2 * (height + 0.62) + lower + 0.75
    figure = style.new_figure(total, WIDTH)
    left, y, axes = 0.75, total - 0.95, []
    for _ in range(2):
        y -= height
        axes.append(style.panel(figure, left, y, inner, height))
        y -= 0.62
    y -= lower
    half, names = 0.34 * inner, 2.6
    motion = style.panel(figure, left, y, half, lower - 0.1)
    values = style.panel(figure, left + half + names, y, inner - half - names, lower - 0.1)
    _draw_sections(axes[0], case, analysis, limits)
    _draw_zif(axes[1], case, analysis, limits)
    _draw_motion(motion, analysis)
    _draw_values(values, case, analysis)
    heading = f"{case.title}, {analysis.judgement.name} slide"
    x, words = left / WIDTH, textwrap.fill("; ".join(notes(analysis)), 135)
    figure.text(x, 1 - 0.22 / total, heading, fontsize=13, weight="bold", va="center")
    figure.text(x, 1 - 0.38 / total, words, fontsize=8.5, va="top", color=style.TEXT_COLOUR)
    style.save_figure(figure, path)


def _limits(analysis: Analysis) -> tuple[tuple[float, float], tuple[float, float]]:
    section = analysis.slide.before
    left, right = section.extent
    left = min(left, analysis.slide.toe_after)
    right = max(right, analysis.slide.toe_after)
    margin = 0.02 * (right - left)
    x = np.linspace(left, right, 400)
    low, high = float(section.ground_level(x).min()), float(section.surface(x).max())
    return (left - margin, right + margin), (low - 0.08 * (high - low), high + 0.08 * (high - low))


def _background(ax: Axes, analysis: Analysis, stage: Stage | None, limits: tuple) -> None:
    """Pool and groundwater of a section, and the rigid base."""
    section = analysis.slide.before if stage is None else stage.section
    x = np.linspace(*limits[0], 800)
    ground = section.ground_level(x)
    ax.fill_between(x, limits[1][0], ground, color=style.GROUND_COLOUR, lw=0, zorder=3)
    ax.plot(x, ground, color=style.GROUND_LINE, lw=1.0, zorder=3)
    if section.water is not None:
        level = section.water_level(x)
        pool = np.where(level > section.surface(x), level, ground)
        ax.fill_between(x, ground, pool, color=style.WATER_COLOUR, lw=0, zorder=1)
        shown = np.where(level > ground + 1e-6, level, np.nan)
        ax.plot(
            x, shown, color=style.WATER_LINE, lw=0.9, ls=(0, (6, 2)), zorder=4, label="water line"
        )
    ax.set(xlim=limits[0], ylim=limits[1], aspect="equal")
    style.labels(ax, "", "y (m)")
    style.tidy(ax)


def _zones(ax: Axes, case: CaseSections, stage: Stage | None) -> None:
    if stage is None:
        drawn = [(np.asarray(zone.polygon), zone.material) for zone in case.scene.zones]
    else:
        soils = zip(stage.section.polygons, stage.section.soils, strict=True)
        drawn = [(polygon, soil.name) for polygon, soil in soils]
    for polygon, name in drawn:
        material = case.scene.materials[name]
        ax.add_patch(
            Polygon(
                polygon,
                closed=True,
                facecolor=material_colour(material),
                edgecolor="#333333",
                linewidth=0.35,
                hatch="////" if material.liquefied else None,
                zorder=2,
            )
        )


def _draw_sections(ax: Axes, case: CaseSections, analysis: Analysis, limits: tuple) -> None:
    """Before the slide, with the sections of IMM, the slip surface and the centre's path."""
    _background(ax, analysis, None, limits)
    _zones(ax, case, None)
    for stage in analysis.stages[1:-1]:
        ax.plot(*stage.surface.T, color="#555555", lw=0.5, zorder=5)
    after = analysis.slide.after
    constructed = analysis.after.kind == "constructed"
    ax.plot(
        *after.T,
        color="black",
        lw=1.8,
        ls=(0, (0.2, 1.7)) if constructed else "-",
        dash_capstyle="round",
        zorder=6,
        label=f"surface after ({analysis.after.kind})",
    )
    ax.plot([], [], color="#555555", lw=0.5, label="sections of IMM")
    ax.plot(*analysis.slide.slip.points.T, color=SLIP, lw=1.8, zorder=6, label="slip surface")
    path = analysis.answer("kinetics").path
    if path is not None:
        ax.plot(*path.T, color=CENTRE, lw=1.3, zorder=7, label="path of Kinetics")
    centres = np.array([forces.centre for forces in analysis.forces])
    ax.plot(
        *centres.T, "o", color="white", mec=CENTRE, ms=4, lw=0, zorder=7, label="centres of IMM"
    )
    style.title(ax, "Section before the slide", fontweight="normal")
    _legend(ax)


def _draw_zif(ax: Axes, case: CaseSections, analysis: Analysis, limits: tuple) -> None:
    """The section at the zero inertial factor, with every tenth slice."""
    stage, slices = analysis.zif_stage, analysis.zif_slices
    _background(ax, analysis, stage, limits)
    _zones(ax, case, stage)
    edges = np.append(slices.x - 0.5 * slices.width, slices.x[-1] + 0.5 * slices.width[-1])
    few = edges[:: max(1, len(edges) // 24)]
    ax.vlines(
        few, stage.slip.level(few), stage.section.surface(few), color="black", lw=0.4, zorder=5
    )
    for liquefied, colour, words in (
        (True, "#d5006d", "base with S_r"),
        (False, "#222222", "base with another strength"),
    ):
        x = np.where(slices.liquefied == liquefied, slices.x, np.nan)
        ax.plot(x, slices.base, color=colour, lw=2.6, zorder=6, label=words)
    words = f"Section at f = {stage.share:g} of the displacement (ZIF), some of its slices"
    style.title(ax, words, fontweight="normal")
    style.labels(ax, "x (m)", "y (m)")
    _legend(ax)


def _legend(ax: Axes) -> None:
    ax.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=6,
        fontsize=7.5,
        frameon=False,
        handlelength=1.5,
        columnspacing=0.9,
        borderpad=0.0,
        borderaxespad=0.2,
    )


def _draw_motion(ax: Axes, analysis: Analysis) -> None:
    """Velocity of the centre of gravity against time."""
    for answer in analysis.answers:
        if answer.motion is None:
            continue
        t, v = answer.motion.time, answer.motion.velocity
        marker = "o" if answer.method == "imm" else None
        ax.plot(
            t,
            v,
            color=COLOURS[answer.method],
            ls=STYLES[answer.method],
            marker=marker,
            ms=3,
            label=f"{SHORT[answer.method]}, S_r {answer.strength / 1e3:.1f} kPa",
        )
    style.labels(ax, "time (s)", "velocity of the centre (m/s)")
    style.tidy(ax)
    top = ax.get_ylim()[1]
    ax.set(xlim=(0, None), ylim=(0, 1.3 * top))
    if any(answer.motion is not None for answer in analysis.answers):
        ax.legend(fontsize=7.5, frameon=False, loc="upper left")


def _draw_values(ax: Axes, case: CaseSections, analysis: Analysis) -> None:
    """Every option's S_r, one row of dots per method, with the published values."""
    rows: list[tuple[str, str]] = []
    for number, answer in enumerate(analysis.answers):
        colour = COLOURS[answer.method]
        rows.append((SHORT[answer.method], colour))
        span = answer.range
        if span is None:
            continue
        ax.plot(np.array(span) / 1e3, [number] * 2, color=colour, lw=5, alpha=0.25, zorder=2)
        for each in answer.options:
            if each.strength is not None:
                face = colour if each.option.in_range else "white"
                ax.plot(each.strength / 1e3, number, "o", mec=colour, mfc=face, ms=4, zorder=3)
        ax.plot(answer.strength / 1e3, number, "D", color=colour, mec="white", ms=9, zorder=4)
        words = f"{answer.strength / 1e3:.1f} ({span[0] / 1e3:.1f} to {span[1] / 1e3:.1f}) kPa"
        style.tell(
            ax, answer.strength / 1e3, number, words, away=(0, 8), color=colour, weight="bold"
        )
    for key, entry in published(case.measurements, analysis).items():
        number = len(rows)
        rows.append((f"{key.replace('_', ' ')} ({entry.get('confidence', '')})", "#555555"))
        if "low" in entry:
            ax.plot([entry["low"], entry["high"]], [number] * 2, color="#999999", lw=3, zorder=2)
        ax.plot(entry["value"], number, "s", color="#555555", ms=5, zorder=3)
    ax.set_yticks(range(len(rows)), [words for words, _ in rows], fontsize=8)
    for tick, (_, colour) in zip(ax.get_yticklabels(), rows, strict=True):
        tick.set_color(colour)
    ax.tick_params(axis="y", length=0)
    ax.set(ylim=(len(rows) - 0.3, -0.8), xlim=(0, None))
    style.labels(ax, "S_r (kPa): value, other judgements; open: not in the range")
    style.tidy(ax)
    ax.grid(axis="x", color=style.LINE, lw=0.6)
    ax.set_axisbelow(True)
    ax.spines["left"].set_visible(False)
