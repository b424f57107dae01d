"""Where a deposit would be thicker than stated, and how likely: one plan for each thickness."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.colors import BoundaryNorm

from geometry.terrain.raster import Raster, hillshade
from mpm_taichi.readings3d import Maps
from report import style
from report.pictures.body_map import (
    LENGTH,
    colour_bar,
    draw_places,
    finish_plan,
    height_of_plan,
    plan_axes,
)

GAP = 0.8  # between two plans [inches]
CLASSES = (1, 5, 10, 25, 50, 75, 95, 100)
"""Ends of the classes of probability, %."""
COLOURS = "YlOrRd"


def save_exceedance(
    path: str | Path,
    title: str,
    maps: Maps,
    exceedance: Mapping[float, Raster],
    *,
    paths: Mapping[str, np.ndarray],
    lines: Mapping[str, np.ndarray],
) -> Path:
    """Draw the probabilities where the soil was not as thick before.

    Args:
        path: png, svg or pdf.
        title: above the first plan.
        maps: of the ground before the slide.
        exceedance: thickness [m] -> probability that the deposit is thicker.
        paths: name -> (P, 2) [m].
        lines: name -> (2, 2) [m].
    """
    (x, y), d = maps.before.axes, maps.before.spacing
    plan_height = height_of_plan(x, y)
    total = len(exceedance) * (plan_height + GAP) + 0.1
    figure = style.new_figure(total, LENGTH)
    extent = (x[0] - d / 2, x[-1] + d / 2, y[0] - d / 2, y[-1] + d / 2)
    colours = matplotlib.colormaps[COLOURS].resampled(len(CLASSES) - 1)
    classes = BoundaryNorm(CLASSES, colours.N)
    shade = 0.35 + 0.65 * hillshade(maps.surface)
    for row, (thickness, chance) in enumerate(exceedance.items()):
        low = total - 0.35 - plan_height - row * (plan_height + GAP)
        plan = plan_axes(figure, total, low, plan_height)
        plan.imshow(shade.T, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)
        body = maps.before.values
        hidden = (body >= thickness) | (100.0 * chance.values < CLASSES[0])
        shown = np.ma.masked_where(hidden, 100.0 * chance.values)
        image = plan.imshow(
            shown.T, origin="lower", extent=extent, cmap=colours, norm=classes, alpha=0.75
        )
        if body.min() < thickness < body.max():
            plan.contour(
                x, y, body.T, [thickness], colors=style.BEFORE, linewidths=1.3, linestyles="--"
            )
        draw_places(plan, paths, lines, 0.5 * (x[0] + x[-1]))
        words = f"probability of a deposit thicker than {thickness:g} m"
        finish_plan(plan, f"{title}: {words}" if row == 0 else words, extent)
        colour_bar(figure, image, total, low, plan_height, "%")
    return style.save_figure(figure, path)
