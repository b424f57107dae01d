"""`--effects FILE` of the back-analysis: a section may have an effect of its user's."""

import shutil
from pathlib import Path

import pytest
import yaml

from flowslide.command_line import main
from mpm_taichi.effects.framework import registry
from pipeline.cli import InputError

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "my_effect.py"


@pytest.fixture
def folder(tmp_path):
    """Lower San Fernando with an effect that no library has."""
    case = tmp_path / "case"
    shutil.copytree(ROOT / "case_histories" / "lower_san_fernando_paper", case)
    scene = yaml.safe_load((case / "scene.yaml").read_text())
    scene["effects"] = {"strength_regain": 0.1}
    (case / "scene.yaml").write_text(yaml.safe_dump(scene))
    yield case
    registry._users.clear()


@pytest.mark.parametrize("command", [["invert"], ["predict", "--residual-strength", "20"]])
def test_a_file_that_is_not_there_is_refused(command, tmp_path):
    with pytest.raises(InputError, match="none.py: No such file"):
        main([*command, "lower_san_fernando_paper", "--effects", str(tmp_path / "none.py")])


@pytest.mark.slow
def test_a_section_with_a_user_s_effect_needs_its_file(folder, tmp_path):
    arguments = ["invert", str(folder), "--spacing", "4", "--quick", "--report", "none",
                 "--threads", "1", "--quiet", "--out", str(tmp_path / "out")]  # fmt: skip
    with pytest.raises(InputError, match="effect 'strength_regain' is unknown"):
        main(arguments)
    assert not main([*arguments, "--effects", str(EXAMPLE)])
    assert (tmp_path / "out" / "result.json").exists()
