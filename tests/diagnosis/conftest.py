"""What the tests of the diagnosis share: the example with a hidden effect, coarse and quick."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from inversion.engines.run_store import RunStore


@pytest.fixture
def embankment(root: Path, tmp_path: Path) -> Path:
    """A copy of the example's folder that may be changed."""
    folder = tmp_path / "embankment"
    shutil.copytree(root / "docs" / "examples" / "hidden_effect", folder)
    return folder


@pytest.fixture(scope="session")
def kept_runs(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    """Runs shared by all tests of a session; equal scenes are simulated once."""
    return RunStore(tmp_path_factory.mktemp("runs"), threads=1)
