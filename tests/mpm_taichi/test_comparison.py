"""The command `case`, with the real solver on Lower San Fernando at coarse spacing."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure
from PIL import Image

from flowslide.command_line import main
from geometry.case import load_case
from mpm_taichi import comparison
from pipeline.cli import InputError, WorkFailed
from report.pictures.case_history import distances, line_overlay
from tests.dams import dam_with_pool

SHORT = ["--set", "simulation.duration_s=2", "--threads", "1", "--quiet"]
LIQUEFIED = "liquefied_hydraulic_fill"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return dam_with_pool(tmp_path_factory.mktemp("case") / "dam")


@pytest.fixture(scope="module")
def simulated(folder):
    """The whole slide at 4 m spacing."""
    case = load_case(folder).resolved(spacing_m=4.0)
    return case, comparison.simulate_case(case, threads=1)


def test_readings_of_a_coarse_slide(simulated):
    case, run = simulated
    readings = {r.type: r for r in comparison.read_deposit(case, run)}
    assert set(readings) == {
        "toe_runout", "naked_eye_toe", "crest_settlement", "freeboard", "slide_duration"
    }  # fmt: skip
    assert 5 < readings["slide_duration"].simulated < run.time[-1]
    assert 20 < readings["toe_runout"].simulated < 110
    assert readings["toe_runout"].simulated < readings["naked_eye_toe"].simulated
    assert readings["toe_runout"].at_start < -4  # a gentle foot reads short, and is not hidden
    assert 10 < readings["crest_settlement"].simulated < 25
    assert readings["crest_settlement"].at_start == 0.0
    assert readings["freeboard"].at_start == pytest.approx(46.37 - 35.9, abs=1.5)
    toe = readings["toe_runout"]
    assert toe.difference == pytest.approx(toe.simulated - 53.0)
    assert toe.difference_in_std == pytest.approx((toe.simulated - 53.0) / 5.75)
    assert readings["naked_eye_toe"].difference is None


def test_the_table_says_how_far_each_value_may_be_trusted(simulated):
    case, run = simulated
    text = comparison.table(case, comparison.read_deposit(case, run))
    lines = {line.split("  ")[0]: line for line in text.splitlines()}
    assert "value paper, std assumed" in lines["toe runout (upstream toe)"]
    assert "value published, std published" in lines["freeboard"]
    assert lines["profile"].endswith("constructed: drawn, not compared")
    assert "Nothing is subtracted" in text
    assert "S_r 21.5 kPa; water at 35.9 m (pore pressure)\n" in comparison.heading(case, run)
    shaken = replace(case, scene=case.scene.changed(effects={"shaking": -0.2, "weak_base": 0}))
    assert "(pore pressure); with shaking -0.2 g\n" in comparison.heading(shaken, run)


def test_the_energy_adds_up(simulated):
    _, run = simulated
    text = comparison.energy_line(run)
    shares = [float(part.split(" %")[0]) for part in text.split("released: ")[1].split(", ")]
    assert sum(shares) == pytest.approx(100.0, abs=0.3)
    assert "plastic" in text and "numerical" in text


def test_the_command_writes_all(folder, tmp_path, capsys):
    main(["simulate", str(folder), "--out", str(tmp_path), "--spacing", "4", *SHORT])
    out = capsys.readouterr().out
    assert out.startswith(
        "Lower San Fernando Paper: liquefied hydraulic fill S_r 21.5 kPa; water at"
    )
    assert "slide duration [s]" in out
    assert "not read" in out and "duration: the run was stopped in motion at 2" in out
    assert "stopped after 2.0 s" in out and f"Picture: {tmp_path / 'runout.png'}" in out
    assert {path.name for path in tmp_path.iterdir()} == {
        "runout.png",
        "runout.mp4",
        "observables.csv",
    }
    with Image.open(tmp_path / "runout.png") as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert pixels.shape[1] == 1430 and pixels.std() > 20
    with (tmp_path / "observables.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["type"] for row in rows] == [
        "toe_runout", "naked_eye_toe", "crest_settlement", "freeboard", "slide_duration",
    ]  # fmt: skip
    assert rows[-1]["simulated"] == rows[-1]["difference"] == ""
    toe = rows[0]
    assert (toe["measured"], toe["low"], toe["std"], toe["std_is"], toe["unit"]) == (
        "53.0", "42.0", "5.75", "assumed", "m",
    )  # fmt: skip
    difference = float(toe["simulated"]) - 53.0
    assert float(toe["difference"]) == pytest.approx(difference, abs=1e-3)
    assert rows[1]["measured"] == rows[1]["difference"] == ""


def test_results_that_cannot_be_written_are_not_simulated(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(comparison, "simulate_case", None)
    (tmp_path / "file").write_text("")
    (tmp_path / "out" / "observables.csv").mkdir(parents=True)
    for out, complaint in (("file", "cannot be written"), ("out", "observables.csv: is a folder")):
        with pytest.raises(InputError, match=complaint):
            main(["simulate", str(folder), "--out", str(tmp_path / out), "--spacing", "4", *SHORT])


def test_options_change_the_scene(folder, tmp_path, capsys):
    dry = ["--no-water", "--strength", f"{LIQUEFIED}=40", "--strength", "clay_core=25"]
    options = ["--spacing", "4", "--film", "gif", *dry, *SHORT]
    main(["simulate", str(folder), "--out", str(tmp_path), *options])
    assert "liquefied hydraulic fill S_r 40 kPa; no water" in capsys.readouterr().out
    assert (tmp_path / "runout.gif").exists() and not (tmp_path / "runout.mp4").exists()
    case = load_case(folder).changed(water=False, strengths={"clay_core": 25.0})
    assert case.scene.materials["clay_core"].cohesion_kpa == 25.0 and not case.scene.has_water
    assert case.scene.spacing == 1.0


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--spacing", "-1"], "--spacing -1: must be greater than 0 m"),
        (["--spacing", "30"], "scene.yaml at 30 m spacing"),
        (["--strength", "jelly=3"], "has no material 'jelly'; it has liquefied_hydraulic_fill"),
        (["--set", "simulation.corant=1"], "did you mean courant"),
    ],
)
def test_bad_choices_are_one_line_and_leave_nothing(folder, tmp_path, options, complaint):
    with pytest.raises(InputError, match=complaint):
        main(["simulate", str(folder), "--out", str(tmp_path / "out"), *options])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "value", ["clay_core", "clay_core=", "clay_core=-1", "clay_core=nan", "=3"]
)
def test_a_strength_is_material_and_number(folder, tmp_path, value, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["simulate", str(folder), "--out", str(tmp_path), "--strength", value])
    assert caught.value.code == 2
    assert "is not MATERIAL=KPA" in capsys.readouterr().err


def test_folders_that_are_no_case(folder, tmp_path):
    with pytest.raises(InputError, match="no such folder; a case has scene.yaml, and meas"):
        main(["simulate", str(tmp_path / "nowhere"), "--out", str(tmp_path)])
    shutil.copy(folder / "scene.yaml", tmp_path)
    with pytest.raises(InputError, match="measurements.yaml: no such file"):
        main(["simulate", str(tmp_path), "--out", str(tmp_path), "--set-of-measurements", "field"])


def test_a_run_that_a_guard_stops_is_failed_work(folder, tmp_path):
    options = ["--spacing", "4", "--set", "simulation.time_step_s=0.5", *SHORT]
    with pytest.raises(WorkFailed, match="lower_san_fernando_paper: stopped at .* s: "):
        main(["simulate", str(folder), "--out", str(tmp_path), *options])
    assert not list(tmp_path.iterdir())


def test_marks_of_the_picture(simulated):
    case, run = simulated
    ax = Figure().add_subplot()
    line_overlay(case)(ax)
    labels = ax.get_legend_handles_labels()[1]
    assert labels == ["profile after the slide: constructed", "profile after the slide: unchanged"]
    ax = Figure().add_subplot()
    distances(case, comparison.read_deposit(case, run))(ax)
    words = [text.get_text() for text in ax.texts if text.get_text()]
    assert words[0] == "53 m measured (42-65 m)" and words[1].endswith(" m simulated")


def test_a_case_of_another_shape(folder, tmp_path):
    """A right-hand toe, no range, no profile, no water: nothing is special about one dam."""
    shutil.copytree(folder, tmp_path / "case")
    path = tmp_path / "case" / "measurements.yaml"
    document = yaml.safe_load(path.read_text())
    document["sets"]["field"] = [
        {
            "name": "downstream toe",
            "type": "toe_runout",
            "side": "right",
            "value_m": 0.5,
            "std_m": 1.0,
            "confidence": "recalled",
            "source": "a test",
        }
    ]
    path.write_text(yaml.safe_dump(document))
    out = tmp_path / "out"
    options = ["--no-water", "--spacing", "4", "--film", "none", *SHORT]
    main(["simulate", str(tmp_path / "case"), "--out", str(out), *options])
    assert {path.name for path in out.iterdir()} == {"runout.png", "observables.csv"}


def test_every_type_of_measurement_is_read(folder, simulated, tmp_path):
    """Markers, histories, velocities and a surveyed profile stand in the table and in the CSV."""
    shutil.copytree(folder, tmp_path / "case")
    path = tmp_path / "case" / "measurements.yaml"
    (tmp_path / "case" / "survey.csv").write_text("x_m,y_m\n120,22\n150,26\n180,27\n")
    document = yaml.safe_load(path.read_text())
    about = {"confidence": "assumed", "source": "a test"}
    document["sets"]["all"] = [
        {"name": "stake", "type": "marker_displacement", "x_m": 120.0, "y_m": 15.0, "dx_m": -30.0,
         "dy_m": -5.0, "std_m": 1.0, **about},
        {"name": "film", "type": "toe_history", "side": "left", "times_s": [0.0, 5.0, 1000.0],
         "values_m": [0.0, 30.0, 53.0], "std_m": 3.0, **about},
        {"name": "speed", "type": "velocity", "x_m": 120.0, "at_s": 3.0, "value_m_per_s": -4.0,
         "std_m_per_s": 1.0, "held_out": True, **about},
        {"name": "survey", "type": "surface_profile", "file": "survey.csv", "std_m": 1.0, **about},
    ]  # fmt: skip
    path.write_text(yaml.safe_dump(document))
    case = load_case(tmp_path / "case").with_set("all").resolved(spacing_m=4.0)
    readings = comparison.read_deposit(case, simulated[1])
    assert [(r.name, r.part) for r in readings] == [
        ("stake", "dx"), ("stake", "dy"), ("film", "at 0 s"), ("film", "at 5 s"),
        ("film", "at 1000 s"), ("speed", ""), ("survey", "root mean square of 3 points"),
    ]  # fmt: skip
    stake, _, begin, five, end, speed, survey = readings
    assert stake.simulated < -5 and stake.at_start == 0.0
    assert begin.simulated < five.simulated < end.simulated
    assert speed.simulated < -0.5 and speed.at_start == 0.0 and speed.unit == "m/s"
    assert survey.difference is None and 0 < survey.simulated < survey.at_start
    text = comparison.table(case, readings)
    assert "velocity (speed) [m/s]" in text and "std assumed, held out" in text
    assert "toe history (film), at 5 s" in text
    comparison.write_observables(tmp_path / "o.csv", readings)
    with (tmp_path / "o.csv").open(newline="") as file:
        rows = {(row["name"], row["part"]): row for row in csv.DictReader(file)}
    assert rows["speed", ""]["unit"] == "m/s" and float(rows["speed", ""]["measured"]) == -4.0
    foot = case.feet["left"]  # a stake in the last centimetres of the toe has no points around it
    document["sets"]["all"] = [{"name": "stake", "type": "marker_displacement", "x_m": foot + 0.2,
                                "y_m": float(case.scene.ground.height(foot)) + 0.01, "dx_m": -30.0,
                                "std_m": 1.0, **about}]  # fmt: skip
    path.write_text(yaml.safe_dump(document))
    case = load_case(tmp_path / "case").with_set("all").resolved(spacing_m=4.0)
    (stake,) = comparison.read_deposit(case, simulated[1])
    assert np.isnan(stake.at_start) and np.isnan(stake.simulated)
    assert "outside the soil" in stake.trouble
    assert "not read" in comparison.table(case, [stake])
    with pytest.raises(InputError, match="no set of measurements 'lab'; there are all, field"):
        load_case(tmp_path / "case").with_set("lab")


def test_a_toe_that_no_survey_counts_is_not_read(folder, simulated, tmp_path, monkeypatch):
    shutil.copy(folder / "scene.yaml", tmp_path)
    case = load_case(tmp_path).resolved(spacing_m=4.0)

    def too_thin(*_arguments, **_options):
        raise ValueError("the column is less than 0.5 m high")

    monkeypatch.setattr(comparison, "toe_runout", too_thin)
    readings = comparison.read_deposit(case, simulated[1])
    assert [one.trouble for one in readings] == ["the column is less than 0.5 m high"] * 2
    assert "not read" in comparison.table(case, readings)
