"""All answers against the truths: risk over coverage, false names, S_r.

In: rows of the record, a slide each with its truth and all answers. Out: the figures of each
method, a table and a picture. *Coverage* is the share of the slides on which a name is given as the
confidence that is asked for falls; *risk* the share of these names that are wrong. Where nothing or
a stranger is hidden every name is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field

from benchmarks.generated_pages import table
from benchmarks.hidden_effects.baselines.answers import Answer
from benchmarks.hidden_effects.scoring.opened import SlideRow

#: The picture as the page sees it.
SHOWN = "../images/baselines.png"
OWN = "diagnosis"
#: Method -> words.
METHODS = {
    OWN: "diagnosis",
    "nearest": "nearest signature",
    "aic": "AIC by refit",
    "bic": "BIC by refit",
    "classifier": "classifier",
    "discrepancy": "Gaussian-process discrepancy",
}
HEADER = (
    "", "names by its own rule: right", "of nulls, of strangers", "risk at the coverage of the "
    "diagnosis", "mean risk", "alarm: nulls, hidden", "S_r off by: half, nine of ten",
    "within 95 %",
)  # fmt: skip


class Row(SlideRow):
    """A slide and all answers."""

    answers: dict[str, Answer] = Field(description="by method")

    @property
    def kind(self) -> str:
        """Of the slide."""
        return self.truth["kind"]


@dataclass(frozen=True)
class Curve:
    """Risk over coverage.

    Attributes:
        right: of the names, the surest first, (n,) bool.
        slides: how many there are.
    """

    right: np.ndarray
    slides: int

    @classmethod
    def of(cls, rows: Sequence[Row], method: str) -> Curve:
        """Of the slides on which a method has a name, given by its own rule or not."""
        named = [row for row in rows if row.answers[method].names]
        named.sort(key=lambda row: -row.answers[method].confidence)
        right = [row.answers[method].right(row.truth) for row in named]
        return cls(np.array(right, dtype=bool), len(rows))

    @property
    def coverage(self) -> np.ndarray:
        """After each name, (n,)."""
        return np.arange(1, len(self.right) + 1) / self.slides

    @property
    def risk(self) -> np.ndarray:
        """After each name, (n,)."""
        return np.cumsum(~self.right) / np.arange(1, len(self.right) + 1)

    def at(self, names: int) -> float | None:
        """Risk of so many names; None where there are fewer."""
        return float(self.risk[names - 1]) if 0 < names <= len(self.right) else None

    def mean(self, names: int) -> float | None:
        """Mean risk up to so many names: the area under the curve over its width."""
        return float(self.risk[:names].mean()) if 0 < names <= len(self.right) else None


def rows_of(rows: Sequence[Row]) -> list[list[str]]:
    """The table, a method in each row."""
    curves = {name: Curve.of(rows, name) for name in METHODS}
    own = sum(row.answers[OWN].given for row in rows)
    # Where every method that names anything has a risk.
    common = min((len(one.right) for one in curves.values() if len(one.right)), default=0)
    return [
        [words, *_names(rows, name), _share(curves[name].at(own)),
         _share(curves[name].mean(common)), *_rest(rows, name)]
        for name, words in METHODS.items()
    ]  # fmt: skip


def _names(rows: Sequence[Row], method: str) -> list[str]:
    """Names by the method's own rule: right of given; of nulls and of strangers."""
    if not any(row.answers[method].names for row in rows):
        return ["-", "-"]
    given = [row for row in rows if row.answers[method].given]
    right = sum(row.answers[method].right(row.truth) for row in given)
    false = [sum(row.kind == kind for row in given) for kind in ("null", "outside")]
    return [f"{right} of {len(given)}", "{}, {}".format(*false)]


def _rest(rows: Sequence[Row], method: str) -> list[str]:
    """Alarms of nulls and of others; how far S_r was off; how often its interval held it."""
    answers = [(row, row.answers[method]) for row in rows]
    alarms = [sum(said.alarm for row, said in answers if (row.kind == "null") == null)
              for null in (True, False)]  # fmt: skip
    errors = np.abs([said.strength_error(row.truth) for row, said in answers])
    off = [f"{100.0 * np.expm1(np.quantile(errors, share)):.0f}" for share in (0.5, 0.9)]
    held = sum(said.holds(row.truth) for row, said in answers)
    return ["{}, {}".format(*alarms), "{}, {} %".format(*off), str(held)]


def _share(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.0f} %"


def page(rows: Sequence[Row]) -> str:
    """The part of docs/records/hidden-effects.md."""
    if not rows:
        return "No slide has been judged so yet."
    sets = ", ".join(dict.fromkeys(row.of for row in rows))
    kinds = [sum(row.kind == kind for row in rows) for kind in ("null", "outside")]
    head = f"{len(rows)} slides ({sets}), {kinds[0]} nulls, {kinds[1]} with strangers."
    found = table(HEADER, rows_of(rows), "l" + "r" * (len(HEADER) - 1))
    return f"{head}\n\n{found}\n\n![Risk over coverage]({SHOWN})"


def draw(path: Path, rows: Sequence[Row]) -> Path:
    """The curves; a ring where the diagnosis stops by its own rule."""
    from report.style import (
        BEFORE,
        CLASSICAL,
        HELD_OUT,
        OURS,
        TEXT_COLOUR,
        new_figure,
        quiet,
        save_figure,
    )

    looks = {OWN: (OURS, "o"), "nearest": (BEFORE, "s"), "aic": (HELD_OUT, "D"),
             "bic": (CLASSICAL, "^"), "classifier": (TEXT_COLOUR, "x")}  # fmt: skip
    figure = new_figure(3.2)
    ax = figure.add_axes((0.11, 0.15, 0.86, 0.7))
    for name, (colour, mark) in looks.items():
        curve = Curve.of(rows, name)
        ax.plot(100.0 * curve.coverage, 100.0 * curve.risk, marker=mark, color=colour,
                markersize=4, linewidth=1.1, label=METHODS[name])  # fmt: skip
    own, curve = sum(row.answers[OWN].given for row in rows), Curve.of(rows, OWN)
    risk = curve.at(own)
    if risk is not None:
        ax.plot(100.0 * own / curve.slides, 100.0 * risk, "o", color=OURS, markersize=11,
                fillstyle="none")  # fmt: skip
    ax.set_xlim(0, 103)
    ax.set_ylim(-3, 103)
    ax.set_xlabel("coverage: slides on which a name is given [%]", fontsize=8.5, color=TEXT_COLOUR)
    ax.set_ylabel("risk: names that are wrong [%]", fontsize=8.5, color=TEXT_COLOUR)
    quiet(ax, grid="y")
    figure.legend(loc="upper center", ncol=3, frameon=False, fontsize=8)
    return save_figure(figure, path)
