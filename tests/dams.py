"""A dam with a pool for tests: seven zones, level base, coarse spacings allowed."""

from __future__ import annotations

import shutil
from pathlib import Path

from tests.conftest import ROOT

POOL_M = 35.9


def dam_with_pool(folder: Path) -> Path:
    """A copy of the section that the paper assumes for Lower San Fernando, with its reservoir."""
    shutil.copytree(ROOT / "case_histories" / "lower_san_fernando_paper", folder)
    path = folder / "scene.yaml"
    text = path.read_text()
    assert "water_level: null" in text
    path.write_text(text.replace("water_level: null", f"water_level: {POOL_M}"))
    return folder
