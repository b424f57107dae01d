"""A far boundary in a picture: the ground goes on where the section was cut."""

from __future__ import annotations

from matplotlib.axes import Axes

from geometry.scenes.scene import Scene
from geometry.sides import Side
from report.style import GROUND_COLOUR, GROUND_LINE, SMALL


def far_boundary(
    ax: Axes, scene: Scene, side: Side, edge: float, y_limits: tuple[float, float]
) -> None:
    """Draw it.

    Args:
        ax: with the section in metres.
        scene: the section.
        side: of the boundary.
        edge: of the picture on that side, x [m].
        y_limits: of the picture [m].
    """
    wall = scene.domain.wall(side)
    top = max(y for zone in scene.zones for _, y in scene.at_end(zone, side))
    low = float(scene.ground.height(wall))
    ax.fill_betweenx(
        [low, top], wall, edge, facecolor="none", edgecolor=GROUND_COLOUR, hatch="///", lw=0
    )
    ax.plot([wall, wall], [low, top], color=GROUND_LINE, lw=1.2, ls=(0, (6, 2, 1.5, 2)), zorder=4)
    ax.text(
        wall,
        top + 0.02 * (y_limits[1] - y_limits[0]),
        "goes on",
        ha="left" if side == "left" else "right",
        va="bottom",
        fontsize=SMALL,
        color=GROUND_LINE,
        zorder=6,
    )
