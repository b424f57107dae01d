from __future__ import annotations

import numpy as np
import pytest

from benchmarks.verification import residual_deposit as case


@pytest.mark.slow
def test_quick_version_is_within_tolerance(tmp_path):
    for row in case.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "residual_deposit.png").stat().st_size > 10_000


def test_closed_form_is_in_balance():
    """Section force of the yield state, integrated numerically, against the shear of the ground."""
    height, length = 6.0, 0.3
    toe = case.toe_of(height, length)
    x = np.linspace(0.0, 0.9 * toe, 50)
    s = (np.arange(20_000) + 0.5) / 20_000
    for h, ahead in zip(case.profile(x, toe, length), toe - x, strict=True):
        lateral = -(1.0 - s) * h + 2.0 * length * np.sqrt(1.0 - (1.0 - s) ** 2)
        assert lateral.mean() * h == pytest.approx(-length * ahead, rel=1e-4)


def test_area_gives_the_height_back():
    area = case.area_of(6.0, 0.3)
    assert case.height_of(area, 0.3) == pytest.approx(6.0)
    assert case.length_of(area, 0.05) == pytest.approx(0.3)
    x = np.linspace(0.0, case.toe_of(6.0, 0.3), 200_001)[:-1]
    assert np.mean(case.profile(x, x[-1], 0.3)) * x[-1] == pytest.approx(area, rel=1e-4)
