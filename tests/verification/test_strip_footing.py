from __future__ import annotations

import pytest

from benchmarks.verification import strip_footing


@pytest.mark.slow
def test_quick_version_is_within_tolerance(tmp_path):
    for row in strip_footing.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "strip_footing.png").stat().st_size > 10_000


@pytest.mark.slow
def test_averaging_lowers_the_load():
    assert strip_footing.press(0.2, averaged=True).limit < (
        0.95 * strip_footing.press(0.2, averaged=False).limit
    )
