"""Calibration: do intervals and probabilities hold what they state?

In: judged cases. Out: how often the interval of the first parameter that the verdict quotes holds
the truth, at each level, and how often an explanation is right by the probability it was given
(reliability). A level is met where it lies in the 95 % interval of the share.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.hidden_effects.scoring.intervals import Share
from benchmarks.hidden_effects.scoring.score import Judged

#: Levels of the intervals, and their half widths in standard deviations.
LEVELS = {"50%": (0.50, 0.6745), "80%": (0.80, 1.2816), "95%": (0.95, 1.9600)}
#: Ends of the bins of stated probabilities.
STATED = (0.0, 0.2, 0.5, 0.8, 0.95, 1.0)

IsRight = Callable[[Judged, Sequence[str]], bool]
"""(case, effects of an explanation) -> it is what was hidden."""


def exactly(one: Judged, names: Sequence[str]) -> bool:
    """The explanation is exactly what was hidden; none where nothing was."""
    return set(names) == one.hidden


@dataclass(frozen=True)
class Reliability:
    """Explanations that were given a probability within a bin.

    Attributes:
        stated: mean of the probabilities; None of nothing.
        right: how many were right.
    """

    stated: float | None
    right: Share


@dataclass(frozen=True)
class Calibration:
    """What was stated against what was so.

    Attributes:
        coverage: level -> how often its interval holds the truth.
        reliability: by bin of `STATED`.
    """

    coverage: dict[str, Share]
    reliability: list[Reliability]

    @property
    def document(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "coverage": {level: share.document for level, share in self.coverage.items()},
            "reliability": [
                {"stated": one.stated, "right": one.right.document} for one in self.reliability
            ],
        }


def in_band(level: str, share: Share) -> bool | None:
    """The level lies in the interval of the share; None of nothing."""
    low, high = share.interval
    return low <= LEVELS[level][0] <= high if share.n else None


def covers(one: Judged, level: str) -> bool:
    """The quoted interval of the first parameter holds the truth.

    Where a digest of an earlier version quotes none, that of the final model, Gaussian in its
    logarithm.
    """
    name, true = next(iter(one.truth["parameters"].items()))
    quoted = one.digest.quoted.get(name)
    if quoted is not None:
        low, high = quoted[level]
        return low <= true <= high
    final = one.digest.final
    wide = LEVELS[level][1] * final.std[name] / final.values[name]
    return bool(abs(math.log(final.values[name] / true)) <= wide)


def calibration(judged: Sequence[Judged], is_right: IsRight = exactly) -> Calibration:
    """Coverage of the intervals and reliability of the probabilities.

    Args:
        judged: cases.
        is_right: whether an explanation is what was hidden.
    """
    coverage = {level: Share.of(covers(one, level) for one in judged) for level in LEVELS}
    given = [
        (probability, is_right(one, names))
        for one in judged
        for names, probability in zip(one.digest.set_90, one.digest.shares, strict=False)
    ]
    reliability = []
    for low, high in zip(STATED, STATED[1:], strict=False):
        last = high == STATED[-1]
        own = [(p, ok) for p, ok in given if low <= p < high or (last and p == high)]
        stated = round(statistics.mean(p for p, _ in own), 4) if own else None
        reliability.append(Reliability(stated, Share.of(ok for _, ok in own)))
    return Calibration(coverage, reliability)
