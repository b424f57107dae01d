"""What passes the lines over time: discharge and volume, median and 5 to 95 % of the slides.

In: the `hydrographs` of a prediction. Out: a chart with two panels a line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from report import style
from report.numbers import unit_of

HYDROGRAPH = "hydrograph.svg"
ABOVE, LEFT, HEIGHT, FOOT = 0.3, 0.75, 1.5, 0.35
#: The time axis ends where this share of the largest volume has passed.
SHOWN = 0.995


def save_hydrographs(found: Sequence[Mapping[str, Any]], path: Path) -> Path | None:
    """Save the chart; None where there is no line.

    Args:
        found: as `inversion.prediction.hydrograph.hydrograph` makes them.
        path: of the chart.
    """
    if not found:
        return None
    figure, panels = style.chart([HEIGHT] * 2 * len(found), above=ABOVE, left=LEFT, foot=FOOT)
    for place, one in enumerate(found):
        for ax, what in zip(panels[2 * place :], ("discharge", "volume"), strict=False):
            _draw(ax, one, what)
    style.legend(figure, panels[0].get_legend_handles_labels()[0], columns=2)
    return style.save_figure(figure, path)


def _draw(ax: Axes, one: Mapping[str, Any], what: str) -> None:
    style.quiet(ax)
    time = np.array(one["time_s"])
    low, middle, high = (np.array(one[what][percent]) for percent in ("5", "50", "95"))
    ax.fill_between(
        time, low, high, color=style.PALE, linewidth=0, label="5 to 95 % of the volumes"
    )
    ax.plot(time, middle, color=style.OURS, linewidth=1.6, label="median volume")
    ax.set_xlim(time[0], last_shown(one))
    style.title(ax, f"{one['line']}: {what}")
    style.labels(
        ax, "time after the start of the slide (s)", f"{what} ({unit_of(one[f'{what}_unit'])})"
    )


def last_shown(one: Mapping[str, Any]) -> float:
    """Time at which nearly all has passed, in the widest of the three [s]."""
    time, ends = one["time_s"], [time_of(one, percent) for percent in one["volume"]]
    return max(max(ends), time[0] + 5.0 * one["step_s"])


def time_of(one: Mapping[str, Any], percent: str) -> float:
    """Time by which `SHOWN` of a volume has passed [s]."""
    volume = np.array(one["volume"][percent])
    return float(one["time_s"][int(np.argmax(volume >= SHOWN * volume.max()))])
