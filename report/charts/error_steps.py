"""How the error falls step by step: fitted and held-out data against the noise.

In: the steps of a verdict, or of a track. Out: a chart with a row for each model. The scale is the
root mean square residual in standard deviations; noise alone gives 1, with a grey band for 95 % of
data sets.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.special import chdtri

from diagnosis.verdict.verdict import WaterfallStep
from report import style
from report.numbers import number, root_mean_square
from report.sentences.diagnosis import follows, is_by_hand, step_words

ROW, LEFT, FOOT = 0.64, 1.5, 0.28
HUMAN = "#8a5a00"


def draw_steps(
    steps: Sequence[WaterfallStep], path: Path, *, by_hand: Collection[str] = ()
) -> Path | None:
    """Save the chart; None where there is no step."""
    if not steps:
        return None
    figure, (ax,) = style.chart([ROW * len(steps)], left=LEFT, foot=FOOT)
    style.quiet(ax, grid="x", left=False)
    style.rows(ax, [step_words(n, steps, by_hand) for n in range(len(steps))], width=20, lines=3)
    fitted = [root_mean_square(s.chi2, max(s.dof, 1)) for s in steps]
    held = [
        None
        if s.held_out_chi2 is None or not s.held_out_n
        else root_mean_square(s.held_out_chi2, s.held_out_n)
        for s in steps
    ]
    reach = max(1.6, *fitted, *(h for h in held if h is not None))
    ax.set_xlim(0, 1.16 * reach)
    dof = max(1, steps[-1].dof)
    low, high = ((chdtri(dof, beyond) / dof) ** 0.5 for beyond in (0.975, 0.025))
    ax.axvspan(low, high, color=style.LINE, alpha=0.8, linewidth=0, zorder=0)
    ax.axvline(1.0, color=style.TEXT_COLOUR, linewidth=1.0, linestyle=style.DASHED, zorder=4)
    for place, step in enumerate(steps):
        colour = HUMAN if is_by_hand(step, by_hand) else style.AFTER
        if follows(place, steps):
            ax.barh(
                place - 0.14,
                fitted[place - 1],
                height=0.34,
                color=style.PALE_AFTER,
                alpha=0.7,
                linewidth=0,
                zorder=1,
            )
            ax.plot(
                [fitted[place - 1]] * 2,
                [place - 1.0, place + 0.03],
                color="#8aa9bd",
                linewidth=0.9,
                linestyle=(0, (2, 2)),
                zorder=2,
            )
        ax.barh(place - 0.14, fitted[place], height=0.34, color=colour, linewidth=0, zorder=3)
        style.tell(ax, fitted[place], place - 0.14, number(fitted[place], 2))
        if held[place] is not None:
            ax.plot(
                [held[place]],
                [place + 0.24],
                marker="D",
                color=style.HELD_OUT,
                markersize=7,
                markeredgecolor="white",
                zorder=5,
            )
            style.tell(
                ax,
                held[place],
                place + 0.24,
                number(held[place], 2),
                away=(8, 0),
                color=style.HELD_OUT,
            )
            if follows(place, steps) and held[place - 1] is not None:
                ax.plot(
                    [held[place - 1], held[place]],
                    [place - 0.76, place + 0.24],
                    color=style.HELD_OUT,
                    linewidth=0.8,
                    alpha=0.6,
                    zorder=2,
                )
    style.labels(ax, "root mean square residual, in std")
    style.legend(figure, _handles(held, steps, by_hand), columns=4)
    return style.save_figure(figure, path)


def _handles(
    held: list[float | None], steps: Sequence[WaterfallStep], by_hand: Collection[str]
) -> list[Line2D | Patch]:
    made: list[Line2D | Patch] = [Patch(facecolor=style.AFTER, label="fitted")]
    if any(is_by_hand(step, by_hand) for step in steps):
        made.append(Patch(facecolor=HUMAN, label="by hand"))
    if any(value is not None for value in held):
        made.append(
            Line2D(
                [],
                [],
                marker="D",
                color=style.HELD_OUT,
                linestyle="none",
                markersize=6,
                label="held out",
            )
        )
    made.append(
        Line2D(
            [], [], color=style.TEXT_COLOUR, linewidth=1.0, linestyle=style.DASHED, label="noise"
        )
    )
    return made
