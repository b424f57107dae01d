"""How many examples the property tests try: few in `make test`, many in `make test-all`."""

from __future__ import annotations

import os

from hypothesis import settings

LARGE = os.environ.get("HYPOTHESIS_PROFILE") == "large"


def examples(number: int) -> int:
    """The examples of one property test, from the number that suits it in between."""
    return 4 * number if LARGE else max(10, number // 3)


# The small budget tries the same examples every time, so that `make test` is repeatable.
settings.register_profile("small", max_examples=examples(100), deadline=None, derandomize=True)
settings.register_profile("large", max_examples=examples(100), deadline=None)
