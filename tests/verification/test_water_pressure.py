from __future__ import annotations

import pytest

from benchmarks.verification import water_pressure as case


def test_quick_version_is_within_tolerance(tmp_path):
    for row in case.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "water_pressure.png").stat().st_size > 10_000


def test_thrust_is_that_of_the_water_above_a_level():
    assert case.thrust(0.0) == pytest.approx(0.5 * 9810.0 * 10.0**2)
    assert case.thrust(4.0) == pytest.approx(0.5 * 9810.0 * 6.0**2)
    assert case.thrust(11.0) == 0.0
