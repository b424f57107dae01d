"""Which effects have similar signatures in these measurements: |cos| between each pair.

In: a `DiagnosisData`. Out: a triangle of cells, with similar effects next to each other.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.patches import Patch, Rectangle

from report import style
from report.data.diagnosis import DiagnosisData
from report.sentences.diagnosis import NOT_SEPARABLE, WEAKLY, shortened

LEFT, RIGHT, ABOVE, FOOT = 1.45, 1.15, 0.8, 0.35
#: Effects whose names have room.
MOST = 20
DARK, MIDDLE, LIGHT = "#003a5d", style.OURS, "#d9e6f0"


def most_alike(cosine: np.ndarray) -> list[int]:
    """Effects that have room, in their order: first those that look like another, (k, k) -> n."""
    alike = [place for place, row in enumerate(cosine) if np.sum(row >= WEAKLY) > 1]
    rest = [place for place in range(len(cosine)) if place not in alike]
    return sorted([*alike, *rest][:MOST])


def order(cosine: np.ndarray) -> list[int]:
    """Order of the effects that puts similar ones together (single linkage, (k, k) -> k)."""
    from scipy.cluster.hierarchy import leaves_list, linkage
    from scipy.spatial.distance import squareform

    apart = 1.0 - np.clip(np.abs(cosine), 0.0, 1.0)
    apart = 0.5 * (apart + apart.T)
    np.fill_diagonal(apart, 0.0)
    return [int(place) for place in leaves_list(linkage(squareform(apart), optimal_ordering=True))]


def draw_confounding(data: DiagnosisData, path: Path) -> Path | None:
    """Save the map; None where fewer than two effects can be compared."""
    found = data.confounding
    if found is None:
        return None
    cosine = np.abs(np.array(found.cosine))
    kept = np.array(most_alike(cosine))
    places = kept[order(cosine[np.ix_(kept, kept)])]
    cosine, names = cosine[np.ix_(places, places)], [shortened(found.names[p], 20) for p in places]
    count = len(names)
    cell = min(0.42, (style.WIDTH - LEFT - RIGHT) / (count - 1))
    height = cell * (count - 1)
    total = ABOVE + height + FOOT
    figure = style.new_figure(total)
    ax = style.panel(figure, LEFT, FOOT, height, height)
    ax.set(xlim=(0, count - 1), ylim=(count - 1, 0))
    ax.axis("off")
    for row in range(1, count):
        ax.text(
            -0.12,
            row - 0.5,
            style.words(names[row]),
            ha="right",
            va="center",
            fontsize=style.TEXT,
            color=style.TEXT_COLOUR,
        )
        for column in range(row):
            value = cosine[row, column]
            colour = DARK if value >= NOT_SEPARABLE else MIDDLE if value >= WEAKLY else LIGHT
            ax.add_patch(
                Rectangle(
                    (column + 0.03, row - 0.97),
                    0.94,
                    0.94,
                    facecolor=colour,
                    alpha=1.0 if value >= WEAKLY else 0.35 + 0.6 * value,
                    linewidth=0,
                )
            )
            if cell > (0.22 if value >= WEAKLY else 0.3):
                ax.text(
                    column + 0.5,
                    row - 0.5,
                    f"{value:.2f}".removeprefix("0"),
                    ha="center",
                    va="center",
                    fontsize=min(style.SMALL, 30 * cell),
                    color="white" if value >= WEAKLY else style.TEXT_COLOUR,
                )
    for column in range(count - 1):
        ax.text(
            column + 0.28,
            column - 0.08,
            style.words(names[column]),
            ha="left",
            va="bottom",
            fontsize=style.TEXT,
            color=style.TEXT_COLOUR,
            rotation=32,
            rotation_mode="anchor",
            clip_on=False,
        )
    dark = Patch(facecolor=DARK, label=f"{NOT_SEPARABLE:g} or more: not separable")
    middle = Patch(facecolor=MIDDLE, label=f"{WEAKLY:g} to {NOT_SEPARABLE:g}: weakly")
    style.legend(figure, [dark, middle], columns=2)
    return style.save_figure(figure, path)
