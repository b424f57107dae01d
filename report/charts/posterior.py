"""Charts of a posterior: numbers before and after, unknowns before and after, shares.

In: a document and its draws. Out: three charts.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from scipy.ndimage import gaussian_filter1d

from inversion.posterior.document import PosteriorDocument, PredictedNumber, UnknownAnswer
from inversion.posterior.draws import Draws, key
from report import style
from report.numbers import unit_of
from report.tables.posterior import LEAST_SHARE, named

ROW, HEIGHT, CELLS = 0.3, 0.75, 120
#: Most measured numbers that have a panel; a profile's are many.
MOST_NUMBERS = 10


def draw_predicted(document: PosteriorDocument, draws: Draws, path: Path) -> Path | None:
    """Save the distribution of each measured number; None where there is none."""
    chosen = [one for one in named(document) if one.role != "constructed"][:MOST_NUMBERS]
    if not chosen:
        return None
    figure, axes = style.chart([HEIGHT] * len(chosen), left=0.2, above=0.26, below=0.42)
    for ax, one in zip(axes, chosen, strict=True):
        place = draws.numbers.index(key(one.name))
        _number(ax, one, draws.prior_predictive[:, place], draws.posterior_predictive[:, place])
    return style.save_figure(figure, path)


def _number(ax: Axes, one: PredictedNumber, before: np.ndarray, after: np.ndarray) -> None:
    style.quiet(ax, grid="x", left=False)
    stated = (one.measured - 2 * one.std, one.measured + 2 * one.std)
    ends = style.span(np.percentile(after, (0.2, 99.8)), np.percentile(before, (5, 95)), stated)
    cells = np.linspace(*ends, CELLS + 1)
    middle = 0.5 * (cells[1:] + cells[:-1])
    _, colour = style.ROLES[one.role]
    for draws, line, fill in ((before, style.GREY, style.PALE_BEFORE), (after, colour, colour)):
        counts = np.histogram(draws, cells)[0] / len(draws)
        density = gaussian_filter1d(counts, 2.0, mode="nearest")
        ax.fill_between(middle, density / density.max(), color=fill, alpha=0.45, linewidth=0)
        ax.plot(middle, density / density.max(), color=line, linewidth=1.0)
    if one.censored:
        ax.axvspan(cells[0], one.measured, color=style.LINE, alpha=0.5, linewidth=0, zorder=0)
    else:
        ax.axvspan(
            one.measured - one.std,
            one.measured + one.std,
            color=style.WINDOW,
            alpha=0.45,
            linewidth=0,
            zorder=0,
        )
    ax.axvline(one.measured, color=style.TEXT_COLOUR, linewidth=1.4)
    ax.set(xlim=(cells[0], cells[-1]), ylim=(0, 1.08))
    ax.set_yticks([])
    style.title(ax, f"{one.name} ({unit_of(one.unit)}), {one.role}")


def draw_before_after(document: PosteriorDocument, path: Path) -> Path:
    """Save 95 % of every unknown before and after, on the scale of what was known before."""
    unknowns = document.unknowns
    figure, (ax,) = style.chart([ROW * len(unknowns)], left=2.45, below=0.5)
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, [one.label for one in unknowns], width=36)
    for row, one in enumerate(unknowns):
        colour = style.OURS if one.kind == "parameter" else style.CLASSICAL
        low, high, _ = _ends(one, before=True)
        ax.barh(row, high - low, left=low, height=0.62, color=style.PALE_BEFORE, linewidth=0)
        low, high, median = _ends(one, before=False)
        ax.barh(row, high - low, left=low, height=0.26, color=colour, linewidth=0)
        ax.plot([median] * 2, [row - 0.22, row + 0.22], color=style.TEXT_COLOUR, linewidth=1.4)
    style.labels(ax, "standard deviations of what was known before")
    return style.save_figure(figure, path)


def _ends(one: UnknownAnswer, *, before: bool) -> tuple[float, float, float]:
    """95 % interval and median in standard deviations of the prior about its mean."""
    spread = one.before if before else one.after
    return tuple(
        (value - one.before.mean) / one.before.std for value in (*spread.interval_95, spread.median)
    )


def draw_shares(document: PosteriorDocument, path: Path) -> Path | None:
    """Save the shares of each parameter's variance; None where there are none."""
    shown = [
        (one, [s for s in one.sobol if max(s.first, s.total) >= LEAST_SHARE])
        for one in document.parameters
    ]
    shown = [(one, inputs) for one, inputs in shown if inputs]
    if not shown:
        return None
    heights = [ROW * len(inputs) for _, inputs in shown]
    figure, axes = style.chart(heights, left=2.45, above=0.3, below=0.45)
    for ax, (one, inputs) in zip(axes, shown, strict=True):
        style.quiet(ax, grid="x", left=False)
        style.rows(ax, [share.name for share in inputs], width=36)
        for row, share in enumerate(inputs):
            ax.barh(row, 100 * share.total, height=0.62, color=style.PALE, linewidth=0)
            ax.barh(row, 100 * share.first, height=0.26, color=style.OURS, linewidth=0)
        ax.set_xlim(0, 100)
        style.title(ax, style.words(one.label))
        style.labels(ax, "share of the posterior variance (%)")
    return style.save_figure(figure, path)
