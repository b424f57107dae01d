"""How far an undetected effect could shift the calibrated parameters.

In: a `DiagnosisData`. Out: a chart of the shift by each effect just too weak to be detected.
"""

from __future__ import annotations

from pathlib import Path

from diagnosis.verdict.verdict import ParameterWords
from pipeline.ties import ranked
from report import style
from report.data.diagnosis import DiagnosisData
from report.numbers import signed_percent
from report.sentences.diagnosis import spoken

ABOVE, LEFT, ROW = 0.32, 1.5, 0.3
MOST, LEAST_PERCENT = 12, 0.5


def hidden_bars(data: DiagnosisData, name: str) -> list[tuple[str, float]]:
    """(effect, change [%]) of a parameter, the largest first; negligible ones are left out."""
    found = ranked(data.hidden.get(name, {}).items(), lambda item: abs(item[1]))
    return [item for item in found if abs(item[1]) >= LEAST_PERCENT][:MOST]


def _sure(data: DiagnosisData, name: str) -> float:
    """Two standard deviations of a parameter [%]."""
    value = data.base.values[name]
    return 100 * 2 * data.base.std.get(name, 0.0) / abs(value) if value else 0.0


def _matters(data: DiagnosisData, p: ParameterWords, bars: list[tuple[str, float]]) -> bool:
    return any(abs(change) > _sure(data, p.name) for _, change in bars)


def draw_hidden(data: DiagnosisData, path: Path) -> Path | None:
    """Save the shifts that undetected effects could cause; None where there are none."""
    shown = [(p, hidden_bars(data, p.name)) for p in data.parameters]
    shown = [(p, bars) for p, bars in shown if bars and (p.strength or _matters(data, p, bars))]
    if not shown:
        return None
    assumed = {c.name for c in data.candidates if c.family != "physics"}
    figure, panels = style.chart([ROW * len(bars) for _, bars in shown], above=ABOVE, left=LEFT)
    for ax, (parameter, bars) in zip(panels, shown, strict=True):
        style.quiet(ax, grid="x", left=False)
        style.rows(ax, [spoken(name) for name, _ in bars], width=20)
        sure = _sure(data, parameter.name)
        ax.axvspan(-sure, sure, color=style.LINE, alpha=0.7, linewidth=0, zorder=0)
        ax.axvline(0, color=style.TEXT_COLOUR, linewidth=0.9, zorder=4)
        for place, (name, change) in enumerate(bars):
            colour = (
                style.ASSUMED
                if name in assumed
                else style.PALE_AFTER
                if abs(change) < sure
                else style.AFTER
            )
            ax.barh(place, change, height=0.6, linewidth=0, zorder=3, color=colour)
            style.tell(ax, change, place, signed_percent(change), away=(4 if change > 0 else -4, 0))
        reach = max(sure, *(abs(change) for _, change in bars))
        ax.set_xlim(-1.45 * reach, 1.45 * reach)
        style.title(ax, style.wrapped(parameter.words, 36, 1))
        style.labels(ax, "undetected shift, % (shaded: ± 2 std)")
    return style.save_figure(figure, path)
