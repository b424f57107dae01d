"""Does any figure of a verdict tell a right name from a stranger that was explained away?

    python -m benchmarks.studies.names_and_strangers

From the records of the third to the sixth set of slides by other codes, each judged once: the right
names against the verdicts that attribute a stranger's misfit to what is on the list. A figure that
could tell them apart would be larger, or smaller, for nearly every right name than for nearly every
stranger. Renews a part of docs/records/foreign-sixth.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.generated_pages import ROOT, renew, table
from benchmarks.hidden_effects.making.benchmark import load_benchmark
from benchmarks.hidden_effects.scoring.by_other_codes import ByCode
from benchmarks.hidden_effects.scoring.digest import METHOD, Digest
from benchmarks.hidden_effects.scoring.opened import judged, load_rows
from benchmarks.studies.strength_by_verdict import FOLDER, SETS
from report.numbers import number

PAGE = ROOT / "docs" / "records" / "foreign-sixth.md"
#: Least chi2 before, for a share of it.
LEAST = 0.1
FIGURES: dict[str, Callable[[Digest], float]] = {
    "p of what is left": lambda one: one.final.p,
    "chi² left over its degrees of freedom": lambda one: one.final.chi2 / one.final.dof,
    "fall of chi²": lambda one: one.base.chi2 - one.final.chi2,
    "held-out chi² over that before": lambda one: (
        one.final.held_out_chi2 / max(one.base.held_out_chi2, LEAST)
    ),
    "share of the probability": lambda one: max(one.shares, default=0.0),
}


def names_and_strangers() -> tuple[list[Digest], list[Digest]]:
    """Verdicts with a right name, and those that explain a stranger away."""
    right, away = [], []
    for name in SETS:
        benchmark = load_benchmark(FOLDER / f"foreign_{name}.yaml")
        rows = load_rows(FOLDER / f"foreign_{name}_results.json")
        for one in judged(rows, benchmark, METHOD):
            if ByCode(one).right:
                right.append(one.digest)
            elif one.truth["kind"] == "outside" and one.attributed:
                away.append(one.digest)
    return right, away


def chance_larger(first: Sequence[float], second: Sequence[float]) -> float:
    """That one of the first is larger than one of the second; equal ones count half."""
    difference = np.subtract.outer(np.asarray(first), np.asarray(second))
    return float(np.mean((difference > 0.0) + 0.5 * (difference == 0.0)))


def by_chance(n: int, m: int) -> float:
    """Two standard deviations of that chance where both are alike (Mann and Whitney 1947)."""
    return 2.0 * math.sqrt((n + m + 1) / (12.0 * n * m))


def shown(right: Sequence[Digest], away: Sequence[Digest]) -> str:
    """The part of the page."""
    rows = []
    for words, figure in FIGURES.items():
        own, others = ([figure(one) for one in some] for some in (right, away))
        spans = (f"{number(min(some), 2)} to {number(max(some), 2)}" for some in (own, others))
        rows.append([words, f"{chance_larger(own, others):.2f}", *spans])
    off = by_chance(len(right), len(away))
    said = (
        f"{len(right)} right names against {len(away)} strangers that were explained away. The "
        "chance that a right name has the larger figure is 0.5 where the figure says nothing, and "
        f"with so few cases {0.5 - off:.2f} to {0.5 + off:.2f} is no more than luck:"
    )
    return f"{said}\n\n" + table(
        ["figure of the answer", "chance", "range of right names", "of strangers"], rows, "lrll"
    )


if __name__ == "__main__":
    renew(PAGE, apart=shown(*names_and_strangers()))
