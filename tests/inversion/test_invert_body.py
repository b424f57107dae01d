"""Back-analysis from a map: a twin on real ground, the question's other readings, bad input."""

from __future__ import annotations

import runpy
from dataclasses import replace

import numpy as np
import pytest

import flowslide
from flowslide.command_line import main
from geometry.scenes3d.scene3d import load_scene_3d
from geometry.survey3d.survey import FILE_NAME
from geometry.terrain.raster import Raster, read_raster, write_raster
from inversion.back_analysis.body_case import body_case
from inversion.back_analysis.by_engine import back_analysis_by, chosen_engine
from inversion.back_analysis.result import load_result
from inversion.back_analysis.variants import vary
from inversion.engines.body_engine import BodyEngine, BodyStore, run_key_3d
from inversion.engines.body_setup import BodySetup
from inversion.engines.run_store import RunStore
from inversion.estimation.data import Targets
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import FLOOR_KPA, Question, Variant, load_question
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import write_text, yaml_text
from pipeline.progress import Watch

TRUTH, DURATION = 2.6, 12.0
SAID = {"confidence": "published", "source": "simulated"}
STRENGTH = {"name": "S_r", "zones": ["slimes"], "property": "residual_strength_kpa",
            "start": 5.0, "low": 1.0, "high": 12.0}  # fmt: skip
FEW = ["--set", "inversion.step_seeds=1", "--threads", "1", "--quiet"]


def slide(folder):
    """A small tailings dam in a valley."""
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    folder.mkdir(exist_ok=True)
    x, y = np.meshgrid(np.arange(0.0, 101.0, 2.0), np.arange(0.0, 33.0, 2.0), indexing="ij")
    base = -0.05 * x + 0.3 * np.maximum(np.abs(y - 16.0) - 8.0, 0.0)
    dam = np.where(x >= 24.0, np.minimum(9.0, 9.0 - (x - 28.0) / 2.5), -99.0)
    surface = np.maximum(base, np.maximum(dam, np.where(x < 24.0, 8.0, -99.0)))
    for name, values in (("base", base), ("surface", surface)):
        write_raster(Raster((0.0, 0.0), 2.0, values), folder / f"{name}.tif")
    fill = {"friction_deg": 0, "cohesion_kpa": 14, "density": 1900}
    slimes = {"friction_deg": 0, "cohesion_kpa": 3, "density": 1700, "liquefied": True}
    box = [[24, 0], [100, 0], [100, 32], [24, 32]]
    document = {
        "name": "small_dam", "spacing": 2.0, "duration_s": DURATION,
        "terrain": {
            "surface": "surface.tif", "base": "base.tif",
            "zones": [{"name": "dam", "material": "fill", "plan": box},
                      {"name": "slimes", "material": "slimes"}],
            "materials": {"fill": fill, "slimes": slimes},
        },
        "paths": {"valley": [[28, 16], [100, 16]]},
        "lines": {"road": [[65, 0], [65, 32]]},
    }  # fmt: skip
    write_text(folder / "scene3d.yaml", yaml_text(document))
    return folder


def asked(folder, *entries, **question):
    """The survey and the question of a slide."""
    survey = {"case": "dam", "default_set": "all", "sets": {"all": list(entries)}}
    write_text(folder / FILE_NAME, yaml_text(survey))
    write_text(folder / "inversion.yaml", yaml_text({"parameters": [STRENGTH], **question}))
    return folder


def truth(folder, kpa: float):
    """Readings of the slide with a strength, on other points, and its surface as a raster."""
    scene = load_scene_3d(folder)
    settings = load_config(None).simulation.model_copy(update={"duration_s": DURATION})
    parameters = Parameters(Question(parameters=[STRENGTH]).parameters)
    nothing = Targets([], [], np.zeros(0), np.zeros((0, 0)), [])
    setup = BodySetup(scene, settings, parameters, nothing, jitter=0.5, jitter_seed=99)
    kept = BodyEngine(BodyStore(folder / "truth", threads=1)).kept_maps(setup.at(np.array([kpa])))
    deposit = setup.deposit_map(np.array([kpa]), kept)
    (x, y), pixel = deposit.before.axes, deposit.before.spacing
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    surface = deposit.surface_at(places).reshape(len(x), len(y))
    surface += 0.3 * np.random.default_rng(1).standard_normal(surface.shape)
    return kept.readings, Raster(deposit.before.origin, pixel, surface)


SURFACE = {"name": "surface", "type": "surface_after", "file": "after.tif", "every_m": 6.0,
           "std_m": 0.4, "correlation_length_m": 10.0} | SAID  # fmt: skip
RUNOUT = {"name": "toe", "type": "path_runout", "path": "valley", "value_m": 20.0,
          "std_m": 2.0} | SAID  # fmt: skip


@pytest.mark.slow
def test_the_strength_of_a_twin_is_found_from_its_map(tmp_path, capsys):
    folder, out = slide(tmp_path / "dam"), tmp_path / "out"
    readings, surface = truth(folder, TRUTH)
    write_raster(surface, folder / "after.tif")
    road = {"name": "road", "type": "crossed_volume", "line": "road", "std_m3": 150.0,
            "value_m3": readings["volume_across_road_m3"], "held_out": True} | SAID  # fmt: skip
    asked(folder, SURFACE, road, loss="misfit")
    command = ["invert", str(folder), "--out", str(out), "--quick", *FEW]
    main(command)
    said = capsys.readouterr().out
    assert "surface after" in said and said.count("surface at (") == 0
    result = load_result(out)
    (found,) = result.answer.parameters
    assert abs(found.value - TRUTH) < min(2.0 * found.std_data, 0.2 * TRUTH)
    # Five points in the height of the dam: the cells are worth 40 % of the strength.
    assert 0.3 < found.std_by_source["cell size"] / found.value < 0.5
    assert found.determined and found.ratio == pytest.approx(found.value / found.sigma_v0_kpa)
    checked = {m.group: m for m in result.measurements if m.role == "held out"}
    assert abs(checked["road"].difference_in_std) < 3.0
    page = (out / "report.html").read_text()
    assert "The map, measured and simulated" in page and page.count("data:image/png") >= 2
    assert read_raster(out / "surface_after.tif").values.shape == (25, 8)
    # What was run is kept: the same question again simulates nothing.
    stamps = {path: path.stat().st_mtime_ns for path in (out / "runs").glob("*.npz")}
    again = flowslide.back_analyse(
        folder, out=out, quick=True, threads=1,
        settings=load_config(None, ["inversion.step_seeds=1"]),
    )  # fmt: skip
    assert again.answer.parameters[0].value == found.value
    assert {path: path.stat().st_mtime_ns for path in (out / "runs").glob("*.npz")} == stamps


def test_a_question_has_the_readings_that_three_dimensions_have(tmp_path):
    wall = {"name": "wall", "kind": "zone_boundary", "vertices": [{"at": [0, 0], "move": [1, 0]}]}
    sensitivities = [
        {"name": "fill", "kind": "property", "zones": ["dam"], "property": "cohesion_kpa",
         "std": 3.0},
        {"name": "cells", "kind": "cell_size", "factor": 1.25},
        {"name": "step", "kind": "time_step", "factor": 0.5},
        {"name": "toe", "kind": "target", "measurement": "toe"},
        wall,
    ]  # fmt: skip
    variants = [
        {"name": "dry", "contact": "no_slip"},
        {"name": "farther", "targets": {"toe": 25.0}},
    ]
    folder = asked(slide(tmp_path / "dam"), RUNOUT, sensitivities=sensitivities, variants=variants)
    case = body_case(folder, load_config(None))
    known, left_out = case.sensitivities
    assert [entry.name for entry, _ in known] == ["fill", "step", "toe"]
    (other,) = case.other_cells(case.setup)
    assert other.scene.spacing == 1.25 * case.spacing_m
    assert left_out == ["wall: left out: kind zone_boundary: not available in three dimensions"]
    stronger, weaker = (one.setup.scene.soil.materials for one in known[0][1])
    assert (stronger["fill"].cohesion_kpa, weaker["fill"].cohesion_kpa) == (17.0, 11.0)
    assert known[1][1][0].words == "courant 0.15 instead of 0.3"
    assert [one.setup.targets.measured[0] for one in known[2][1]] == [22.0, 18.0]
    kept, lines = case.variants_of(lambda setup: "")
    assert [one.name for one in kept] == ["farther"] and lines[0].startswith("dry: left out: con")
    assert case.variant(kept[0]).setup.targets.measured[0] == 25.0
    engine = chosen_engine(case, None, None).engine
    analysis = back_analysis_by(engine, case, RunStore(None, threads=1), Watch())
    assert analysis.known_variants() == (kept, lines)
    assert analysis.coarse_spacing_m is None  # too few points for coarse runs


def test_another_set_is_fitted_by_the_same_names(tmp_path):
    folder = asked(slide(tmp_path / "dam"), RUNOUT, fit=["toe"])
    area = {"name": "area", "type": "inundated_area", "value_m2": 900.0, "std_m2": 90.0} | SAID
    survey = {"case": "dam", "default_set": "one", "sets": {
        "one": [RUNOUT, area], "two": [RUNOUT | {"value_m": 25.0}, area]}}  # fmt: skip
    write_text(folder / FILE_NAME, yaml_text(survey))
    question = {"parameters": [STRENGTH], "fit": ["toe"],
                "variants": [{"name": "second survey", "measurements": "two"}]}  # fmt: skip
    write_text(folder / "inversion.yaml", yaml_text(question))
    case = body_case(folder, load_config(None))
    other = body_case(folder, load_config(None), measurement_set="two")
    (variant,) = case.question.variants
    for targets in (case.setup.targets, other.setup.targets, case.variant(variant).setup.targets):
        assert dict(zip(targets.names, targets.fitted, strict=True)) == {"toe": True, "area": False}


def test_a_run_is_known_by_all_that_holds_the_soil(tmp_path):
    folder = asked(slide(tmp_path / "dam"), RUNOUT)
    problem, scene = body_case(folder, load_config(None)).setup.problem, load_scene_3d(folder)
    settings = load_config(None).simulation
    others = [
        problem,
        replace(problem, contact="coulomb", friction_coefficient=0.2),
        replace(problem, contact="coulomb", friction_coefficient=0.4),
        replace(problem, flanks="no_slip"),
        replace(problem, velocity=np.ones_like(problem.position)),
    ]
    assert len({run_key_3d(scene, one, settings) for one in others}) == len(others)


def test_coarse_runs_are_of_the_same_question(tmp_path):
    folder = asked(slide(tmp_path / "dam"), RUNOUT)
    case = body_case(folder, load_config(None, ["inversion.coarse_points=50"]), spacing_m=1.0)
    assert case.coarse_spacing_m is None  # 4 m, twice the spacing of the folder: 150 points
    config = load_config(None, ["inversion.coarse_points=50", "inversion.coarse_factor=1.5"])
    case = body_case(folder, config, spacing_m=1.0)
    assert case.coarse_spacing_m == 3.0
    coarse = case.coarsened(case.setup)
    assert coarse is not None and coarse.scene.spacing == 3.0
    assert coarse.targets is case.setup.targets
    assert len(coarse.problem.position) < len(case.setup.problem.position) / 20


def test_jitter_moves_points_and_keeps_them_above_the_ground(tmp_path):
    case = body_case(asked(slide(tmp_path / "dam"), RUNOUT), load_config(None))
    values = np.array([3.0])
    plain = case.setup.problem_at(values)[1].position
    first, again, other = (
        case.jittered(case.setup, seed).problem_at(values)[1] for seed in (1, 1, 2)
    )
    assert np.array_equal(first.position, again.position)
    assert not np.array_equal(first.position, other.position)
    assert np.abs(first.position - plain).max() <= 0.5 * case.config.inversion.noise_jitter * 2.0
    assert np.all(first.position[:, 2] > first.base.at(*first.position[:, :2].T))


@pytest.mark.parametrize(
    "change, words",
    [
        ({"parameters": [STRENGTH | {"zones": ["mud"]}]}, "no zone 'mud' in the scene"),
        ({"engine": "gns"}, "engine: gns: not in three dimensions; only mpm3d"),
        ({"fit": ["nose"]}, "no measurement 'nose' in this set; it has toe"),
        ({"parameters": [{"name": "level", "property": "water_level", "start": 5.0, "low": 4.0,
                          "high": 6.0}]}, "the scene has no water_level"),
        ({"parameters": [STRENGTH | {"prior": {"relation": "weber_2015", "n1_60": 8}}]},
         "prior.relation: not available in three dimensions"),
        ({"sensitivities": [{"name": "s", "kind": "property", "zones": ["slimes"], "std": 1.0,
                             "property": "cohesion_kpa"}]}, "calibrated by 'S_r'"),
        ({"sensitivities": [{"name": "w", "kind": "water_level", "std_m": 1.0}]},
         "the scene has no water_level"),
        ({"sensitivities": [{"name": "c", "kind": "cell_size", "factor": 4.9}], "spacing_m": 5.0},
         "sensitivities: c: at 24.5 m spacing"),
    ],
)  # fmt: skip
def test_a_question_that_cannot_be_asked_is_one_line(tmp_path, change, words):
    folder = asked(slide(tmp_path / "dam"), RUNOUT, **change)
    with pytest.raises(InputError) as raised:
        body_case(folder, load_config(None))
    assert words in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "options, words",
    [
        (["--engine", "gns"], "--engine gns: not in three dimensions"),
        (["--model", "small"], "--model: not in three dimensions"),
        (["--set-of-measurements", "old"], "no set of measurements 'old'; there are all"),
        (["--spacing", "-1"], "-1"),
    ],
)
def test_options_that_cannot_be_are_refused(tmp_path, options, words):
    folder = asked(slide(tmp_path / "dam"), RUNOUT)
    with pytest.raises(InputError, match=words):
        main(["invert", str(folder), *options, "--out", str(tmp_path / "out"), "--quiet"])
    assert not (tmp_path / "out").exists()


def test_the_question_of_the_example_is_one_of_its_dam(root, tmp_path):
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    valley, survey = (
        runpy.run_path(str(root / f"docs/examples/tailings_{name}.py"))
        for name in ("valley", "survey")
    )
    valley["write_example"](tmp_path)
    write_text(tmp_path / "inversion.yaml", yaml_text(survey["QUESTION"]))
    (spec,) = load_question(tmp_path, load_scene_3d(tmp_path).soil).parameters
    assert spec.zones == ["slimes"] and spec.low < survey["TRUE_KPA"] < spec.high


def test_without_a_survey_there_is_nothing_to_fit(tmp_path):
    folder = asked(slide(tmp_path / "dam"), RUNOUT)
    (folder / FILE_NAME).unlink()
    with pytest.raises(InputError, match=FILE_NAME):
        main(["invert", str(folder), "--out", str(tmp_path / "out"), "--quiet"])


def test_a_strength_ratio_of_a_body_is_of_its_settled_stress(tmp_path):
    ratio = {**STRENGTH, "property": "strength_ratio", "start": 0.1, "low": 0.02, "high": 0.5}
    scene = load_scene_3d(slide(tmp_path / "dam"))
    settings = load_config(None).simulation.model_copy(update={"duration_s": 0.5})
    parameters = Parameters(Question(parameters=[ratio]).parameters)
    nothing = Targets([], [], np.zeros(0), np.zeros((0, 0)), [])
    setup = BodySetup(scene, settings, parameters, nothing)
    soils = {one.name: one for one in setup.scene_at(np.array([0.2])).soil.zones}
    materials = setup.scene_at(np.array([0.2])).soil.materials
    slimes = materials[soils["slimes"].material]
    assert (slimes.strength_ratio, slimes.cohesion_kpa) == (0.2, FLOOR_KPA)
    assert materials[soils["dam"].material].strength_ratio is None
    kept = BodyEngine(BodyStore(tmp_path / "runs", threads=1)).kept_maps(setup.at(np.array([0.2])))
    assert not kept.reason
    mean, _ = setup._stress(kept)
    assert mean == pytest.approx([kept.stress_kpa["slimes"][1]]) and 10.0 < mean[0] < 80.0
    variant = Variant(name="other", property="residual_strength_kpa")
    with pytest.raises(InputError, match="property: not available in three dimensions"):
        vary(setup, variant, nothing, "here")
