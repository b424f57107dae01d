from __future__ import annotations

import numpy as np
import pytest

from benchmarks.verification import aluminium_bars


@pytest.mark.slow
def test_quick_version_is_within_tolerance_but_for_the_toe():
    plain, inertial = np.array_split(aluminium_bars.run(None, quick=True), 2)
    surface, toe, failure_line = plain
    assert surface.passed, surface
    assert failure_line.passed, failure_line
    # Known miss, explained in the module: the thin front runs too far. It must not grow.
    assert 0.0 < toe.error < 0.20, toe
    # What was missing: friction mu(I) at the bars' own size.
    assert all(row.passed for row in inertial), inertial
    assert inertial[0].measured < 0.6 * surface.measured
