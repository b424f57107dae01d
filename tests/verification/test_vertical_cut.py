from __future__ import annotations

import numpy as np
import pytest

from benchmarks.verification import vertical_cut
from benchmarks.verification.strength_reduction import Ramp


@pytest.mark.slow
def test_quick_version_is_within_tolerance(tmp_path):
    for row in vertical_cut.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "vertical_cut.png").stat().st_size > 10_000


def test_a_slope_that_stands_has_no_limit():
    nothing = np.zeros((1, 2))
    ramp = Ramp(np.linspace(1, 2, 5), np.zeros(5), np.full(5, 0.01), nothing, nothing, 1.0)
    with pytest.raises(ValueError, match="stands up to F = 2"):
        _ = ramp.limit
