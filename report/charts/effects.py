"""Ranked effects: expected reduction of the misfit, and the reduction after refitting.

In: a `DiagnosisData`. Out: a chart with a row for each candidate, the best score first. The axis is
the square root of chi², so that the length of a bar is proportional to the score z.
"""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from diagnosis.verdict.verdict import CandidateVerdict
from pipeline import ties
from report import style
from report.data.diagnosis import DiagnosisData
from report.numbers import chance, number, with_unit
from report.sentences.diagnosis import achieved, spoken

ROW, LEFT, FOOT = 0.48, 1.5, 0.5
MOST = 12
"""Most candidates drawn; the table has all of them."""
PALE_ASSUMED = "#b5dccf"
COUNTS = 6.0
"""Smallest reduction of chi² that counts."""


def ranked(data: DiagnosisData) -> list[CandidateVerdict]:
    """The candidates to draw: the best scores, and all that were refitted."""
    scored = ties.ranked(
        (c for c in data.candidates if c.expected_drop is not None), lambda c: c.expected_drop
    )
    kept = [c for n, c in enumerate(scored) if n < MOST or c.refit is not None]
    return kept[:16]


def draw_effects(data: DiagnosisData, path: Path) -> Path | None:
    """Save the chart; None where no candidate was scored."""
    shown = ranked(data)
    if not shown:
        return None
    figure, (ax,) = style.chart([ROW * len(shown)], left=LEFT, foot=FOOT)
    style.quiet(ax, grid="", left=False)
    style.rows(ax, [spoken(c.name) for c in shown], width=22)
    reach = max(4.0, *(_root(value) for c in shown for value in (c.expected_drop, achieved(c))))
    ax.set_xlim(0, 1.75 * reach)
    _ticks(ax, reach)
    ax.axvspan(0, _root(COUNTS), color=style.LINE, alpha=0.55, linewidth=0, zorder=0)
    for place, candidate in enumerate(shown):
        _draw_row(ax, place, candidate)
    style.labels(ax, "reduction of chi² (square-root scale)")
    style.legend(figure, _handles(shown), columns=2)
    return style.save_figure(figure, path)


def _root(value: float | None) -> float:
    return math.sqrt(max(value or 0.0, 0.0))


def _ticks(ax: Axes, reach: float) -> None:
    """Round reductions of chi², evenly spaced on the square-root scale."""
    step = next(s for s in (1, 2, 5, 10, 20, 50, 100, 1000) if reach / s <= 5)
    places = [step * k for k in range(int(reach / step) + 1)]
    ax.set_xticks(places, [number(place**2, 6) for place in places], fontsize=style.SMALL)
    for place in places:
        ax.axvline(place, color=style.LINE, linewidth=0.6, zorder=0)


def _draw_row(ax: Axes, place: int, candidate: CandidateVerdict) -> None:
    assumed = candidate.family != "physics"
    pale, dark = (PALE_ASSUMED, style.ASSUMED) if assumed else (style.PALE_AFTER, style.AFTER)
    expected, fell = _root(candidate.expected_drop), _root(achieved(candidate))
    ax.barh(place, expected, height=0.62, color=pale, linewidth=0, zorder=2)
    if candidate.refit is not None:
        ax.barh(place, fell, height=0.26, color=dark, linewidth=0, zorder=3)
    first, second = _remarks(candidate)
    middle = 0.0 if not second else 0.19
    accepted = candidate.refit is not None and candidate.refit.accepted
    for text, shift, bold in ((first, -middle, accepted), (second, middle, False)):
        style.tell(
            ax,
            max(expected, fell),
            place + shift,
            style.words(text),
            color=style.TEXT_COLOUR if text == first and second else style.NOTE,
            fontweight="bold" if bold else "normal",
        )


def _remarks(candidate: CandidateVerdict) -> tuple[str, str]:
    """Amplitude and significance next to a bar."""
    refit = candidate.refit
    amplitude = refit.amplitude if refit is not None else candidate.amplitude_by_score
    first = "" if amplitude is None else with_unit(amplitude, candidate.unit, 2)
    if refit is not None and refit.accepted:
        first += "  accepted"
    second = "" if candidate.p_family is None else chance(candidate.p_family)
    if candidate.resolved is False:
        second += ", unresolved"
    if not candidate.expected_drop:
        return "no improvement", ""
    return first, second


def _handles(shown: list[CandidateVerdict]) -> list[Patch]:
    made = [
        Patch(facecolor=style.PALE_AFTER, label="expected"),
        Patch(facecolor=style.AFTER, label="achieved when refitted"),
    ]
    if any(c.family != "physics" for c in shown):
        made.append(Patch(facecolor=style.ASSUMED, label="another assumption"))
    made = made if any(c.refit for c in shown) else [made[0], *made[2:]]
    return [*made, Patch(facecolor=style.LINE, label=f"{COUNTS:g}: too little to count")]
