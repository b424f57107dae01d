"""A small copy of the Lower San Fernando case: coarse, short, with a question."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.dams import dam_with_pool

QUESTION = """
parameters:
  - {name: residual_strength_1, label: S_r of the fill, zones: ["1"],
     property: residual_strength_kpa, start: 30, low: 5, high: 90}
  - {name: friction_7, zones: ["7"], property: friction_deg, start: 30, low: 27, high: 37}
fit: [upstream toe]
loss: runout
spacing_m: 4
variants:
  - {name: dry, water: none}
sensitivities:
  - name: top of the liquefied zone
    kind: zone_boundary
    vertices:
      - {at: [126.54, 18.5], move: [15.24, 6.0]}
      - {at: [176.75, 18.5], move: [2.93, 6.0]}
  - {name: pool level, kind: water_level, std_m: 0.5}
  - {name: time step, kind: time_step, factor: 0.5}
"""


@pytest.fixture
def lsfd(tmp_path: Path) -> Path:
    """A case folder that may be changed."""
    folder = dam_with_pool(tmp_path / "small_dam")
    (folder / "inversion.yaml").write_text(QUESTION)
    return folder
