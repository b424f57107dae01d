"""Pictures of scenes: zones, materials, base, water, blocks' velocities. One scene or a gallery.

Colour says what kind of soil a zone is: warm = liquefied, and otherwise the stronger the darker.
The colours keep apart for every kind of colour vision; liquefied zones are hatched as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon, Rectangle
from shapely import maximum_inscribed_circle
from shapely.geometry import LineString
from shapely.geometry import Polygon as Shape

from geometry.random_scenes.sketch import signed_area
from geometry.scenes.fill import fill, point_count
from geometry.scenes.scene import Material, Scene
from geometry.sides import SIDES
from pipeline.cli import InputError
from report import style
from report.pictures.far_boundary import far_boundary

LABEL_SIZE = 7.5
LIQUEFIED, CLAY = "#d55e00", "#ddaa77"
FRICTIONAL = ("#dde5c9", "#5f7f4a")
COHESIVE = ("#cfd8e3", "#4f6f93")
"""Light and dark end of soils with friction alone, and with friction and cohesion."""


def material_colour(material: Material) -> str | tuple[float, float, float]:
    """Colour of a material: by kind, and by strength within a kind."""
    if material.liquefied:
        return LIQUEFIED
    if material.friction_deg == 0.0:
        return CLAY
    light, dark = FRICTIONAL if material.cohesion_kpa <= 5.0 else COHESIVE
    strength = np.clip((material.friction_deg - 20.0) / 27.0, 0.0, 1.0)
    mixed = (1.0 - strength) * np.array(to_rgb(light)) + strength * np.array(to_rgb(dark))
    return tuple(float(part) for part in mixed)


def draw_section(ax: Axes, scene: Scene, *, names: bool = True, whole_domain: bool = True) -> None:
    """Draw one scene on axes: water, zones, base, walls, velocities.

    Args:
        ax: gets equal scales and the limits of the scene, in metres.
        scene: the scene.
        names: write name and strength of each zone into it, where there is room.
        whole_domain: show the domain from wall to wall, not only where the soil is.
    """
    x_limits, y_limits = _limits(scene, whole_domain)
    ax.set(xlim=x_limits, ylim=y_limits, aspect="equal")
    ax.set_axisbelow(True)
    _draw_water(ax, scene, x_limits)
    for zone in scene.zones:
        material = scene.materials[zone.material]
        ax.add_patch(
            Polygon(
                zone.polygon,
                closed=True,
                facecolor=material_colour(material),
                edgecolor="#333333",
                linewidth=0.7,
                zorder=2,
                hatch="////" if material.liquefied else None,
            )
        )
        if names:
            _label(ax, zone.polygon, [zone.name.replace("_", " "), _strength(material)])
        _draw_velocity(ax, scene, zone.polygon, zone.initial_velocity)
    _draw_water_line(ax, scene, x_limits)
    _draw_ground(ax, scene, x_limits, y_limits)
    style.tidy(ax)


def save_scene_picture(scene: Scene, path: str | Path, *, points: bool = False) -> None:
    """Write a picture of one scene: zones, a table of materials and, if asked, the points."""
    x_limits, y_limits = _limits(scene, True)
    width = 11.0
    height = (width - 1.2) * (y_limits[1] - y_limits[0]) / (x_limits[1] - x_limits[0])
    table = 0.2 * (len(scene.materials) + 1) + 0.25
    total = height + table + 1.35
    figure = style.new_figure(total, width)
    ax = figure.add_axes((0.065, (table + 0.65) / total, 0.92, height / total))
    draw_section(ax, scene)
    if points:
        _draw_points(ax, scene)
    style.labels(ax, "x (m)", "y (m)")
    figure.text(0.065, 1.0 - 0.3 / total, _title(scene), fontsize=12, weight="bold", va="center")
    figure.text(0.065, 1.0 - 0.53 / total, _subtitle(scene), fontsize=9, va="center")
    _material_table(figure, scene, total)
    style.save_figure(figure, path, dpi=150)


def save_gallery(scenes: Sequence[Scene], path: str | Path, *, columns: int = 5) -> None:
    """Write one picture of many scenes, row by row, all at the same scale."""
    if not scenes:
        raise InputError("a gallery needs at least one scene")
    columns = min(columns, len(scenes))
    rows = math.ceil(len(scenes) / columns)
    widest = max(scene.domain.width for scene in scenes)
    tallest = max(np.ptp(_limits(scene, True)[1]) for scene in scenes)
    cell_width = 13.0 / columns if columns > 2 else 5.5
    cell_height = (cell_width - 0.25) * tallest / widest + 0.34
    width, total = columns * cell_width + 0.2, rows * cell_height + 0.62
    figure = style.new_figure(total, width)
    for number, scene in enumerate(scenes):
        row, column = divmod(number, columns)
        bottom = total - (row + 1) * cell_height
        left = 0.15 + column * cell_width
        ax = style.panel(figure, left, bottom, cell_width - 0.2, cell_height - 0.3)
        draw_section(ax, scene, names=False)
        bottom_y = ax.get_ylim()[0]
        ax.set_ylim(bottom_y, bottom_y + tallest)
        ax.set_anchor("SW")
        style.title(ax, _title(scene), fontsize=7.5, pad=2.0, fontweight="normal")
        _scale_bar(ax, scene)
    _legend(figure)
    style.save_figure(figure, path, dpi=150)


def _limits(scene: Scene, whole_domain: bool) -> tuple[tuple[float, float], tuple[float, float]]:
    points = np.array([point for zone in scene.zones for point in zone.polygon])
    low, high = points.min(axis=0), points.max(axis=0)
    left, right = (scene.domain.x_min, scene.domain.x_max) if whole_domain else (low[0], high[0])
    lowest = min(scene.ground.lowest, low[1])
    margin = 0.02 * (right - left)
    top = high[1] if scene.water_level is None else max(high[1], scene.water_level)
    return (left - margin, right + margin), (lowest - 1.5 * margin, top + 1.2 * margin)


def _draw_water(ax: Axes, scene: Scene, x_limits: tuple[float, float]) -> None:
    if not scene.has_water:
        return
    x, level = _water_table(scene, x_limits)
    ground = scene.ground.height(x)
    ax.fill_between(x, ground, np.maximum(level, ground), color=style.WATER_COLOUR, lw=0, zorder=1)


def _draw_water_line(ax: Axes, scene: Scene, x_limits: tuple[float, float]) -> None:
    if not scene.has_water:
        return
    x, level = _water_table(scene, x_limits)
    shown = np.where(level >= scene.ground.height(x), level, np.nan)
    ax.plot(
        x, shown, color=style.WATER_LINE, lw=1.1, ls=(0, (6, 2)), zorder=4, path_effects=style.HALO
    )


def _water_table(scene: Scene, x_limits: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    left, right = max(x_limits[0], scene.domain.x_min), min(x_limits[1], scene.domain.x_max)
    bends = [x for x, _ in [*(scene.phreatic_line or []), *scene.ground.points]]
    x = np.unique(np.concatenate([np.linspace(left, right, 400), bends]))
    x = x[(x >= left) & (x <= right)]
    return x, scene.phreatic_level(x)


def _draw_ground(
    ax: Axes, scene: Scene, x_limits: tuple[float, float], y_limits: tuple[float, float]
) -> None:
    bends = [x for x, _ in scene.ground.points if x_limits[0] < x < x_limits[1]]
    x = np.array([x_limits[0], *bends, x_limits[1]])
    y = scene.ground.height(x)
    ax.fill_between(x, y_limits[0], y, color=style.GROUND_COLOUR, lw=0, zorder=3)
    ax.plot(x, y, color=style.GROUND_LINE, lw=1.0, zorder=3)
    for side, edge in zip(SIDES, x_limits, strict=True):
        wall = scene.domain.wall(side)
        if scene.domain.goes_on(side):
            far_boundary(ax, scene, side, edge, y_limits)
        elif not scene.domain.is_open(side):
            ax.plot(
                [wall, wall],
                [scene.ground.height(wall), y_limits[1]],
                color=style.GROUND_LINE,
                lw=1.4,
            )


def _draw_velocity(ax: Axes, scene: Scene, polygon: Sequence, velocity: tuple) -> None:
    if velocity == (0.0, 0.0):
        return
    centre = np.mean(polygon, axis=0)
    # 10 m/s at the large scale, or what is the same motion at another size, is drawn 24 m long.
    size = scene.domain.width / 240.0
    arrow = np.array(velocity) * 2.4 * np.sqrt(size)
    ax.annotate(
        "",
        xy=centre + arrow,
        xytext=centre,
        arrowprops={"arrowstyle": "-|>", "color": "black", "lw": 1.2, "shrinkA": 0, "shrinkB": 0},
        zorder=6,
    )


def _draw_points(ax: Axes, scene: Scene) -> None:
    points = fill(scene).position
    scale = ax.get_position().width * ax.figure.get_figwidth() * 72.0 / np.ptp(ax.get_xlim())
    size = (0.45 * scene.spacing * scale) ** 2
    ax.scatter(*points.T, s=size, c="black", lw=0, alpha=0.55, zorder=5, rasterized=True)


def label_place(shape: Shape) -> tuple[tuple[float, float], float, float]:
    """Where to write into a zone.

    Returns:
        The middle of its width at the height of its largest inscribed circle [m], the radius of
        that circle [m] and the width [m].
    """
    circle = maximum_inscribed_circle(shape)
    (x, y), radius = circle.coords[0], circle.length
    left, _, right, _ = shape.bounds
    chord = shape.intersection(LineString([(left - 1.0, y), (right + 1.0, y)]))
    for part in getattr(chord, "geoms", [chord]):
        if part.bounds[0] <= x <= part.bounds[2]:
            left, right = part.bounds[0], part.bounds[2]
    return (0.5 * (left + right), y), radius, right - left


def _label(ax: Axes, polygon: Sequence, lines: Sequence[str]) -> None:
    """Write into a zone as many of the lines as fit into it."""
    (x, y), radius, width = label_place(Shape(polygon))
    points_per_metre = (
        72.0 * ax.figure.get_figwidth() * ax.get_position().width / np.ptp(ax.get_xlim())
    )
    room = width * points_per_metre
    high = int(2.0 * radius * points_per_metre // (1.05 * LABEL_SIZE))
    shown = [line for line in lines if 0.52 * LABEL_SIZE * len(line) <= room][:high]
    ax.text(
        x,
        y,
        "\n".join(shown),
        ha="center",
        va="center",
        fontsize=LABEL_SIZE,
        linespacing=1.25,
        color=style.TEXT_COLOUR,
        path_effects=style.HALO,
        zorder=7,
        clip_on=True,
    )


def _strength(material: Material) -> str:
    if material.strength_ratio is not None:
        return f"Sᵣ/σ'ᵥ₀ {material.strength_ratio:.3g}"
    if material.liquefied:
        return f"Sᵣ {material.cohesion_kpa:.3g} kPa"
    if material.friction_deg == 0.0:
        return f"c {material.cohesion_kpa:.3g} kPa"
    if material.cohesion_kpa == 0.0:
        return f"φ {material.friction_deg:.3g}°"
    return f"φ {material.friction_deg:.3g}°, c {material.cohesion_kpa:.3g} kPa"


def _cohesion(material: Material) -> str:
    """Cohesion, or the ratio by which it follows the stress before failure."""
    if material.strength_ratio is None:
        return f"{material.cohesion_kpa:g}"
    return f"{material.strength_ratio:g} σ'ᵥ₀"


def _title(scene: Scene) -> str:
    if scene.origin is None:
        return scene.name
    return f"{scene.name} ({scene.origin.template})"


def _subtitle(scene: Scene) -> str:
    area = sum(abs(signed_area(zone.polygon)) for zone in scene.zones)
    water = f"water at {scene.water_level:g} m" if scene.has_water else "no water"
    return (
        f"{point_count(scene):,} material points at {scene.spacing:g} m, {area:,.0f} m², {water}, "
        f"base {scene.ground.contact.replace('_', ' ')}, walls {scene.domain.walls}"
    )


def _material_table(figure: Figure, scene: Scene, total: float) -> None:
    columns = (0.065, 0.10, 0.40, 0.50, 0.60, 0.70, 0.80)
    heads = ("", "material", "φ (°)", "c or Sᵣ (kPa)", "ρ (kg/m³)", "E (MPa)", "ν")
    step = 0.2 / total
    y = (0.2 * (len(scene.materials) + 1)) / total
    for x, head in zip(columns, heads, strict=True):
        figure.text(x, y, head, fontsize=style.SMALL, color="#555555", va="center")
    for name, material in scene.materials.items():
        y -= step
        figure.add_artist(
            Rectangle(
                (columns[0], y - 0.36 * step),
                0.022,
                0.72 * step,
                transform=figure.transFigure,
                facecolor=material_colour(material),
                edgecolor="#333333",
                linewidth=0.6,
                hatch="////" if material.liquefied else None,
            )
        )
        values = (
            name.replace("_", " ") + (" (liquefied)" if material.liquefied else ""),
            f"{material.friction_deg:g}",
            _cohesion(material),
            f"{material.density:g}",
            f"{material.youngs_modulus_mpa:g}",
            f"{material.poisson_ratio:g}",
        )
        for x, value in zip(columns[1:], values, strict=True):
            figure.text(x, y, value, fontsize=8, color=style.TEXT_COLOUR, va="center")


def _scale_bar(ax: Axes, scene: Scene) -> None:
    """A bar instead of axes with numbers, which a small picture has no room for."""
    ax.set(xticks=[], yticks=[])
    ax.spines[["left", "bottom"]].set_visible(False)
    length = 10.0 ** math.floor(math.log10(scene.domain.width / 4.0))
    length *= max(m for m in (1.0, 2.0, 5.0) if m * length <= scene.domain.width / 4.0)
    (left, right), (_, top) = ax.get_xlim(), ax.get_ylim()
    y, end = top - 0.02 * (right - left), right - 0.03 * (right - left)
    ax.plot([end - length, end], [y, y], color=style.TEXT_COLOUR, lw=1.2, zorder=8)
    label = f"{length:g} m"
    y -= 0.01 * (right - left)
    ax.text(end - 0.5 * length, y, label, fontsize=6.5, ha="center", va="top", zorder=8)


def _legend(figure: Figure) -> None:
    edge = {"edgecolor": "#333333", "linewidth": 0.6}
    handles = [
        Patch(facecolor=LIQUEFIED, hatch="//////", label="cohesion alone, liquefied", **edge),
        Patch(facecolor=FRICTIONAL[0], label="c up to 5 kPa, φ 20°", **edge),
        Patch(facecolor=FRICTIONAL[1], label="47°", **edge),
        Patch(facecolor=COHESIVE[0], label="c over 5 kPa, φ 20°", **edge),
        Patch(facecolor=COHESIVE[1], label="47°", **edge),
        Patch(
            facecolor=style.GROUND_COLOUR,
            edgecolor=style.GROUND_LINE,
            linewidth=0.6,
            label="rigid base",
        ),
        Patch(facecolor=style.WATER_COLOUR, linewidth=0, label="pool"),
        Line2D([], [], color=style.WATER_LINE, lw=1.1, ls=(0, (6, 2)), label="water table"),
        Line2D([], [], color="black", lw=1.2, marker=">", markersize=4, label="initial velocity"),
    ]
    style.legend(figure, handles, columns=len(handles), fontsize=7.5)
