"""How well each effect can be seen at all: what of it a refitted base model cannot imitate.

Some effects are faint whatever their amplitude: a resistance that grows everywhere is a strength to
a surveyor who sees the final surface alone. What can be reached is measured before cases are
planned, so that none is planned that cannot be made.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.hidden_effects.making.base_model import BaseModel
from benchmarks.hidden_effects.making.benchmark import Benchmark
from benchmarks.hidden_effects.making.laboratory import Laboratory
from benchmarks.hidden_effects.making.plan import Reach
from benchmarks.hidden_effects.making.sections import Section
from benchmarks.hidden_effects.making.sight import LOOKS, Sight, strongest
from mpm_taichi.effects import effect as effect_of

#: Strengths at which it is measured, as shares of the logarithm of the range of truths.
LEVELS = (0.2, 0.6)
#: Amplitudes from half the lowest rung of the ladder up to the strongest.
AMPLITUDES = 5


def measure_reach(
    benchmark: Benchmark,
    laboratory: Laboratory,
    base: Callable[[Section], BaseModel],
    on_effect: Callable[[str], None] = lambda words: None,
) -> Reach:
    """Largest lambda of each effect in each section and survey; absent where it cannot act."""
    found: dict[tuple[str, str, str], float] = {}
    for section in benchmark.sections.values():
        names = [
            name
            for name in dict.fromkeys((*benchmark.library, *benchmark.outside))
            if not effect_of(name).applies(section.scene)
        ]
        for level in LEVELS:
            sight = Sight(laboratory, base(section), "profile", section.typical(level))
            for name in names:
                for survey, seen in _seen(sight, name, benchmark.plan.surveys).items():
                    key = (name, section.name, survey)
                    found[key] = max(found.get(key, 0.0), seen)
                on_effect(f"{section.name}: {name}")
    return found


def _seen(sight: Sight, name: str, surveys: list[str]) -> dict[str, float]:
    """Largest lambda over the amplitudes, by survey; what stops the slide does not count."""
    scale = effect_of(name).amplitude
    largest = dict.fromkeys(surveys, 0.0)
    for sign in (1.0, -1.0) if scale.two_signed else (1.0,):
        for size in np.geomspace(0.5 * scale.ladder[0], strongest(scale, sign), AMPLITUDES):
            slides = sight.slides({name: float(sign * size)}, LOOKS)
            for survey in surveys:
                found = None if slides is None else sight.refit(slides, survey)
                largest[survey] = max(largest[survey], 0.0 if found is None else found.seen)
    return largest
