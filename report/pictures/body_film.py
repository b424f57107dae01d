"""A slide in three dimensions as a film: from above, and in perspective."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from geometry.survey3d.deposit import Side
from geometry.terrain.raster import hillshade
from mpm_taichi.readings3d import Maps
from pipeline.files import atomic_path
from report import style
from report.pictures.body_map import SOIL, finish_plan
from report.pictures.body_view import draw_surface, perspective
from report.pictures.video import check_video, write_video

LENGTH, VIEW = 7.2, 3.4  # of the figure and height of the view [inches]
FACETS = 90
"""Along the longer edge of the view, at most."""
FRAMES, FRAMES_PER_SECOND, HOLD_S = 40, 10.0, 1.5


def save_body_film(
    path: Path, title: str, time: Sequence[float], maps: Sequence[Maps], *, side: Side = "right"
) -> Path:
    """Save a film; colours and axes stay from frame to frame.

    Args:
        path: .mp4 (needs the extra `video`) or .gif.
        title: above the plan.
        time: of the frames, (T,) [s].
        maps: of the frames, (T,).
        side: downstream, where the eye is.

    Raises:
        InputError: another suffix, or the extra is missing.
    """
    check_video(path)
    with atomic_path(path) as temporary:
        write_video(
            temporary,
            _images(title, time, maps, side),
            frames_per_second=FRAMES_PER_SECOND,
            hold_s=HOLD_S,
        )
    return path


def chosen_frames(count: int) -> np.ndarray:
    """Frames of a run that are shown, evenly spread."""
    return np.unique(np.linspace(0, count - 1, FRAMES).round().astype(int))


def _images(
    title: str, time: Sequence[float], maps: Sequence[Maps], side: Side
) -> Iterator[np.ndarray]:
    first = maps[0]
    (x, y), d = first.before.axes, first.before.spacing
    high = float(np.clip((LENGTH - 0.9) * len(y) / len(x), 1.0, 5.0))
    total = high + VIEW + 0.9
    figure = style.new_figure(total, LENGTH)
    plan = style.panel(figure, 0.7, VIEW + 0.5, LENGTH - 0.9, high)
    extent = (x[0] - d / 2, x[-1] + d / 2, y[0] - d / 2, y[-1] + d / 2)
    shared = {"origin": "lower", "extent": extent}
    scale = max(float(first.before.values.max()), first.least)
    shade = plan.imshow(_shade(first), cmap="gray", vmin=0, vmax=1, **shared)
    soil = plan.imshow(_soil(first), cmap=SOIL, alpha=0.65, vmin=0, vmax=scale, **shared)
    body = first.before.values
    if body.min() < first.least < body.max():
        plan.contour(
            x, y, body.T, [first.least], colors=style.BEFORE, linewidths=1.2, linestyles="--"
        )
    finish_plan(plan, title, extent)
    view = figure.add_axes(
        (0.0, 0.0, 1.0, (VIEW + 0.1) / total), projection="3d", computed_zorder=False
    )
    perspective(view, first, side)
    stamp = figure.text(0.98, 1.0 - 0.2 / total, "", ha="right", va="center", fontsize=style.TEXT)
    for now, one in zip(time, maps, strict=True):
        shade.set_data(_shade(one))
        soil.set_data(_soil(one))
        drawn = draw_surface(view, one, scale, FACETS)
        stamp.set_text(f"{now:.1f} s")
        figure.canvas.draw()
        yield np.asarray(figure.canvas.buffer_rgba()).copy()
        drawn.remove()


def _shade(maps: Maps) -> np.ndarray:
    return (0.35 + 0.65 * hillshade(maps.surface)).T


def _soil(maps: Maps) -> np.ma.MaskedArray:
    return np.ma.masked_less(maps.deposit.values, maps.least).T
