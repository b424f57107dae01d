"""What the fast tests may cost: examples of the property tests, CPU seconds of each test."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping

import numpy as np
from hypothesis import settings

LARGE = os.environ.get("HYPOTHESIS_PROFILE") == "large"

CPU_S = float(os.environ.get("CPU_BUDGET_S", "inf"))
"""CPU seconds of a fast test with its child processes; `make test` sets it."""
FAILS = 3.0
"""A test that takes so many times its budget fails the run; below, a loaded machine may be why."""
UNIT_S = 0.0205
"""What `_unit` takes on the processor that the budget is meant for, a Xeon with AVX-512 [CPU s]."""


def examples(number: int) -> int:
    """The examples of one property test, from the number that suits it in between."""
    return 4 * number if LARGE else max(10, number // 3)


# The small budget tries the same examples every time, so that `make test` is repeatable.
settings.register_profile("small", max_examples=examples(100), deadline=None, derandomize=True)
settings.register_profile("large", max_examples=examples(100), deadline=None)


def cpu_s() -> float:
    """CPU seconds of this process and of its children that have ended."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def slowness(work: Callable[[], None] | None = None, *, clock=time.process_time) -> float:
    """How much slower this processor is now than the one of the budget; at least 1."""
    taken = []
    for _ in range(5):
        begin = clock()
        (work or _unit)()
        taken.append(clock() - begin)
    return max(1.0, min(taken) / UNIT_S)


def _unit() -> None:
    """Half plain Python, half arrays, as the tests are."""
    total = 0
    for number in range(400_000):
        total += number % 7
    values = np.linspace(0.0, 1.0, 200_000)
    for _ in range(12):
        values = np.sqrt(values * values + 1.0) - 0.5
    assert total and values.size


def over(spent: Mapping[str, float], budget: float, factor: float) -> list[str]:
    """A line for each test that took more than its budget on a processor `factor` times slower."""
    return [
        f"{name}: {seconds:.1f} s of CPU, at most {budget * factor:.1f} s here: make it cheaper "
        "or mark it slow"
        for name, seconds in sorted(spent.items(), key=lambda one: -one[1])
        if seconds > budget * factor
    ]
