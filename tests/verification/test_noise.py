from __future__ import annotations

import numpy as np
import pytest

from benchmarks.verification import noise


@pytest.mark.slow
def test_quick_version_is_within_tolerance(tmp_path):
    for row in noise.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "noise.png").stat().st_size > 10_000


@pytest.mark.slow
def test_even_pressure_has_no_noise():
    points = np.stack(np.meshgrid(np.arange(12.0), np.arange(9.0)), axis=-1).reshape(-1, 2)
    even = 3.0 + 2.0 * points[:, 0] - 5.0 * points[:, 1]
    assert np.abs(noise.off_the_plane(points, even)).max() < 1e-9
    alternating = even + np.where(points.sum(axis=1) % 2 == 0, 1.0, -1.0)
    ripple = noise.off_the_plane(points, alternating)
    assert np.sqrt(np.mean(ripple**2)) == pytest.approx(1.0, abs=0.1)
