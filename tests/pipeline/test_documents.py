"""True and false are not numbers, at any depth of a document."""

from __future__ import annotations

import pytest

from diagnosis.hypotheses.hypothesis_file import load_hypothesis
from diagnosis.question import load_diagnosis_question
from geometry.scenes.scene import Scene, load_scene
from geometry.survey.measurements import load_measurements
from inversion.classical.judgement import load_judgements
from inversion.problem.question import load_question
from pipeline.cli import InputError
from pipeline.config import load_config
from tests.dams import dam_with_pool


@pytest.fixture
def lsfd(tmp_path):
    """A dam with a pool, to be changed."""
    return dam_with_pool(tmp_path / "lsfd")


def change(path, old, new):
    """Put other words into a file."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("spacing: 1.0", "spacing: true", "spacing"),
        ("water_level: 35.9", "water_level: false", "water_level"),
        ("friction_deg: 37.0", "friction_deg: true", r"materials\.\w+\.friction_deg"),
    ],
)
def test_of_a_scene(lsfd, old, new, field):
    path = lsfd / "scene.yaml"
    change(path, old, new)
    with pytest.raises(InputError) as caught:
        load_scene(path)
    assert caught.match(rf"^{path}: {field}: Input should be a number \(got (True|False)\)$")


def test_of_a_polygon_and_of_a_scene_that_was_kept(lsfd):
    document = load_scene(lsfd / "scene.yaml").model_dump(mode="json")
    document["zones"][1]["polygon"][2] = [1.0, True]
    with pytest.raises(ValueError, match=r"zones\.1\.polygon\.2\.1\n +Input should be a number"):
        Scene.model_validate(document)


def test_of_measurements(lsfd):
    change(lsfd / "measurements.yaml", "std_m: 5.75", "std_m: true")
    with pytest.raises(InputError, match=r"std_m: Input should be a number \(got True\)$"):
        load_measurements(lsfd)


def test_of_a_question(lsfd):
    change(lsfd / "inversion.yaml", "parameters:", "spacing_m: true\nparameters:")
    with pytest.raises(InputError, match=r"yaml: spacing_m: Input should be a number"):
        load_question(lsfd, load_scene(lsfd / "scene.yaml"))


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("priors: {weak_base: {mean: true, std: 1}}", "priors.weak_base.mean"),
        ("parameters: {shaking: {frequency_hz: true}}", "parameters.shaking.frequency_hz"),
        ("hold_out: {blocks: {profile: [false, 3]}}", "hold_out.blocks.profile.0"),
    ],
)
def test_of_what_is_known_of_the_effects(tmp_path, text, field):
    (tmp_path / "diagnosis.yaml").write_text(text)
    with pytest.raises(InputError, match=f"yaml: {field}: Input should be a number"):
        load_diagnosis_question(tmp_path)


@pytest.mark.parametrize("entry", ["true", "{amplitude: true}"])
def test_of_a_model(tmp_path, entry):
    path = tmp_path / "01_x.yaml"
    path.write_text(f"effects: {{weak_base: {entry}}}\n")
    with pytest.raises(InputError, match="effects.weak_base.amplitude: Input should be a number"):
        load_hypothesis(path)


def test_of_classical_analyses(lsfd):
    change(lsfd / "classical.yaml", "zif_share: 0.45", "zif_share: true")
    with pytest.raises(InputError, match="analyses.0.zif_share: Input should be a number"):
        load_judgements(lsfd, load_measurements(lsfd))


def test_of_settings():
    with pytest.raises(InputError, match="^--set: simulation.duration_s: True: input should be a"):
        load_config(None, ["simulation.duration_s=true"])
    assert load_config(None, ["simulation.early_stop=false"]).simulation.early_stop is False
