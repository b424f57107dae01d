from __future__ import annotations

import pytest

from benchmarks.verification import material_paths


@pytest.mark.slow
def test_quick_version_is_within_tolerance(tmp_path):
    for row in material_paths.run(tmp_path, quick=True):
        assert row.passed, row
    assert (tmp_path / "material_paths.png").stat().st_size > 10_000
