"""One frame of a run on matplotlib axes: points, ground, water, outline before, overlays.

In: axes and a `Run`. Out: the axes drawn on, in metres, with the same scale in x and y. An overlay
is a function of the axes, drawn last and kept in view.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation
from scipy.ndimage import distance_transform_edt
from shapely.geometry import Polygon
from shapely.ops import unary_union

from geometry.scenes.scene import Scene
from geometry.sides import SIDES
from mpm_taichi.solver.water import MovingFace, moving_face
from mpm_taichi.trajectory import Run, refuse_empty
from report.pictures.colouring import Colouring, colouring_of
from report.pictures.far_boundary import far_boundary
from report.style import GROUND_COLOUR, GROUND_LINE, HALO, WATER_COLOUR, WATER_LINE, labels, tidy

Overlay = Callable[[Axes], None]

# A point stands for a square of soil; a disc a little larger leaves no pinholes between neighbours.
DISC = 1.45
# Shear pulls the lattice apart into rows. Between points nearer than twice this (in spacings) there
# is soil, not water, and it is painted; what flies alone stays alone, and the outline where it is.
REACH = 1.3
PIXELS_PER_SPACING = 3

LAYER = {"water": 1, "soil": 2.1, "points": 2.2, "ground": 3, "lines": 4, "overlay": 6, "stamp": 8}


@dataclass(frozen=True)
class DrawnWater:
    """The pool and the line of the water on some axes; `show` moves them to another frame."""

    run: Run
    face: MovingFace | None
    x: np.ndarray
    pool: PolyCollection
    line: Line2D

    def show(self, frame: int) -> None:
        """Draw the water where it is in `frame`: it follows the soil, or stays."""
        scene = self.run.scene
        level = scene.phreatic_level(self.x)
        if self.face is not None and frame > 0:
            points = self.run.positions[frame][~self.run.kinematic]
            # A model without points knows a deposit and not where each of them went.
            if np.all(np.isfinite(points)):
                level = self.face.head(self.x, points)
        ground = scene.ground.height(self.x)
        upper, lower = np.maximum(level, ground), ground
        outline = np.concatenate(
            [np.stack([self.x, upper], axis=1), np.stack([self.x, lower], axis=1)[::-1]]
        )
        self.pool.set_verts([outline])
        self.line.set_data(self.x, np.where(level > ground + 1e-6, level, np.nan))


@dataclass(frozen=True)
class DrawnSoil:
    """The soil on some axes, and the water; `show` moves them to another frame."""

    run: Run
    colouring: Colouring
    points: EllipseCollection
    body: AxesImage
    water: DrawnWater | None

    def show(self, frame: int) -> None:
        """Move the points to where they are in `frame` (0 to T - 1) and colour them for it."""
        if self.water is not None:
            self.water.show(frame)
        positions, values = self.run.positions[frame], self.colouring.values(frame)
        self.points.set_offsets(positions)
        self.points.set_array(values)
        rows, columns = self.body.get_size()
        self.body.set_data(
            paint_body(
                positions,
                values,
                extent=self.body.get_extent(),
                shape=(rows, columns),
                reach=REACH * self.run.scene.spacing,
            )
        )


def paint_body(
    positions: np.ndarray,
    values: np.ndarray,
    *,
    extent: tuple[float, float, float, float],
    shape: tuple[int, int],
    reach: float,
) -> np.ma.MaskedArray:
    """The soil as a picture: a pixel has the value of the nearest point, masked outside the soil.

    The soil is the morphological closing of the points with a disc: gaps up to twice its radius are
    filled, and the outline is not pushed outwards.

    Args:
        positions: (N, 2) [m].
        values: (N,).
        extent: left, right, bottom, top of the picture [m].
        shape: rows and columns; row 0 is the lowest.
        reach: radius of the disc [m].

    Returns:
        (rows, columns) of the values' kind.
    """
    left, right, bottom, top = extent
    pixel = np.array([(right - left) / shape[1], (top - bottom) / shape[0]])
    with np.errstate(invalid="ignore"):
        column, row = np.floor((positions - [left, bottom]) / pixel).T
    seen = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
    place = np.full(shape, -1)
    place[row[seen].astype(int), column[seen].astype(int)] = np.flatnonzero(seen)
    if not seen.any():
        return np.ma.masked_all(shape, values.dtype)
    away, nearest = distance_transform_edt(place < 0, sampling=pixel[::-1], return_indices=True)
    near = away <= reach
    inside = near & (distance_transform_edt(near, sampling=pixel[::-1]) > reach)
    return np.ma.array(values[place[tuple(nearest)]], mask=~inside)


def draw_frame(
    ax: Axes,
    run: Run,
    frame: int = -1,
    *,
    colour: str = "displacement",
    colouring: Colouring | None = None,
    overlay: Overlay | None = None,
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None,
) -> DrawnSoil:
    """Draw one frame on `ax`: water, points, ground, initial outline, then the overlay.

    Args:
        ax: axes to draw on; gets equal scales and the run's limits.
        run: the run; needs at least one frame.
        frame: number of the frame; negative numbers count from the end.
        colour: one of `COLOURS`.
        colouring: as made by `colouring_of`, so that several frames share one colour scale.
        overlay: called with `ax` last.
        limits: (left, right), (bottom, top) [m]; None: `view_limits`.

    Returns:
        The soil, so that a caller can move it to another frame.
    """
    refuse_empty(run)
    colouring = colouring or colouring_of(run, colour)
    x_limits, y_limits = limits or view_limits(run, overlay)
    ax.set(xlim=x_limits, ylim=y_limits, aspect="equal")
    labels(ax, "x (m)", "y (m)")
    tidy(ax)
    soil = _draw_soil(ax, run, colouring, _draw_water(ax, run, x_limits))
    soil.show(frame % run.frames)
    _draw_ground(ax, run.scene, x_limits, y_limits)
    _draw_outline(ax, run.scene)
    if overlay is not None:
        overlay(ax)
    return soil


def _draw_soil(ax: Axes, run: Run, colouring: Colouring, water: DrawnWater | None) -> DrawnSoil:
    """The points and the body below them, still without a place and a colour."""
    style = {"cmap": colouring.colour_map, "norm": colouring.norm}
    diameter = DISC * run.scene.spacing
    points = EllipseCollection(
        widths=diameter,
        heights=diameter,
        angles=0.0,
        units="xy",
        offset_transform=ax.transData,
        linewidths=0,
        zorder=LAYER["points"],
        rasterized=True,  # thousands of discs would make an svg or a pdf slow to open
        **style,
    )
    ax.add_collection(points, autolim=False)
    left, right = ax.get_xlim()
    bottom, top = ax.get_ylim()
    pixel = max(run.scene.spacing / PIXELS_PER_SPACING, (right - left) / 1600)
    shape = (round((top - bottom) / pixel), round((right - left) / pixel))
    body = ax.imshow(
        np.ma.masked_all(shape),
        extent=(left, right, bottom, top),
        origin="lower",
        interpolation="nearest",
        aspect="equal",
        zorder=LAYER["soil"],
        **style,
    )
    return DrawnSoil(run, colouring, points, body, water)


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
    """Extent of a picture [m]: the scene before, nearly all of its points ever, the overlay."""
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


def _draw_water(ax: Axes, run: Run, x_limits: tuple[float, float]) -> DrawnWater | None:
    """The pool behind the points, and the water level through them, still without a place."""
    scene = run.scene
    if scene.water_level is None:
        return None
    left, right = (
        None if scene.domain.is_open(side) else scene.domain.wall(side) for side in SIDES
    )
    x_limits = (
        x_limits[0] if left is None else max(x_limits[0], left),
        x_limits[1] if right is None else min(x_limits[1], right),
    )
    x = np.linspace(*x_limits, max(round((x_limits[1] - x_limits[0]) / scene.spacing), 200))
    face = moving_face(scene, run.settings, run.positions[0][~run.kinematic])
    pool = PolyCollection([], facecolors=WATER_COLOUR, linewidths=0, zorder=LAYER["water"])
    ax.add_collection(pool, autolim=False)
    (line,) = ax.plot(
        [],
        [],
        color=WATER_LINE,
        linewidth=0.9,
        linestyle=(0, (7, 2, 1.5, 2)),
        path_effects=HALO,
        zorder=LAYER["lines"],
        label="water level" if scene.phreatic_line is None else "pool and phreatic line",
    )
    return DrawnWater(run, face, x, pool, line)


def _draw_ground(
    ax: Axes, scene: Scene, x_limits: tuple[float, float], y_limits: tuple[float, float]
) -> None:
    bends = [x for x, _ in scene.ground.points if x_limits[0] < x < x_limits[1]]
    x = np.array([x_limits[0], *bends, x_limits[1]])
    y = scene.ground.height(x)
    ax.fill_between(x, y_limits[0], y, color=GROUND_COLOUR, linewidth=0, zorder=LAYER["ground"])
    ax.plot(x, y, color=GROUND_LINE, linewidth=1.0, zorder=LAYER["ground"])
    for side, edge in zip(SIDES, x_limits, strict=True):
        wall = scene.domain.wall(side)
        if not scene.domain.is_open(side) and x_limits[0] < wall < x_limits[1]:
            if scene.domain.goes_on(side):
                far_boundary(ax, scene, side, edge, y_limits)
            else:
                ax.axvspan(wall, edge, color=GROUND_COLOUR, linewidth=0, zorder=LAYER["ground"])
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
