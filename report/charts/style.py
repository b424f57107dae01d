"""How the charts of a report look: sizes, colours, words, files.

The colours follow Okabe and Ito (2008) and keep apart for every kind of colour vision; none of them
is the only bearer of a meaning. A chart is narrow, so that it can be read on a phone as well.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.files import atomic_path
from report.pictures.scene import TEXT_COLOUR

WIDTH = 5.8
"""Width of a chart [inches]."""
DPI = 130

OURS, CLASSICAL, OTHERS, HELD_OUT = "#0072b2", "#009e73", "#555555", "#d55e00"
PALE, LINE, NOTE = "#a9cbe2", "#d5dbe0", "#666666"

ROLE_COLOURS = {
    "fitted": OURS,
    "compared": CLASSICAL,
    "held out": HELD_OUT,
    "constructed": "#888888",
}
ROLE_MARKERS = {"fitted": "o", "compared": "s", "held out": "D", "constructed": "x"}

#: Deterministic files: no date, and names within an SVG that depend on what is drawn alone.
FIXED = {"svg.hashsalt": "flowslide", "svg.fonttype": "path"}


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty white figure [inches] that needs no screen."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: Path) -> Path:
    """Save a figure under its name when it is whole; the suffix chooses the format."""
    more = {"metadata": {"Date": None}} if path.suffix == ".svg" else {"dpi": DPI}
    with matplotlib.rc_context(FIXED), atomic_path(path) as temporary:
        figure.savefig(temporary, **more)
    return path


def words(text: str) -> str:
    """Text for a picture: S_r with its subscript; what else looks like a formula is shown as is."""
    return text.replace("$", r"\$").replace("S_r", "$S_r$")


def wrapped(text: str, width: int, lines: int = 3) -> str:
    """Text for a picture in lines of at most `width` characters; what does not fit is cut off."""
    found = textwrap.wrap(text, width)
    if len(found) > lines:
        found = [*found[: lines - 1], textwrap.shorten(" ".join(found[lines - 1 :]), width)]
    return words("\n".join(found))


def clean(ax: Axes, *, grid: str = "x", left: bool = False) -> None:
    """Take away the frame; leave a quiet grid along one axis."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines["left"].set_visible(left)
    ax.grid(axis=grid, color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=8.5, colors=TEXT_COLOUR, length=3 if left else 0)


def row_labels(ax: Axes, labels: list[str], *, width: int = 36, lines: int = 2) -> None:
    """Name the rows 0, 1, 2, ... of a chart, the first on top, in at most so many lines each."""
    shown = [wrapped(label, width, lines) for label in labels]
    ax.set_yticks(range(len(labels)), shown, fontsize=8.5, linespacing=1.0)
    for label, text in zip(ax.get_yticklabels(), shown, strict=True):
        label.set_fontsize(8.5 if "\n" not in text else 7.5)
    ax.tick_params(axis="y", length=0, labelcolor=TEXT_COLOUR)
    ax.set_ylim(len(labels) - 0.4, -0.6)
