"""The strength curve of an unknown effect: what the strength would have to depend on, and how.

In: a `verdict.UnknownCurve`. Out: the multiplier of the strength with its band, and the misfit of
the curves over other variables.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.ticker import FuncFormatter, NullFormatter

from diagnosis.verdict.verdict import UnknownCurve
from pipeline.ties import ranked
from report import style
from report.numbers import number, signed
from report.sentences.diagnosis import spoken

HEIGHT, ROW, LEFT = 2.3, 0.32, 0.65
LOGARITHM = "log10 of "
WIDE = 30.0
"""Ratio of the outer knots from which on the variable has a logarithmic axis."""


def plain_knots(curve: UnknownCurve) -> tuple[list[float], str]:
    """Places of the knots and their unit; a variable that is a logarithm as what it is of."""
    if curve.unit.startswith(LOGARITHM):
        return [10.0**knot for knot in curve.knots], curve.unit.removeprefix(LOGARITHM)
    return curve.knots, curve.unit


def draw_curve(curve: UnknownCurve, path: Path) -> Path:
    """Save the curve."""
    gain = curve.ln_evidence
    others = ranked(curve.chi2.items(), lambda item: gain.get(item[0], 0.0))
    bars = ROW * len(others) if len(others) > 1 else 0.0
    total = 0.32 + HEIGHT + 0.55 + (0.35 + bars + 0.5 if bars else 0.0)
    figure = style.new_figure(total)
    ax = style.panel(figure, LEFT, total - 0.32 - HEIGHT, style.WIDTH - LEFT - 0.15, HEIGHT)
    style.quiet(ax)
    knots, unit = plain_knots(curve)
    ax.fill_between(knots, curve.low, curve.high, color=style.PALE_AFTER, linewidth=0, zorder=2)
    ax.plot(
        knots,
        curve.multiplier,
        color=style.AFTER,
        linewidth=2.2,
        marker="o",
        markersize=6,
        markeredgecolor="white",
        zorder=4,
    )
    ax.axhline(1.0, color=style.TEXT_COLOUR, linewidth=1.0, linestyle=style.DASHED, zorder=3)
    ax.text(
        0.99,
        1.0,
        "as the base model ",
        transform=ax.get_yaxis_transform(),
        ha="right",
        va="bottom",
        fontsize=style.SMALL,
        path_effects=style.HALO,
        zorder=5,
    )
    if knots[0] > 0 and knots[-1] / knots[0] > WIDE:
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_ylim(bottom=0)
    style.labels(
        ax, style.words(f"{curve.words} ({unit})" if unit else curve.words), "strength / base"
    )
    style.title(ax, "Strength that would explain it (band: 68 %)")
    if bars:
        ax = style.panel(figure, 1.75, 0.5, style.WIDTH - 2.1, bars)
        style.quiet(ax, grid="x", left=False)
        style.rows(ax, [spoken(name) for name, _ in others], width=24, lines=1)
        for place, (name, value) in enumerate(others):
            ax.barh(
                place,
                value,
                height=0.6,
                linewidth=0,
                zorder=3,
                color=style.AFTER if name == curve.variable else style.BEFORE,
            )
            evidence = f",  ln evidence {signed(gain[name])}" if name in gain else ""
            style.tell(ax, value, place, number(value) + evidence, away=(4, 0))
        ax.set_xlim(0, 2.1 * max(value for _, value in others))
        style.labels(ax, "chi² with a curve over this variable")
    return style.save_figure(figure, path)
