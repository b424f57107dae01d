"""A folder becomes one object: names, spacing, duration, feet and sets are resolved once."""

import shutil
from types import SimpleNamespace

import pytest

from geometry.case import load_case
from pipeline.cli import InputError
from pipeline.config import load_config

NAME = "lower_san_fernando_paper"


@pytest.fixture
def bare(case_folder, tmp_path):
    """A case of which the section alone is known."""
    (tmp_path / "dam").mkdir()
    shutil.copy(case_folder / "scene.yaml", tmp_path / "dam")
    return tmp_path / "dam"


def test_a_name_is_found_from_any_working_directory(case_folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = load_case(NAME)
    assert case.folder.resolve() == case_folder and case.name == NAME
    assert case.title == "Lower San Fernando Paper"


def test_a_body_is_no_case(bare):
    body = bare / "scene3d.yaml"
    body.write_text("ground: ground.tif\n")
    assert load_case(bare).name == "dam", "a section over a width"
    assert load_case(bare / "scene.yaml").folder == bare
    (bare / "scene.yaml").unlink()
    for place in (bare, body):
        with pytest.raises(InputError, match="a body in three dimensions; this takes a section"):
            load_case(place)


def test_the_foot_is_the_surveyed_one_else_the_drawn_one(case_folder, bare):
    case = load_case(case_folder)
    assert case.feet["left"] == case.measurements.foot("left") is not None
    assert load_case(bare).feet == {side: case.scene.foot(side) for side in ("left", "right")}


def test_the_first_question_that_states_a_spacing_or_a_duration_decides_it(case_folder):
    case = load_case(case_folder, load_config(None, ["simulation.duration_s=7"]))
    first = SimpleNamespace(spacing_m=None, duration_s=40.0)
    second = SimpleNamespace(spacing_m=2.0, duration_s=50.0)
    assert case.resolved().scene is case.drawn and case.resolved().simulation.duration_s == 7.0
    both = case.resolved(first, None, second, spacing_factor=1.5)
    assert (both.scene.spacing, both.own_spacing_m, both.simulation.duration_s) == (3.0, 2.0, 40.0)
    assert case.resolved(second, spacing_factor=1.5, spacing_m=4.0).scene.spacing == 4.0
    assert both.resolved().scene.spacing == case.drawn.spacing  # from the file, not from `both`
    with pytest.raises(InputError, match=r"scene\.yaml at 30 m spacing: "):
        case.resolved(spacing_m=30.0)


def test_a_case_without_measurements_is_one_until_they_are_needed(bare):
    case = load_case(bare)
    assert case.survey is None and case.measured == [] and case.measurement_set == ""
    with pytest.raises(InputError, match="measurements.yaml: no such file"):
        _ = case.measurements
    with pytest.raises(InputError, match="measurements.yaml: no such file"):
        case.with_set(None)


def test_no_case_is_one_line(tmp_path):
    with pytest.raises(InputError, match="nowhere: no such folder; a case has scene.yaml"):
        load_case(tmp_path / "nowhere")
