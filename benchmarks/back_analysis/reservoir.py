"""Lower San Fernando: the published section, and what its water does.

The published digital section and other readings of it. Published: Olson and Stark (2002) 18.7 kPa
(15.8-21.8), the paper 18.9 kPa, Weber (2015) 25.8 kPa (recalled).
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure
from inversion.back_analysis.result import ParameterAnswer, VariantAnswer

TITLE = "Lower San Fernando: the published section and its water"

STRENGTH = "residual_strength"
PUBLISHED = (15.8, 21.8)


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """The answer and its variants."""
    _, result = lab.solved(lab.LSFD, quick=quick)
    answer = result.answer.parameters[0]
    return [
        Figure("S_r, water as pressure in and on the soil",
               f"{answer.value:.1f} ± {answer.std_total:.1f} kPa",
               "18.7 (15.8-21.8); paper 18.9", note=_overlap(answer)),
        *(_variant(variant) for variant in result.variants),
    ]  # fmt: skip


def _overlap(answer: ParameterAnswer) -> str:
    low, high = answer.interval_95
    touches = low <= PUBLISHED[1] and high >= PUBLISHED[0]
    return (
        f"95 %: {low:.1f} to {high:.1f} kPa, which "
        f"{'overlaps' if touches else 'does not meet'} the published range"
    )


def _variant(variant: VariantAnswer) -> Figure:
    toe = variant.predicted["upstream toe"]
    return Figure(
        f"S_r, {variant.name}",
        f"{variant.values[STRENGTH]:.1f} kPa",
        note=f"{variant.words}; toe {toe:.1f} m"
        + ("" if variant.reached else f"; NOT FITTED: {variant.words_end}"),
    )
