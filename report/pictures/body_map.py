"""A slide in plan and in sections: hillshade, contours, thickness of soil, edge of the deposit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from geometry.survey3d.deposit import samples_along
from geometry.terrain.raster import Raster, hillshade
from mpm_taichi.readings3d import Maps
from report import style

LENGTH = 7.2  # of the figure [inches]
LEFT, RIGHT = 0.7, 1.0  # margins [inches]
SECTION, GAP = 1.3, 0.75  # height of a section and what its labels take [inches]
SOIL = "YlOrBr"


def save_map(
    path: str | Path,
    title: str,
    maps: Maps,
    *,
    paths: Mapping[str, np.ndarray],
    lines: Mapping[str, np.ndarray],
    water_level: float | None = None,
    measured: Raster | None = None,
) -> Path:
    """Plan above, a section along each path below.

    Args:
        path: png, svg or pdf.
        title: above the plan.
        maps: what is drawn.
        paths: name -> (P, 2) [m].
        lines: name -> (2, 2) [m], drawn in plan.
        water_level: pool [m].
        measured: elevation of the surface that was surveyed after the slide [m].
    """
    (x, y), d = maps.before.axes, maps.before.spacing
    plan_height = height_of_plan(x, y)
    total = plan_height + 0.9 + len(paths) * (SECTION + GAP)
    figure = style.new_figure(total, LENGTH)
    plan = plan_axes(figure, total, total - 0.35 - plan_height, plan_height)
    extent = (x[0] - d / 2, x[-1] + d / 2, y[0] - d / 2, y[-1] + d / 2)
    shade = 0.35 + 0.65 * hillshade(maps.surface)
    plan.imshow(shade.T, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)
    thick = np.ma.masked_less(maps.deposit.values, maps.least)
    image = plan.imshow(thick.T, origin="lower", extent=extent, cmap=SOIL, alpha=0.65, vmin=0)
    colour_bar(figure, image, total, total - 0.35 - plan_height, 0.9, "thickness [m]")
    _draw_lines(plan, maps)
    draw_places(plan, paths, lines, 0.5 * (x[0] + x[-1]))
    finish_plan(plan, title, extent)
    for number, (name, way) in enumerate(paths.items()):
        low = total - 0.35 - plan_height - 0.5 - (number + 1) * (SECTION + GAP) + GAP - 0.2
        _draw_section(
            plan_axes(figure, total, low, SECTION), name, way, maps, water_level, measured
        )
    return style.save_figure(figure, path)


def draw_places(
    plan: Axes, paths: Mapping[str, np.ndarray], lines: Mapping[str, np.ndarray], middle: float
) -> None:
    """Paths and lines with their names, written towards the middle of x [m]."""
    for name, way in paths.items():
        plan.plot(*way.T, color=style.TEXT_COLOUR, lw=0.9, ls=":")
        inwards = "left" if way[-1, 0] < middle else "right"
        plan.annotate(
            name, way[-1], fontsize=style.SMALL, ha=inwards, va="bottom", path_effects=style.HALO
        )
    for name, line in lines.items():
        plan.plot(*line.T, color=style.HELD_OUT, lw=1.2)
        plan.annotate(name, line[0], fontsize=style.SMALL, path_effects=style.HALO)


def finish_plan(plan: Axes, title: str, extent: tuple[float, float, float, float]) -> None:
    """Axes of a plan over x_min, x_max, y_min, y_max [m]."""
    plan.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", xlim=extent[:2], ylim=extent[2:])
    plan.set_title(title, fontsize=style.TEXT, loc="left")
    plan.tick_params(labelsize=style.SMALL)


def height_of_plan(x: np.ndarray, y: np.ndarray) -> float:
    """Height of a plan over the cells x and y, to scale within limits [inches]."""
    return float(np.clip((LENGTH - LEFT - RIGHT) * len(y) / len(x), 1.2, 6.0))


def colour_bar(
    figure: Figure, image: AxesImage, total: float, low: float, height: float, label: str
) -> None:
    """Colours of a plan to its right, from `low` upwards in a figure `total` high [inches]."""
    place = (1 - 0.8 / LENGTH, low / total, 0.12 / LENGTH, height / total)
    bar = figure.colorbar(image, cax=figure.add_axes(place))
    bar.set_label(label, fontsize=style.SMALL)
    bar.ax.tick_params(labelsize=style.SMALL)


def plan_axes(figure: Figure, total: float, low: float, height: float) -> Axes:
    """Axes over the width of the figure, from `low` upwards [inches]."""
    return figure.add_axes(
        (LEFT / LENGTH, low / total, (LENGTH - LEFT - RIGHT) / LENGTH, height / total)
    )


def _draw_lines(axes: Axes, maps: Maps) -> None:
    """Contours of the surface, and the edge of the soil before (dashed) and after."""
    x, y = maps.before.axes
    surface = maps.surface.values
    if min(surface.shape) < 2:
        return
    if np.ptp(surface) > 0.1:
        levels = axes.contour(x, y, surface.T, 8, colors=style.TEXT_COLOUR, linewidths=0.35)
        axes.clabel(levels, fontsize=5.5, fmt="%g")
    edges = [(maps.before, style.BEFORE, "--")]
    if maps.after is not None:
        edges.append((maps.after, style.AFTER, "-"))
    for thickness, colour, dashes in edges:
        values = thickness.values
        if values.min() < maps.least < values.max():
            axes.contour(
                x, y, values.T, [maps.least], colors=colour, linewidths=1.3, linestyles=dashes
            )


def _draw_section(
    axes: Axes,
    name: str,
    path: np.ndarray,
    maps: Maps,
    water_level: float | None,
    measured: Raster | None,
) -> None:
    """Ground, surface before and after along a path; heights may be enlarged."""
    way, places = samples_along(path, 0.5 * maps.base.spacing)
    ground = maps.base.at(*places.T)
    before = ground + maps.before.at(*places.T)
    axes.plot(way, before, color=style.BEFORE, ls=style.DASHED, label="before")
    if maps.after is not None:
        top = ground + maps.after.at(*places.T)
        axes.fill_between(way, ground, top, color=style.PALE_AFTER, lw=0)
        axes.plot(way, top, color=style.AFTER, label="after")
    if measured is not None:
        axes.plot(way, measured.at(*places.T), color=style.HELD_OUT, lw=1.0, label="measured")
    if water_level is not None:
        axes.axhline(water_level, color=style.WATER_LINE, lw=0.8, label="water")
    low, high = axes.get_ylim()
    axes.fill_between(way, ground, low - (high - low), color=style.GROUND_COLOUR, lw=0)
    axes.set_ylim(min(low, ground.min() - 0.08 * (high - low)), high)
    axes.set(xlabel="way [m]", ylabel="elevation [m]", xlim=(way[0], way[-1]))
    axes.set_title(f"section along {name}", fontsize=style.SMALL, loc="left")
    axes.legend(fontsize=style.SMALL, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.tick_params(labelsize=style.SMALL)
