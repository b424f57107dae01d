"""Halving the time step or the cell does not change the runout (quick version)."""

from benchmarks.verification import convergence


def test_convergence():
    rows = convergence.run(None, quick=True)
    assert len(rows) == 4
    assert all(row.passed for row in rows), rows
