"""Halving the time step or the cell does not change the runout (quick version)."""

import pytest

from benchmarks.verification import convergence


@pytest.mark.slow
def test_convergence():
    rows = convergence.run(None, quick=True)
    assert len(rows) == 4
    assert all(row.passed for row in rows), rows
