"""The largest, the smallest and the order of computed numbers, alike on every processor.

Numbers that are equal in exact arithmetic differ in their last bits, and which of them is larger
depends on the kernels of the linear algebra. Here numbers that agree to `RELATIVE` are equal, and
among equals the first in the order of the arguments is taken. What is chosen by a computed number
(scores, cosines, evidence, sums of squares, starts of a search) is chosen by these functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TypeVar

T = TypeVar("T")

RELATIVE = 1e-9
"""Of the larger of two numbers, or of 1 where it is smaller: scores count standard deviations."""


def largest(
    items: Iterable[T], number: Callable[[T], float], default: T | None = None, *, unit: float = 1.0
) -> T:
    """The first item whose number is as large as any.

    Args:
        items: candidates, in the order in which equals are taken.
        number: of an item.
        default: taken where there are no items.
        unit: numbers below it are equal if they agree to `RELATIVE` of it; 0 for probabilities,
            of which 1e-12 and 1e-40 are not the same.

    Raises:
        ValueError: no items and no default.
    """
    known = list(items)
    if not known:
        if default is None:
            raise ValueError("largest() of nothing")
        return default
    numbers = [_or_last(number(item)) for item in known]
    top = max(numbers)
    return next(item for item, one in zip(known, numbers, strict=True) if _equal(top, one, unit))


def smallest(
    items: Iterable[T], number: Callable[[T], float], default: T | None = None, *, unit: float = 1.0
) -> T:
    """The first item whose number is as small as any; as `largest`."""
    return largest(items, lambda item: -number(item), default, unit=unit)


def ranked(items: Iterable[T], number: Callable[[T], float]) -> list[T]:
    """Items by falling number; equals keep their order, and what is not a number comes last."""
    known = list(items)
    numbers = [_or_last(number(item)) for item in known]
    found: list[int] = []
    equal: list[int] = []
    for place in sorted(range(len(known)), key=lambda place: -numbers[place]):
        if equal and not _equal(numbers[equal[0]], numbers[place]):
            found, equal = found + sorted(equal), []
        equal.append(place)
    return [known[place] for place in found + sorted(equal)]


def largest_place(numbers: Iterable[float]) -> int:
    """Place of the first number that is as large as any."""
    known = list(numbers)
    return largest(range(len(known)), known.__getitem__)


def _or_last(number: float) -> float:
    return -math.inf if math.isnan(number) else float(number)


def _equal(larger: float, number: float, unit: float = 1.0) -> bool:
    if not math.isfinite(larger):
        return number == larger
    return larger - number <= RELATIVE * max(unit, abs(larger))
