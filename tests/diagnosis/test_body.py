"""A diagnosis of a body in three dimensions: what is on trial, by a formula and by the solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flowslide
from diagnosis.adequacy.compare import compare
from diagnosis.body_diagnosis import body_diagnosis
from diagnosis.diagnose import diagnose
from diagnosis.hypotheses.hypothesis_file import Hypothesis
from diagnosis.hypotheses.model import Proposing
from diagnosis.hypotheses.start import k0_of
from diagnosis.selection.explain import explain
from diagnosis.verdict.verdict import load_verdict
from diagnosis.verdict.verdict_builder import verdict_document
from flowslide.command_line import main
from geometry.survey3d.survey import FILE_NAME
from geometry.terrain.raster import Raster, write_raster
from inversion.back_analysis.body_case import body_case
from inversion.back_analysis.deviations import LEFT_OUT
from inversion.engines.body_engine import BodyEngine, BodyStore, body_of
from inversion.engines.registry import Engine
from inversion.engines.run_store import RunStore
from inversion.estimation.forward import Forward, Prediction
from inversion.problem.state import State, state
from mpm_taichi.effects import effects
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import read_yaml, write_text, yaml_text
from report.sentences.finding import headline
from report.table import plain

STRENGTH = {"name": "S_r", "zones": ["slimes"], "property": "residual_strength_kpa",
            "start": 5.0, "low": 1.0, "high": 20.0}  # fmt: skip
SURFACE = {"name": "surface", "type": "surface_after", "file": "after.tif", "every_m": 4.0,
           "std_m": 0.2, "confidence": "published", "source": "simulated"}  # fmt: skip
FAST = {"synthetic": True, "finer_share": 0.0, "finer_share_std": 0.0}
SETTINGS = [f"diagnosis.{one}" for one in ("replicates=3", "draws=300", "starts=1", "rounds=1",
                                           "refitted=2", "max_runs=200")]  # fmt: skip


@pytest.fixture
def bank(tmp_path):
    """A small bank on a gentle slope: crust on slimes, its surface surveyed in 48 squares."""
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    folder = tmp_path / "bank"
    folder.mkdir()
    x, _ = np.meshgrid(np.arange(0.0, 49.0, 2.0), np.arange(0.0, 17.0, 2.0), indexing="ij")
    base = -0.05 * x
    surface = np.maximum(base, np.minimum(8.0, 8.0 - (x - 12.0) / 1.5))
    for name, values in (("base", base), ("surface", surface), ("after", surface)):
        write_raster(Raster((0.0, 0.0), 2.0, values), folder / f"{name}.tif")
    soil = {"friction_deg": 0, "youngs_modulus_mpa": 2}
    document = {
        "name": "small_bank", "spacing": 2.0, "duration_s": 4.0,
        "terrain": {
            "surface": "surface.tif", "base": "base.tif",
            "zones": [{"name": "crust", "material": "fill", "bottom": 4.0},
                      {"name": "slimes", "material": "slimes"}],
            "materials": {
                "fill": {**soil, "cohesion_kpa": 14, "density": 1900},
                "slimes": {**soil, "cohesion_kpa": 3, "density": 1700, "liquefied": True},
            },
        },
    }  # fmt: skip
    write_text(folder / "scene3d.yaml", yaml_text(document))
    survey = {"case": "bank", "default_set": "all", "sets": {"all": [SURFACE]}}
    write_text(folder / FILE_NAME, yaml_text(survey))
    write_text(folder / "inversion.yaml", yaml_text({"parameters": [STRENGTH], "loss": "misfit"}))
    write_text(folder / "diagnosis.yaml", yaml_text(FAST))
    return folder


def asked(folder, **options):
    return body_diagnosis(body_case(folder, load_config(None, SETTINGS)), **options)


class Slope(Forward):
    """A surface that falls along x, the faster the stronger; a heavy crust turns it."""

    def predict(self, requests):
        self.runs += len(requests)
        return [self.one(request) for request in requests]

    def one(self, request) -> Prediction:
        setup = body_of(request)
        zones = {zone.name: zone.material for zone in setup.scene_at(request.values).soil.zones}
        soils = setup.scene_at(request.values).soil.materials
        strength = soils[zones["slimes"]].cohesion_kpa
        weight = soils[zones["crust"]].density / 1900.0
        x, _ = setup.targets.entries[0].places.T
        noise = 0.01 * np.random.default_rng(setup.seed).standard_normal(len(x))
        found = 8.0 * np.exp(-0.005 * strength * x) + (weight - 1.0) * (x - 12.0) + noise
        return Prediction(found, np.zeros(len(x)))


SLOPE = Engine("slope", "slope", "a formula", "slope", "x", lambda store: Slope())


def by_formula(folder, hidden: dict[str, float]) -> tuple:
    """The case with a survey that the formula has made with something hidden, and its model."""
    case = asked(folder)
    store = RunStore(None)
    (made,) = case.model(store, SLOPE).predict([state((7.0,), hidden, seed=11)])
    made = made + 0.2 * np.random.default_rng(3).standard_normal(len(made))
    case = replace(
        case, setup=replace(case.setup, targets=replace(case.setup.targets, measured=made))
    )
    return case, case.model(store, SLOPE)


@pytest.mark.parametrize(
    "hidden", [{"datum_shift": 0.7}, {"datum_tilt_across": 0.7}, {"density_of_fill": 150.0}]
)
def test_what_was_hidden_leads(bank, hidden):
    case, model = by_formula(bank, hidden)
    options = case.options(model)
    comparison = compare(model, options)
    assert comparison.adequacy.p_combined < 0.05
    assert explain(model, comparison, options).names[0] == next(iter(hidden))


def test_a_body_with_nothing_hidden_is_adequate(bank):
    case, model = by_formula(bank, {})
    verdict = verdict_document(
        diagnose(model, case.options(model)), case=case.name, title=case.title,
        left_out=case.left_out(model),
    )  # fmt: skip
    assert verdict.verdict == "adequate" and not verdict.answer.effects
    (found,) = verdict.final.values.values()
    assert found == pytest.approx(7.0, rel=0.1)
    left_out = {one.name: one.left_out for one in verdict.candidates if one.left_out}
    assert left_out["weak_base"] == f"can do nothing here: {LEFT_OUT}"


def test_what_is_on_trial_and_what_is_left_out(bank):
    model = by_formula(bank, {})[1]
    names = {one.name for one in model.candidates}
    assert names == {
        "bonded_base", "base_of_friction", "pool", "strength_of_fill", "density_of_fill",
        "stiffness_of_fill", "density_of_slimes", "stiffness_of_slimes", "left_stretch",
        "middle_stretch", "right_stretch", "small_y_stretch", "middle_y_stretch",
        "large_y_stretch", "sudden_start", "lateral_stress", "datum_shift", "datum_tilt",
        "datum_tilt_across",
    }  # fmt: skip
    assert model.left_out == dict.fromkeys(effects(), LEFT_OUT)
    assert not model.simulates(State((5.0,), numerics="transfer"))
    assert not isinstance(model, Proposing) and model.curves == []


def test_an_assumption_is_another_body(bank):
    model = by_formula(bank, {})[1]

    def soils(effects, **numerics):
        setup = model.setup_of(replace(state((5.0,), effects), **numerics))
        scene, problem = setup.problem_at(np.array([5.0]))
        found = {zone.name: scene.soil.materials[zone.material] for zone in scene.soil.zones}
        return setup, found, problem

    plain, own, before = soils({})
    assert soils({"density_of_fill": 95.0})[1]["crust"].density == own["crust"].density + 95.0
    setup, _, problem = soils({"base_of_friction": 0.5})
    assert (problem.contact, problem.friction_coefficient) == ("coulomb", 0.3)
    assert soils({"bonded_base": 1.0})[2].contact == "no_slip"
    assert soils({"pool": 2.0})[2].water.values.max() == pytest.approx(
        before.position[:, 2].min() + 2.0
    )
    assert soils({"lateral_stress": 0.1})[0].settings.k0 == pytest.approx(k0_of(plain) + 0.1)
    assert soils({"sudden_start": 1.0})[0].settings.initial_stress == "gravity_on"
    assert soils({}, numerics="fine")[2].spacing == 0.5 * before.spacing
    assert np.ptp(soils({}, seed=3)[2].position - before.position) > 0.1
    with pytest.raises(InputError, match=f"weak_base: {LEFT_OUT}"):
        soils({"weak_base": 0.3})


@pytest.mark.parametrize("name, axis", [("left_stretch", 0), ("large_y_stretch", 1)])
def test_a_stretch_has_another_strength_and_all_points_stand_where_they_did(bank, name, axis):
    model = by_formula(bank, {})[1]
    plain, cut = (
        model.setup_of(state((5.0,), one)).problem_at(np.array([5.0])) for one in ({}, {name: 0.7})
    )

    def ordered(problem):
        return problem.position[np.lexsort(problem.position.T)]

    assert ordered(plain[1]) == pytest.approx(ordered(cut[1]), abs=1e-9)
    scene, problem = cut
    zones = [zone.name for zone in scene.soil.zones]
    strength = {zone.name: scene.soil.materials[zone.material].cohesion_kpa
                for zone in scene.soil.zones}  # fmt: skip
    part = f"{name} of slimes"
    assert strength == pytest.approx({"crust": 14.0, part: 5.0 * np.exp(0.7), "slimes": 5.0})
    inside, rest = (
        problem.position[problem.zone == zones.index(one), axis] for one in (part, "slimes")
    )
    assert len(inside) and len(rest)
    assert inside.max() < rest.min() if axis == 0 else inside.min() > rest.max()


def test_zones_of_one_parameter_may_differ(bank):
    question = {"parameters": [STRENGTH | {"zones": ["crust", "slimes"]}], "loss": "misfit"}
    scene = (bank / "scene3d.yaml").read_text().replace("material: fill", "material: slimes")
    before, _, rest = scene.partition("    fill:")
    write_text(bank / "scene3d.yaml", before + rest[rest.index("    slimes:") :])
    write_text(bank / "inversion.yaml", yaml_text(question))
    model = by_formula(bank, {})[1]
    assert [one.name for one in model.candidates if one.name.startswith("contrast")] == [
        "contrast_of_crust"
    ]
    scene = model.setup_of(state((5.0,), {"contrast_of_crust": -0.5})).scene_at(np.array([5.0]))
    found = [scene.soil.materials[zone.material].cohesion_kpa for zone in scene.soil.zones]
    assert found == pytest.approx([5.0 * np.exp(-0.5), 5.0])


def test_with_water_its_level_is_on_trial(bank):
    scene = (
        (bank / "scene3d.yaml").read_text().replace("  zones:", "  water_level: 1.0\n  zones:", 1)
    )
    write_text(bank / "scene3d.yaml", scene)
    model = by_formula(bank, {})[1]
    names = {one.name for one in model.candidates}
    assert {"no_water", "pool_level"} <= names and "pool" not in names
    assert "pool_level" not in model.left_out
    levels = [model.setup_of(state((5.0,), one)).soil.water_level
              for one in ({"pool_level": 0.5}, {"no_water": 1.0})]  # fmt: skip
    assert levels == [1.5, None]
    with pytest.raises(InputError, match="pool_level: there is no water"):
        model.setup_of(state((5.0,), {"no_water": 1.0, "pool_level": 0.5}))


@pytest.mark.parametrize(
    "entry, words",
    [
        ({"effects": ["weak_base"]}, "effects: no effect 'weak_base' in three dimensions; there "),
        ({"forbid": ["shaking"]}, "forbid: no effect 'shaking' in three dimensions"),
        ({"priors": {"side_shear": {"mean": 0.1, "std": 0.1}}}, "no effect 'side_shear' in three"),
        ({"parameters": {"late_liquefaction": {"hold": 0.5}}}, f"parameters: {LEFT_OUT}"),
        ({"validation_case": "other"}, f"validation_case: {LEFT_OUT}"),
        ({"source": {"toe_runout": {"std": 1.0}}}, f"source: {LEFT_OUT}"),
        ({"hold_out": {"groups": ["crest"]}}, "hold_out: no measurement 'crest'; there are surf"),
    ],
)  # fmt: skip
def test_what_three_dimensions_lack_is_refused_by_its_name(bank, entry, words, capsys):
    write_text(bank / "diagnosis.yaml", yaml_text(FAST | entry))
    with pytest.raises(InputError) as raised:
        flowslide.compare(bank, settings=load_config(None, SETTINGS))
    assert words in str(raised.value) and "\n" not in str(raised.value)


def test_no_measurement_is_proposed(bank, tmp_path):
    with pytest.raises(InputError, match=f"suggest: .*bank: {LEFT_OUT}"):
        main(["diagnose", "suggest", str(bank), "--out", str(tmp_path / "out"), "--quiet"])


def test_a_section_over_a_width_has_what_its_section_has(embankment):
    """But for what the solver takes of a terrain alone."""
    survey = {"name": "toe", "type": "path_runout", "value_m": 9.0, "std_m": 1.0,
              "confidence": "published", "source": "simulated"}  # fmt: skip
    sets = {"case": "b", "default_set": "all", "sets": {"all": [survey, survey | {"name": "b"}]}}
    document = {"name": "wide", "section": {"file": "scene.yaml", "width_m": 20.0}, "spacing": 3.0}
    write_text(embankment / "scene3d.yaml", yaml_text(document))
    write_text(embankment / FILE_NAME, yaml_text(sets))
    (embankment / "diagnosis.yaml").unlink(missing_ok=True)
    case = asked(embankment / "scene3d.yaml")
    model = case.model(RunStore(None), SLOPE)
    names = [one.name for one in model.candidates]
    assert "bonded_base" in names and "lateral_stress" in names and "pool" not in names
    density = next(name for name in names if name.startswith("density_of"))
    for name in ("bonded_base", density):
        setup = model.setup_of(state(case.setup.parameters.start, {name: 1.0}))
        assert setup.soil != case.setup.soil and len(setup.problem.position)
    assert "scene.yaml" in {path.name for path in case.files}


@pytest.mark.parametrize(
    "options, words",
    [
        (["--engine", "mpm"], "--engine mpm: not in three dimensions"),
        (["--set", "diagnosis.finite_width=true"], f"diagnosis.finite_width: {LEFT_OUT}"),
        (["--effects", "docs/examples/my_effect.py"], "--effects: not in three dimensions"),
        (["--set", "simulation.transfer=flip"], "in three dimensions only affine_flip"),
    ],
)
def test_options_that_cannot_be_are_refused(bank, options, words, tmp_path, root):
    given = [str(root / one) if one.endswith(".py") else one for one in options]
    with pytest.raises(InputError, match=words):
        main(["diagnose", "compare", str(bank), *given, "--out", str(tmp_path / "out"), "--quiet"])
    assert not (tmp_path / "out").exists()


def test_a_hypothesis_assumes_otherwise(bank):
    plain, heavy = (
        asked(bank),
        asked(bank, hypothesis=Hypothesis(effects={"density_of_fill": 95.0})),
    )
    one, two = (case.setup.scene.soil.materials["fill"].density for case in (plain, heavy))
    assert two == one + 95.0 and plain.scene_hash != heavy.scene_hash
    assert (
        plain.setup.scene.spacing == 2.0 and asked(bank, spacing_m=4.0).setup.scene.spacing == 4.0
    )
    both = {"density_of_fill": 95.0, "bonded_base": 1.0}
    soil = asked(bank, hypothesis=Hypothesis(effects=both)).setup.scene.soil
    assert soil.materials["fill"].density == two and soil.contact == "no_slip"
    shifted = asked(bank, hypothesis=Hypothesis(effects={"datum_shift": 0.5}))
    assert shifted.setup.targets.measured == pytest.approx(plain.setup.targets.measured - 0.5)
    for change, words in (
        ({"effects": {"weak_base": 0.3}}, "no effect 'weak_base' in three dimensions"),
        ({"scene_changes": {"name": "other"}}, f"scene_changes: {LEFT_OUT}"),
    ):
        with pytest.raises(InputError, match=words):
            asked(bank, hypothesis=Hypothesis(**change))
    assert {path.name for path in plain.files} == {
        "scene3d.yaml", "measurements3d.yaml", "inversion.yaml", "diagnosis.yaml", "surface.tif",
        "base.tif", "after.tif",
    }  # fmt: skip


def test_a_share_of_a_parameter_counts_beside_another_base(bank):
    scene = read_yaml(bank / "scene3d.yaml")
    scene["terrain"]["materials"]["fill"]["liquefied"] = True
    write_text(bank / "scene3d.yaml", yaml_text(scene))
    shared = {**STRENGTH, "zones": ["crust", "slimes"]}
    write_text(bank / "inversion.yaml", yaml_text({"parameters": [shared], "loss": "misfit"}))
    both = Hypothesis(effects={"contrast_of_crust": 0.5, "bonded_base": 1.0})
    setup = asked(bank, hypothesis=both).setup
    assert setup.factors == {"crust": pytest.approx(np.exp(0.5))}
    assert setup.scene.soil.contact == "no_slip"


def surveyed(folder, setup, raised: float) -> None:
    """The survey of a simulated slide with S_r of 6 kPa, on other points, at pixels of 1 m.

    Those of the maps are too coarse for its crest. Errors are of squares of 4 m.
    """
    setup = setup.jittered(0.5, 99)
    values = np.array([6.0])
    kept = BodyEngine(BodyStore(None, threads=1)).kept_maps(setup.at(values))
    x, y = np.meshgrid(np.arange(49.0), np.arange(17.0), indexing="ij")
    places = np.stack([x, y], axis=-1).reshape(-1, 2)
    after = setup.deposit_map(values, kept).surface_at(places).reshape(x.shape) + raised
    errors = 0.2 * np.random.default_rng(1).standard_normal((13, 5))
    after += np.kron(errors, np.ones((4, 4)))[:49, :17]
    write_raster(Raster((0.0, 0.0), 1.0, after), folder / "after.tif")


@pytest.mark.slow
@pytest.mark.parametrize("hidden", ["nothing", "datum"])
def test_a_slide_by_the_solver(bank, hidden, tmp_path, capsys):
    case = asked(bank)
    surveyed(bank, case.setup, raised=0.8 if hidden == "datum" else 0.0)
    # Few hypotheses: each takes runs of a second.
    few = ["datum_shift", "datum_tilt", "density_of_fill", "left_stretch"]
    write_text(bank / "diagnosis.yaml", yaml_text(FAST | {"effects": few}))
    out = tmp_path / "out"
    settings = [part for one in SETTINGS for part in ("--set", one)]
    main(["diagnose", str(bank), "--out", str(out), "--threads", "1", "--quiet", *settings])
    verdict = load_verdict(out)
    assert plain(headline(verdict)) in capsys.readouterr().out and (out / "report.html").is_file()
    (found,) = verdict.final.values.values() if verdict.final else [np.nan]
    if hidden == "nothing":
        assert verdict.verdict == "adequate" and found == pytest.approx(6.0, abs=1.0)
        return
    assert verdict.base.p_combined < 0.01
    scores = {one.name: one.z for one in verdict.candidates if not one.left_out}
    assert max(scores, key=scores.get) == "datum_shift"
    (refit,) = [one for one in verdict.candidates if one.name == "datum_shift"]
    assert refit.refit.amplitude == pytest.approx(0.8, abs=0.15)
