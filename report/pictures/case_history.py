"""Picture and film of a case history: the section before, the deposit after, what was measured.

In: a `Case`, its `Run` and the `ComparedReading`s. Out: a picture of two panels with a small table
above, and a film. What is constructed is dotted and says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from shapely.geometry import Polygon
from shapely.ops import unary_union

from geometry.case import Case
from geometry.survey.marks import Distance, Height, Line
from mpm_taichi.comparison import ComparedReading, label
from mpm_taichi.trajectory import Run
from report.numbers import MINUS, unit_of
from report.pictures.colouring import colouring_of, material_colours
from report.pictures.frame import LAYER, Overlay, draw_frame, overlays, toe_overlay, view_limits
from report.pictures.scene import label_place
from report.pictures.simulated_run import WIDTH_IN, save_animation, strength
from report.style import HALO, TEXT_COLOUR, legend, new_figure, save_figure, tell

MEASURED, SIMULATED = "#000000", "#0b3c8c"
CONSTRUCTED_LINE = {"linestyle": (0, (0.2, 1.7)), "dash_capstyle": "round", "linewidth": 2.4}
MEASURED_LINE = {"linestyle": "-", "linewidth": 1.6}

# Inches around and between the panels.
LEFT, RIGHT, BOTTOM, GAP, LEGEND_ROW = 0.62, 0.2, 0.5, 0.48, 0.175
# Rows of the table, lines of the heading, where the latter begin, and the panel's title below.
ROW, HEADING_ROW, HEADING_TOP, PANEL_TITLE = 0.185, 0.172, 0.46, 0.32
# Dimension lines below the ground, and the lower edge of the panels, in heights of the section.
LINES, LOWEST_LINE = (0.11, 0.25), 0.36
# Half the bar at the end of a measured height, in heights of the section.
BAR = 0.06


def save_case_picture(
    case: Case, run: Run, readings: Sequence[ComparedReading], path: Path
) -> None:
    """Save the section before and the deposit after, with what was measured."""
    after = overlays(line_overlay(case), distances(case, readings))
    limits = _limits(case, run, after)
    bottom = case.scene.ground.lowest
    width = WIDTH_IN - LEFT - RIGHT
    high = width * (limits[1][1] - limits[1][0]) / (limits[0][1] - limits[0][0])
    figure = new_figure(6.0, WIDTH_IN)
    axes = [figure.add_axes((0, 0, 1, 1)) for _ in range(2)]
    colouring = colouring_of(run, "material")
    parts = [(0, _soil_names(case)), (-1, after)]
    stamps = ["Before the slide", f"Simulated deposit, {run.time[-1]:.0f} s later"]
    for ax, (frame, overlay), stamp in zip(axes, parts, stamps, strict=True):
        draw_frame(ax, run, frame, colouring=colouring, overlay=overlay, limits=limits)
        lowest = max(bottom - 5, limits[1][0])  # a tick below the limits would move them
        ax.set_yticks([tick for tick in ax.get_yticks() if lowest < tick < limits[1][1]])
        ax.text(
            0.0, 1.0, stamp, transform=ax.transAxes, va="bottom", fontsize=10, color=TEXT_COLOUR
        )
    axes[0].set_xlabel("")
    handles = [*_material_handles(case), *axes[1].get_legend_handles_labels()[0]]
    top = _head_room(case, readings)
    height = top + 2 * high + GAP + BOTTOM + LEGEND_ROW * -(-len(handles) // 3) + 0.08
    figure.set_size_inches(WIDTH_IN, height)
    for number, ax in enumerate(axes):
        edge = height - top - (number + 1) * high - number * GAP
        ax.set_position((LEFT / WIDTH_IN, edge / height, width / WIDTH_IN, high / height))
    _draw_heading(figure, case, run, height)
    _draw_table(figure, readings, height)
    legend(
        figure,
        handles,
        columns=3,
        loc="lower left",
        labelspacing=0.35,
        bbox_to_anchor=(LEFT / WIDTH_IN, 0.04 / height),
    )
    save_figure(figure, path)


def save_case_film(case: Case, run: Run, path: Path) -> None:
    """Save the run as a film, with the measured profile and toe laid over it."""
    shown = [line_overlay(case)]
    for mark in case.marks:
        if isinstance(mark, Distance):
            y = float(case.scene.ground.height(mark.end))
            shown.append(toe_overlay(mark.end, y, label=f"measured toe, {mark.value:g} m"))
    # Half the frames of other films: drawing them is a tenth of a back-analysis.
    save_animation(
        run, path, colour="material", overlay=overlays(*shown), frames=75, frames_per_second=12.0
    )


def _limits(case: Case, run: Run, overlay: Overlay) -> tuple[tuple[float, float], ...]:
    """Extent of both panels [m]: all that moves, and room below the ground for the distances."""
    x_limits, (_, top) = view_limits(run, overlay)
    ground = case.scene.ground.height(np.linspace(*x_limits, 200))
    return x_limits, (float(ground.min()) - LOWEST_LINE * _height(case), top)


# --- overlays ---


def line_overlay(case: Case) -> Overlay:
    """The measured lines, such as surfaces, constructed ones dotted and named so; and heights.

    A height is a line from the surface before the slide, with a bar at its end.
    """

    def draw(ax: Axes) -> None:
        labelled = set()
        for mark in case.marks:
            if isinstance(mark, Distance):
                continue
            line = _bar(case, mark) if isinstance(mark, Height) else mark
            style = CONSTRUCTED_LINE if line.constructed else MEASURED_LINE
            ax.plot(
                line.x,
                line.y,
                color="white",
                alpha=0.8,
                linewidth=3.4,
                zorder=LAYER["overlay"],
                solid_capstyle="round",
            )
            ax.plot(
                line.x,
                line.y,
                color=MEASURED,
                zorder=LAYER["overlay"],
                label=line.label if line.label not in labelled else "_nolegend_",
                **style,
            )
            labelled.add(line.label)

    return draw


def _bar(case: Case, mark: Height) -> Line:
    """A height at its place, from the surface before the slide, with a bar at its end."""
    start, half = case.scene.surface(mark.x), BAR * _height(case)
    end = start + mark.value
    x = mark.x + half * np.array([0.0, 0.0, -1.0, 1.0])
    return Line(x, np.array([start, end, end, end]), mark.label, constructed=False)


def distances(case: Case, readings: Sequence[ComparedReading]) -> Overlay:
    """Measured and simulated runout as two dimension lines below the ground, from the foot."""
    pairs = [
        (reading, mark)
        for reading in readings
        if reading.measurement is not None
        for mark in reading.measurement.marks(case.feet)
        if isinstance(mark, Distance)
    ]

    def draw(ax: Axes) -> None:
        for reading, mark in pairs:
            foot, outward = mark.start, mark.outward
            upper, lower = (share * _height(case) for share in LINES)
            words = f"{'less than ' * mark.limit}{mark.value:g} m measured"
            if mark.stated_range is not None:
                low, high = mark.stated_range
                words += f" ({low:g}-{high:g} m)"
                ends = [foot + outward * low, foot + outward * high]
                y = np.full(2, _ground(case, foot) - upper)
                ax.plot(
                    ends,
                    y,
                    color="white",
                    linewidth=6,
                    alpha=0.75,
                    solid_capstyle="butt",
                    zorder=LAYER["overlay"],
                )
            _dimension(ax, case, foot, outward * mark.value, upper, words, MEASURED)
            words = f"{reading.simulated:.1f} m simulated"
            _dimension(ax, case, foot, outward * reading.simulated, lower, words, SIMULATED)

    return draw


def _dimension(
    ax: Axes, case: Case, foot: float, runout: float, depth: float, words: str, colour: str
) -> None:
    """An arrow from the foot to a toe, `depth` [m] below the ground, and a tick up to the toe."""
    toe = foot + runout
    base, y = _ground(case, toe), _ground(case, foot) - depth
    order = LAYER["overlay"] + 1
    ax.plot([toe, toe], [base, y], color=colour, linewidth=0.8, zorder=order)
    ax.plot([foot, foot], [_ground(case, foot), y], color=colour, linewidth=0.8, zorder=order)
    ax.annotate(
        "",
        xy=(toe, y),
        xytext=(foot, y),
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0},
        zorder=order,
    )
    ax.plot(
        [toe],
        [base],
        marker="^",
        markersize=7,
        color=colour,
        markeredgecolor="white",
        markeredgewidth=0.7,
        linestyle="none",
        zorder=order + 1,
    )
    inward = -np.sign(runout) or 1.0
    tell(ax, foot, y, words, away=(5 * inward, 0), color=colour, fontweight="bold", zorder=order)


def _soil_names(case: Case) -> Overlay:
    """The name of each soil within every body of it that has room for the name."""

    def draw(ax: Axes) -> None:
        scene = case.scene
        inch = np.ptp(ax.get_xlim()) / (WIDTH_IN - LEFT - RIGHT)  # m
        for name in scene.materials:
            own = [Polygon(zone.polygon) for zone in scene.zones if zone.material == name]
            body = unary_union([polygon.buffer(0.1 * scene.spacing) for polygon in own])
            words = name.replace("_", " ")
            for part in getattr(body, "geoms", [body]):
                (x, y), radius, width = label_place(part)
                if radius < 0.05 * inch or width < 0.075 * len(words) * inch:
                    continue
                ax.text(
                    x,
                    y,
                    words,
                    ha="center",
                    va="center",
                    fontsize=8,
                    fontweight="bold",
                    color=TEXT_COLOUR,
                    path_effects=HALO,
                    zorder=LAYER["overlay"],
                )

    return draw


# --- heading and table ---


def _head_room(case: Case, readings: Sequence[ComparedReading]) -> float:
    """Inches above the panels: as many as the heading or the table needs."""
    heading = HEADING_TOP + HEADING_ROW * len(_heading_lines(case, points=0))
    table = 0.2 + ROW * (1 + sum(reading.measured is not None for reading in readings))
    return max(heading, table) + PANEL_TITLE


def _heading_lines(case: Case, *, points: int) -> list[str]:
    liquefied = [
        f"{name.replace('_', ' ')} {strength(material)}"
        for name, material in case.scene.materials.items()
        if material.liquefied
    ]
    return [
        *liquefied,
        "with the reservoir" if case.scene.has_water else "without water",
        f"{points:,} material points, {case.scene.spacing:g} m apart",
    ]


def _draw_heading(figure: Figure, case: Case, run: Run, height: float) -> None:
    style = {"ha": "left", "va": "top", "color": TEXT_COLOUR}
    x = LEFT / WIDTH_IN
    figure.text(x, 1 - 0.16 / height, case.title, fontsize=14, fontweight="bold", **style)
    text = "\n".join(_heading_lines(case, points=run.points))
    figure.text(x, 1 - HEADING_TOP / height, text, fontsize=8.5, linespacing=1.45, **style)


def _draw_table(figure: Figure, readings: Sequence[ComparedReading], height: float) -> None:
    """Measured and simulated values in the upper right corner."""
    columns = [WIDTH_IN - 4.3, WIDTH_IN - 1.75, WIDTH_IN - 0.95, WIDTH_IN - 0.2]
    rows = [("", "measured", "simulated", "off, in std")]
    for reading in readings:
        m = reading.measurement
        if m is None or reading.measured is None:
            continue
        off = reading.difference_in_std
        rows.append(
            (
                label(reading),
                f"{reading.below}{reading.measured:g} ± {m.std:g} {unit_of(m.unit)}",
                "not read" if off is None else f"{reading.simulated:.1f} {unit_of(m.unit)}",
                "" if off is None else f"{off:+.1f}",
            )
        )
    for line, row in enumerate(rows):
        y = 1 - (0.2 + ROW * line) / height
        for column, text in enumerate(row):
            figure.text(
                columns[column] / WIDTH_IN,
                y,
                text.replace("-", MINUS),
                ha="left" if column == 0 else "right",
                va="top",
                fontsize=9 if line else 8,
                color=SIMULATED if column == 2 and line else TEXT_COLOUR,
                fontweight="bold" if column == 2 and line else "normal",
            )


def _material_handles(case: Case) -> list[Artist]:
    """A legend entry per material, with its strength."""
    handles: list[Artist] = []
    for name, colour in material_colours(case.scene).items():
        words = f"{name.replace('_', ' ')}, {strength(case.scene.materials[name])}"
        handles.append(Patch(facecolor=colour, label=words))
    return handles


# --- small things ---


def _ground(case: Case, x: np.ndarray | float) -> np.ndarray:
    return case.scene.ground.height(x)


def _height(case: Case) -> float:
    """Height of the section before the slide [m]."""
    y = [y for zone in case.scene.zones for _, y in zone.polygon]
    return max(y) - min(y)
