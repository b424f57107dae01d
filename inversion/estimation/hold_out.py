"""Step 0: what no fit may see, decided before the first fit.

A contiguous block of a series and a whole measurement, or what the file names. Every fifth point of
a profile would merely be interpolated by its neighbours. Where little was measured nothing is held
out: two numbers of four would be half of what is known.

A block that no model changes has no power. What is held out therefore lies where the parameters
change the predictions; the measured values have no part in the choice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from inversion.estimation.data import Places, Split, Targets, places_of
from pipeline.cli import InputError

#: A series gives a block once it has this many numbers, and then this share of them, two at least,
#: which of fewer would be more than a quarter. By judgement: the fit misses twice as much.
LEAST_SERIES, SHARE = 8, 0.2
#: Where the block begins, as a share of the series: past the middle, so that both ends are fitted.
BEGIN = 0.6
#: A block elsewhere is taken where the usual one moves by less than this share of the most mobile.
#: By judgement: one that moves half as much still shows a wrong model.
MOBILE = 0.5
#: A whole measurement is held out where at least this many of its kind were made: two are within,
#: to choose from, and three are left to fit.
LEAST_ALIKE = 4


@dataclass(frozen=True)
class HoldOut:
    """Data kept out of every fit, where the measurement file does not say it itself.

    Attributes:
        groups: names of whole measurements.
        blocks: measurement -> (from, to): its numbers between are held out, in the unit of its
            places (x [m] of a profile, time [s] of a history).
    """

    groups: tuple[str, ...] = ()
    blocks: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def split(targets: Targets, wanted: HoldOut | None, predictions: np.ndarray | None = None) -> Split:
    """Decide what is held out.

    Args:
        targets: the measurements with their roles.
        wanted: what the case names; None: what the measurement file holds out, or, where it holds
            out nothing, a block of each long series and one of several measurements of a kind.
        predictions: by different parameters, (n, m), which show where the numbers move; None: not
            known.

    Raises:
        InputError: a name that does not exist, a block without numbers, or nothing left to fit.
    """
    by_file = np.array([role == "held out" for role in targets.roles], dtype=bool)
    may = targets.fitted
    if wanted is not None:
        extra, words = _named(targets, wanted), "as the case says"
    elif by_file.any():
        extra, words = np.zeros_like(may), "as the measurement file says"
    else:
        extra, words = _automatic(targets, may, mobility(targets, predictions)), "automatically"
    held = (extra & may) | by_file
    fitted = may & ~held
    if not fitted.any():
        raise InputError("hold_out: nothing is left to fit; hold out less")
    if targets.limits_alone:
        return Split(fitted, np.zeros_like(held), "nothing can contradict a strength that held")
    return Split(fitted, held, words if held.any() else "nothing is held out")


def _named(targets: Targets, wanted: HoldOut) -> np.ndarray:
    chosen = np.zeros(len(targets.names), dtype=bool)
    known = {place.name: place for place in places_of(targets)}
    for name in [*wanted.groups, *wanted.blocks]:
        if name not in known:
            raise InputError(
                f"hold_out: no measurement {name!r}; there are {', '.join(sorted(known))}"
            )
    for name in wanted.groups:
        chosen[known[name].index] = True
    for name, (begin, end) in wanted.blocks.items():
        inside = (known[name].place >= begin) & (known[name].place <= end)
        if not inside.any():
            raise InputError(
                f"hold_out: blocks: {name!r} has no number between {begin:g} and {end:g}"
            )
        chosen[known[name].index[inside]] = True
    return chosen


def mobility(targets: Targets, predictions: np.ndarray | None) -> np.ndarray:
    """How far parameters move each number, in the survey's standard deviations, (m,).

    Args:
        targets: the measurements.
        predictions: by different parameters, (n, m); rows of NaN are left out. With fewer than two
            that were read all numbers count as equally mobile.
    """
    rows = np.zeros((0, len(targets.names))) if predictions is None else predictions
    rows = rows[np.all(np.isfinite(rows), axis=1)]
    if len(rows) < 2:
        return np.ones(len(targets.names))
    return np.std(rows, axis=0) / np.sqrt(np.diag(targets.covariance))


def _automatic(targets: Targets, may: np.ndarray, mobile: np.ndarray) -> np.ndarray:
    chosen = np.zeros(len(targets.names), dtype=bool)
    for place in places_of(targets):
        index = place.index[may[place.index]]
        if place.series and len(index) >= LEAST_SERIES:
            n = max(round(SHARE * len(index)), 2)
            windows = [index[begin : begin + n] for begin in range(1, len(index) - n)]
            usual = round(BEGIN * len(index)) - 1
            chosen[_mobile_one(windows, usual, mobile)] = True
    for alike in _of_a_kind(targets, may):
        if len(alike) >= LEAST_ALIKE:
            # Not the first or the last: those are extrapolated rather than predicted.
            inner = [place.index for place in alike[1:-1]]
            chosen[_mobile_one(inner, len(alike) // 2 - 1, mobile)] = True
    return chosen


def _mobile_one(windows: Sequence[np.ndarray], usual: int, mobile: np.ndarray) -> np.ndarray:
    """The usual one of some windows, or the nearest to it that moves enough."""
    size = np.array([np.linalg.norm(mobile[window]) for window in windows])
    enough = np.flatnonzero(size >= MOBILE * size.max())
    return windows[int(min(enough, key=lambda place: abs(place - usual)))]


def _of_a_kind(targets: Targets, may: np.ndarray) -> Sequence[list[Places]]:
    """Measurements of one type that are not series, grouped."""
    kinds: dict[str, list[Places]] = {}
    for entry, place in zip(targets.entries, places_of(targets), strict=True):
        if not place.series and may[place.index].all():
            kinds.setdefault(type(entry).__name__, []).append(place)
    return list(kinds.values())
