"""Pictures and animations of a run: points in colour, ground, water, and the outline before.

In: a `Run`. Out: axes drawn on, or a file (png, svg, pdf; mp4, gif). All lengths are metres and
both axes have the same scale. Callers lay their own marks on top with an overlay, a function of the
axes: `profile_overlay` and `toe_overlay` make the usual ones, `overlays` joins several.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.text import Text
from matplotlib.transforms import ScaledTranslation
from shapely.geometry import Polygon
from shapely.ops import unary_union

from geometry.scene import Material, Scene
from mpm_taichi.colouring import COLOURS, Colouring, colouring_of, material_colours
from mpm_taichi.trajectory import Run
from mpm_taichi.video import SUFFIXES as VIDEO_SUFFIXES
from mpm_taichi.video import check_video, write_video
from pipeline.cli import InputError
from pipeline.files import atomic_path

__all__ = [
    "COLOURS",
    "Overlay",
    "draw_frame",
    "nearest_frame",
    "overlays",
    "profile_overlay",
    "save_animation",
    "save_picture",
    "toe_overlay",
    "view_limits",
]

Overlay = Callable[[Axes], None]

PICTURE_SUFFIXES = (".png", ".svg", ".pdf")
WIDTH_IN = 11.0
DPI = 130
# A point stands for a square of soil; a disc a little larger leaves no pinholes between neighbours.
DISC = 1.45
# Inches around and between the panels.
LEFT, RIGHT, TOP, BOTTOM, GAP, LEGEND_ROW = 0.62, 0.2, 0.86, 0.5, 0.52, 0.2

GROUND_COLOUR, GROUND_LINE = "#a39b8f", "#4d4842"
WATER_COLOUR, WATER_LINE = "#d3e6f5", "#2a6fa8"
TEXT_COLOUR = "#222222"
# Thin lines must be seen on dark points and on white.
HALO = [Stroke(linewidth=2.4, foreground="white", alpha=0.75), Normal()]

LAYER = {"water": 1, "points": 2.1, "ground": 3, "lines": 4, "overlay": 6, "stamp": 8}


def draw_frame(
    ax: Axes,
    run: Run,
    frame: int = -1,
    *,
    colour: str = "displacement",
    colouring: Colouring | None = None,
    overlay: Overlay | None = None,
) -> EllipseCollection:
    """Draw one frame on `ax`: water, points, ground, initial outline, then the overlay.

    Args:
        ax: axes to draw on; gets equal scales and the run's limits.
        run: the run; needs at least one frame.
        frame: number of the frame; negative numbers count from the end.
        colour: one of `COLOURS`.
        colouring: as made by `colouring_of`, so that several frames share one colour scale.
        overlay: called with `ax` last.

    Returns:
        The points, so that a caller can move and colour them for another frame.
    """
    _refuse_empty(run)
    colouring = colouring or colouring_of(run, colour)
    x_limits, y_limits = view_limits(run, overlay)
    ax.set(xlim=x_limits, ylim=y_limits, aspect="equal", xlabel="x (m)", ylabel="y (m)")
    ax.tick_params(labelsize=8, colors=TEXT_COLOUR)
    ax.spines[["top", "right"]].set_visible(False)
    _draw_water(ax, run.scene, x_limits)
    diameter = DISC * run.scene.spacing
    points = EllipseCollection(
        widths=diameter,
        heights=diameter,
        angles=0.0,
        units="xy",
        offsets=run.positions[frame],
        offset_transform=ax.transData,
        cmap=colouring.colour_map,
        norm=colouring.norm,
        linewidths=0,
        zorder=LAYER["points"],
        rasterized=True,  # thousands of discs would make an svg or a pdf slow to open
    )
    points.set_array(colouring.values(frame % run.frames))
    ax.add_collection(points, autolim=False)
    _draw_ground(ax, run.scene, x_limits, y_limits)
    _draw_outline(ax, run.scene)
    if overlay is not None:
        overlay(ax)
    return points


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
    path = _checked(path, PICTURE_SUFFIXES)
    frames = [run.frames - 1] if times is None else [nearest_frame(run, time) for time in times]
    sheet = _Sheet(run, frames, colour=colour, overlay=overlay, title=title)
    with atomic_path(path) as temporary:
        sheet.figure.savefig(temporary, dpi=DPI)


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
    path = _checked(path, VIDEO_SUFFIXES)
    check_video(path)
    sheet = _Sheet(run, [0], colour=colour, overlay=overlay, title=title)
    chosen = np.unique(np.linspace(0, run.frames - 1, frames).round().astype(int))
    with atomic_path(path) as temporary:
        write_video(
            temporary, sheet.images(chosen), frames_per_second=frames_per_second, hold_s=hold_s
        )


def profile_overlay(x: np.ndarray, y: np.ndarray, label: str = "measured profile") -> Overlay:
    """Overlay: a polyline through (x, y) [m], shapes (n,), black on a white edge."""

    def draw(ax: Axes) -> None:
        ax.plot(x, y, color="white", linewidth=3.6, zorder=LAYER["overlay"])
        ax.plot(x, y, color="black", linewidth=1.6, zorder=LAYER["overlay"], label=label)

    return draw


def toe_overlay(x: float, y: float, label: str = "measured toe", colour: str = "black") -> Overlay:
    """Overlay: a triangle whose tip stands on the ground at (x, y) [m]."""

    def draw(ax: Axes) -> None:
        # Moved up by half its size, so that its tip and not its middle is at y.
        lift = ScaledTranslation(0.0, 5.0 / 72.0, ax.get_figure().dpi_scale_trans)
        ax.plot(
            [x],
            [y],
            transform=ax.transData + lift,
            marker="v",
            markersize=9,
            color=colour,
            markeredgecolor="white",
            markeredgewidth=0.8,
            linestyle="none",
            zorder=LAYER["overlay"] + 1,
            label=label,
        )
        ax.update_datalim([(x, y)])  # not done by plot where a transform is given

    return draw


def overlays(*parts: Overlay) -> Overlay:
    """Several overlays as one."""

    def draw(ax: Axes) -> None:
        for part in parts:
            part(ax)

    return draw


def view_limits(
    run: Run, overlay: Overlay | None = None
) -> tuple[tuple[float, float], tuple[float, float]]:
    """What a picture shows [m]: the scene before, nearly all of its points ever, the overlay."""
    seen = run.positions[:: max(1, run.frames // 40)].reshape(-1, 2)
    seen = np.concatenate([seen, run.positions[-1]])
    corners = [np.asarray(zone.polygon) for zone in run.scene.zones]
    corners = np.concatenate([*corners, _extent(overlay)])
    seen = np.concatenate([seen[np.isfinite(seen).all(axis=1)], corners])
    # Not the extremes: one stray point must not shrink the picture.
    low = np.minimum(np.quantile(seen, 0.0005, axis=0), corners.min(axis=0))
    high = np.maximum(np.quantile(seen, 0.9995, axis=0), corners.max(axis=0))
    if run.scene.water_level is not None:
        high[1] = max(high[1], run.scene.water_level)
    margin = max(0.04 * (high[0] - low[0]), 2.0 * run.scene.spacing)
    x_limits = (float(low[0] - margin), float(high[0] + margin))
    ground = run.scene.ground.height(np.linspace(*x_limits, 200))
    bottom = min(low[1], ground.min()) - 0.6 * margin
    return x_limits, (float(bottom), float(high[1] + 0.5 * margin))


def _extent(overlay: Overlay | None) -> np.ndarray:
    """Corners of what an overlay draws (2, 2), found on axes of its own; (0, 2) if nothing."""
    if overlay is None:
        return np.zeros((0, 2))
    scratch = Figure().add_subplot()
    overlay(scratch)
    corners = scratch.dataLim.get_points()
    return corners if np.isfinite(corners).all() else np.zeros((0, 2))


def nearest_frame(run: Run, time: float) -> int:
    """Number of the frame nearest to `time` [s]."""
    _refuse_empty(run)
    return int(np.argmin(np.abs(run.time - time)))


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
        _refuse_empty(run)
        self.run = run
        self.colouring = colouring_of(run, colour)
        x_limits, y_limits = view_limits(run, overlay)
        self.width = WIDTH_IN - LEFT - RIGHT
        panel = self.width * (y_limits[1] - y_limits[0]) / (x_limits[1] - x_limits[0])
        above = TOP + len(frames) * panel + (len(frames) - 1) * GAP + BOTTOM
        self.figure = Figure(figsize=(WIDTH_IN, above), dpi=DPI, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        self.axes = [self.figure.add_axes((0, 0, 1, 1)) for _ in frames]
        for ax, frame in zip(self.axes, frames, strict=True):
            self.points = draw_frame(ax, run, frame, colouring=self.colouring, overlay=overlay)
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
        self.figure.legend(
            handles=handles,
            loc="lower left",
            bbox_to_anchor=(LEFT / WIDTH_IN, 0.04 / self.height),
            ncols=columns,
            frameon=False,
            fontsize=8,
            borderaxespad=0,
            borderpad=0,
            handlelength=1.6,
            columnspacing=1.4,
            labelspacing=0.35,
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
            self.points.set_offsets(self.run.positions[frame])
            self.points.set_array(self.colouring.values(frame))
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
    details = [*liquefied[:3], f"points every {scene.spacing:g} m"]
    return f"{scene.name.replace('_', ' ').title()}\n{'   '.join(details)}"


def strength(material: Material) -> str:
    """A material's strength in a few characters: S_r where it liquefied, else phi and c."""
    if material.liquefied and material.friction_deg == 0:
        return f"$S_r$ {material.cohesion_kpa:.3g} kPa"
    parts = []
    if material.friction_deg > 0:
        parts.append(f"$\\varphi$ {material.friction_deg:.3g}°")
    if material.cohesion_kpa > 0 or not parts:
        parts.append(f"c {material.cohesion_kpa:.3g} kPa")
    return ", ".join(parts)


def _draw_water(ax: Axes, scene: Scene, x_limits: tuple[float, float]) -> None:
    """The pool behind the points, and the phreatic line through them."""
    if scene.water_level is None:
        return
    bends = [x for x, _ in [*(scene.phreatic_line or []), *scene.ground.points]]
    x = np.unique(np.clip([*np.linspace(*x_limits, 200), *bends], *x_limits))
    ground, level = scene.ground.height(x), scene.phreatic_level(x)
    wet = level > ground + 1e-6
    ax.fill_between(
        x,
        ground,
        np.maximum(level, ground),
        color=WATER_COLOUR,
        linewidth=0,
        zorder=LAYER["water"],
    )
    ax.plot(
        x,
        np.where(wet, level, np.nan),
        color=WATER_LINE,
        linewidth=0.9,
        linestyle=(0, (7, 2, 1.5, 2)),
        path_effects=HALO,
        zorder=LAYER["lines"],
        label="water level" if scene.phreatic_line is None else "pool and phreatic line",
    )


def _draw_ground(
    ax: Axes, scene: Scene, x_limits: tuple[float, float], y_limits: tuple[float, float]
) -> None:
    bends = [x for x, _ in scene.ground.points if x_limits[0] < x < x_limits[1]]
    x = np.array([x_limits[0], *bends, x_limits[1]])
    y = scene.ground.height(x)
    ax.fill_between(x, y_limits[0], y, color=GROUND_COLOUR, linewidth=0, zorder=LAYER["ground"])
    ax.plot(x, y, color=GROUND_LINE, linewidth=1.0, zorder=LAYER["ground"])
    if scene.domain.walls == "closed":
        for wall in (scene.domain.x_min, scene.domain.x_max):
            ax.axvline(wall, color=GROUND_LINE, linewidth=1.6, zorder=LAYER["ground"])


def _draw_outline(ax: Axes, scene: Scene) -> None:
    """Outer edge of all zones before the slide."""
    # Zones may be apart by rounding: closed over a tenth of the spacing they become one.
    reach = 0.1 * scene.spacing
    whole = unary_union([Polygon(zone.polygon).buffer(reach) for zone in scene.zones]).buffer(
        -reach
    )
    label = "before"
    for part in getattr(whole, "geoms", [whole]):
        x, y = part.exterior.xy
        ax.plot(
            x,
            y,
            color="#333333",
            linewidth=1.0,
            linestyle="--",
            path_effects=HALO,
            zorder=LAYER["lines"],
            label=label,
        )
        label = "_nolegend_"


def _draw_stamp(ax: Axes, time: float) -> Text:
    return ax.text(
        0.0,
        1.0,
        _stamp_text(time),
        transform=ax.transAxes,
        ha="left",
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
    """The points and all that lies over them."""
    drawn = [*ax.collections, *ax.lines, *ax.patches, *ax.texts]
    return [artist for artist in drawn if artist.zorder >= LAYER["points"]]


def _refuse_empty(run: Run) -> None:
    if run.frames == 0 or run.points == 0:
        raise InputError(f"{run.scene.name}: the run has no frames to draw ({run.reason})")


def _checked(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    path = Path(path)
    if path.suffix not in suffixes:
        raise InputError(f"{path}: the suffix must be one of {', '.join(suffixes)}")
    return path
