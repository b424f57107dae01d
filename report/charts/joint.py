"""Charts of a relation over several slides: every slide with the relation; ratio against N1,60.

In: a `JointDocument`. Out: two charts. What is recalled is hollow.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from inversion.catalogue.correlations import RELATIONS
from inversion.joint.document import JointDocument, SlideRow
from report import style

ROW = 0.34
ENDS = (0.02, 1.0)
#: Lower ends of the axis of the ratio; a slide known by a few numbers may reach far down.
LOWER_ENDS = (0.001, 0.002, 0.005, 0.01, 0.02)
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
LINE_COLOURS = ("#0072b2", "#009e73", "#56b4a0", "#8a5a00", "#cc79a7")
#: Stress at which relations that differ with it are drawn [kPa].
STRESS_KPA = 100.0
MOST_COUNT = 25.0


def draw_slides(document: JointDocument, path: Path) -> Path:
    """Save the ratios of all slides next to the relation and to what others found."""
    lower, upper = _secondary(document)
    others = [
        ("relation: median", document.relation.median.interval_95, document.relation.median.median),
        ("a dam without a slide", document.ratio.interval_95, document.ratio.median),
        ("before the slides: median", document.before.median.interval_95, None),
        (
            f"{document.secondary.slides} ranges, secondary source",
            (lower, upper),
            document.secondary.geometric_mean,
        ),
    ]
    named = [row.title for row in document.slides] + [name for name, _, _ in others]
    figure, (ax,) = style.chart([ROW * len(named)], left=1.85, below=0.5, foot=0.55)
    least = _ratio_axis(ax, document)
    style.rows(ax, named, width=27)
    ax.axvspan(*document.relation.median.interval_95, color=style.PALE, alpha=0.35, linewidth=0)
    for place, row in enumerate(document.slides):
        _slide(ax, place, row, least)
        for author in (one for one in document.authors if one.case == row.case):
            face = "white" if author.recalled else style.OTHERS
            ax.plot(author.ratio, place + 0.3, "o", color=style.OTHERS, mfc=face, markersize=3.5)
    for place, (_, (low, high), middle) in enumerate(others, start=len(document.slides)):
        colour = style.OURS if place < len(document.slides) + 2 else style.GREY
        ax.plot([low, high], [place, place], color=colour, linewidth=5, solid_capstyle="butt")
        if middle is not None:
            ax.plot(middle, place, "|", color=style.TEXT_COLOUR, markersize=11, markeredgewidth=1.6)
    dot = {"linestyle": "none", "marker": "o", "color": style.OTHERS, "markersize": 3.5}
    style.legend(
        figure,
        [
            Patch(color=style.PALE_BEFORE, label="slide alone, 95 %"),
            Patch(color=style.HELD_OUT, label="with the others"),
            Line2D([], [], **dot, label="by others"),
            Line2D([], [], **dot, markerfacecolor="white", label="partly recalled"),
        ],
        columns=2,
    )
    return style.save_figure(figure, path)


def draw_blow_counts(document: JointDocument, path: Path) -> Path:
    """Save ratio against N1,60 with the relation and published ones."""
    figure, (ax,) = style.chart([2.7], left=0.6, above=0.1, below=0.5, foot=0.95)
    style.quiet(ax)
    ax.set_yscale("log")
    ax.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
    ax.minorticks_off()
    ax.axhspan(*document.ratio.interval_95, color=style.PALE_BEFORE, alpha=0.6, linewidth=0)
    ax.axhspan(*document.relation.median.interval_95, color=style.PALE, alpha=0.7, linewidth=0)
    ax.axhline(document.secondary.geometric_mean, color=style.GREY, linestyle=style.DASHED)
    handles: list[Line2D | Patch] = []
    for colour, relation in zip(LINE_COLOURS, RELATIONS.values(), strict=True):
        counts = np.linspace(0.5, relation.largest or MOST_COUNT, 60)
        ratios = [relation.strength(count, STRESS_KPA) / STRESS_KPA for count in counts]
        ax.plot(counts, ratios, color=colour, linewidth=1.2)
        handles.append(Line2D([], [], color=colour, label=relation.label))
    for row in document.slides:
        if row.n1_60 is not None and row.tells:
            _mark(ax, row)
    handles += [
        Patch(color=style.PALE, label="median of the relation, 95 %"),
        Patch(color=style.PALE_BEFORE, label="a dam without a slide, 95 %"),
        Line2D([], [], color=style.GREY, linestyle=style.DASHED, label="ranges, secondary"),
    ]
    ax.set(xlim=(0.0, MOST_COUNT), ylim=ENDS)
    style.labels(ax, f"N1,60 (relations at {STRESS_KPA:g} kPa)", style.words("S_r/σ'_v0"))
    style.legend(figure, handles, columns=2)
    return style.save_figure(figure, path)


def _ratio_axis(ax: Axes, document: JointDocument) -> float:
    """Set the axis of the ratio; its lower end, which every interval of 95 % has within."""
    told = [row.ratio_95[0] for row in document.slides if row.tells]
    lowest = min([*told, document.ratio.interval_95[0], ENDS[0]])
    least = max((end for end in LOWER_ENDS if end <= lowest), default=LOWER_ENDS[0])
    ticks = [tick for tick in (*LOWER_ENDS[:-1], *TICKS) if tick >= least]
    style.quiet(ax, grid="x", left=False)
    ax.set_xscale("log")
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.set_xlim(least, ENDS[1])
    style.labels(ax, style.words("S_r/σ'_v0"))
    return least


def _slide(ax: Axes, place: int, row: SlideRow, least: float) -> None:
    if not row.tells:
        words = "recalled" if row.kind == "recalled" else "not determined"
        style.tell(ax, least, place, words)
        return
    low, high = row.ratio_95
    ax.barh(place, high - low, left=low, height=0.5, color=style.PALE_BEFORE, linewidth=0)
    if row.after is not None:
        ax.plot(row.after.interval_95, [place, place], color=style.HELD_OUT, linewidth=2.2)
    mark = ">" if row.kind == "bound" else "|"
    ax.plot(row.ratio, place, mark, color=style.TEXT_COLOUR, markersize=8, markeredgewidth=1.4)


def _mark(ax: Axes, row: SlideRow) -> None:
    count = 0.0 if row.n1_60 is None else row.n1_60
    face = "white" if row.n1_60_recalled else style.HELD_OUT
    mark = "^" if row.kind == "bound" else "o"
    ax.plot([count, count], row.ratio_95, color=style.HELD_OUT, linewidth=1.2, zorder=4)
    ax.plot(count, row.ratio, mark, color=style.HELD_OUT, mfc=face, markersize=6, zorder=5)
    side = 1 if count < 0.6 * MOST_COUNT else -1
    style.tell(ax, count, row.ratio, row.title, away=(6 * side, 3))


def _secondary(document: JointDocument) -> tuple[float, float]:
    """95 % of a lognormal through the secondary ranges."""
    one = document.secondary
    far = math.exp(1.96 * one.log_std)
    return one.geometric_mean / far, one.geometric_mean * far
