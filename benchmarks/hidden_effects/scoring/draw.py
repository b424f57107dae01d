"""Pictures of a score: every figure, named over detectability, hidden against said, S_r."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.making.detectability import BINS
from benchmarks.hidden_effects.scoring.asked import ASKED, MISSED, Asked
from benchmarks.hidden_effects.scoring.calibration import LEVELS, Calibration, calibration
from benchmarks.hidden_effects.scoring.intervals import Share
from benchmarks.hidden_effects.scoring.score import Judged, Score
from report.style import (
    AFTER,
    ALIKE,
    BEFORE,
    HELD_OUT,
    LINE,
    OURS,
    PALE_AFTER,
    TEXT_COLOUR,
    new_figure,
    quiet,
    save_figure,
    wrapped,
)

NOTHING, UNKNOWN, SEVERAL = "nothing", "unknown", "several"
WIDTH = 7.0


def draw_all(folder: Path, method: Score, judged: Sequence[Judged]) -> list[Path]:
    """All pictures."""
    return [
        draw_asked(folder / "asked.png", ASKED, method.shares),
        detectability(folder / "detectability.png", method),
        confusion(folder / "confusion.png", judged),
        strength(folder / "strength.png", judged),
        reliability(folder / "calibration.png", calibration(judged)),
    ]


def draw_asked(path: Path, asked: Sequence[Asked], shares: Mapping[str, Share]) -> Path:
    """Every figure with its interval; the side on which it should lie is shaded."""
    known = [one for one in asked if shares[one.name].n]
    figure = new_figure(0.9 + 0.34 * len(known), WIDTH)
    height = figure.get_size_inches()[1]
    ax = figure.add_axes((0.5, 0.55 / height, 0.33, 0.34 * len(known) / height))
    for row, one in enumerate(known):
        share = shares[one.name]
        if one.limit is not None:
            ends = (100.0 * one.limit, 100.0) if one.least else (0.0, 100.0 * one.limit)
            ax.barh(row, ends[1] - ends[0], left=ends[0], height=0.86, color=PALE_AFTER)
        value, (low, high) = 100.0 * share.hits / share.n, share.interval
        met = one.verdict(share) != MISSED
        ax.hlines(row, 100.0 * low, 100.0 * high, color=OURS if met else HELD_OUT, linewidth=1.8)
        ax.plot(value, row, "o" if met else "D", color=OURS if met else HELD_OUT, markersize=5.5,
                clip_on=False)  # fmt: skip
        ax.text(103.0, row, f"{value:.0f} %, {share.hits} of {share.n}", va="center", fontsize=8,
                color=TEXT_COLOUR)  # fmt: skip
    labels = [wrapped(one.words, 48) for one in known]
    ax.set_yticks(range(len(known)), labels, fontsize=8)
    ax.set_ylim(len(known) - 0.5, -0.5)
    ax.set_xlim(0.0, 100.0)
    ax.set_xlabel("share and its 95 % interval [%]; shaded: asked for", fontsize=8.5,
                  color=TEXT_COLOUR)  # fmt: skip
    quiet(ax, grid="x")
    return save_figure(figure, path)


def detectability(path: Path, method: Score) -> Path:
    """Shares with intervals in every bin of lambda."""
    figure = new_figure(3.4, WIDTH)
    ax = figure.add_axes((0.1, 0.16, 0.87, 0.66))
    series = (
        ("alarm", "an alarm", BEFORE, "s"),
        ("named_or_set", "named, or look-alikes in a set of three", OURS, "o"),
        ("wrong_name", "a wrong name alone", HELD_OUT, "D"),
    )
    for place, (name, words, colour, marker) in enumerate(series):
        _points(ax, method.bins[name], 0.16 * (place - 1), colour, marker, words)
    ends = [f"{low:g} to {high:g}" for low, high in zip(BINS, BINS[1:], strict=False)]
    counts = [share.n for share in method.bins["alarm"]]
    labels = [f"{end}\n{n} cases" for end, n in zip(ends, counts, strict=True)]
    ax.set_xticks(range(len(ends)), labels, fontsize=8.5)
    ax.set_ylim(-3, 103)
    ax.set_ylabel("share of singles [%]", fontsize=9, color=TEXT_COLOUR)
    ax.set_xlabel("detectability lambda", fontsize=9, color=TEXT_COLOUR)
    quiet(ax, grid="y")
    figure.legend(loc="upper center", ncol=3, frameon=False, fontsize=8.5)
    return save_figure(figure, path)


def _points(ax, shares: Sequence[Share], shift: float, colour: str, marker: str, words: str):  # noqa: ANN001, ANN202
    known = [(k, share) for k, share in enumerate(shares) if share.n]
    x = np.array([k + shift for k, _ in known])
    y = np.array([100.0 * share.hits / share.n for _, share in known])
    ends = 100.0 * np.array([share.interval for _, share in known]).reshape(-1, 2)
    bars = np.abs(ends.T - y)
    ax.errorbar(x, y, yerr=bars, color=colour, marker=marker, linestyle="none", capsize=3,
                markersize=6, label=words)  # fmt: skip


def reliability(path: Path, found: Calibration) -> Path:
    """Levels of intervals and probabilities of explanations against how often they were so."""
    levels = [(LEVELS[level][0], share) for level, share in found.coverage.items()]
    stated = [(one.stated, one.right) for one in found.reliability if one.stated is not None]
    parts = (("level of the interval of S_r", "intervals that hold the truth", levels),
             ("stated probability", "explanations that are right", stated))  # fmt: skip
    known = [part for part in parts if any(share.n for _, share in part[2])]
    n = max(len(known), 1)
    figure = new_figure(3.4, 0.5 * WIDTH * n)
    for place, (across, up, points) in enumerate(known):
        ax = figure.add_axes(((0.18 + place) / n, 0.15, 0.78 / n, 0.8))
        ax.plot([0, 100], [0, 100], color=LINE, linewidth=1.2, zorder=1)
        for x, share in points:
            if share.n:
                low, high = (100.0 * end for end in share.interval)
                met = low <= 100.0 * x <= high
                colour = OURS if met else HELD_OUT
                ax.vlines(100.0 * x, low, high, color=colour, linewidth=1.8)
                ax.plot(100.0 * x, 100.0 * share.hits / share.n, "o" if met else "D",
                        color=colour, markersize=6)  # fmt: skip
        ax.set_xlim(-3, 103)
        ax.set_ylim(-3, 103)
        ax.set_xlabel(f"{across} [%]", fontsize=8.5, color=TEXT_COLOUR)
        ax.set_ylabel(f"{up} [%]", fontsize=8.5, color=TEXT_COLOUR)
        quiet(ax, grid="y")
    return save_figure(figure, path)


def confusion(path: Path, judged: Sequence[Judged]) -> Path:
    """Rows: what was hidden; columns: what was said; numbers: cases."""
    counts = Counter((_hidden(one), _said(one)) for one in judged)
    rows = sorted({row for row, _ in counts}, key=lambda name: (name == NOTHING, name))
    last = [NOTHING, SEVERAL, UNKNOWN]
    columns = [*sorted({column for _, column in counts} - set(last)), *last]
    matrix = np.array([[counts[row, column] for column in columns] for row in rows], dtype=float)
    figure = new_figure(2.0 + 0.25 * len(rows), WIDTH)
    height = figure.get_size_inches()[1]
    ax = figure.add_axes((0.26, 0.08 / height, 0.69, (0.25 * len(rows)) / height))
    shares = matrix / np.maximum(matrix.sum(axis=1, keepdims=True), 1.0)
    ax.imshow(shares, cmap=ALIKE, vmin=0.0, vmax=1.0, aspect="auto")
    for i, j in np.argwhere(matrix > 0):
        dark = shares[i, j] > 0.6
        ax.text(j, i, f"{matrix[i, j]:.0f}", ha="center", va="center", fontsize=8,
                color="white" if dark else TEXT_COLOUR)  # fmt: skip
    ax.set_yticks(range(len(rows)), rows, fontsize=8)
    ax.xaxis.tick_top()
    ax.set_xticks(range(len(columns)), columns, fontsize=8, rotation=60, ha="left")
    ax.tick_params(length=0, colors=TEXT_COLOUR)
    for spine in ax.spines.values():
        spine.set_color(LINE)
    return save_figure(figure, path)


def _hidden(one: Judged) -> str:
    if one.truth["kind"] == "pair":
        return "two effects"
    if one.truth["kind"] == "outside":
        return f"stranger: {min(one.hidden)}"
    return min(one.hidden, default=NOTHING)


def _said(one: Judged) -> str:
    if one.named is not None:
        return one.named
    if one.attributed:
        return SEVERAL
    return UNKNOWN if one.digest.verdict == "unknown_effect" else NOTHING


def strength(path: Path, judged: Sequence[Judged]) -> Path:
    """Error of S_r of the base model and of the final one, case by case."""
    right = [one for one in judged if one.right]
    figure = new_figure(3.6, WIDTH)
    ax = figure.add_axes((0.1, 0.14, 0.86, 0.76))
    if right:
        order = sorted(right, key=lambda one: one.strength_error("base"))
        x = np.arange(len(order))
        before, after = (
            np.array([100.0 * (np.exp(one.strength_error(stage)) - 1.0) for one in order])
            for stage in ("base", "final")
        )
        ax.vlines(x, before, after, color=LINE, linewidth=1.0)
        ax.plot(x, before, "s", color=BEFORE, markersize=4, label="base model")
        ax.plot(x, after, "o", color=AFTER, markersize=4.5, label="with the effect that was named")
        figure.legend(loc="upper center", ncol=2, frameon=False, fontsize=8.5)
    ax.axhline(0.0, color=TEXT_COLOUR, linewidth=0.8)
    ax.set_xticks([])
    ax.set_xlabel(f"{len(right)} cases whose effect was named", fontsize=9, color=TEXT_COLOUR)
    ax.set_ylabel("error of $S_r$ [%]", fontsize=9, color=TEXT_COLOUR)
    quiet(ax, grid="y")
    return save_figure(figure, path)
