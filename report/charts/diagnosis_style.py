"""How the charts of a diagnosis look: colours of models and effects, sizes, words.

The colours and the way of saving are those of the back-analysis. The model before is grey, the
model after is blue, held-out data are orange diamonds, errors of the survey are green, and the
worst stretch lies on yellow. Text is large enough for a phone.
"""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from report.charts.style import CLASSICAL, HELD_OUT, LINE, OURS, new_figure, wrapped
from report.pictures.scene import TEXT_COLOUR

WIDTH = 4.6
"""Width of a chart [inches]."""
TEXT, SMALL = 9.5, 8.5
"""Sizes of text [points]."""

BEFORE, AFTER, SURVEY = "#7a828a", OURS, CLASSICAL
WINDOW, NOISE = "#f7e463", "#222222"
PALE_BEFORE, PALE_AFTER = "#dde1e4", "#b9d6ea"
HELD_MARKER, FITTED_MARKER, CONSTRUCTED_MARKER = "D", "o", "x"

SIGNED = LinearSegmentedColormap.from_list("signed", [OURS, "#ffffff", HELD_OUT])
"""Blue: lower than; white: none; orange: higher than."""
ALIKE = LinearSegmentedColormap.from_list("alike", ["#ffffff", "#d3e3ef", OURS, "#00324f"])


def chart(
    heights: list[float],
    *,
    above: float,
    below: float,
    left: float,
    right: float = 0.15,
    foot: float = 0.0,
):
    """A figure with panels of these heights one below the other; lengths in inches.

    Args:
        heights: of the panels.
        above: room over each panel for its title.
        below: room under each panel for its axis.
        left: room for the labels.
        right: room at the right.
        foot: room at the foot of the figure, for a legend.

    Returns:
        The figure and its panels, from the top.
    """
    total = sum(heights) + len(heights) * (above + below) + foot
    figure = new_figure(total, WIDTH)
    top, panels = total, []
    for height in heights:
        top -= above + height
        box = (left / WIDTH, top / total, (WIDTH - left - right) / WIDTH, height / total)
        panels.append(figure.add_axes(box))
        top -= below
    return figure, panels


def quiet(ax: Axes, *, grid: str = "both", left: bool = True) -> None:
    """Take away the frame, leave a quiet grid; text in the size of these charts."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines["left"].set_visible(left)
    ax.spines[["left", "bottom"]].set_color("#888888")
    if grid:
        ax.grid(axis=grid, color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=SMALL, labelcolor=TEXT_COLOUR, length=3, color="#888888")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]))


def rows(ax: Axes, labels: list[str], *, width: int, lines: int = 2) -> None:
    """Name the rows 0, 1, 2, ... of a chart, the first on top."""
    shown = [wrapped(label, width, lines) for label in labels]
    ax.set_yticks(range(len(labels)), shown, fontsize=TEXT, linespacing=1.0)
    for tick, text in zip(ax.get_yticklabels(), shown, strict=True):
        tick.set_fontsize(TEXT if "\n" not in text else SMALL)
    ax.tick_params(axis="y", length=0, labelcolor=TEXT_COLOUR)
    ax.set_ylim(len(labels) - 0.45, -0.55)


def title(ax: Axes, text: str, *, colour: str = TEXT_COLOUR) -> None:
    """Head a panel, at its left end."""
    ax.set_title(text, loc="left", fontsize=TEXT, color=colour, fontweight="bold", pad=4)


def label_x(ax: Axes, text: str) -> None:
    """Name the horizontal axis."""
    ax.set_xlabel(text, fontsize=TEXT, color=TEXT_COLOUR, labelpad=3)


def label_y(ax: Axes, text: str) -> None:
    """Name the vertical axis."""
    ax.set_ylabel(text, fontsize=TEXT, color=TEXT_COLOUR, labelpad=3)


def legend(figure: Figure, handles: list, *, columns: int, y: float) -> None:
    """A line of marks and words across the foot of a figure, `y` inches above its edge."""
    figure.legend(
        handles=handles, loc="lower center", ncols=columns, fontsize=SMALL, frameon=False,
        bbox_to_anchor=(0.5, y / figure.get_figheight()), borderaxespad=0.0, handlelength=1.6,
        handletextpad=0.5, columnspacing=1.3, labelcolor=TEXT_COLOUR,
    )  # fmt: skip
