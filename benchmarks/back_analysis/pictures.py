"""Pictures of the validation: the way of the loss, equally good triples, twins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullLocator

from inversion.back_analysis.result import Result
from pipeline.files import atomic_path

if TYPE_CHECKING:
    from benchmarks.back_analysis.twins import Twin

STRENGTH_TICKS = (1, 2, 3, 5, 10, 20, 30, 50, 100)
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")


def history_picture(results: Mapping[str, Result], path: Path) -> None:
    """Loss and S_r by iteration, one line for each search; the paper's tolerance."""
    figure, (left, right) = _figure(9.0, 3.4)
    for (name, result), colour in zip(results.items(), COLOURS, strict=False):
        looks = [i for i in result.iterations if i.loss is not None and i.kind != "scan"]
        number = [i.iteration for i in looks]
        left.semilogy(number, [max(i.loss, 1e-4) for i in looks], "o-", color=colour, label=name)
        right.plot(number, [i.values["residual_strength_1"] for i in looks], "o-", color=colour,
                   label=name)  # fmt: skip
    left.axhline(0.1, color="#555555", linestyle="--", linewidth=1.0)
    left.text(0.02, 0.13, "0.1 m², the paper's tolerance", fontsize=8, color="#555555",
              transform=left.get_yaxis_transform())  # fmt: skip
    right.axhline(18.9, color="#555555", linestyle="--", linewidth=1.0)
    right.text(0.02, 19.1, "the paper's answer", fontsize=8, color="#555555",
               transform=right.get_yaxis_transform())  # fmt: skip
    _label(left, "iteration", "loss (m²)")
    _label(right, "iteration", "S_r of zone 1 (kPa)")
    for ax in (left, right):
        ax.xaxis.get_major_locator().set_params(integer=True)
        ax.legend(fontsize=8, frameon=False)
    _save(figure, path)


def triples_picture(results: Mapping[str, Result], path: Path) -> None:
    """The segments of equally good triples: zones 1 and 6 have the upstream toe between them."""
    figure, (left, right) = _figure(9.0, 3.6)
    names = [f"residual_strength_{zone}" for zone in (1, 2, 6)]
    for (name, result), colour in zip(results.items(), COLOURS, strict=False):
        answer = [parameter.value for parameter in result.answer.parameters]
        triples = [[stop.values[key] for key in names] for stop in result.answer.equally_good]
        line = np.array(sorted([*triples, answer]))
        for ax, other in ((left, 2), (right, 1)):
            ax.plot(line[:, 0], line[:, other], "o-", color=colour, markersize=4,
                    label=f"`{name}`: equally good".replace("`", ""))  # fmt: skip
            ax.plot(answer[0], answer[other], "D", color=colour, markersize=8)
    for ax, value in ((left, 4.0), (right, 4.6)):
        ax.plot(4.2, value, "*", color="#111111", markersize=12, label="the paper's triple")
        ax.set(xlim=(0, None), ylim=(0, None))
        ax.legend(fontsize=8, frameon=False)
    _label(left, "S_r of zone 1 (kPa)", "S_r of zone 6 (kPa)")
    _label(right, "S_r of zone 1 (kPa)", "S_r of zone 2 (kPa)")
    _save(figure, path)


def twins_picture(twins: Sequence[Twin], path: Path) -> None:
    """Found against true strength with two standard deviations, and the errors in theirs."""
    figure, (left, right) = _figure(9.0, 4.0)
    groups = list(dict.fromkeys(twin.group for twin in twins))
    for group, colour in zip(groups, COLOURS, strict=False):
        own = [twin for twin in twins if twin.group == group]
        true = np.array([twin.truth_kpa for twin in own])
        found = np.array([twin.answer_kpa for twin in own])
        std = np.array([twin.std_total for twin in own])
        lower = np.minimum(2 * std, 0.9 * found)
        left.errorbar(true, found, yerr=[lower, 2 * std], fmt="o", color=colour, markersize=4,
                      linewidth=1.0, label=group.replace("_", " "))  # fmt: skip
        away = np.clip([twin.in_std for twin in own], -6, 6)
        right.plot(away, 100 * (found / true - 1), "o", color=colour, markersize=5)
    ends = np.array([min(t.truth_kpa for t in twins) * 0.8, max(t.truth_kpa for t in twins) * 1.2])
    left.loglog(ends, ends, color="#555555", linewidth=0.8)
    left.set(xlim=ends, ylim=ends)
    for axis in (left.xaxis, left.yaxis):
        axis.set_major_locator(FixedLocator(STRENGTH_TICKS))
        axis.set_major_formatter(FormatStrFormatter("%g"))
        axis.set_minor_locator(NullLocator())
    left.legend(fontsize=8, frameon=False)
    right.axvspan(-2, 2, color="#dddddd", zorder=0)
    right.axhspan(-3, 3, color="#cfe8dd", zorder=0, alpha=0.6)
    _label(left, "true S_r (kPa)", "S_r found, ± 2 std (kPa)")
    _label(right, "error / standard deviation quoted", "error (%)")
    _save(figure, path)


def _figure(width: float, height: float) -> tuple[Figure, tuple[Axes, Axes]]:
    figure = Figure(figsize=(width, height), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    return figure, tuple(figure.subplots(1, 2))


def _label(ax: Axes, x: str, y: str) -> None:
    ax.set_xlabel(x, fontsize=9)
    ax.set_ylabel(y, fontsize=9)
    ax.tick_params(labelsize=8)
    ax.grid(color="#e5e5e5", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=150)
