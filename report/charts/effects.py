"""Ranked effects: how far each should lower the misfit, and how far it did when refitted.

In: a `ReportData`. Out: a chart with a row for each candidate, the best score first. The scale is
that of z: chi² grows with its square, so a bar is as long as the score is high.
"""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from diagnosis.verdict.verdict import CandidateVerdict
from report.charts.diagnosis_style import (
    AFTER,
    PALE_AFTER,
    SMALL,
    SURVEY,
    chart,
    label_x,
    legend,
    quiet,
    rows,
)
from report.charts.style import LINE, NOTE, save_figure, words
from report.diagnosis.data import ReportData
from report.diagnosis.sentences import achieved, spoken
from report.numbers import chance, number, with_unit
from report.pictures.scene import HALO, TEXT_COLOUR

ROW, BELOW, LEFT, FOOT = 0.5, 0.52, 1.5, 0.5
MOST = 12
"""Candidates that are drawn; the table has all of them."""
PALE_SURVEY = "#b5dccf"
COUNTS = 6.0
"""Least fall of chi² that counts."""


def ranked(data: ReportData) -> list[CandidateVerdict]:
    """The candidates to draw: the best scores, and every one that was refitted."""
    scored = [c for c in data.candidates if c.expected_drop is not None]
    scored.sort(key=lambda c: (-c.expected_drop, -(c.z or 0.0)))
    kept = [c for n, c in enumerate(scored) if n < MOST or c.refit is not None]
    return kept[:16]


def draw_effects(data: ReportData, path: Path) -> Path | None:
    """Save the chart; None where no candidate was scored."""
    shown = ranked(data)
    if not shown:
        return None
    figure, (ax,) = chart([ROW * len(shown)], above=0.12, below=BELOW, left=LEFT, foot=FOOT)
    quiet(ax, grid="", left=False)
    rows(ax, [spoken(c.name) for c in shown], width=22)
    reach = max(4.0, *(_root(value) for c in shown for value in (c.expected_drop, achieved(c))))
    ax.set_xlim(0, 1.75 * reach)
    _ticks(ax, reach)
    ax.axvspan(0, _root(COUNTS), color=LINE, alpha=0.55, linewidth=0, zorder=0)
    for place, candidate in enumerate(shown):
        _draw_row(ax, place, candidate)
    label_x(ax, "fall of chi² (scale of its square root)")
    legend(figure, _handles(shown), columns=2, y=0.06)
    return save_figure(figure, path)


def _root(value: float | None) -> float:
    return math.sqrt(max(value or 0.0, 0.0))


def _ticks(ax: Axes, reach: float) -> None:
    """Falls of chi² at even distances of their roots, in round numbers."""
    step = next(s for s in (1, 2, 5, 10, 20, 50, 100, 1000) if reach / s <= 5)
    places = [step * k for k in range(int(reach / step) + 1)]
    ax.set_xticks(places, [number(place**2, 6) for place in places], fontsize=SMALL)
    for place in places:
        ax.axvline(place, color=LINE, linewidth=0.6, zorder=0)


def _draw_row(ax: Axes, place: int, candidate: CandidateVerdict) -> None:
    survey = candidate.kind == "survey"
    pale, dark = (PALE_SURVEY, SURVEY) if survey else (PALE_AFTER, AFTER)
    expected, fell = _root(candidate.expected_drop), _root(achieved(candidate))
    ax.barh(place, expected, height=0.62, color=pale, linewidth=0, zorder=2)
    if candidate.refit is not None:
        ax.barh(place, fell, height=0.26, color=dark, linewidth=0, zorder=3)
    first, second = _told(candidate)
    middle = 0.0 if not second else 0.19
    accepted = candidate.refit is not None and candidate.refit.accepted
    for text, shift, bold in ((first, -middle, accepted), (second, middle, False)):
        ax.annotate(words(text), (max(expected, fell), place + shift), xytext=(5, 0),
                    textcoords="offset points", va="center", fontsize=SMALL, path_effects=HALO,
                    color=TEXT_COLOUR if text == first and second else NOTE, zorder=5,
                    fontweight="bold" if bold else "normal")  # fmt: skip


def _told(candidate: CandidateVerdict) -> tuple[str, str]:
    """Amplitude and chance beside a bar."""
    refit = candidate.refit
    amplitude = refit.amplitude if refit is not None else candidate.amplitude_by_score
    first = "" if amplitude is None else with_unit(amplitude, candidate.unit, 2)
    if refit is not None and refit.accepted:
        first += "  accepted"
    second = "" if candidate.p_family is None else chance(candidate.p_family)
    if candidate.resolved is False:
        second += ", unresolved"
    if not candidate.expected_drop:
        return "makes it no better", ""
    return first, second


def _handles(shown: list[CandidateVerdict]) -> list[Patch]:
    made = [
        Patch(facecolor=PALE_AFTER, label="expected"),
        Patch(facecolor=AFTER, label="achieved when refitted"),
    ]
    if any(c.kind == "survey" for c in shown):
        made.append(Patch(facecolor=SURVEY, label="error of the survey"))
    made = made if any(c.refit for c in shown) else [made[0], *made[2:]]
    return [*made, Patch(facecolor=LINE, label=f"{COUNTS:g}: too little to count")]
