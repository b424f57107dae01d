"""The ratio S_r / sigma'_v0 as an unknown: what it sets, what it means, a twin, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import flowslide
from geometry.case import load_case
from geometry.scenes.scene import load_scene, scene_from_mapping
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.hand_checks import ratio_check
from inversion.back_analysis.result import load_result
from inversion.back_analysis.variants import sides
from inversion.catalogue.catalogue import answers_of
from inversion.classical.section import section_of
from inversion.classical.slices import slice_at
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import (
    FLOOR_KPA,
    FixedProperty,
    ParameterSpec,
    Variant,
    load_question,
)
from inversion.problem.scene_changes import with_properties
from inversion.problem.state import state
from pipeline.cli import InputError
from tests.dams import dam_with_pool

QUESTION = {
    "parameters": [
        {"name": "ratio", "zones": ["1"], "property": "strength_ratio",
         "start": 0.15, "low": 0.03, "high": 0.6},
    ],
    "fit": ["upstream toe"],
    "loss": "runout",
    "spacing_m": 4.0,
}  # fmt: skip
TRUTH = 0.11


def asked(folder: Path, **changes: object) -> Path:
    """The dam with a question about the ratio of its liquefied zone."""
    if not folder.is_dir():
        dam_with_pool(folder)
    (folder / "inversion.yaml").write_text(yaml.safe_dump({**QUESTION, **changes}))
    return folder


def parameter(**changes: object) -> list[dict]:
    return [{**QUESTION["parameters"][0], **changes}]


def case_of(folder: Path):
    return inversion_case(load_case(folder))


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return case_of(asked(tmp_path_factory.mktemp("ratio") / "dam"))


def soil_of(scene, zone: str):
    return scene.materials[next(one.material for one in scene.zones if one.name == zone)]


def test_a_value_sets_the_ratio_and_the_floor_of_its_zones_alone(case):
    scene = case.setup.scene_at(np.array([0.12]))
    soil = soil_of(scene, "1")
    assert (soil.strength_ratio, soil.cohesion_kpa) == (0.12, FLOOR_KPA)
    assert all(soil_of(scene, zone).strength_ratio is None for zone in "234567")
    assert case.parameters.logarithmic.all() and case.parameters.strengths.all()
    assert case.parameters.specs[0].words == "S_r/sigma'_v0 of zone 1"


def test_the_floor_can_be_asked_for(tmp_path):
    own = case_of(asked(tmp_path / "dam", parameters=parameter(floor_kpa=3.0)))
    assert soil_of(own.setup.scene_at(np.array([0.12])), "1").cohesion_kpa == 3.0


def test_a_strength_replaces_a_ratio(case):
    grown = case.setup.scene_at(np.array([0.12]))
    plain = with_properties(grown, [("1", "cohesion_kpa", 20.0)])
    assert soil_of(plain, "1").strength_ratio is None
    name = next(zone.material for zone in grown.zones if zone.name == "1")
    assert grown.with_strength(name, cohesion_kpa=20.0).materials[name].strength_ratio is None
    known = grown.with_strength(name, friction_deg=1.0).materials[name]
    assert known.strength_ratio == 0.12


def test_the_stress_of_a_ratio_is_the_settled_one(case):
    """So that value x stress is the mean strength of the run."""
    setup = case.setup
    store = RunStore(None)
    (prediction,) = MPMEngine(store).predict([setup.at(np.array([0.12]))])
    (run,) = store.fetch([(setup.scene_at(np.array([0.12])), setup.settings)], [setup.reader])
    own = run.zone == [zone.name for zone in setup.scene.zones].index("1")
    settled = np.average(np.maximum(run.vertical_stress[own], 0), weights=run.initial_volume[own])
    assert prediction.sigma_v0_kpa == pytest.approx([1e-3 * settled])
    per = case.parameters.per_ratio(prediction.sigma_v0_kpa)
    assert per.tolist() == [1.0]


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    """A dam whose toe is that of a run with the true ratio; its folder and its back-analysis."""
    folder = asked(tmp_path_factory.mktemp("twin") / "dam")
    own = case_of(folder)
    (truth,) = MPMEngine(RunStore(None)).predict([own.setup.at(np.array([TRUTH]))])
    place = own.setup.targets.names.index("upstream toe")
    path = folder / "measurements.yaml"
    survey = yaml.safe_load(path.read_text())
    toe = survey["sets"]["field"][0]
    toe.pop("low_m"), toe.pop("high_m")
    toe.update(value_m=float(truth.values[place]), std_m=1.0)
    path.write_text(yaml.safe_dump(survey))
    out = folder / "inversion"
    return folder, flowslide.back_analyse(folder, out=out, quick=True, threads=1), out


def test_a_twin_is_found(twin):
    _, result, out = twin
    (found,) = result.answer.parameters
    assert result.answer.reached
    assert found.as_run == pytest.approx(TRUTH, rel=0.05)
    assert (found.unit, found.ratio) == ("", found.value)
    assert found.ratio_std == pytest.approx(found.std_total, rel=0.05)
    assert 60.0 < found.sigma_v0_kpa < 250.0
    assert found.strength_kpa == pytest.approx(found.value * found.sigma_v0_kpa)
    assert found.strength_std_kpa == pytest.approx(found.std_total * found.sigma_v0_kpa)
    assert load_result(out).answer == result.answer
    assert ratio_check(found).value == found.value


def test_the_summary_states_the_ratio_and_the_mean_strength(twin):
    from report.back_analysis import summary
    from report.data.back_analysis import load_back_analysis
    from report.sentences.back_analysis import meaning_sentences

    _, result, out = twin
    (found,) = result.answer.parameters
    text = summary(load_back_analysis(out))
    assert f"{found.value:.3f} " in text
    assert f"mean S_r {found.strength_kpa:.1f}"[:12] in text
    said = " ".join(meaning_sentences(load_back_analysis(out)))
    assert "A strength ratio gives each point the ratio times its own" in said
    low, high = found.interval_95
    assert f"{low:.3f} to {high:.3f}" in said and "kPa." not in said.split("95 % range")[1][:60]


def test_the_catalogue_compares_the_mean_strength(twin):
    _, result, _ = twin
    (found,) = result.answer.parameters
    (ours,) = answers_of(result.model_dump(mode="json"))
    assert ours.s_r_kpa == pytest.approx(found.strength_kpa)
    assert ours.std_kpa == pytest.approx(found.strength_std_kpa)
    assert (ours.ratio, ours.ratio_std) == (found.ratio, found.ratio_std)


def test_both_readings_of_an_s_r_leave_the_mean(tmp_path):
    """A variant reads the unknown S_r as a ratio, of the mean stress by weight."""
    s_r = parameter(property="residual_strength_kpa", start=20.0, low=4.0, high=60.0)
    own = case_of(asked(tmp_path / "dam", parameters=s_r))
    changed = own.variant(Variant(name="deeper is stronger", property="strength_ratio"))
    assert changed.words == "strength in proportion to the stress before failure"
    values = np.array([18.0])
    soil = soil_of(changed.setup.scene_at(values), "1")
    (spec,) = changed.setup.parameters.specs
    assert soil.strength_ratio == pytest.approx(18.0 / spec.stress_kpa)
    assert soil.cohesion_kpa == FLOOR_KPA
    assert (spec.low, spec.high, spec.unit) == (4.0, 60.0, "kPa")
    (prediction,) = MPMEngine(RunStore(None)).predict([changed.setup.at(values)])
    assert prediction.sigma_v0_kpa == pytest.approx([spec.stress_kpa])


def test_a_ratio_can_be_read_as_one_strength(case):
    changed = case.variant(Variant(name="everywhere", property="residual_strength_kpa"))
    soil = soil_of(changed.setup.scene_at(np.array([0.1])), "1")
    (spec,) = changed.setup.parameters.specs
    assert soil.strength_ratio is None
    assert soil.cohesion_kpa == pytest.approx(0.1 * spec.stress_kpa)
    with pytest.raises(InputError, match="asks for no residual_strength_kpa"):
        case.variant(Variant(name="so already", property="strength_ratio"))


def test_a_variant_with_a_ratio_is_solved(twin, tmp_path):
    folder, result, _ = twin
    (found,) = result.answer.parameters
    asked(folder, variants=[{"name": "everywhere", "property": "residual_strength_kpa"}])
    few = ["starts=1", "noise_seeds=0", "step_seeds=0"]
    settings = flowslide.load_settings(None, [f"inversion.{one}" for one in few])
    again = flowslide.back_analyse(folder, out=tmp_path / "out", threads=1, settings=settings)
    (variant,) = again.variants
    assert variant.reached
    assert 0.4 * found.value < variant.values["ratio"] < 2.0 * found.value
    assert variant.ratios["ratio"] == pytest.approx(variant.values["ratio"])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"high": 1.5}, "high 1.5: a strength ratio S_r / sigma'_v0 is at most 1"),
        ({"low": 0.0}, "low 0 must be greater than 0"),
        ({"floor_kpa": -1.0}, "floor_kpa: Input should be greater than or equal to 0"),
        ({"zones": ["7"]}, "zone '7' is not marked liquefied: true"),
        ({"prior": {"relation": "weber_2015", "n1_60": 12.0}}, "is of residual_strength_kpa"),
        ({"property": "residual_strength_kpa", "high": 60.0, "floor_kpa": 1.0},
         "floor_kpa: belongs to strength_ratio, not residual_strength_kpa"),
    ],
)  # fmt: skip
def test_bad_questions_are_one_line(tmp_path, changes, message):
    folder = asked(tmp_path / "dam", parameters=parameter(**changes))
    with pytest.raises(InputError) as told:
        load_question(folder, load_scene(folder / "scene.yaml"))
    assert message in str(told.value) and "\n" not in str(told.value)


def test_a_zone_has_one_or_the_other(tmp_path):
    other = {**QUESTION["parameters"][0], "name": "S_r", "property": "residual_strength_kpa",
             "start": 20.0, "low": 4.0, "high": 60.0}  # fmt: skip
    folder = asked(tmp_path / "dam", parameters=[*parameter(), other])
    with pytest.raises(InputError, match=r"'ratio' \(strength_ratio\) and 'S_r' .* ask for one"):
        load_question(folder, load_scene(folder / "scene.yaml"))


def test_sensitivities_name_the_strength_that_a_soil_has(tmp_path, case):
    entry = {"name": "r", "kind": "property", "zones": ["7"], "property": "strength_ratio",
             "std": 0.02}  # fmt: skip
    folder = asked(tmp_path / "dam", sensitivities=[entry])
    with pytest.raises(InputError, match="zone '7' has no strength_ratio in the scene"):
        load_question(folder, load_scene(folder / "scene.yaml"))
    for key in ("strength_ratio", "residual_strength_kpa"):
        fixed = FixedProperty(**{**entry, "zones": ["1"], "property": key})
        with pytest.raises(InputError, match="is calibrated by 'ratio'"):
            sides(case.setup, fixed, case.source)


def test_learned_models_have_never_seen_it(case):
    from gns.data.scene_facts import start_of
    from gns.direct.sections import check_known

    scene = case.setup.scene_at(np.array([0.12]))
    for refuse in (check_known, lambda one: start_of(one, case.setup.settings)):
        with pytest.raises(InputError, match="never seen strength that grows with depth"):
            refuse(scene)


@pytest.mark.slow
def test_a_prediction_takes_a_ratio_as_it_was_found(twin, tmp_path):
    folder, result, _ = twin
    (found,) = result.answer.parameters
    given = f"{found.value}+-{0.02 * found.value}"
    options = {"ratios": [given], "spacing_m": 4.0, "seeds": 0, "threads": 1}
    document = flowslide.predict(folder, **options, out=tmp_path / "out")
    (strength,) = document["strengths"]
    assert (strength["property"], strength["unit"]) == ("strength_ratio", "")
    toe = next(one for one in document["quantities"] if one["name"] == "upstream toe")
    assert toe["quantiles"]["50"] == pytest.approx(toe["measured"], rel=0.02)
    assert "Assumed: S_r/σ" in (tmp_path / "out/prediction.html").read_text("utf-8")
    with pytest.raises(InputError, match="never seen strength that grows with depth"):
        flowslide.predict(folder, **options, engine="direct", out=tmp_path / "direct")


def test_a_diagnosis_leaves_out_what_a_ratio_rules_out(case):
    from diagnosis.hypotheses.engine_model import EngineModel

    model = EngineModel(case.setup, RunStore(None))
    names = {candidate.name for candidate in model.candidates}
    for name in ("overburden_strength", "sudden_start"):
        assert name not in names and "strength" in model.left_out[name]
    assert {"spatial_variability", "strain_softening", "k0"} & names
    there = model.setup_of(state((0.12,), {"strain_softening": 1.0})).scene
    assert soil_of(there, "1").strength_ratio == 0.12 and "strain_softening" in there.effects


def test_slices_have_the_strength_at_their_depth():
    """On level ground: ratio x (18 - 9.81) kN/m3 x depth below the water, at least the floor."""
    document = {
        "name": "level",
        "domain": {"x_min": 0, "x_max": 40, "y_max": 30, "walls": "closed"},
        "ground": {"points": [[0, 0], [40, 0]]},
        "zones": [{"name": "a", "material": "silt",
                   "polygon": [[0, 0], [40, 0], [40, 10], [0, 10]]}],
        "materials": {"silt": {"friction_deg": 0, "cohesion_kpa": 1.0, "liquefied": True,
                               "strength_ratio": 0.1, "density": 18000.0 / 9.81}},
        "water_level": 12.0,
        "spacing": 1.0,
    }  # fmt: skip
    section = section_of(scene_from_mapping(document))
    edges = np.linspace(5.0, 35.0, 7)
    base = np.linspace(1.0, 10.0, 7)
    slices = slice_at(section, edges, base, "left", form="buoyant")
    depth = 10.0 - 0.5 * (base[1:] + base[:-1])
    expected = np.maximum(100.0 * (18.0 - 9.81) * depth, 1000.0)
    assert slices.cohesion == pytest.approx(expected, rel=1e-6)


def test_a_known_ratio_of_the_scene_may_be_uncertain(case):
    from diagnosis.hypotheses.soil import assumptions

    scene = case.setup.scene_at(np.array([0.12]))
    friction = parameter(property="friction_deg", zones=["7"], start=30.0, low=25.0, high=35.0)
    setup = replace(case.setup, scene=scene, parameters=Parameters([ParameterSpec(**friction[0])]))
    entry = FixedProperty(name="r", kind="property", zones=["1"], property="strength_ratio",
                          std=0.02)  # fmt: skip
    up, down = sides(setup, entry, "here")
    assert soil_of(up.setup.scene, "1").strength_ratio == pytest.approx(0.14)
    assert soil_of(down.setup.scene, "1").strength_ratio == pytest.approx(0.10)
    found, _ = assumptions(setup, [])
    (one,) = [a for a in found if a.candidate.name.startswith("strength_ratio_of")]
    assert soil_of(one.change(setup, 0.03).scene, "1").strength_ratio == pytest.approx(0.15)
    name = next(zone.material for zone in scene.zones if zone.name == "1")
    assert f"strength_of_{name}" not in [a.candidate.name for a in found]
