"""The sections of a slide that nobody drew: what is stated leaves many, the measurements fewer.

In: a posterior and its draws. Out: a chart of outlines before and after the data, with what
liquefied, on equal scales.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from geometry.dimensions.family import FILL, LIQUEFIED, SectionFamily, Shape, shape_of
from inversion.posterior.document import PosteriorDocument
from inversion.posterior.draws import Draws
from report import style

#: Sections in a panel.
SHOWN = 40
LEFT, ABOVE = 0.55, 0.3


def draw_hidden_section(document: PosteriorDocument, draws: Draws, path: Path) -> Path | None:
    """Save the chart; None where the section was drawn."""
    if document.section is None:
        return None
    family = SectionFamily(document.section)
    panels = [
        (_shapes(document, family, values), heading, colour)
        for values, heading, colour in (
            (draws.prior, "before the data: all that is stated allows", style.GREY),
            (draws.posterior, "after the data", style.OURS),
        )
    ]
    every = [shape for shapes, *_ in panels for shape in shapes]
    right = max(x for shape in every for x, _ in shape.zones[FILL])
    top = 1.08 * max(shape.crest[2] for shape in every)
    toe = _toe(document)
    low, high = -1.05 * max(toe or 0.0, 0.05 * right), 1.03 * right
    height = (style.WIDTH - LEFT - 0.15) * top / (high - low)
    figure, axes = style.chart([height] * 2, left=LEFT, above=ABOVE, below=0.45)
    for ax, (shapes, heading, colour) in zip(axes, panels, strict=True):
        style.quiet(ax, grid="")
        for shape in shapes:
            _outline(ax, shape, colour)
        if toe is not None:
            ax.axvline(-toe, color=style.TEXT_COLOUR, linewidth=1.2)
        ax.set(xlim=(low, high), ylim=(0.0, top))
        style.title(ax, heading)
        style.labels(ax, "x (m)", "y (m)")
    return style.save_figure(figure, path)


def _shapes(document: PosteriorDocument, family: SectionFamily, draws: np.ndarray) -> list[Shape]:
    """Sections of some draws (s, q); a dimension that is not unknown keeps its median."""
    columns = {one.dimension: k for k, one in enumerate(document.unknowns) if one.dimension}
    medians = family.values({})
    return [
        shape_of(
            {**medians, **{key: float(row[k]) for key, k in columns.items()}},
            family.stated.slid_face,
        )
        for row in draws[:: max(len(draws) // SHOWN, 1)][:SHOWN]
    ]


def _outline(ax: Axes, shape: Shape, colour: str) -> None:
    liquefied, fill = (np.array(shape.zones[name]) for name in (LIQUEFIED, FILL))
    ax.fill(*liquefied.T, color=colour, alpha=1.5 / SHOWN, linewidth=0)
    for line in (liquefied, fill):
        ax.plot(*np.vstack([line, line[:1]]).T, color=colour, linewidth=0.5, alpha=0.35)


def _toe(document: PosteriorDocument) -> float | None:
    """The measured runout [m]; None: none was measured."""
    return next((one.measured for one in document.numbers if one.unit == "m"), None)
