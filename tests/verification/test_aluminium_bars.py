from __future__ import annotations

import pytest

from benchmarks.verification import aluminium_bars


@pytest.mark.slow
def test_quick_version_is_within_tolerance_but_for_the_toe():
    surface, toe, failure_line = aluminium_bars.run(None, quick=True)
    assert surface.passed, surface
    assert failure_line.passed, failure_line
    # Known miss, explained in the module: the thin front runs too far. It must not grow.
    assert 0.0 < toe.error < 0.20, toe
