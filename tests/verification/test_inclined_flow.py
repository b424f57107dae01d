from __future__ import annotations

import pytest

from benchmarks.verification import inclined_flow


@pytest.mark.slow
def test_quick_version_is_within_tolerance():
    rows = inclined_flow.run(None, quick=True)
    assert len(rows) == 2
    for row in rows:
        assert row.passed, row
