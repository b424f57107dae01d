"""How sure the answer is: what moves it (a tornado chart), and what was known before and after.

In: a `ReportData`. Out: two charts. The tornado has a bar for each change of an assumption, the
strongest on top; the other one shows what the data have and have not added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes

from inversion.back_analysis.result import ParameterAnswer
from inversion.back_analysis.result_builder import NOISE_SOURCE
from report.back_analysis.data import ReportData
from report.charts.style import (
    HELD_OUT,
    NOTE,
    OURS,
    PALE,
    clean,
    new_figure,
    row_labels,
    save_figure,
    words,
)
from report.pictures.scene import HALO, TEXT_COLOUR

ROW, ABOVE, BELOW, LEFT, RIGHT = 0.3, 0.42, 0.6, 1.95, 0.3
MOVED = 1e-3
"""A parameter that no assumption moves by this share of its value has no chart."""


@dataclass(frozen=True)
class Bar:
    """One source of uncertainty: what it adds [unit of the parameter].

    Attributes:
        label: of the row.
        changes: signed changes, one for each side tried.
        std: its contribution to the total; None: it is told, not added.
    """

    label: str
    changes: tuple[float, ...]
    std: float | None


def bars(data: ReportData, parameter: ParameterAnswer) -> list[Bar]:
    """The sources for one parameter, the strongest first."""
    name = parameter.name
    found = [Bar("survey", (-parameter.std_data, parameter.std_data), parameter.std_data)]
    if data.result.noise is not None:
        std = data.result.noise.answer_std[name]
        found.append(Bar(NOISE_SOURCE, (-std, std), std))
    for entry in data.result.sensitivities:
        changes = tuple(side.change[name] for side in entry.sides)
        std = None if entry.kind == "target" else entry.std[name]
        found.append(Bar(entry.name, changes, std))
    return sorted(found, key=lambda bar: -max(map(abs, bar.changes), default=0.0))


def tornado_parameters(data: ReportData) -> list[ParameterAnswer]:
    """The parameters that have something to show: those that an assumption moves."""
    if not data.result.sensitivities:
        return []
    return [
        p
        for p in data.result.answer.parameters
        if any(
            abs(side.change[p.name]) > MOVED * abs(p.value)
            for entry in data.result.sensitivities
            for side in entry.sides
        )
    ]


def draw_tornado(data: ReportData, path: Path) -> Path | None:
    """Save the tornado chart; None where no assumption was changed or none moves anything."""
    shown = tornado_parameters(data)
    if not shown:
        return None
    panels = [bars(data, p) for p in shown]
    heights = [ROW * len(panel) for panel in panels]
    total = sum(heights) + len(panels) * (ABOVE + BELOW)
    figure = new_figure(total)
    width, top = figure.get_figwidth(), total
    for p, panel, height in zip(shown, panels, heights, strict=True):
        top -= ABOVE + height
        box = (LEFT / width, top / total, (width - LEFT - RIGHT) / width, height / total)
        _draw_tornado(figure.add_axes(box), p, panel)
        top -= BELOW
    return save_figure(figure, path)


def _draw_tornado(ax: Axes, p: ParameterAnswer, panel: Sequence[Bar]) -> None:
    reach = 1.45 * max(abs(change) for bar in panel for change in bar.changes)
    ax.set_xlim(p.value - reach, p.value + reach)
    ax.axvspan(p.value - p.std_total, p.value + p.std_total, color=OURS, alpha=0.08, linewidth=0)
    ax.axvline(p.value, color=TEXT_COLOUR, linewidth=1.0, zorder=4)
    row_labels(ax, [bar.label for bar in panel], width=30)
    clean(ax)
    for number, bar in enumerate(panel):
        low, high = min(0.0, *bar.changes), max(0.0, *bar.changes)
        style = {"height": 0.62, "linewidth": 0, "zorder": 3}
        ax.barh(number, low, left=p.value, color=OURS, **style)
        ax.barh(number, high, left=p.value, color=HELD_OUT, **style)
        for change, side in ((low, "right"), (high, "left")):
            if round(abs(change), 2) > 0:
                ax.annotate(f"{change:+.2g}".replace("-", "\N{MINUS SIGN}"),
                            (p.value + change, number), xytext=(-4 if side == "right" else 4, 0),
                            textcoords="offset points", va="center", ha=side, fontsize=8,
                            color=TEXT_COLOUR, path_effects=HALO, zorder=5)  # fmt: skip
    unit = p.unit.replace("deg", "°")
    ax.set_xlabel(words(f"{p.label} ({unit})"), fontsize=8.5)
    title = f"{p.label}: {p.value:.1f} ± {p.std_total:.1f} {unit} (shaded)"
    ax.set_title(words(title), x=1.0, ha="right", fontsize=9, color=TEXT_COLOUR, fontweight="bold")


def draw_before_after(data: ReportData, path: Path) -> Path:
    """Save what was known of each parameter before the data and what is known after."""
    parameters = data.result.answer.parameters
    total = 0.62 * len(parameters) + 0.62
    figure = new_figure(total)
    ax = figure.add_axes((0.35, 0.42 / total, 0.6, (total - 0.5) / total))
    row_labels(ax, [p.label for p in parameters], width=26)
    ax.set_xlim(-0.02, 1.02)
    ax.set_xticks([0, 1], ["lower bound", "upper bound"], fontsize=8)
    ax.spines[["top", "right", "left", "bottom"]].set_visible(False)
    for number, p in enumerate(parameters):
        _draw_before_after(ax, number, p, data.prior_mean(p))
    return save_figure(figure, path)


def _draw_before_after(ax: Axes, number: int, p: ParameterAnswer, prior_mean: float | None) -> None:
    def share(value: float) -> float:
        return min(max((value - p.low) / (p.high - p.low), 0.0), 1.0)

    ax.plot([0, 1], [number + 0.12] * 2, color="#888888", linewidth=0.8, zorder=1)
    before = (0.0, 1.0)
    if prior_mean is not None:
        before = share(prior_mean - p.prior_std), share(prior_mean + p.prior_std)
    after = share(p.value - p.std_data), share(p.value + p.std_data)
    if not p.determined and not p.has_prior:
        after = before
    colour = OURS if p.determined else HELD_OUT
    ax.barh(number + 0.12, before[1] - before[0], left=before[0], height=0.34, color=PALE,
            linewidth=0, zorder=2)  # fmt: skip
    ax.barh(number + 0.12, after[1] - after[0], left=after[0], height=0.16, color=colour,
            linewidth=0, zorder=3)  # fmt: skip
    ax.plot([share(p.value)] * 2, [number - 0.1, number + 0.34], color=TEXT_COLOUR, linewidth=1.6,
            zorder=4)  # fmt: skip
    unit = "°" if p.unit == "deg" else f" {p.unit}"
    before_words = "" if prior_mean is None else f" (before ± {p.prior_std:.2g})"
    known = f"± {p.std_data:.2g} from the data" if p.determined else "as wide as before"
    text = f"{p.value:.1f}{unit}, {known} {before_words}"
    place, side = (0.0, "left") if share(p.value) < 0.6 else (1.0, "right")
    ax.text(place, number - 0.28, words(text), fontsize=8.5, color=colour, ha=side, va="center")
    for x, value in ((0, p.low), (1, p.high)):
        ax.text(x, number + 0.41, f"{value:g}", fontsize=7.5, color=NOTE, ha="center", va="center")
