from __future__ import annotations

from benchmarks.verification import granular_column


def test_quick_version_is_within_tolerance():
    for row in granular_column.run(None, quick=True):
        assert row.passed, row
