"""A slide in perspective: the surface under a light, ground grey and soil by its thickness."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from geometry.survey3d.deposit import Side
from geometry.terrain.raster import hillshade
from mpm_taichi.readings3d import Maps
from report import style
from report.pictures.body_map import SOIL

MOST = 160
"""Facets along the longer edge, at most; more are too small to be seen."""


def save_view(path: str | Path, title: str, maps: Maps, *, side: Side = "right") -> Path:
    """Draw the surface in true proportions, seen from downstream and above.

    Args:
        path: png, svg or pdf.
        title: above the picture.
        maps: what is drawn.
        side: downstream, where the eye is.
    """
    scale = max(float(maps.deposit.values.max()), maps.least)
    figure = style.new_figure(4.2, 7.2)
    axes = figure.add_axes((0.0, 0.0, 1.0, 0.95), projection="3d", computed_zorder=False)
    draw_surface(axes, maps, scale, MOST)
    perspective(axes, maps, side)
    figure.text(0.02, 0.95, title, fontsize=style.TEXT)
    return style.save_figure(figure, path)


def draw_surface(axes: Axes3D, maps: Maps, scale: float, most: int) -> Poly3DCollection:
    """The surface as facets, at most so many along the longer edge; `scale` m is darkest soil."""
    step = max(int(np.ceil(max(maps.before.values.shape) / most)), 1)
    taken = (slice(None, None, step), slice(None, None, step))
    x, y = np.meshgrid(*maps.before.axes, indexing="ij")
    surface, thick = maps.surface.values, maps.deposit.values
    shade = 0.4 + 0.6 * hillshade(maps.surface)
    soil = matplotlib.colormaps[SOIL](0.15 + 0.6 * np.clip(thick / scale, 0.0, 1.0))[..., :3]
    colour = np.where(thick[..., None] >= maps.least, soil, 0.78) * shade[..., None]
    drawn = axes.plot_surface(
        x[taken],
        y[taken],
        surface[taken],
        facecolors=colour[taken],
        rstride=1,
        cstride=1,
        shade=False,
        linewidth=0,
        antialiased=False,
    )
    drawn.set_clip_on(False)  # the box of the axes is narrower than the view
    return drawn


def perspective(axes: Axes3D, maps: Maps, side: Side) -> None:
    """True proportions, seen from downstream and above."""
    surface = maps.surface.values
    lengths = [float(np.ptp(values)) for values in (*maps.before.axes, surface)]
    axes.set_box_aspect([max(length, 0.02 * max(lengths)) for length in lengths], zoom=1.45)
    axes.view_init(elev=28, azim=-125 if side == "left" else -55)
    limits = [(values.min(), values.max()) for values in (*maps.before.axes, surface)]
    axes.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    axes.set_xlabel("x [m]", fontsize=style.SMALL)
    axes.set_ylabel("y [m]", fontsize=style.SMALL)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.set_zticks([round(float(surface.min())), round(float(surface.max()))])
    axes.tick_params(labelsize=style.SMALL - 1)
    axes.set_facecolor((0.0, 0.0, 0.0, 0.0))
