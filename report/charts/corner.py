"""The corner plot of a posterior: unknowns alone and in pairs.

In: a document and its draws. Out: a PNG. The parameters, and the nuisances that move them most.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import gaussian_filter

from inversion.posterior.document import PosteriorDocument, UnknownAnswer
from inversion.posterior.draws import Draws
from pipeline.ties import ranked
from report import style
from report.numbers import unit_of

#: Most unknowns of a plot, and most nuisances next to the parameters.
MOST, MOST_NUISANCES = 7, 4
#: Probabilities of the regions, cells along a side of a panel, smoothing in cells.
REGIONS, CELLS, SMOOTH = (0.95, 0.8, 0.5), 40, 1.8
SHADES = ("#d3e3ef", "#7fb2d6", style.OURS)
SIDE, LEFT, BELOW, GAP, ABOVE = 1.25, 0.75, 0.65, 0.1, 0.3


def draw_corner(document: PosteriorDocument, draws: Draws, path: Path) -> Path:
    """Save the plot."""
    chosen = shown(document)
    n = len(chosen)
    side = max(SIDE, 3.6 / n)
    width = LEFT + n * side + (n - 1) * GAP + 0.15
    figure = style.new_figure(BELOW + n * side + (n - 1) * GAP + ABOVE, width)
    places = [document.unknowns.index(one) for one in chosen]
    ranges = [
        _range(draws.posterior[:, place], draws.prior[:, place], one.kind)
        for place, one in zip(places, chosen, strict=True)
    ]
    for row in range(n):
        for column in range(row + 1):
            ax = style.panel(
                figure,
                LEFT + column * (side + GAP),
                BELOW + (n - 1 - row) * (side + GAP),
                side,
                side,
            )
            style.quiet(ax, grid="")
            ax.set_xlim(*ranges[column])
            x = draws.posterior[:, places[column]]
            if row == column:
                _alone(ax, x, draws.prior[:, places[column]], ranges[column])
            else:
                ax.set_ylim(*ranges[row])
                _pair(ax, x, draws.posterior[:, places[row]], ranges[column], ranges[row])
                ax.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
            ax.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
            _name(ax, chosen, row, column)
    return style.save_figure(figure, path, dpi=150)


def shown(document: PosteriorDocument) -> list[UnknownAnswer]:
    """The parameters, then the nuisances with the largest shares."""
    most: dict[str, float] = {}
    for one in document.parameters:
        for share in one.sobol:
            most[share.name] = max(most.get(share.name, 0.0), share.total)
    nuisances = ranked(document.nuisances, lambda one: most.get(one.name, 0.0))
    room = max(min(MOST_NUISANCES, MOST - len(document.parameters)), 0)
    return [*document.parameters, *nuisances[:room]]


def _range(after: np.ndarray, before: np.ndarray, kind: str) -> tuple[float, float]:
    """Of an axis: the posterior, for a nuisance its prior as well, with room within the prior.

    The posterior may lie where the prior has no draws.
    """
    shown = (before, after) if kind == "nuisance" else (after,)
    low, high = style.span(*(np.percentile(draws, (0.3, 99.7)) for draws in shown))
    room = 0.08 * (high - low)
    begin, end = max(low - room, before.min()), min(high + room, before.max())
    return float(min(begin, low)), float(max(end, high))


def _alone(ax: Axes, after: np.ndarray, before: np.ndarray, limits: tuple[float, float]) -> None:
    cells = np.linspace(*limits, CELLS + 1)
    middle = 0.5 * (cells[1:] + cells[:-1])
    width = cells[1] - cells[0]

    def density(draws: np.ndarray) -> np.ndarray:
        counts = np.histogram(draws, cells)[0] / (len(draws) * width)
        return gaussian_filter(counts, SMOOTH, mode="nearest")

    ax.fill_between(middle, density(after), color=style.PALE, linewidth=0)
    ax.plot(middle, density(after), color=style.OURS, linewidth=1.2)
    ax.plot(middle, density(before), color=style.GREY, linewidth=1.0, linestyle=style.DASHED)
    ax.set_ylim(0, None)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    for place in np.percentile(after, (2.5, 97.5)):
        ax.axvline(place, color=style.OURS, linewidth=0.8, linestyle=":")


def _pair(
    ax: Axes, x: np.ndarray, y: np.ndarray, across: tuple[float, float], up: tuple[float, float]
) -> None:
    counts, columns, rows = np.histogram2d(x, y, CELLS, [across, up])
    density = gaussian_filter(counts.T, SMOOTH, mode="nearest")
    ordered = np.sort(density.ravel())[::-1]
    inside = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(inside, share)]) for share in REGIONS]
    levels = list(np.maximum.accumulate(np.array(levels) * (1.0 + 1e-9 * np.arange(len(levels)))))
    middle = [0.5 * (edges[1:] + edges[:-1]) for edges in (columns, rows)]
    top = max(float(density.max()), levels[-1]) * 1.001
    ax.contourf(*middle, density, [*levels, top], colors=SHADES)


def _name(ax: Axes, chosen: list[UnknownAnswer], row: int, column: int) -> None:
    last = len(chosen) - 1
    if row < last:
        ax.tick_params(labelbottom=False)
    else:
        ax.set_xlabel(_label(chosen[column]), fontsize=7, color=style.TEXT_COLOUR)
    if column > 0:
        ax.tick_params(labelleft=False)
    else:
        ax.set_ylabel(_label(chosen[row]), fontsize=7, color=style.TEXT_COLOUR)
    ax.tick_params(labelsize=7)


def _label(one: UnknownAnswer) -> str:
    return style.wrapped(f"{one.name} ({unit_of(one.unit)})".replace("_", " "), 22)
