"""What a slide left in plan: measured, simulated, and the difference."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from geometry.survey3d.measured import DepositMap
from geometry.terrain.raster import Raster, hillshade
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
COLOURS = "RdBu_r"
SHARE = 99.5
"""Percentile of the changes at which the colours end."""


def save_measured_map(
    path: str | Path,
    title: str,
    deposit: DepositMap,
    *,
    measured: Raster | None,
    edges: Mapping[str, np.ndarray],
    lines: Mapping[str, np.ndarray],
) -> Path:
    """One plan for each change of the surface: measured, simulated, and their difference.

    Args:
        path: png, svg or pdf.
        title: above the first plan.
        deposit: as simulated.
        measured: elevation of the surface after the slide [m]; None: the simulated alone.
        edges: measured edges of the deposit, name -> places on them (P, 2) [m].
        lines: name -> (2, 2) [m].
    """
    (x, y), d = deposit.before.axes, deposit.before.spacing
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    shape = deposit.before.values.shape
    after = deposit.surface_at(places).reshape(shape)
    moved = deposit.after.values - deposit.before.values
    plans: list[tuple[str, np.ndarray]] = [("simulated", moved)]
    if measured is not None:
        seen = measured.at(*places.T).reshape(shape)
        plans = [
            ("measured", seen - (after - moved)),
            *plans,
            ("simulated less measured", after - seen),
        ]
    reach = float(np.percentile(np.abs([values for _, values in plans]), SHARE)) or 1.0
    plan_height = height_of_plan(x, y)
    total = len(plans) * (plan_height + GAP) + 0.1
    figure = style.new_figure(total, LENGTH)
    extent = (x[0] - d / 2, x[-1] + d / 2, y[0] - d / 2, y[-1] + d / 2)
    shade = 0.35 + 0.65 * hillshade(Raster(deposit.before.origin, d, after))
    for row, (words, values) in enumerate(plans):
        low = total - 0.35 - plan_height - row * (plan_height + GAP)
        plan = plan_axes(figure, total, low, plan_height)
        plan.imshow(shade.T, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)
        image = plan.imshow(
            values.T,
            origin="lower",
            extent=extent,
            cmap=COLOURS,
            alpha=0.65,
            vmin=-reach,
            vmax=reach,
        )
        _draw_edges(plan, deposit, edges.values())
        draw_places(plan, {}, lines, 0.5 * (x[0] + x[-1]))
        said = words if words.startswith("simulated less") else f"change of the surface, {words}"
        finish_plan(plan, f"{title}: {said}" if row == 0 else said, extent)
        colour_bar(figure, image, total, low, plan_height, "m")
    return style.save_figure(figure, path)


def _draw_edges(plan: Axes, deposit: DepositMap, edges: Iterable[np.ndarray]) -> None:
    """Edge of the soil before (dashed) and after the slide, and as measured."""
    x, y = deposit.before.axes
    for thickness, colour, dashes in (
        (deposit.before, style.BEFORE, "--"),
        (deposit.after, style.AFTER, "-"),
    ):
        values = thickness.values
        if values.min() < deposit.least < values.max():
            plan.contour(
                x, y, values.T, [deposit.least], colors=colour, linewidths=1.3, linestyles=dashes
            )
    for edge in edges:
        plan.plot(*np.asarray(edge).T, "o", color=style.HELD_OUT, markersize=3)
