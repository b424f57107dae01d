from __future__ import annotations

import shutil

import numpy as np
import pytest
import yaml

from geometry.scenes.fill import fill
from geometry.survey.crest_settlement import CrestSettlement
from geometry.survey.measured import Deposit, single_lengths
from geometry.survey.measurements import load_measurements
from geometry.survey.profiles import load_profile
from pipeline.cli import InputError


@pytest.fixture
def folder(case_folder, tmp_path):
    """A copy of Lower San Fernando that a test may spoil."""
    return shutil.copytree(case_folder, tmp_path / "case")


def spoil(folder, change) -> None:
    document = yaml.safe_load((folder / "measurements.yaml").read_text())
    change(document)
    (folder / "measurements.yaml").write_text(yaml.safe_dump(document))


def test_the_constructed_deposit_reads_as_measured(case_folder, dam, deposit):
    measurements = load_measurements(case_folder)
    before = fill(dam).position
    after = Deposit(deposit(1.0), before, 1.0, 1.0, {"left": measurements.foot("left")})
    readings = {m.type: float(m.observe(after)[0]) for m in single_lengths(measurements.chosen())}
    assert readings["toe_runout"] == pytest.approx(53.0, abs=0.5)
    assert readings["crest_settlement"] == pytest.approx(20.0, abs=0.5)
    assert readings["freeboard"] == pytest.approx(1.7, abs=0.2)
    for measurement in single_lengths(measurements.chosen()):
        assert not measurement.constructed


def test_crest_settlement_of_the_crests_own_points(dam):
    before = fill(dam).position
    sunk = before - [0.0, 7.0]
    crest = CrestSettlement(
        name="crest", type="crest_settlement", at="crest_points", value_m=7, std_m=1,
        confidence="recalled", source="here",
    )  # fmt: skip
    assert crest.observe(Deposit(sunk, before, 1.0, 1.0, {})) == pytest.approx([7.0])


def test_profile_in_pieces(case_folder):
    (measurement,) = load_measurements(case_folder).profiles
    assert measurement.constructed
    profile = load_profile(case_folder / measurement.file)
    (first, x_first, _), (second, x_second, _) = profile.pieces()
    assert (first, second) == ("constructed", "unchanged")
    assert x_first[0] == 23 and x_second[-1] == 369.2
    assert x_second[0] == x_first[-1], "a stretch begins where the one before ended"
    assert np.all(np.diff(profile.x) > 0)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda d: d.update(default_set="lab"), "default_set: 'lab' is none of field"),
        (lambda d: d["sets"]["field"][0].update(std_m=0), "std_m: Input should be greater than 0"),
        (lambda d: d["sets"]["field"][0].update(value_m=70), "value_m 70 lies outside low_m 42"),
        (lambda d: d["sets"]["field"][0].pop("high_m"), "give both or neither"),
        (lambda d: d["sets"]["field"][0].update(type="smell"), "'smell'.*'toe_runout'"),
        (lambda d: d["sets"]["field"][1].pop("x_m"), "x_m: give the place of the crest"),
        (
            lambda d: d["sets"]["field"][1].update(name="upstream toe"),
            "two measurements are called",
        ),
        (lambda d: d["sets"]["field"][2].update(weight=2), "weight: unknown key; allowed are name"),
        (lambda d: d["sets"]["field"][2].update(std=2), "std: unknown key; did you mean std_is or"),
        (
            lambda d: d["sets"]["field"][2].update(std=d["sets"]["field"][2].pop("std_m")),
            "sets.field.2.freeboard.std: unknown key; did you mean std_is or std_m",
        ),
        (lambda d: d["sets"]["field"][2].update(value_ft=5), "value_ft: .* did you mean value_m"),
        (lambda d: d["initial"].update(crest_ft=5), "initial.crest_ft: .*mean crest_x_m or crest"),
        (lambda d: d.update(colour=5), ".yaml: colour: unknown key; allowed are case, upstream"),
        (lambda d: d["sets"].update(lab=[]), "sets.lab: holds no measurement"),
        (
            lambda d: d["sets"]["field"][3].update(part="lost"),
            "part: 'lost' is not in .*; it has c",
        ),
        (lambda d: d["sets"]["field"][3].update(file="no.csv"), "no.csv: no such file"),
        (lambda d: d["sets"]["field"][3].update(correlation_length_m=0), "greater than 0"),
        (lambda d: d["sets"]["field"][3].update(model_std_m=-1), "greater than or equal to 0"),
        (lambda d: d["sets"]["field"][3].update(held_out_x_m=[9, 3]), "from 9 to 3; it must asc"),
        (lambda d: d["sets"]["field"][3].update(held_out_x_m=[1, 2]), "no point of .* 1 and 2 m"),
        (lambda d: d["sets"]["field"][3].update(held_out_x_m=[0, 900]), "every point of"),
        (
            lambda d: d["sets"]["field"][3].update(held_out_x_m=[60, 90], held_out=True),
            "leave held_out_x_m out",
        ),
        (lambda d: d["sets"]["field"][2].update(confidence="sure"), "'published', 'paper'"),
    ],
)
def test_what_does_not_hold_together_is_one_line(folder, change, complaint):
    spoil(folder, change)
    with pytest.raises(InputError, match=complaint) as caught:
        load_measurements(folder)
    assert "measurements.yaml" in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_are_no_measurements(tmp_path):
    with pytest.raises(InputError, match="measurements.yaml: no such file"):
        load_measurements(tmp_path)
    (tmp_path / "measurements.yaml").write_text("[1, 2]")
    with pytest.raises(InputError, match="must be a mapping of keys, not list"):
        load_measurements(tmp_path)
    for rows, complaint in (
        ("1,2\n3,4,x,y\n", "line 3: 4 cells for 2 columns"),
        ('"1\n",2\n3,4\n', "line 2: y_m"),
        ("1,2\n3\n", "line 3: y_m: None is not a finite number"),
    ):
        (tmp_path / "rows.csv").write_text("x_m,y_m\n" + rows)
        with pytest.raises(InputError, match=complaint):
            load_profile(tmp_path / "rows.csv")
    (tmp_path / "b.csv").write_bytes(bytes(range(128, 256)))
    with pytest.raises(InputError, match="b.csv: not a UTF-8 text file"):
        load_profile(tmp_path / "b.csv")
    with pytest.raises(InputError, match="p.csv: no such file"):
        load_profile(tmp_path / "p.csv")
