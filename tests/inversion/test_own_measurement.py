"""A user's own type of measurement end to end: read, predicted, fitted, in tables and proposals."""

import json
import shutil
from pathlib import Path

import pytest
import yaml

from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.possible_measurements import possible_measurements
from flowslide.command_line import main as flowslide
from geometry.case import load_case
from geometry.survey import registry
from pipeline.cli import InputError

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "my_measurement.py"
ENTRY = {"name": "centroid", "type": "centroid_travel", "value_m": -12.0, "std_m": 1.0,
         "confidence": "assumed", "source": "a test"}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """Lower San Fernando with a measurement that no library has, in the fit."""
    case = tmp_path / "case"
    shutil.copytree(ROOT / "case_histories" / "lower_san_fernando_paper", case)
    survey = yaml.safe_load((case / "measurements.yaml").read_text())
    survey["sets"][survey["default_set"]].append(ENTRY)
    (case / "measurements.yaml").write_text(yaml.safe_dump(survey))
    question = yaml.safe_load((case / "inversion.yaml").read_text())
    question |= {"fit": ["upstream toe", "centroid"], "loss": "misfit"}
    (case / "inversion.yaml").write_text(yaml.safe_dump(question))
    registry._users.clear()
    yield case
    registry._users.clear()


@pytest.mark.slow
def test_a_users_measurement_from_the_file_to_the_tables(folder, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["invert", str(folder), "--spacing", "4", "--quick", "--report", "none",
                 "--threads", "1", "--quiet", "--out", str(out)]  # fmt: skip
    with pytest.raises(InputError, match="'centroid_travel'.*need --measurements-code FILE") as no:
        flowslide(arguments)
    assert "\n" not in str(no.value)
    code = ["--measurements-code", str(EXAMPLE)]
    assert not flowslide(["check", str(folder), *code])
    assert "centroid (centroid_travel)" in capsys.readouterr().out
    assert not flowslide([*arguments, *code])
    assert "centroid travel" in capsys.readouterr().out
    result = json.loads((out / "result.json").read_text())
    (row,) = [one for one in result["measurements"] if one["name"] == "centroid"]
    assert row["role"] == "fitted" and row["unit"] == "m" and row["measured"] == -12.0
    assert -40.0 < row["predicted"] < -2.0, "the slide runs to the left"
    with pytest.raises(InputError, match="'centroid_travel'"):
        diagnosis_case(load_case(folder), spacing_m=4.0)  # a command forgets what it was given
    registry.load_measurements_code(EXAMPLE)
    case = diagnosis_case(load_case(folder), spacing_m=4.0)
    assert "centroid" in case.setup.targets.names
    assert "travel of the centroid" not in [e.name for e in possible_measurements(case.setup)]
