"""Signatures: what each effect changes in each measurement, with the residual on top.

In: a `DiagnosisData`. Out: a heat map. Each row is scaled to its largest value, so it shows shape,
not size, after refitting the parameters. The effect whose row resembles the residual explains it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize

from diagnosis.verdict.verdict import Signature
from report.data.diagnosis import DiagnosisData
from report.numbers import fixed
from report.sentences.diagnosis import spoken
from report.style import (
    SIGNED,
    SMALL,
    TEXT,
    TEXT_COLOUR,
    WIDTH,
    new_figure,
    panel,
    save_figure,
    wrapped,
)

ROW, TOP_ROW, LEFT, RIGHT = 0.3, 0.36, 1.45, 0.5
ABOVE, BELOW, GAP = 0.25, 1.55, 0.06
LEAST_WIDTH = 0.12
"""Width of the cell of a single number [inches]."""
MOST = 16
TIGHT = 7.5
"""Size of a name that takes two lines [points]."""


@dataclass(frozen=True)
class Block:
    """The numbers of one measurement.

    Attributes:
        name: of the measurement.
        columns: places of its numbers in the lists of a signature.
        ends: where the first and the last one are, as text; None for single numbers.
    """

    name: str
    columns: list[int]
    ends: tuple[str, str] | None


def blocks(data: DiagnosisData) -> list[Block]:
    """Columns of the map: measurements in order, constructed numbers left out."""
    names = data.signatures.measurements
    known = {line.name: line for line in data.measurements}
    found: dict[str, list[int]] = {}
    for column, name in enumerate(names):
        line = known.get(name)
        if line is None:  # an explanation lists no measurements: use the names
            found.setdefault(
                name.split(" at ")[0].removesuffix(" dx").removesuffix(" dy"), []
            ).append(column)
        elif line.role != "constructed":
            found.setdefault(line.measurement, []).append(column)
    made = []
    for name, columns in found.items():
        ends = None
        if len(columns) > 2:
            texts = [
                names[c].removeprefix(name).strip().removeprefix("at ").removeprefix("x ")
                for c in (columns[0], columns[-1])
            ]
            ends = (texts[0], texts[1])
        made.append(Block(name, columns, ends))
    return made


def fingerprints(data: DiagnosisData) -> list[Signature]:
    """One signature for each candidate, best score first: the one nearest to its amplitude."""
    order = [c.name for c in data.candidates if c.z is not None] or data.signatures.names
    wanted = {c.name: c.amplitude_by_score for c in data.candidates}
    chosen = []
    for name in order:
        own = [entry for entry in data.signatures.entries if entry.name == name]
        if own:
            target = wanted.get(name)
            middle = sorted(own, key=lambda e: abs(e.amplitude))[len(own) // 2]
            chosen.append(
                middle if target is None else min(own, key=lambda e: abs(e.amplitude - target))
            )
    return chosen[:MOST]


def draw_fingerprints(data: DiagnosisData, path: Path) -> Path | None:
    """Save the map; None where there are no signatures."""
    if data.signatures is None:
        return None
    parts, shown = blocks(data), fingerprints(data)
    if not parts or not shown:
        return None
    known = {line.name: line.residual_base for line in data.measurements}
    residual = np.array([known.get(n) or 0.0 for n in data.signatures.measurements])
    with_residual = any(known.get(n) is not None for n in data.signatures.measurements)
    head = TOP_ROW + 0.1 if with_residual else 0.0
    total = ABOVE + head + ROW * len(shown) + BELOW
    figure = new_figure(total)
    widths = _widths(parts)
    left = LEFT
    for place, (block, width) in enumerate(zip(parts, widths, strict=True)):
        ax = panel(figure, left, BELOW, width, ROW * len(shown))
        _draw_block(ax, np.array([_shape(e.left_after_refit, block, parts) for e in shown]))
        _name_block(ax, block, width)
        if place == 0:
            _name_rows(ax, [spoken(e.name) for e in shown])
        if with_residual:
            ax = panel(figure, left, BELOW + ROW * len(shown) + 0.1, width, TOP_ROW)
            _draw_block(ax, _shape(residual, block, parts)[None])
            if place == 0:
                _name_rows(ax, ["RESIDUAL"], bold=True)
        left += width + GAP
    if with_residual:
        _likeness(figure, data, shown, residual, parts, total)
    bar = figure.add_axes((0.34, 0.3 / total, 0.48, 0.11 / total))
    Colorbar(
        bar, ScalarMappable(Normalize(-1, 1), SIGNED), orientation="horizontal", ticks=[-1, 0, 1]
    )
    bar.set_xticklabels(["lower", "as the base model", "higher"], fontsize=SMALL)
    bar.tick_params(length=0)
    return save_figure(figure, path)


def _widths(parts: list[Block]) -> list[float]:
    """Inches of each block: single numbers keep a least width, series share the rest."""
    room = WIDTH - LEFT - RIGHT - GAP * (len(parts) - 1)
    narrow = [LEAST_WIDTH * len(b.columns) if b.ends is None else 0.0 for b in parts]
    series = sum(len(b.columns) for b in parts if b.ends is not None)
    rest = room - sum(narrow)
    if series == 0 or rest < 0.3 * room:
        count = sum(len(b.columns) for b in parts)
        return [room * len(b.columns) / count for b in parts]
    return [n or rest * len(b.columns) / series for n, b in zip(narrow, parts, strict=True)]


def _shape(values: np.ndarray | list[float], block: Block, parts: list[Block]) -> np.ndarray:
    """The values of a block, the largest of the whole row being 1."""
    values = np.asarray(values, dtype=float)
    largest = max(float(np.abs(values[b.columns]).max()) for b in parts)
    return values[block.columns] / (largest or 1.0)


def _draw_block(ax: Axes, values: np.ndarray) -> None:
    edges = (np.arange(values.shape[1] + 1) - 0.5, np.arange(values.shape[0] + 1) - 0.5)
    # Edges in the colour of the cell: without them a browser shows the seams.
    ax.pcolormesh(*edges, values, cmap=SIGNED, vmin=-1, vmax=1, edgecolors="face", linewidth=0.4)
    for row in range(1, values.shape[0]):
        ax.axhline(row - 0.5, color="white", linewidth=1.2)
    ax.set(xticks=[], yticks=[], ylim=(values.shape[0] - 0.5, -0.5))
    for spine in ax.spines.values():
        spine.set(color="#9aa3ab", linewidth=0.7)


def _name_rows(ax: Axes, names: list[str], *, bold: bool = False) -> None:
    shown = [wrapped(name, 20, 2) for name in names]
    ax.set_yticks(range(len(names)), shown, fontsize=TEXT, linespacing=0.95)
    for tick, text in zip(ax.get_yticklabels(), shown, strict=True):
        tick.set_fontsize(TEXT if "\n" not in text else TIGHT)
    ax.tick_params(axis="y", length=0, labelcolor=TEXT_COLOUR)
    if bold:
        ax.get_yticklabels()[0].set_fontweight("bold")


def _name_block(ax: Axes, block: Block, width: float) -> None:
    style = {"fontsize": SMALL, "color": TEXT_COLOUR, "transform": ax.transAxes, "va": "top"}
    down = 0.05 / (ROW * max(ax.get_ylim()[0] + 0.5, 1))
    if block.ends is not None and width > 0.9:
        first, last = block.ends
        ax.text(0.0, -down, first, ha="left", **style)
        ax.text(1.0, -down, last, ha="right", **style)
        style["fontsize"] = TEXT
        ax.text(0.5, -4 * down, wrapped(block.name, 30, 1), ha="center", **style)
        return
    ax.text(0.5, -down, wrapped(block.name, 18, 1), ha="center", rotation=90, **style)


def _likeness(figure, data: DiagnosisData, shown, residual, parts, total: float) -> None:  # noqa: ANN001
    """The cosine of each row to the residual over the fitted numbers, at the right."""
    known = {line.name: line for line in data.measurements}
    names = data.signatures.measurements
    fitted = [
        c
        for b in parts
        for c in b.columns
        if names[c] in known and known[names[c]].role == "fitted"
    ]
    x = 1 - 0.06 / WIDTH
    figure.text(
        x,
        (BELOW + ROW * len(shown) + 0.1 + TOP_ROW / 2) / total,
        "cos",
        ha="right",
        va="center",
        fontsize=SMALL,
        color=TEXT_COLOUR,
    )
    r = residual[fitted]
    for place, entry in enumerate(shown):
        s = np.array(entry.left_after_refit)[fitted]
        size = float(np.linalg.norm(s) * np.linalg.norm(r))
        cosine = float(s @ r) / size if size else 0.0
        y = (BELOW + ROW * (len(shown) - place - 0.5)) / total
        figure.text(
            x,
            y,
            fixed(cosine, 2),
            ha="right",
            va="center",
            fontsize=SMALL,
            color=TEXT_COLOUR,
            fontweight="bold" if cosine > 0.7 else "normal",
        )
