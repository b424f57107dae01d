"""Measured against predicted: every measurement on one scale, in its own standard deviations.

In: a `ReportData`. Out: a chart of a row for each measurement; a profile of many points is one row
of many marks. Held-out, compared and constructed data differ by mark, colour and words.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from inversion.back_analysis.result import MeasurementAnswer
from report.back_analysis.data import ReportData
from report.charts.style import (
    LINE,
    NOTE,
    ROLE_COLOURS,
    ROLE_MARKERS,
    clean,
    new_figure,
    row_labels,
    save_figure,
    words,
)
from report.pictures.scene import HALO, TEXT_COLOUR

ROW, ABOVE, BELOW, LEFT, RIGHT = 0.52, 0.2, 0.55, 1.35, 0.15


@dataclass(frozen=True)
class Group:
    """The lines of one measurement."""

    name: str
    lines: list[MeasurementAnswer]

    @property
    def role(self) -> str:
        """Of the first line; that of a profile with a block held out is told line by line."""
        return self.lines[0].role

    @property
    def text(self) -> str:
        """Measured and predicted, in words."""
        if len(self.lines) > 1:
            square = sum((m.predicted - m.measured) ** 2 for m in self.lines) / len(self.lines)
            unit = self.lines[0].unit
            return f"{len(self.lines)} points, off by {square**0.5:.1f} {unit} (root mean square)"
        m = self.lines[0]
        predicted = f"{m.predicted:.1f}".replace("-", "\N{MINUS SIGN}")
        return f"measured {m.measured:g} ± {m.std:.3g} {m.unit}, predicted {predicted} {m.unit}"


def groups(data: ReportData) -> list[Group]:
    """The measurements that have a measured value, in the order of the file."""
    found: dict[str, list[MeasurementAnswer]] = {}
    for m in data.result.measurements:
        if m.measured is not None and m.difference_in_std is not None:
            found.setdefault(m.group, []).append(m)
    return [Group(name, lines) for name, lines in found.items()]


def draw_measured(data: ReportData, path: Path) -> Path | None:
    """Save the chart; None where nothing was measured."""
    rows = groups(data)
    if not rows:
        return None
    total = ROW * len(rows) + ABOVE + BELOW
    figure = new_figure(total)
    width = figure.get_figwidth()
    ax = figure.add_axes(
        (LEFT / width, BELOW / total, (width - LEFT - RIGHT) / width, ROW * len(rows) / total)
    )
    row_labels(ax, [f"{row.name} ({row.role})" for row in rows], width=20)
    reach = max(3.0, *(abs(m.difference_in_std) for row in rows for m in row.lines)) * 1.12
    ax.set_xlim(-reach, reach)
    ax.axvspan(-2, 2, color=LINE, alpha=0.55, linewidth=0, zorder=0)
    ax.axvline(0, color=TEXT_COLOUR, linewidth=0.9, zorder=1)
    clean(ax)
    for number, row in enumerate(rows):
        for m in row.lines:
            ax.plot([m.difference_in_std], [number + 0.12], marker=ROLE_MARKERS[m.role],
                    color=ROLE_COLOURS[m.role], markersize=8 if len(row.lines) == 1 else 5,
                    markeredgecolor="white" if m.role != "constructed" else None,
                    linestyle="none", zorder=3)  # fmt: skip
        colour = ROLE_COLOURS[row.role] if row.role != "constructed" else NOTE
        ax.text(0.01, number - 0.26, words(row.text), fontsize=8, color=colour, va="center",
                transform=ax.get_yaxis_transform(), path_effects=HALO, zorder=4)  # fmt: skip
    for tick, row in zip(ax.get_yticklabels(), rows, strict=True):
        tick.set_color(ROLE_COLOURS[row.role] if row.role != "constructed" else NOTE)
    ax.set_xlabel("predicted minus measured, in std (shaded: within 2)",
                  fontsize=8.5)  # fmt: skip
    return save_figure(figure, path)
