"""Pictures and animations of a run: points in colour, ground, water, and the outline before.

In: a `Run`. Out: a file (png, svg, pdf; mp4, gif) with heading, time stamps, colour bar and legend.
Callers lay their own marks on top with an overlay, a function of the axes: `profile_overlay` and
`toe_overlay` make the usual ones, `overlays` joins several.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.patches import Patch
from matplotlib.text import Text

from geometry.scenes.scene import Material, Scene
from mpm_taichi.trajectory import Run, nearest_frame, refuse_empty
from pipeline.files import atomic_path
from report.pictures.colouring import colouring_of, material_colours
from report.pictures.frame import LAYER, Overlay, draw_frame, view_limits
from report.pictures.video import SUFFIXES as VIDEO_SUFFIXES
from report.pictures.video import check_video, write_video
from report.style import TEXT_COLOUR, check_suffix, legend, new_figure, save_figure

WIDTH_IN = 11.0
# Inches around and between the panels.
LEFT, RIGHT, TOP, BOTTOM, GAP, LEGEND_ROW = 0.62, 0.2, 0.86, 0.5, 0.52, 0.2


def save_picture(
    run: Run,
    path: str | Path,
    *,
    colour: str = "displacement",
    times: Sequence[float] | None = None,
    overlay: Overlay | None = None,
    title: str | None = None,
) -> None:
    """Save a picture of one or several moments, one above the other.

    Args:
        run: the run.
        path: .png, .svg or .pdf.
        colour: one of `COLOURS`.
        times: moments [s], each shown by the nearest frame; None: the end.
        overlay: drawn on every panel.
        title: heading; None: the scene's name and its residual strengths.

    Raises:
        InputError: unknown suffix or colour, or a run without frames.
    """
    check_suffix(path)
    frames = [run.frames - 1] if times is None else [nearest_frame(run, time) for time in times]
    sheet = _Sheet(run, frames, colour=colour, overlay=overlay, title=title)
    save_figure(sheet.figure, path)


def save_animation(
    run: Run,
    path: str | Path,
    *,
    colour: str = "displacement",
    overlay: Overlay | None = None,
    title: str | None = None,
    frames: int = 150,
    frames_per_second: float = 20.0,
    hold_s: float = 1.5,
) -> None:
    """Save an animation of the whole run.

    Args:
        run: the run.
        path: .mp4 (needs the extra `video`) or .gif.
        colour: one of `COLOURS`.
        overlay: drawn on every frame, above the points.
        title: heading; None: the scene's name and its residual strengths.
        frames: at most this many frames of the run are shown, evenly spread.
        frames_per_second: of the animation.
        hold_s: how long the end is shown [s].

    Raises:
        InputError: unknown suffix or colour, a run without frames, or the extra is missing.
    """
    path = check_suffix(path, VIDEO_SUFFIXES)
    check_video(path)
    sheet = _Sheet(run, [0], colour=colour, overlay=overlay, title=title)
    chosen = np.unique(np.linspace(0, run.frames - 1, frames).round().astype(int))
    with atomic_path(path) as temporary:
        write_video(
            temporary, sheet.images(chosen), frames_per_second=frames_per_second, hold_s=hold_s
        )


class _Sheet:
    """A figure of one or more panels with heading, time stamps, colour bar and legend."""

    def __init__(
        self,
        run: Run,
        frames: Sequence[int],
        *,
        colour: str,
        overlay: Overlay | None,
        title: str | None,
    ) -> None:
        refuse_empty(run)
        self.run = run
        self.colouring = colouring_of(run, colour)
        x_limits, y_limits = view_limits(run, overlay)
        self.width = WIDTH_IN - LEFT - RIGHT
        panel = self.width * (y_limits[1] - y_limits[0]) / (x_limits[1] - x_limits[0])
        above = TOP + len(frames) * panel + (len(frames) - 1) * GAP + BOTTOM
        self.figure = new_figure(above, WIDTH_IN)
        self.canvas = self.figure.canvas
        self.axes = [self.figure.add_axes((0, 0, 1, 1)) for _ in frames]
        for ax, frame in zip(self.axes, frames, strict=True):
            self.soil = draw_frame(ax, run, frame, colouring=self.colouring, overlay=overlay)
            self.stamp = _draw_stamp(ax, run.time[frame])
            if ax is not self.axes[-1]:
                ax.set_xlabel("")
        handles = self._legend_handles(colour)
        columns = _columns([handle.get_label() for handle in handles])
        self.height = above + LEGEND_ROW * -(-len(handles) // columns)
        self.figure.set_size_inches(WIDTH_IN, self.height)
        for number, ax in enumerate(self.axes):
            bottom = self.height - TOP - (number + 1) * panel - number * GAP
            ax.set_position(self._box(LEFT, bottom, self.width, panel))
        self._draw_heading(title or default_title(run.scene))
        self._draw_colour_bar()
        legend(
            self.figure,
            handles,
            columns=columns,
            loc="lower left",
            labelspacing=0.35,
            bbox_to_anchor=(LEFT / WIDTH_IN, 0.04 / self.height),
        )

    def images(self, frames: Sequence[int]) -> Iterator[np.ndarray]:
        """The sheet at each frame as RGBA (height, width, 4) uint8; only what moves is redrawn."""
        (ax,) = self.axes
        moving = sorted(_above_the_background(ax), key=lambda artist: artist.zorder)
        for artist in moving:
            artist.set_animated(True)
        self.canvas.draw()
        background = self.canvas.copy_from_bbox(self.figure.bbox)
        for frame in frames:
            self.canvas.restore_region(background)
            self.soil.show(frame)
            self.stamp.set_text(_stamp_text(self.run.time[frame]))
            for artist in moving:
                ax.draw_artist(artist)
            yield np.asarray(self.canvas.buffer_rgba())

    def _box(self, x: float, y: float, width: float, height: float) -> tuple[float, ...]:
        """Inches as shares of the figure."""
        return x / WIDTH_IN, y / self.height, width / WIDTH_IN, height / self.height

    def _draw_heading(self, title: str) -> None:
        name, _, details = title.partition("\n")
        x, y, *_ = self._box(LEFT, self.height - 0.14, 0, 0)
        style = {"ha": "left", "va": "top", "color": TEXT_COLOUR}
        self.figure.text(x, y, name, fontsize=12, fontweight="bold", **style)
        x, y, *_ = self._box(LEFT, self.height - 0.37, 0, 0)
        self.figure.text(x, y, details, fontsize=8.5, **style)

    def _draw_colour_bar(self) -> None:
        if not self.colouring.label:
            return
        box = self._box(WIDTH_IN - RIGHT - 2.9, self.height - 0.3, 2.8, 0.12)
        bar = self.figure.colorbar(
            ScalarMappable(self.colouring.norm, self.colouring.colour_map),
            cax=self.figure.add_axes(box),
            orientation="horizontal",
            extend="max",
        )
        bar.outline.set_linewidth(0.4)
        bar.ax.tick_params(labelsize=7.5, length=2, pad=1.5, colors=TEXT_COLOUR)
        x, y, *_ = self._box(WIDTH_IN - RIGHT - 3.0, self.height - 0.24, 0, 0)
        self.figure.text(x, y, self.colouring.label, ha="right", va="center", fontsize=8.5)

    def _legend_handles(self, colour: str) -> list[Artist]:
        handles: list[Artist] = []
        if colour == "material":
            for name, its_colour in material_colours(self.run.scene).items():
                text = f"{name.replace('_', ' ')}: {strength(self.run.scene.materials[name])}"
                handles.append(Patch(facecolor=its_colour, label=text))
        return handles + self.axes[0].get_legend_handles_labels()[0]


def default_title(scene: Scene) -> str:
    """Name of the scene; below it the residual strengths and the spacing."""
    liquefied = [
        f"{name.replace('_', ' ')}: {strength(material)}"
        for name, material in scene.materials.items()
        if material.liquefied
    ]
    template = [f"template ({scene.origin.template})"] if scene.origin else []
    details = [*template, *liquefied[:3], f"points every {scene.spacing:g} m"]
    return f"{scene.name.replace('_', ' ').title()}\n{'   '.join(details)}"


def strength(material: Material) -> str:
    """A material's strength in a few characters: S_r where it liquefied, else phi and c."""
    if material.strength_ratio is not None:
        return f"$S_r/\\sigma'_{{v0}}$ {material.strength_ratio:.3g}"
    if material.liquefied and material.friction_deg == 0:
        return f"$S_r$ {material.cohesion_kpa:.3g} kPa"
    parts = []
    if material.friction_deg > 0:
        parts.append(f"$\\varphi$ {material.friction_deg:.3g}°")
    if material.cohesion_kpa > 0 or not parts:
        parts.append(f"c {material.cohesion_kpa:.3g} kPa")
    return ", ".join(parts)


def _draw_stamp(ax: Axes, time: float) -> Text:
    return ax.text(
        0.0,
        1.0,
        _stamp_text(time),
        transform=ax.transAxes,
        va="bottom",
        fontsize=10,
        color=TEXT_COLOUR,
        zorder=LAYER["stamp"],
    )


def _stamp_text(time: float) -> str:
    return f"t = {time:.1f} s"


def _columns(labels: Sequence[str]) -> int:
    """Columns of a legend that fit into the width."""
    longest = max(len(label.replace("$", "")) for label in labels)
    return 4 if longest <= 36 else 3 if longest <= 52 else 2


def _above_the_background(ax: Axes) -> list[Artist]:
    """The water, the soil and all that lies over it."""
    drawn = [*ax.images, *ax.collections, *ax.lines, *ax.patches, *ax.texts]
    return [artist for artist in drawn if artist.zorder >= LAYER["water"]]
