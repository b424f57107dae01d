"""States become scenes and runs; errors of the survey cost none; what fails is NaN."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.model import Model
from geometry.case import load_case
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.problem.state import State, state

BOUNDARY = {"name": "top", "kind": "zone_boundary",
            "vertices": [{"at": [10.0, 5.0], "move": [2.0, 1.0]},
                         {"at": [44.0, 5.0], "move": [0.0, 1.0]}]}  # fmt: skip


@pytest.fixture
def folder(embankment):
    path = embankment / "inversion.yaml"
    question = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump({**question, "sensitivities": [BOUNDARY]}))
    (embankment / "diagnosis.yaml").write_text(
        "spacing_m: 2.0\nparameters: {strain_softening: {reference_strain: 0.7}}\n"
    )
    return embankment


@pytest.fixture
def case(folder):
    return diagnosis_case(load_case(folder))


def test_a_state_becomes_a_scene(case):
    model = case.model(RunStore(None, threads=1))
    assert isinstance(model, Model)
    plain = model.setup_of(state((9.0, 33.0))).scene
    assert plain == model.parameters.scene(case.scene, np.array([9.0, 33.0]))
    assert plain.materials["loose_sand"].cohesion_kpa == 9.0
    jittered = model.setup_of(state((9.0, 33.0), seed=3)).scene
    assert (jittered.jitter, jittered.seed) == (0.5, 3) and plain.jitter == 0.0
    fine = State((9.0, 33.0), numerics="fine")
    assert model.setup_of(fine).scene.spacing == pytest.approx(1.0)
    other = State((9.0, 33.0), numerics="transfer")
    assert (
        model.setup_of(other).scene == plain and model.setup_of(other).settings.transfer == "flip"
    )
    assert model.setup_of(fine).settings.transfer == "affine_flip"
    soft = model.setup_of(state((9.0, 33.0), {"strain_softening": 1.0, "weak_base": 0.2})).scene
    assert soft.effects == {
        "strain_softening": {"amplitude": 1.0, "reference_strain": 0.7},
        "weak_base": 0.2,
    }
    # The boundary moves with the strengths in place, and brings no effect into the scene.
    higher = model.setup_of(state((9.0, 33.0), {"boundary_top": 1.0})).scene
    assert (44.0, 6.0) in higher.zones[0].polygon and not higher.effects
    assert higher.materials["loose_sand"].cohesion_kpa == 9.0


def test_an_effect_on_a_part_is_tried_where_the_part_is_stated(folder):
    model = diagnosis_case(load_case(folder)).model(RunStore(None, threads=1))
    assert "no place is stated" in model.left_out["strength_contrast"]
    (folder / "diagnosis.yaml").write_text(
        "parameters:\n  strength_contrast: {y_m: 1.0, half_height_m: 1.0}\n"
    )
    model = diagnosis_case(load_case(folder)).model(RunStore(None, threads=1))
    assert "strength_contrast" in {candidate.name for candidate in model.candidates}
    assert "strength_contrast" not in model.left_out


def test_a_random_pattern_is_by_chance_until_its_draw_is_given(folder):
    def by_chance() -> set[str]:
        model = diagnosis_case(load_case(folder)).model(RunStore(None, threads=1))
        return {candidate.name for candidate in model.candidates if candidate.by_chance}

    assert by_chance() == {"spatial_variability"}
    text = "parameters:\n  spatial_variability: {correlation_length_m: 10}\n"
    (folder / "diagnosis.yaml").write_text(text)
    assert by_chance() == {"spatial_variability"}
    (folder / "diagnosis.yaml").write_text(text.replace("10}", "10, seed: 4}"))
    assert not by_chance()


def test_a_curve_is_one_entry_of_the_scene(case, kept_runs):
    model = case.model(kept_runs)
    curves = {curve.variable: curve for curve in model.curves}
    assert set(curves) == {"strain_rate", "strain", "time", "overburden", "position"}
    low, high = curves["overburden"].knots[0], curves["overburden"].knots[-1]
    assert 0.0 < low < high < 18.0 * 9.81 * 1.2
    assert 0.0 < curves["position"].knots[0] < curves["position"].knots[-1] < 44.0
    first, *_, last = curves["strain"].names
    entry = model.setup_of(state((9.0, 33.0), {first: 0.3, last: -0.2})).scene.effects[
        "strength_curve"
    ]
    assert (entry["c0"], entry["c1"], entry["c4"], entry["knots"]) == (0.3, 0.0, -0.2, 5.0)
    assert entry["variable"] == 1.0 and entry["last_knot"] == 2.0


def test_predictions_are_those_of_the_back_analysis(case, kept_runs):
    model = case.model(kept_runs)
    engine = MPMEngine(kept_runs)
    (row,) = model.predict([state((9.0, 33.0))])
    (prediction,) = engine.predict([case.setup.at([9.0, 33.0])])
    assert np.array_equal(row, prediction.values) and np.all(np.isfinite(row))


def test_errors_of_the_survey_cost_no_run(case, kept_runs):
    model = case.model(kept_runs)
    base = state((9.0, 33.0))
    shifted = base.with_effects({"datum_shift": 0.4, "datum_tilt": -1.0})
    rows = model.predict([base, shifted, shifted, base])
    assert model.runs == 1
    assert np.array_equal(rows[0], rows[3]) and np.array_equal(rows[1], rows[2])
    change = dict(zip(model.targets.names, rows[1] - rows[0], strict=True))
    assert change["surface at x 40 m"] == pytest.approx(0.4 - 1.0)
    assert change["surface at x -33.26 m"] == pytest.approx(0.4 + 1.0)
    assert change["toe"] == 0.0


@pytest.mark.slow
def test_runs_are_counted_once_and_found_again(case, tmp_path):
    states = [
        state((9.0, 33.0)),
        state((9.0, 33.0), {"weak_base": 0.3}),
        state((9.0, 33.0), seed=1),
    ]
    first = case.model(RunStore(tmp_path, threads=1))
    rows = first.predict([*states, states[0]])
    assert first.runs == first.computed == 3
    assert len({row.tobytes() for row in rows[:3]}) == 3
    again = case.model(RunStore(tmp_path, threads=1))
    assert np.array_equal(again.predict(states), rows[:3])
    assert (again.runs, again.computed) == (3, 0)
    # One run at a time, or all together: the same numbers.
    single = case.model(RunStore(None, threads=1))
    assert np.array_equal(single.predict(states[1:2])[0], rows[1])


def test_a_state_that_cannot_be_is_nan_and_stops_no_other(case, kept_runs):
    model = case.model(kept_runs)
    broken = state((9.0, 33.0), {"boundary_top": 40.0})
    beyond = state((9.0, 33.0), {"weak_base": 7.0})
    rows = model.predict([broken, state((9.0, 33.0)), beyond])
    assert np.isnan(rows[[0, 2]]).all() and np.isfinite(rows[1]).all()
    assert "weak_base" in model.failures[beyond] and "allowed are 0 to 1" in model.failures[beyond]
    assert "top" in model.failures[broken]


def test_the_foot_that_moves_takes_the_zero_of_the_runout_with_it(folder, kept_runs):
    path = folder / "inversion.yaml"
    question = yaml.safe_load(path.read_text())
    question["sensitivities"][0]["vertices"] = [{"at": [0.0, 0.0], "move": [-3.0, 0.0]}]
    path.write_text(yaml.safe_dump(question))
    model = diagnosis_case(load_case(folder)).model(kept_runs)
    moved = model.setup_of(state((9.0, 33.0), {"boundary_top": 1.0}))
    assert moved.foot == {"left": -3.0, "right": 64.0}
    assert model.setup_of(state((9.0, 33.0))).foot == {"left": 0.0, "right": 64.0}
