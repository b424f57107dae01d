from __future__ import annotations

from benchmarks.verification import block_on_incline


def test_quick_version_is_within_tolerance(tmp_path):
    for row in block_on_incline.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "block_on_incline.png").stat().st_size > 10_000
