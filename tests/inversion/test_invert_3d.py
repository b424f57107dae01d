"""Back-analysis over a width: the middle section, what flanks do, the question answered."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.verification.three_dimensions import slab_scene
from flowslide.command_line import main
from geometry.case import load_case
from geometry.scenes.scene import Scene
from geometry.scenes3d.scene3d import Section
from geometry.survey.toe_runout import toe_runout
from inversion.back_analysis.by_engine import back_analysis_by
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.result import load_result
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.registry import engine_named, of_section, untrained
from inversion.engines.run_store import RunStore
from inversion.engines.run_store_3d import RunStore3d
from inversion.posterior.document import load_posterior
from inversion.posterior.runs import CaseModel
from inversion.posterior.varied_case import varied_case
from mpm_taichi.trajectory import read_run
from pipeline.cli import InputError
from pipeline.config import SimulationSettings, load_config
from pipeline.files import read_json, write_text, yaml_text
from pipeline.progress import Watch

FEW = ["simulation.duration_s=4", "inversion.step_seeds=1"]
TRUTH = 12.0
SETTINGS = SimulationSettings(duration_s=20.0)


def section(width: float, **more) -> Section:
    return Section(file="scene.yaml", width_m=width, **more)


def question(folder, *, runout: float = 1.0, width: float = 10.0, **question):
    """A case of a bank of clay, its runout and its S_r."""
    folder.mkdir(exist_ok=True)
    write_text(folder / "scene.yaml", yaml_text(slab_scene(spacing=1.0)))
    scene3d = {"name": "bank", "section": {"file": "scene.yaml", "width_m": width}}
    write_text(folder / "scene3d.yaml", yaml_text(scene3d))
    said = {"confidence": "recalled", "source": "simulated", "std_is": "assumed"}
    toe = {"name": "toe", "type": "toe_runout", "side": "right", "value_m": runout, "std_m": 0.3}
    head = {"case": "bank", "upstream": "right", "initial": {}, "default_set": "all"}
    measured = {**head, "sets": {"all": [toe | said]}}
    write_text(folder / "measurements.yaml", yaml_text(measured))
    strength = {
        "name": "S_r", "zones": ["bank"], "property": "residual_strength_kpa",
        "start": 18.0, "low": 3.0, "high": 40.0,
    }  # fmt: skip
    asked = {"parameters": [strength], "fit": ["toe"], "loss": "misfit", **question}
    write_text(folder / "inversion.yaml", yaml_text(asked))
    return folder


def runout(run) -> float:
    places, volume = run.moved
    return toe_runout(places.astype(float), volume, spacing=1.0, side="right", initial_toe=22.0)


@pytest.fixture(scope="module")
def kept():
    """The bank at 15 kPa by the plane solver, between smooth and between rough flanks."""
    scene = Scene.model_validate(slab_scene(spacing=1.0))
    stores = {
        "plane": RunStore(None, threads=1),
        "smooth": RunStore3d(section(8.0), "smooth", None, threads=1),
        "rough": RunStore3d(section(10.0), "rough", None, threads=1),
    }
    runs = {name: store.fetch([(scene, SETTINGS)])[0] for name, store in stores.items()}
    return scene, stores, runs


@pytest.mark.slow
def test_between_smooth_flanks_the_middle_section_is_the_plane_run(kept):
    _, _, runs = kept
    plane, smooth = runs["plane"], runs["smooth"]
    assert np.array_equal(plane.initial, smooth.initial)
    assert np.array_equal(plane.zone, smooth.zone)
    assert runout(smooth) == pytest.approx(runout(plane), rel=0.01)
    assert smooth.volume == pytest.approx(plane.initial_volume, rel=0.02)
    stress = np.abs(smooth.vertical_stress - plane.vertical_stress)
    assert np.median(stress) < 0.03 * plane.vertical_stress.max()


def test_rough_flanks_hold_the_slide_back(kept):
    _, _, runs = kept
    assert runout(runs["rough"]) < 0.7 * runout(runs["plane"])


def test_runs_are_kept_by_width_and_flanks(kept, tmp_path):
    scene, stores, _ = kept
    keys = {store.key(scene, SETTINGS) for store in stores.values()}
    keys.add(RunStore3d(section(7.0), "smooth", None).key(scene, SETTINGS))
    assert len(keys) == 4
    store = RunStore3d(section(8.0), "smooth", tmp_path, threads=1)
    short = SimulationSettings(duration_s=0.5)
    first = store.fetch([(scene, short)])[0]
    again = RunStore3d(section(8.0), "smooth", tmp_path, threads=1)
    assert np.array_equal(again.fetch([(scene, short)])[0].final, first.final)
    assert (store.computed, again.computed) == (1, 0)


def test_walls_move_by_whole_spacings(kept):
    scene, _, _ = kept
    walled = RunStore3d(section(7.0, x_min=-10.3, x_max=70.0), "smooth", None).walled(scene)
    assert (walled.domain.x_min, walled.domain.x_max) == (-11.0, 70.0)


def test_what_it_cannot_do_is_refused_in_one_line(tmp_path):
    case = inversion_case(load_case(question(tmp_path / "bank")))
    with pytest.raises(InputError, match="device cuda: three dimensions run on the CPU"):
        back_analysis_by(engine_named("mpm3d"), case, RunStore(None, device="cuda"), Watch())
    assert untrained("mpm3d").store is not None
    with pytest.raises(InputError, match="answers back-analyses, posteriors and predictions"):
        of_section("mpm3d")
    narrow = RunStore3d(section(2.0), "smooth", None, threads=1)
    with pytest.raises(InputError, match="holds 2 rows of points; 3 are needed"):
        narrow.simulate(case.scene, SimulationSettings(duration_s=0.1))
    (tmp_path / "bank/scene3d.yaml").unlink()
    with pytest.raises(InputError, match=r"scene3d\.yaml"):
        back_analysis_by(engine_named("mpm3d"), case, RunStore(None), Watch())


def test_variants_and_sensitivities_that_the_solver_lacks_are_left_out(tmp_path):
    plain = {"kind": "simulation", "simulation": {"transfer": "flip"}}
    folder = question(
        tmp_path / "bank",
        variants=[{"name": "bonded base", "contact": "no_slip"},
                  {"name": "damped", "simulation": {"local_damping": 0.05}}],
        sensitivities=[{"name": "transfer", **plain},
                       {"name": "time step", "kind": "time_step", "factor": 0.5}],
    )  # fmt: skip
    case = inversion_case(load_case(folder))
    analysis = back_analysis_by(engine_named("mpm3d"), case, RunStore(None), Watch())
    variants, left_out = analysis.known_variants()
    assert [variant.name for variant in variants] == ["bonded base"]
    assert left_out == ["damped: left out: local_damping: not in three dimensions; allowed is 0"]
    sensitivities, left_out = analysis.known_sensitivities()
    assert [entry.name for entry, _ in sensitivities] == ["time step"]
    assert len(left_out) == 1 and "only affine_flip" in left_out[0]
    # A posterior takes what is left as its other ways to simulate.
    unknown = varied_case(analysis.case, analysis.store.refused)
    assert unknown.remarks == tuple(left_out)
    others = CaseModel(unknown, analysis.store).other_ways
    assert {name for name, _ in others} == {"time step"}


@pytest.mark.slow
def test_a_strength_ratio_over_a_width_is_that_of_the_plane_section(tmp_path):
    """Of the settled stress; between smooth flanks."""
    slab = slab_scene(spacing=1.0)
    for soil in slab["materials"].values():
        soil |= {"friction_deg": 0.0, "liquefied": True}
    ratio = {
        "name": "ratio", "zones": ["bank"], "property": "strength_ratio", "start": 0.2, "low": 0.03,
        "high": 0.6,
    }  # fmt: skip
    folder = question(tmp_path / "bank", width=6.0, parameters=[ratio])
    write_text(folder / "scene.yaml", yaml_text(slab))
    case = inversion_case(load_case(folder, load_config(None, FEW)))
    plane, wide = (
        MPMEngine(store).predict([case.setup.at(np.array([0.12]))])[0].values[0]
        for store in (
            RunStore(None, threads=1),
            RunStore3d(section(6.0), "smooth", None, threads=1),
        )
    )
    assert wide == pytest.approx(plane, rel=0.02)


@pytest.mark.slow
def test_the_strength_is_found_from_a_runout_between_flanks(tmp_path):
    folder = question(tmp_path / "bank", width=6.0)
    case = inversion_case(load_case(folder, load_config(None, FEW)))
    store = RunStore3d(section(6.0), "rough", None, threads=1)
    (seen,) = MPMEngine(store).predict([case.setup.at(np.array([TRUTH]))])
    question(folder, runout=float(seen.values[0]), width=6.0)
    found = {}
    for engine in ("mpm3d", "mpm"):
        main(["invert", str(folder), "--engine", engine, "--quick", "--threads", "1", "--quiet",
              *(word for text in FEW for word in ("--set", text)), "--report", "page",
              "--out", str(tmp_path / engine)])  # fmt: skip
        found[engine] = load_result(tmp_path / engine).answer.parameters[0].as_run
    assert found["mpm3d"] == pytest.approx(TRUTH, rel=0.05)
    # A plane section has no flanks to hold it: the same runout asks for a stronger soil.
    assert found["mpm"] > 1.1 * TRUTH
    run = read_run(tmp_path / "mpm3d/run.h5", 0)
    assert run.positions.shape[2] == 2 and run.frames > 10
    assert "three dimensions" in (tmp_path / "mpm3d/report.html").read_text()


@pytest.mark.slow
def test_posterior_and_prediction_are_those_of_the_width(tmp_path):
    folder = question(tmp_path / "bank", width=6.0)
    case = inversion_case(load_case(folder, load_config(None, FEW)), spacing_m=2.0)
    store = RunStore3d(section(6.0), "rough", None, threads=1)
    (seen,) = MPMEngine(store).predict([case.setup.at(np.array([TRUTH]))])
    question(folder, runout=float(seen.values[0]), width=6.0)
    quick = ["--threads", "1", "--quiet", "--spacing", "2", "--engine", "mpm3d"]
    few = ["simulation.duration_s=4", "posterior.coarse_runs=32", "posterior.refined_runs=0",
           "posterior.fine_runs=4", "posterior.live_points=50", "posterior.draws=200"]  # fmt: skip
    settings = [word for text in few for word in ("--set", text)]
    drawn = tmp_path / "posterior"
    main(["posterior", str(folder), "--out", str(drawn), *quick, *settings])
    (strength,) = load_posterior(drawn).parameters
    low, high = strength.after.interval_95
    # Of so few spacings in the height the cells decide how wide it is, not where.
    assert low < TRUTH < high and np.sqrt(low * high) == pytest.approx(TRUTH, rel=0.2)
    main(["predict", str(folder), "--posterior", str(drawn), "--out", str(tmp_path / "predicted"),
          "--seeds", "0", *quick, *settings[:2]])  # fmt: skip
    document = read_json(tmp_path / "predicted/prediction.json")
    (toe,) = [one for one in document["quantities"] if one["name"] == "toe"]
    assert toe["quantiles"]["5"] < seen.values[0] < toe["quantiles"]["95"]
    # The same strengths run farther where no flanks hold them back.
    main(["predict", str(folder), "--posterior", str(drawn), "--out", str(tmp_path / "plane"),
          "--seeds", "0", *quick[:-2], *settings[:2]])  # fmt: skip
    plane = read_json(tmp_path / "plane/prediction.json")
    assert plane["quantities"][0]["mean"] > 1.2 * toe["mean"]
