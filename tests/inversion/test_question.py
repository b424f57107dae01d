"""The question's document: what it refuses, in one line."""

from __future__ import annotations

import re

import pytest
import yaml

from geometry.case import load_case
from geometry.scenes.scene import load_scene
from inversion.back_analysis.case import inversion_case
from inversion.problem.question import load_question
from pipeline.cli import InputError
from pipeline.config import load_config


@pytest.mark.parametrize("name", ["lower_san_fernando", "lower_san_fernando_paper", "la_marquesa"])
def test_the_shipped_questions_hold_together(root, name):
    case = inversion_case(load_case(root / "case_histories" / name))
    assert case.setup.targets.fitted.any()
    assert case.question.variants and case.question.sensitivities


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("low: 5,", "low: 95,", "low 95 must be less than high 90"),
        (
            "property: residual_strength_kpa",
            "property: density",
            "residual_strength_1: low 5 kg/m³: allowed are 100 to 1e+08",
        ),
        ("start: 30, low: 5", "start: 3, low: 5", "start 3 lies outside low 5 to high 90"),
        ("low: 5,", "low: 0,", "low 0 must be greater than 0"),
        ('zones: ["1"]', 'zones: ["11"]', "no zone '11' in the scene; known are 1, 2"),
        ("property: residual_strength_kpa", "property: cohesion", "cohesion_kpa"),
        ("name: friction_7", "name: residual_strength_1", "names must be unique"),
        ("loss: runout", "lose: runout", "docs/method/inversion.md"),
        ("fit: [upstream toe]", "fit: [toe]", "no measurement 'toe' in this set"),
        ("fit: [upstream toe]", "fit: [profile]", "constructed"),
        ("fit: [upstream toe]", "fit: [crest]", "use loss: misfit"),
        ("at: [126.54, 18.5]", "at: [126.54, 19.5]", "no zone has a vertex at (126.54, 19.5)"),
        ("move: [15.24, 6.0]", "move: [400, 6.0]", "top of the liquefied zone"),
        ("factor: 0.5", "factor: 3.5", "simulation.courant 1.05; at most 0.9"),
        ("water: none", "targets: {toe: 4}", "no measurement 'toe'"),
        ("water: none", "targets: {crest: 4}", "'crest' is not fitted; fitted are upstream toe"),
        ("{name: dry, water: none}", "{name: dry}", "changes nothing"),
        ("kind: water_level", "kind: pool", "zone_boundary"),
        ("std_m: 0.5", "std_m: 0", "greater than 0"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(lsfd, old, new, message):
    path = lsfd / "inversion.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        inversion_case(load_case(lsfd))
    assert "inversion.yaml" in str(caught.value)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_errors_that_hang_together_altogether_are_refused(lsfd):
    path = lsfd / "measurements.yaml"
    text = path.read_text()
    assert "correlation_length_m:" in text
    path.write_text(
        re.sub(r"correlation_length_m: *[0-9.]+", "correlation_length_m: 1.0e+17", text)
    )
    with pytest.raises(InputError, match=r"inversion\.yaml: .*correlation length is so great"):
        inversion_case(load_case(lsfd))


def test_a_folder_without_a_question(lsfd):
    (lsfd / "inversion.yaml").unlink()
    with pytest.raises(InputError, match=r"inversion\.yaml: no such file"):
        load_question(lsfd, load_scene(lsfd / "scene.yaml"))


def test_constructed_data_enter_when_asked(lsfd):
    path = lsfd / "inversion.yaml"
    text = path.read_text().replace("fit: [upstream toe]", "fit: [upstream toe, profile]")
    path.write_text(text.replace("loss: runout", "loss: misfit"))
    case = inversion_case(load_case(lsfd), use_constructed=True)
    assert case.setup.targets.fitted.sum() > 2


def test_spacing_from_question_option_and_factor(lsfd):
    config = load_config(None, ["inversion.spacing_factor=0.5"])
    assert inversion_case(load_case(lsfd, config)).scene.spacing == 2.0
    assert inversion_case(load_case(lsfd, config), spacing_m=3.0).scene.spacing == 3.0


def test_an_older_file_calls_a_residual_strength_a_cohesion(lsfd, capsys):
    """It is the same question; one line says what to write."""
    path = lsfd / "inversion.yaml"
    new = load_question(lsfd, load_scene(lsfd / "scene.yaml"))
    assert new.parameters[0].property == "residual_strength_kpa" and not capsys.readouterr().err
    path.write_text(path.read_text().replace("residual_strength_kpa", "cohesion_kpa"))
    for _ in range(2):  # read again, it is not said again
        assert load_question(lsfd, load_scene(lsfd / "scene.yaml")) == new
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        f"{path}: {new.parameters[0].name}: write property: residual_strength_kpa, not "
        "cohesion_kpa: the zones are liquefied"
    )


def test_the_cohesion_of_a_zone_with_friction_is_one(lsfd):
    """It has no ratio to the overburden, and no label of a residual strength."""
    path, scene = lsfd / "inversion.yaml", load_scene(lsfd / "scene.yaml")
    firm = next(zone for zone in scene.zones if not scene.materials[zone.material].liquefied)
    parameter = {"name": "c", "zones": [firm.name], "property": "cohesion_kpa"}
    path.write_text(
        yaml.safe_dump({"parameters": [{**parameter, "start": 5.0, "low": 1.0, "high": 9.0}]})
    )
    (spec,) = load_question(lsfd, scene).parameters
    assert spec.property == "cohesion_kpa" and spec.words == f"c of zone {firm.name}"
    twice = [{**parameter, "name": name, "property": key, "start": 5.0, "low": 1.0, "high": 9.0}
             for name, key in (("c", "cohesion_kpa"), ("s", "residual_strength_kpa"))]  # fmt: skip
    path.write_text(yaml.safe_dump({"parameters": twice}))
    with pytest.raises(InputError, match="is calibrated by 'c' and by 's'"):
        load_question(lsfd, scene)
