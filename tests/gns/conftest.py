"""A small data set, packed once."""

from __future__ import annotations

from pathlib import Path

import pytest

from gns.data.pack import pack, plan_packing
from pipeline.config import PackSettings
from tests.gns.runs import write_batch

SETTINGS = PackSettings(valid_share=0.2, test_share=0.2, runs_per_shard=8)


@pytest.fixture(scope="session")
def batches(tmp_path_factory) -> list[Path]:
    """Trajectories of 30 runs in two files."""
    folder = tmp_path_factory.mktemp("trajectories")
    return [
        write_batch(folder / "batch_000.h5", range(20)),
        write_batch(folder / "batch_001.h5", range(20, 30)),
    ]


@pytest.fixture(scope="session")
def packed(batches, tmp_path_factory) -> Path:
    """The same, packed; for reading only."""
    folder = tmp_path_factory.mktemp("dataset")
    pack(plan_packing(batches, SETTINGS), folder, {})
    return folder
