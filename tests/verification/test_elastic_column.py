from __future__ import annotations

import pytest

from benchmarks.verification import elastic_column

KNOWN_MISSES = {
    # Nodes on and below the ground are both held, though the spline of the node above reaches
    # below the ground: the two lowest cells are off whatever their size. Walls likewise.
    "settled: stress, lowest 3 cells",
    "settled: stress, beside smooth walls",
    "settled: stress, rms error per halving of the cell",
    "gravity_on: stress, above the lowest 3 cells",
    "gravity_on: stress, lowest 3 cells",
    "gravity_on: stress, beside smooth walls",
    "gravity_on: stress, rms error per halving of the cell",
    "gravity_on: settlement",
}


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    found = elastic_column.run(folder, quick=True)
    assert (folder / "elastic_column.png").stat().st_size > 10_000
    return {row.quantity: row for row in found}


def test_everything_else_is_within_tolerance(rows):
    assert set(rows) > KNOWN_MISSES
    for name in set(rows) - KNOWN_MISSES:
        assert rows[name].passed, rows[name]


@pytest.mark.parametrize("name", sorted(KNOWN_MISSES))
@pytest.mark.xfail(strict=True, reason="contact at nodes, see docs/verification.md")
def test_known_misses(rows, name):
    assert rows[name].passed
