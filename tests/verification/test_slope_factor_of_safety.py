from __future__ import annotations

import numpy as np
import pytest

from benchmarks.verification import slope_factor_of_safety as case
from benchmarks.verification.infinite_slope import Slab


@pytest.mark.slow
def test_quick_version_is_within_tolerance(tmp_path):
    for row in case.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "slope_factor_of_safety.png").stat().st_size > 10_000


def test_formula_of_the_infinite_slope():
    slab = Slab(30.0, 0.0, "rough", level=True)
    assert slab.formula == pytest.approx(np.tan(np.radians(30)) / np.tan(np.radians(20)))
    assert slab.whole == pytest.approx(slab.formula)  # ends matter to cohesion alone
    # At failure sin(phi_F) = tan(b): the plane has sigma sin(phi).
    reduced = np.arctan(np.tan(np.radians(30)) / slab.without_dilation(slab.formula))
    assert np.sin(reduced) == pytest.approx(np.tan(np.radians(20)))
    clay = Slab(0.0, 0.4, "rough", level=True)
    assert clay.formula == pytest.approx(0.4 / (np.sin(clay.slope) * np.cos(clay.slope)))
    assert clay.without_dilation(clay.formula) == pytest.approx(clay.formula)
    assert 1.0 < clay.whole / clay.formula < 1.03
