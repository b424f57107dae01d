"""Scores of many runs: medians by template, and the worst of them.

In: `gns.evaluation.metrics.RolloutScore`s. Out: tables of numbers. NaN (no meaning for the run) is
left out of a median, infinity (a rollout that is not finite) counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from gns.evaluation.metrics import RolloutScore

COLUMNS: tuple[tuple[str, Callable[[Sequence[RolloutScore]], float]], ...] = (
    ("runs", len),
    ("travel, d", lambda scores: _median(s.travel_m / s.spacing_m for s in scores)),
    ("position, d", lambda scores: _median(s.position_error_m / s.spacing_m for s in scores)),
    ("runout, m", lambda scores: _median(abs(s.runout_error_m) for s in scores)),
    ("runout, d", lambda scores: _median(abs(s.runout_error_spacings) for s in scores)),
    ("90 %, d", lambda scores: quantile((abs(s.runout_error_spacings) for s in scores), 0.9)),
    ("runout, % of travel", lambda scores: _median(abs(s.runout_error_percent) for s in scores)),
    ("profile, % of area", lambda scores: 100 * _median(s.profile_error_share for s in scores)),
    ("kinetic, % of peak", lambda scores: 100 * _median(s.kinetic_error for s in scores)),
    ("not finite", lambda scores: sum(not s.finite for s in scores)),
    ("left the scene", lambda scores: sum(not s.inside for s in scores)),
)
"""Columns of a table of scores: name, and the number for some runs. Medians but where it says."""


def by_template(scores: Sequence[RolloutScore]) -> dict[str, dict[str, float]]:
    """Table of scores: "all", then a row for each template; columns of COLUMNS."""
    letters = sorted({one.template for one in scores})
    groups = {"all": list(scores)}
    groups |= {letter or "-": [s for s in scores if s.template == letter] for letter in letters}
    return {
        name: {column: float(number(members)) for column, number in COLUMNS}
        for name, members in groups.items()
    }


def worst(scores: Sequence[RolloutScore], count: int = 5) -> list[RolloutScore]:
    """The runs with the largest errors of the runout, the worst first."""

    def key(one: RolloutScore) -> float:
        size = abs(one.runout_error_spacings)
        return -1.0 if math.isnan(size) else size

    return sorted(scores, key=key, reverse=True)[:count]


def _median(values: Iterable[float]) -> float:
    return quantile(values, 0.5)


def quantile(values: Iterable[float], share: float) -> float:
    """Of those that mean something (not NaN); infinite ones count. NaN where none does."""
    known = sorted(value for value in values if not math.isnan(value))
    if not known:
        return math.nan
    place = share * (len(known) - 1)
    low, high = known[math.floor(place)], known[math.ceil(place)]
    return low if low == high else low + (high - low) * (place - math.floor(place))
