"""The page of the score of a set by other codes.

In: the judged cases and their score. Out: Markdown, and two pictures: every figure with what is
asked of it, and S_r over its truth before and after, case by case.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.generated_pages import table
from benchmarks.hidden_effects.scoring.by_other_codes import ASKED, ByCode, shares_of
from benchmarks.hidden_effects.scoring.calibration import calibration
from benchmarks.hidden_effects.scoring.draw import draw_asked, reliability
from benchmarks.hidden_effects.scoring.page import calibration_text
from report.style import (
    AFTER,
    BEFORE,
    LINE,
    TEXT_COLOUR,
    new_figure,
    quiet,
    save_figure,
)

KINDS = {"null": "nothing", "single": "one thing", "outside": "a stranger", "pair": "two things"}


def generated(cases: Sequence[ByCode], document: Mapping[str, Any], pictures: str) -> str:
    """All of it.

    Args:
        cases: of the set.
        document: their score (`score_by_codes`).
        pictures: folder of the pictures, as the page sees it.
    """
    counts = document["counts"]
    shares = shares_of(cases)
    parts = [
        f"{len(cases)} cases: {counts['null']} with nothing hidden, {counts['single']} with one "
        f"thing, {counts['pair']} with two, {counts['outside']} with a stranger. "
        "Intervals: 95 %, Wilson.",
        table(("figure", "measured", "asked", ""),
              [(one.words, shares[one.name].words, one.bound, one.verdict(shares[one.name]))
               for one in ASKED]),
        f"![Every figure with its interval and what is asked]({pictures}/asked.png)",
        "### By code", _by_source(cases),
        "### By detectability", _by_detectability(document),
        "### By family", _by_family(document),
        f"![S_r over its truth, before and after]({pictures}/strength.png)",
        "### Where and when", _regions(document),
        "### Calibration of the set", calibration_text([one.judged for one in cases]),
        f"![Stated probabilities and levels against what was so]({pictures}/calibration.png)",
        "### Every case", _every(document),
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def draw_all(folder: Path, cases: Sequence[ByCode]) -> list[Path]:
    """The pictures."""
    judged = [one.judged for one in cases]
    return [
        draw_asked(folder / "asked.png", ASKED, shares_of(cases)),
        _strength(folder / "strength.png", cases),
        reliability(folder / "calibration.png", calibration(judged)),
    ]


def _by_source(cases: Sequence[ByCode]) -> str:
    names = sorted({one.judged.truth["source"] for one in cases})
    shares = [shares_of([c for c in cases if c.judged.truth["source"] == name]) for name in names]
    rows = [(one.words, *(found[one.name].words for found in shares)) for one in ASKED]
    return table(("figure", *(name.replace("_", " ") for name in names)), rows)


def _by_detectability(document: Mapping[str, Any]) -> str:
    rows = []
    for one in document["seen"]:
        low, high = one["from"], one["to"]
        ends = f"{low:g} and more" if high is None else f"{low:g}-{high:g}"
        shares = (one[key] for key in ("alarmed", "right", "wrong"))
        rows.append((ends, *(f"{share['hits']} of {share['n']}" for share in shares)))
    return (
        "Cases with one thing hidden; lambda is the chi2 that the best base model leaves of the "
        "slide.\n\n"
    ) + table(("lambda", "alarm", "right name or family", "a wrong one"), rows)


def _by_family(document: Mapping[str, Any]) -> str:
    rows = [(name, f"{share['hits']} of {share['n']}")
            for name, share in document["families"].items()]  # fmt: skip
    return table(("family of what was hidden", "right"), rows)


def _regions(document: Mapping[str, Any]) -> str:
    rows = [
        (name, str(found["cases"]), *(_number(found[key]) for key in ("precision", "recall", "f1")))
        for name, found in document["regions"].items()
    ]
    return (
        "The stretch of a series in which the verdict says that the model fails, against the "
        "numbers of which the best base model leaves more than one standard deviation of the "
        "slide itself.\n\n"
    ) + table(("in", "cases that state a stretch", "precision", "recall", "F1"), rows)


def _every(document: Mapping[str, Any]) -> str:
    rows = []
    for one in document["cases"]:
        true, base, final = one["strength"]
        said = " + ".join(one["named"]) or " or ".join(one["families"])
        rows.append((
            one["name"].removeprefix("case_"), one["source"].replace("_", " "),
            " + ".join(one["hidden"]) or "nothing", f"{one['lambda']:.0f}",
            one["verdict"].replace("_", " "), said or "-", "yes" if one["right"] else "",
            f"{true:.1f}", f"{base:.1f}", f"{final:.1f}",
        ))  # fmt: skip
    return table(
        ("case", "code", "hidden", "lambda", "verdict", "named", "right", "S_r, true", "base",
         "answer"), rows,
    )  # fmt: skip


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _strength(path: Path, cases: Sequence[ByCode]) -> Path:
    """S_r of the base model and of the answer over the truth, by kind."""
    figure = new_figure(3.4, 7.0)
    there = {one.judged.truth["kind"] for one in cases}
    shown = [pair for pair in KINDS.items() if pair[0] in there]
    step = 0.93 / len(shown)
    for place, (kind, words) in enumerate(shown):
        ax = figure.add_axes((0.08 + step * place, 0.14, step - 0.04, 0.7))
        own = [one.judged for one in cases if one.judged.truth["kind"] == kind]
        for one in own:
            name, true = next(iter(one.truth["parameters"].items()))
            base, final = one.digest.base.values[name], one.digest.final.values[name]
            ax.plot([true, true], [base, final], color=LINE, linewidth=1.0, zorder=1)
            ax.plot(true, base, "s", color=BEFORE, markersize=4, zorder=2)
            ax.plot(true, final, "o", color=AFTER, markersize=3.5, zorder=3)
        low, high = ax.get_xlim()
        ax.plot([low, high], [low, high], color=TEXT_COLOUR, linewidth=0.8, zorder=0)
        ax.set_title(f"hidden: {words}", fontsize=9, color=TEXT_COLOUR)
        ax.set_xlabel("true $S_r$ [kPa]", fontsize=8.5, color=TEXT_COLOUR)
        if not place:
            ax.set_ylabel("found $S_r$ [kPa]", fontsize=8.5, color=TEXT_COLOUR)
        quiet(ax, grid="y")
    figure.text(0.5, 0.97, "squares: base model; dots: with what is named", ha="center", va="top",
                fontsize=8.5, color=TEXT_COLOUR)  # fmt: skip
    return save_figure(figure, path)
