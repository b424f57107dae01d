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
"""Of the largest number in size; of 1 where all are smaller: scores count standard deviations."""


def largest(items: Iterable[T], number: Callable[[T], float], default: T | None = None) -> T:
    """The first item whose number is as large as any.

    Args:
        items: candidates, in the order in which equals are taken.
        number: of an item.
        default: taken where there are no items.

    Raises:
        ValueError: no items and no default.
    """
    order = ranked(items, number)
    if not order and default is None:
        raise ValueError("largest() of nothing")
    return order[0] if order else default


def smallest(items: Iterable[T], number: Callable[[T], float], default: T | None = None) -> T:
    """The first item whose number is as small as any; as `largest`."""
    return largest(items, lambda item: -number(item), default)


def ranked(items: Iterable[T], number: Callable[[T], float]) -> list[T]:
    """Items by falling number; equals keep their order, and what is not a number comes last."""
    known = [(_or_last(number(item)), item) for item in items]
    finite = [abs(value) for value, _ in known if math.isfinite(value)]
    allowed = RELATIVE * max([1.0, *finite])
    falling = sorted(known, key=lambda one: -one[0])
    found: list[T] = []
    while falling:
        top = falling[0][0]
        equal = sum(value == top or top - value <= allowed for value, _ in falling)
        here = {id(pair) for pair in falling[:equal]}
        found += [pair[1] for pair in known if id(pair) in here]
        falling = falling[equal:]
    return found


def _or_last(number: float) -> float:
    return -math.inf if math.isnan(number) else float(number)


def largest_place(numbers: Iterable[float]) -> int:
    """Place of the first number that is as large as any."""
    known = list(numbers)
    return largest(range(len(known)), known.__getitem__)
