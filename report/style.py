"""How every chart and picture looks: sizes, colours, axes, labels, files.

The colours follow Okabe and Ito (2008) and stay apart for every kind of colour vision; colour is
never the only carrier of a meaning. Charts are narrow, so that they can be read on a phone. The
base model is grey, the answer blue, held-out data are orange diamonds, other assumptions are green.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from matplotlib.text import Annotation
from matplotlib.ticker import AutoLocator, MaxNLocator

from pipeline.cli import InputError
from pipeline.files import atomic_path

WIDTH = 5.2
"""Width of a chart [inches]."""
TEXT, SMALL = 9.0, 8.0
"""Sizes of text [points]."""
DPI = 130
SUFFIXES = (".png", ".svg", ".pdf")

TEXT_COLOUR, NOTE, GREY, LINE = "#222222", "#666666", "#888888", "#d5dbe0"
OURS, CLASSICAL, OTHERS, HELD_OUT = "#0072b2", "#009e73", "#555555", "#d55e00"
BEFORE, AFTER, ASSUMED = "#7a828a", OURS, CLASSICAL
PALE, PALE_BEFORE, PALE_AFTER = "#a9cbe2", "#dde1e4", "#b9d6ea"
WINDOW = "#f7e463"
GROUND_COLOUR, GROUND_LINE = "#a39b8f", "#4d4842"
WATER_COLOUR, WATER_LINE = "#d3e6f5", "#2a6fa8"

ROLES = {
    "fitted": ("o", OURS),
    "compared": ("s", CLASSICAL),
    "held out": ("D", HELD_OUT),
    "constructed": ("x", GREY),
}
"""Mark and colour of a measured number by its role."""

SIGNED = LinearSegmentedColormap.from_list("signed", [OURS, "#ffffff", HELD_OUT])
"""Blue: lower than; white: none; orange: higher than."""
ALIKE = LinearSegmentedColormap.from_list("alike", ["#ffffff", "#d3e3ef", OURS, "#00324f"])

if not Path(matplotlib.matplotlib_fname()).is_absolute():
    matplotlib.rcdefaults()  # it has read a file `matplotlibrc` of the folder one stands in

#: Thin lines and text must be seen on dark points and on white.
HALO = [Stroke(linewidth=2.3, foreground="white", alpha=0.8), Normal()]
DASHED = (0, (4, 2))

#: Deterministic files: no date, and names within an SVG that depend only on what is drawn.
FIXED = {"svg.hashsalt": "flowslide", "svg.fonttype": "path", "hatch.linewidth": 0.5}


def new_figure(height: float, width: float = WIDTH, **more: Any) -> Figure:
    """An empty white figure [inches] that needs no screen."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white", **more)
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: str | Path, *, dpi: int = DPI) -> Path:
    """Save a figure; the file appears under its name when it is complete.

    Raises:
        InputError: the suffix is not one of `SUFFIXES`.
    """
    path = check_suffix(path)
    more: dict[str, Any] = {"metadata": {"Date": None}} if path.suffix.lower() == ".svg" else {}
    with matplotlib.rc_context(FIXED), atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi, **more)
    return path


def check_suffix(path: str | Path, suffixes: Sequence[str] = SUFFIXES) -> Path:
    """The path, if its suffix is one of these; else an `InputError`."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: suffix {path.suffix!r}; allowed are {', '.join(suffixes)}")
    return path


def chart(
    heights: Sequence[float],
    *,
    left: float,
    above: float = 0.1,
    below: float = 0.5,
    right: float = 0.15,
    foot: float = 0.0,
) -> tuple[Figure, list[Axes]]:
    """A figure with panels of these heights one below the other; lengths in inches.

    Args:
        heights: of the panels.
        left: room for the labels.
        above: room above each panel for its title.
        below: room under each panel for its axis.
        right: room at the right.
        foot: room at the foot of the figure, for a legend.
    """
    total = sum(heights) + len(heights) * (above + below) + foot
    figure = new_figure(total)
    top, panels = total, []
    for height in heights:
        top -= above + height
        panels.append(panel(figure, left, top, WIDTH - left - right, height))
        top -= below
    return figure, panels


def panel(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place of the figure given in inches."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))


def quiet(ax: Axes, *, grid: str = "both", left: bool = True) -> None:
    """Remove the frame and leave a quiet grid along `grid` (x, y, both or empty)."""
    tidy(ax)
    ax.spines["left"].set_visible(left)
    ax.spines[["left", "bottom"]].set_color(GREY)
    if grid:
        ax.grid(axis=grid, color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(length=3, color=GREY)
    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_locator(), AutoLocator):
            axis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 5, 10]))


def tidy(ax: Axes) -> None:
    """Small numbers, no frame above and on the right."""
    ax.tick_params(labelsize=SMALL, labelcolor=TEXT_COLOUR)
    ax.spines[["top", "right"]].set_visible(False)


def over_row(ax: Axes, place: float, words: str, colour: str) -> None:
    """Words over what is drawn in a row, at the left edge of the panel."""
    ax.text(
        0.01,
        place - 0.27,
        words,
        fontsize=SMALL,
        color=colour,
        va="center",
        transform=ax.get_yaxis_transform(),
        path_effects=HALO,
        zorder=4,
    )


def rows(ax: Axes, labels: Sequence[str], *, width: int, lines: int = 2) -> None:
    """Name the rows 0, 1, 2, ... of a chart, the first on top, each in at most `lines` lines."""
    shown = [wrapped(label, width, lines) for label in labels]
    ax.set_yticks(range(len(labels)), shown, fontsize=TEXT, linespacing=1.0)
    for tick, text in zip(ax.get_yticklabels(), shown, strict=True):
        tick.set_fontsize(TEXT if "\n" not in text else SMALL)
    ax.tick_params(axis="y", length=0, labelcolor=TEXT_COLOUR)
    ax.set_ylim(len(labels) - 0.42, -0.58)


def span(*values: np.ndarray | Sequence[float]) -> tuple[float, float]:
    """Ends of an axis that shows all finite values, never at the same place."""
    known = np.concatenate([np.ravel(np.asarray(one, dtype=float)) for one in values])
    known = known[np.isfinite(known)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
    room = max(1e-6 * max(abs(low), abs(high)), 1e-9) if high - low <= 0.0 else 0.0
    return float(low - room), float(high + room)


def title(ax: Axes, text: str, *, colour: str = TEXT_COLOUR, **more: Any) -> None:
    """Head a panel, at its left end."""
    style = {"loc": "left", "fontsize": TEXT, "color": colour, "fontweight": "bold", "pad": 4}
    ax.set_title(text, **{**style, **more})


def labels(ax: Axes, x: str = "", y: str = "") -> None:
    """Name the axes."""
    ax.set_xlabel(x, fontsize=TEXT, color=TEXT_COLOUR, labelpad=3)
    ax.set_ylabel(y, fontsize=TEXT, color=TEXT_COLOUR, labelpad=3)


def tell(
    ax: Axes, x: float, y: float, text: str, *, away: tuple[float, float] = (5, 0), **more: Any
) -> Annotation:
    """Write `text` next to (x, y), `away` points from it; to the left of it if that is negative."""
    style: dict[str, Any] = {
        "ha": "right" if away[0] < 0 else "left" if away[0] > 0 else "center",
        "va": "center" if not away[1] else "bottom" if away[1] > 0 else "top",
        "fontsize": SMALL,
        "color": TEXT_COLOUR,
        "zorder": 6,
        "annotation_clip": False,
    }
    return ax.annotate(
        text, (x, y), xytext=away, textcoords="offset points", path_effects=HALO, **style | more
    )


def apart(places: Sequence[float], least: float, most: float = float("inf")) -> list[float]:
    """Places of labels moved up until neighbours are `least` apart; all down again from `most`."""
    moved, last = list(places), -float("inf")
    for number in sorted(range(len(moved)), key=places.__getitem__):
        last = moved[number] = max(moved[number], last + least)
    excess = max(last - most, 0.0)
    return [place - excess for place in moved]


def legend(
    figure: Figure, handles: Sequence[Artist], *, columns: int, y: float = 0.06, **more: Any
) -> None:
    """Marks and words across the foot of a figure, `y` inches above its edge."""
    style: dict[str, Any] = {
        "loc": "lower center",
        "ncols": columns,
        "fontsize": SMALL,
        "frameon": False,
        "bbox_to_anchor": (0.5, y / figure.get_figheight()),
        "borderaxespad": 0.0,
        "borderpad": 0.0,
        "handlelength": 1.6,
        "handletextpad": 0.5,
        "columnspacing": 1.3,
        "labelcolor": TEXT_COLOUR,
    }
    figure.legend(handles=list(handles), **style | more)


def words(text: str) -> str:
    """Text for a picture: S_r with its subscript; anything else that looks like a formula as is."""
    return text.replace("$", r"\$").replace("S_r", "$S_r$")


def wrapped(text: str, width: int, lines: int = 3) -> str:
    """Text for a picture in lines of at most `width` characters; what does not fit is cut off."""
    found = textwrap.wrap(text, width)
    if len(found) > lines:
        found = [*found[: lines - 1], textwrap.shorten(" ".join(found[lines - 1 :]), width)]
    return words("\n".join(found))
