"""Models as files: what a person may write, and what is refused in one line."""

from __future__ import annotations

import pytest

from diagnosis.hypotheses.hypothesis_file import (
    Hypothesis,
    HypothesisEffect,
    check_parent,
    find_hypothesis,
    hypothesis_files,
    load_hypothesis,
    new_name,
    save_hypothesis,
)
from geometry.scenes.scene import load_scene
from pipeline.cli import InputError


@pytest.fixture
def scene(embankment):
    return load_scene(embankment / "scene.yaml")


def test_a_model_changes_the_section(tmp_path, scene):
    path = tmp_path / "02_stiffer.yaml"
    path.write_text(
        "parent: 00_base\nnotes: the fill was compacted better\n"
        "effects:\n  weak_base: 0.3\n"
        "  strain_softening: {amplitude: 1, parameters: {reference_strain: 2}}\n"
        "scene_changes:\n  materials: {compacted_fill: {cohesion_kpa: 9}}\n"
        "  zones: {sand: {polygon: [[0, 0], [44, 0], [44, 4], [8, 4]]},\n"
        "          fill: {polygon: [[8, 4], [44, 4], [44, 0], [64, 0], [34, 12], [24, 12]]}}\n"
    )
    model = load_hypothesis(path)
    changed = model.scene(scene, str(path))
    assert changed.materials["compacted_fill"].cohesion_kpa == 9.0
    assert changed.materials["compacted_fill"].friction_deg == 34.0
    assert changed.zones[0].polygon[2] == (44.0, 4.0) and changed.zones[0].material == "loose_sand"
    assert changed.effects["weak_base"] == 0.3
    assert changed.effects["strain_softening"] == {"amplitude": 1.0, "reference_strain": 2.0}
    assert model.by == "engineer" and scene.effects == {}


def test_a_model_is_written_as_it_is_read(tmp_path):
    model = Hypothesis(
        parent="00_base",
        by="extend",
        notes="a test: with a colon",
        effects={
            "weak_base": HypothesisEffect(amplitude=0.25, std=0.1, parameters={"width_m": 3.0})
        },
        scene_changes={"water_level": None},
    )
    path = tmp_path / "hypotheses" / "01_weak_base.yaml"
    save_hypothesis(model, path)
    assert load_hypothesis(path) == model
    first = path.read_bytes()
    save_hypothesis(model, path)
    assert path.read_bytes() == first


def test_models_are_numbered_in_their_order(tmp_path):
    assert hypothesis_files(tmp_path) == {} and new_name(tmp_path, "base") == "01_base"
    for name in ("00_base", "01_weak_base", "03_core"):
        save_hypothesis(Hypothesis(), tmp_path / "hypotheses" / f"{name}.yaml")
    (tmp_path / "hypotheses" / "notes.yaml").write_text("a: 1\n")
    assert list(hypothesis_files(tmp_path)) == ["00_base", "01_weak_base", "03_core"]
    assert new_name(tmp_path, "Strain softening + rate") == "04_strain_softening_rate"
    assert find_hypothesis(tmp_path, "03_core") == (
        "03_core",
        tmp_path / "hypotheses" / "03_core.yaml",
    )
    own = tmp_path / "elsewhere.yaml"
    save_hypothesis(Hypothesis(), own)
    assert find_hypothesis(tmp_path, str(own)) == ("elsewhere", own)
    with pytest.raises(
        InputError, match="--hypothesis 9: no such file.*there are 00_base, 01_weak"
    ):
        find_hypothesis(tmp_path, "9")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("- a\n", "must be a mapping of keys"),
        (
            "effect: {weak_base: 1}\n",
            "effect: unknown key; the keys are listed in docs/method/diagnosis",
        ),
        ("by: chance\n", "by: Input should be 'engineer'"),
        ("effects: {weak_base: {std: 1}}\n", "effects.weak_base.amplitude: Field required"),
        ("effects: 3\n", "effects: Input should be a valid dictionary"),
        ("effects: {weak_base: {amplitude: 1, high: 2}}\n", "weak_base.high: unknown key"),
        ("scene_changes: 3\n", "scene_changes: Input should be a valid dictionary"),
    ],
)
def test_what_is_refused(tmp_path, text, complaint):
    path = tmp_path / "01_x.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint) as caught:
        load_hypothesis(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"zones": {"core": {"material": "x"}}}, "zones: 'core': keys of one of the zones sand, f"),
        ({"materials": {"compacted_fill": {"colour": 1}}}, "compacted_fill.colour: unknown key"),
        ({"spacing": -1}, "spacing: Input should be greater than 0"),
        ({"effects": 3}, r"effects: is a mapping, effect: amplitude .*\(got 3\)"),
        ({"zones": {"sand": {"name": "silt"}}}, "zones: 'sand' is gone; a model keeps the names"),
        ({"zones": 3}, "zones: Input should be a valid list"),
        ({"zones": {"sand": 3}}, "zones: 'sand': keys of one of the zones sand, fill"),
        ({"materials": {"loose_sand": None}}, "materials.loose_sand: Input should be a valid dict"),
    ],
)
def test_changes_that_do_not_fit_the_scene(scene, changes, complaint):
    model = Hypothesis(scene_changes=changes, effects={"weak_base": {"amplitude": 0.3}})
    with pytest.raises(InputError, match=complaint) as caught:
        model.scene(scene, "02_x.yaml")
    assert str(caught.value).startswith("02_x.yaml: ") and "\n" not in str(caught.value)


def test_a_parent_that_a_person_names_is_there(tmp_path):
    folder = tmp_path / "hypotheses"
    for name in ("01_weak_base", "02_core"):
        save_hypothesis(Hypothesis(), folder / f"{name}.yaml")
    elsewhere = tmp_path / "mine.yaml"
    save_hypothesis(Hypothesis(), elsewhere)
    for parent in (None, "00_base", "01_weak_base"):
        check_parent(Hypothesis(parent=parent), elsewhere, tmp_path)
    # What extend and run have written may have lost its parent; it holds all of its effects.
    check_parent(Hypothesis(parent="gone", by="extend"), folder / "02_core.yaml", tmp_path)
    for path, parent in ((elsewhere, "01_weak"), (folder / "02_core.yaml", "02_core")):
        with pytest.raises(
            InputError, match=f"{path}: parent: no hypothesis '{parent}'; there are 00_"
        ):
            check_parent(Hypothesis(parent=parent), path, tmp_path)
