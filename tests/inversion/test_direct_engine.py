"""The direct models as engines: protocol, derivative, what is refused, a back-analysis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from diagnosis.adequacy.calibration import calibrate
from diagnosis.hypotheses.engine_model import EngineModel
from diagnosis.options import Options
from geometry.case import load_case
from geometry.survey.toe_history import ToeHistory
from gns.direct.effects import NAMES, most
from gns.direct.network import DirectConfig, DirectModel
from gns.direct.predictor import DirectPredictor, Forecast, described
from gns.direct.sections import check_settings, section_of
from inversion.back_analysis import with_direct_model
from inversion.back_analysis.by_engine import back_analysis_by
from inversion.back_analysis.case import inversion_case
from inversion.engines.direct_engine import READ, DirectEngine, shipped
from inversion.engines.forecast_times import read_times, time_error_std
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.registry import engine_named, engines, untrained
from inversion.engines.run_store import RunStore
from inversion.estimation.forward import Forward
from inversion.posterior.runs import CaseModel
from inversion.posterior.varied_case import varied_case as unknowns_of
from inversion.prediction.known_strength import KnownStrength
from inversion.prediction.predict import predict
from inversion.prediction.prediction_case import prediction_case
from inversion.problem.state import State
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.progress import Watch
from tests.conftest import ROOT

QUICK = [
    "inversion.starts=1", "inversion.noise_seeds=0", "inversion.step_seeds=0",
    "inversion.variants=false", "inversion.sensitivities=false", "inversion.waterfall=false",
]  # fmt: skip


def predictor_near(section, effects: tuple[str, ...] = ()) -> DirectPredictor:
    """An untrained model that has seen this section, and does not ignore what it is given."""
    torch.manual_seed(1)
    model = DirectModel(DirectConfig((8, 8, 8, 8), effects=effects))
    for parameter in model.parameters():
        torch.nn.init.normal_(parameter, std=0.15)
    return DirectPredictor(
        model.eval().requires_grad_(False), 1.5, 1.5, 1.5, described(section)[None], 1.0
    )


@pytest.fixture
def setup(lsfd):
    return inversion_case(load_case(lsfd, load_config(None, QUICK))).setup


def engine_of(setup, **more) -> DirectEngine:
    return DirectEngine(predictor_near(section_of(setup.scene)), **more)


def test_it_is_an_engine_whose_numbers_are_those_of_the_survey(setup):
    engine = engine_of(setup)
    assert isinstance(engine, Forward)
    first, second = (setup.at(np.array([s, 30.0])) for s in (10.0, 40.0))
    one, other = engine.predict([first, second])
    assert engine.runs == 2
    assert one.values.shape == (len(setup.targets.names),)
    fitted = setup.targets.fitted
    assert np.all(np.isfinite(one.values[fitted])) and not np.array_equal(one.values, other.values)
    (again,) = engine.predict([second])
    assert np.array_equal(other.values, again.values, equal_nan=True)
    assert one.sigma_v0_kpa[0] > 50.0 and one.spacing_m == setup.scene.spacing
    std = engine.error_std(first)
    assert std.shape == one.values.shape and np.all(std[fitted] > 0)


def test_results_of_engines_lie_apart_and_say_who_answered():
    known = {name: engine.suffix for name, engine in engines().items()}
    assert known["mpm"] == "" and known["mpm3d"] == "_3d" and known["direct"] == "_direct"
    assert len(set(known.values())) == len(known)
    assert engine_named("mpm").said == ""
    assert engine_named("direct").said == "by a learned model that predicts the deposit in one pass"


def test_a_diagnosis_asks_it_for_nothing_that_it_cannot_read(setup):
    engine = engine_of(setup)
    known = replace(engine_named("direct"), forward=lambda store: engine)
    model = EngineModel(setup, RunStore(None, threads=1), engine=known)
    assert {
        entry.type for entry in EngineModel(setup, RunStore(None, threads=1))._possible.entries
    } - set(READ)
    assert all(entry.type in READ for entry in model._possible.entries)
    state = State(tuple(float(value) for value in setup.parameters.start))
    assert model.propose([state]).shape == (1, len(model._possible.names))
    request = setup.at(np.array(state.values))
    np.testing.assert_array_equal(model.error_std(state), engine.error_std(request))
    assert not {"remoulding", "shaking"} & {one.name for one in model.candidates}


def test_effects_that_it_has_learned_are_on_trial_and_others_refused(setup):
    setup = setup.at_spacing(2.0, "test")
    learned = DirectEngine(predictor_near(section_of(setup.scene), NAMES))
    known = replace(
        engine_named("direct"),
        forward=lambda store: learned,
        learned_effects=lambda: {name: most(name) for name in learned.predictor.effects},
    )
    model = EngineModel(setup, RunStore(None, threads=1), engine=known)
    physics = {one.name for one in model.candidates if one.family == "physics"}
    assert {"remoulding", "shaking"} < physics <= set(NAMES)
    assert "has no such effect" in model.left_out["spatial_variability"]
    assert {one.high for one in model.candidates if one.name == "side_shear"} == {0.15}
    state = State(tuple(float(value) for value in setup.parameters.start))
    base, shaken = model.predict([state, state.with_effects({"shaking": 0.3})])
    assert np.nanmax(np.abs(shaken - base)) > 0.0
    numbers = {"shaking": {"frequency_hz": 2.0}}
    model = EngineModel(setup, RunStore(None, threads=1), engine=known, numbers=numbers)
    assert "knows its default numbers alone" in model.left_out["shaking"]
    on = replace(setup, scene=setup.scene.changed(effects={"remoulding": 0.4}))
    with pytest.raises(InputError, match="effects: remoulding is on; this direct model"):
        engine_of(setup).predict([on.at(setup.parameters.start)])


@pytest.mark.slow
def test_a_diagnosis_puts_on_trial_what_it_sees_and_nothing_else(setup):
    engine = engine_of(setup)
    known = replace(engine_named("direct"), forward=lambda store: engine)
    model = EngineModel(setup, RunStore(None, threads=1), engine=known)
    state = State(tuple(float(value) for value in setup.parameters.start))
    on_trial = [one for one in model.candidates if one.family in ("soil", "water", "strength")]
    assert {"no_water", "drawdown", "lower_layer"} < {one.name for one in on_trial}
    (part, *_) = model.neighbours("lower_layer")
    assert model.add_placed(part) and not model.add_placed("bump_17_m_before_the_left_foot")
    base, *moved = model.predict(
        [state, *(state.with_effects({one.name: one.ladder[-1]}) for one in on_trial)]
    )
    for one, row in zip(on_trial, moved, strict=True):
        assert np.nanmax(np.abs(row - base)) > 0.0, one.name
    reasons = {
        "stiffness": "does not see it", "bump_near": "level and evenly sloping ground",
        "bonded_base": "knows rough ground", "lateral_stress": "knows none alone",
        "water_as_weight": "knows pore_pressure", "shaking": "has no such effect",
    }  # fmt: skip
    for begin, why in reasons.items():
        names = [name for name in model.left_out if name.startswith(begin)]
        assert names and all(why in model.left_out[name] for name in names), begin


@pytest.mark.slow
def test_a_diagnosis_does_without_the_second_transfer_that_it_does_not_know(setup):
    engine = engine_of(setup)
    known = replace(engine_named("direct"), forward=lambda store: engine)
    state = State(tuple(float(value) for value in setup.parameters.start))
    answers = {
        kind: [
            EngineModel(setup, RunStore(None, threads=1), engine=one).simulates(
                replace(state, numerics=kind)
            )
            for one in (known, engine_named("mpm"))
        ]
        for kind in ("own", "transfer", "fine")
    }
    assert answers["transfer"] == [False, True] and answers["fine"] == [True, True]
    base = calibrate(EngineModel(setup, RunStore(None, threads=1), engine=known), Options())
    assert np.isfinite(base.fit.total) and not np.any(base.covariance.transfer)


def test_a_hypothesis_that_it_refuses_is_no_answer_and_stops_nothing(setup):
    engine = engine_of(setup)
    known = replace(engine_named("direct"), forward=lambda store: engine)
    model = EngineModel(setup, RunStore(None, threads=1), engine=known)
    state = State(tuple(float(value) for value in setup.parameters.start))
    base_section = section_of(setup.at(np.array(state.values)).scene)
    # All but the base model is far outside its training.
    near = replace(engine.predictor, known=described(base_section)[None], unit=1e-6)
    engine.predictor = near
    other = state.with_effects({"no_water": 1.0})
    base, gone = model.predict([state, other])
    assert np.isfinite(base).any() and np.isnan(gone).all()
    assert "from the training" in model.failures[other]
    # Nor is a question answered whose base model is.
    lost = DirectEngine(replace(near, known=near.known + 1.0))
    known = replace(known, forward=lambda store: lost)
    model = EngineModel(setup, RunStore(None, threads=1), engine=known)
    with pytest.raises(InputError, match="from the training"):
        model.predict([state, other])


def test_what_strengths_do_not_change_is_taken_over_and_nothing_else(setup):
    engine, alone = engine_of(setup), engine_of(setup)
    first, second = (setup.at(np.array([s, 30.0 + 0.1 * s])) for s in (10.0, 40.0))
    later = engine.predict([first, second])[1]
    (fresh,) = alone.predict([second])
    assert np.array_equal(later.values, fresh.values, equal_nan=True)
    assert np.array_equal(later.at_start, fresh.at_start, equal_nan=True)
    assert np.array_equal(engine.error_std(second), alone.error_std(second))
    coarser = setup.with_scene(setup.scene.changed(spacing=2.0)).at(second.values)
    assert np.array_equal(
        engine.predict([coarser])[0].values,
        engine_of(setup).predict([coarser])[0].values,
        equal_nan=True,
    )


def test_the_derivative_is_that_of_finite_differences(setup):
    engine, values = engine_of(setup), np.array([25.0, 32.0])
    prediction, derivative, steps = engine.derivative(setup.at(values), np.array([1.0, 1.0]))
    assert not np.any(steps)
    toes = [name for name in setup.targets.names if "toe" in name]
    rows = [setup.targets.names.index(name) for name in toes]
    finite = []
    for place, step in enumerate((0.5, 0.25)):
        ends = [
            engine.predict([setup.at(values + sign * step * np.eye(2)[place])])[0].values
            for sign in (1.0, -1.0)
        ]
        finite.append((ends[0] - ends[1]) / (2.0 * step))
    assert rows and np.abs(derivative[rows]).max() > 1e-3
    assert derivative[rows] == pytest.approx(np.array(finite).T[rows], rel=0.02, abs=2e-4)


def test_far_from_the_training_it_answers_only_if_asked(setup):
    engine = engine_of(setup)
    far = setup.with_scene(
        setup.scene.changed(
            materials={
                name: one.model_dump() | {"density": 6.0 * one.density}
                for name, one in setup.scene.materials.items()
            }
        )
    )
    request = far.at(np.array([25.0, 32.0]))
    assert engine.distance(request) > 2.0
    with pytest.raises(InputError, match=r"lies at .* from the training of the direct model"):
        engine.predict([request])
    near = setup.at(np.array([25.0, 32.0]))
    assert not engine.predict([near])[0].failed
    lost = engine.predict([request, near])  # a trial on the way to an answer
    assert lost[0].failed and "from the training of the direct model" in lost[0].reason
    assert np.isnan(lost[0].values).all() and not lost[1].failed
    assert np.isnan(engine.error_std(request)).all()
    bold = DirectEngine(engine.predictor, anywhere=True)
    assert np.isfinite(bold.predict([request])[0].values[setup.targets.fitted]).all()


def test_a_fit_to_what_it_cannot_read_is_refused(setup):
    names, roles = setup.targets.names, list(setup.targets.roles)
    duration = next(i for i, name in enumerate(names) if "duration" in name)
    roles[duration] = "fitted"
    asked = replace(setup, targets=replace(setup.targets, roles=roles))
    assert np.isfinite(engine_of(setup).predict([asked.at(np.array([25.0, 32.0]))])[0].values).all()
    entries = [
        entry.model_copy(update={"between": (0.001, 0.95)} if "duration" in entry.name else {})
        for entry in setup.targets.entries
    ]
    asked = replace(setup, targets=replace(setup.targets, roles=roles, entries=entries))
    with pytest.raises(InputError, match="duration: slide_duration: .* does not predict it"):
        engine_of(setup).predict([asked.at(np.array([25.0, 32.0]))])


@pytest.mark.parametrize(
    "change",
    [
        {"water": "buoyant"}, {"k0": 0.5}, {"initial_stress": "k0"}, {"local_damping": 0.05},
        {"transfer": "flip"},
    ],
)  # fmt: skip
def test_a_run_by_other_settings_than_it_has_learned_is_refused(setup, change):
    asked = replace(setup, settings=setup.settings.model_copy(update=change))
    with pytest.raises(InputError, match=f"simulation.{next(iter(change))}: .* knows .* alone"):
        engine_of(setup).predict([asked.at(np.array([25.0, 32.0]))])
    dry = setup.scene.model_copy(update={"water_level": None})
    if "water" in change:
        check_settings(dry, asked.settings)  # without water it is all the same


def test_duration_and_history_are_read_on_arrival_times(setup):
    forecast = Forecast(
        toes=np.array([-40.0, 90.0]), toe_interval=np.array([3.29, 3.29]),
        thickness=np.ones(3), thickness_interval=np.ones(3),
        times=np.array([[1.0, 2.0, 3.0, 4.0, 6.0, 8.0]] * 3),
        times_within=np.full((3, 6), np.exp(0.1645)),
    )  # fmt: skip
    duration = next(one for one in setup.targets.entries if one.type == "slide_duration")
    before, foot = np.array([-10.0, 60.0]), {"left": -8.0, "right": 60.0}
    assert read_times(duration, forecast, before, foot) == pytest.approx([5.0])
    assert time_error_std(duration, forecast, before) == pytest.approx([0.6])
    history = ToeHistory(
        type="toe_history", name="toe", side="left", times_s=[0.5, 3.0, 20.0],
        values_m=[0.0, 1.0, 2.0], std_m=1.0, source="made up", confidence="constructed",
    )  # fmt: skip
    # Before the slide the toe is read 2 m out; it goes 30 m.
    expected = [2.0 + 0.5 * 0.05 * 30.0, 2.0 + 0.5 * 30.0, 32.0]
    assert read_times(history, forecast, before, foot) == pytest.approx(expected)
    std = time_error_std(history, forecast, before)
    rate = 0.25 * 30.0  # a quarter of the way in a second, on both sides of 3 s
    assert std[1] == pytest.approx(np.hypot(0.5 * 2.0, rate * 3.0 * np.sinh(0.1)), rel=1e-3)
    assert std[2] == pytest.approx(2.0)


@pytest.mark.slow
def test_the_back_analysis_states_its_distance_and_its_error(lsfd, setup, monkeypatch):
    case = inversion_case(load_case(lsfd, load_config(None, QUICK)))
    near = predictor_near(section_of(case.scene))
    monkeypatch.setattr(with_direct_model, "shipped", lambda name: DirectEngine(near))
    result = back_analysis_by(engine_named("direct"), case, RunStore(None), Watch()).run()
    assert result.engine == "direct"
    assert any("from the training of the direct model" in line for line in result.remarks)
    # Its error is in the ratio as it is in the strength.
    strength = next(one for one in result.answer.parameters if one.ratio is not None)
    share = strength.ratio_std / strength.ratio / (strength.std_total / strength.value)
    assert share == pytest.approx(1.0, abs=0.15)
    assert untrained("direct").name == "direct"


@pytest.mark.slow
def test_runs_of_the_solver_correct_the_answer(lsfd):
    runs = RunStore(None, threads=1)
    settings = load_config(None, [*QUICK, "inversion.paired_runs=3"])
    case = inversion_case(load_case(lsfd, settings))
    result = back_analysis_by(engine_named("direct"), case, runs, Watch()).run()
    (told,) = [line for line in result.remarks if "corrected by 3 runs" in line]
    assert "upstream toe" in told
    values = np.array([one.as_run for one in result.answer.parameters])
    truth, alone = (
        engine.predict([case.setup.at(values)])[0].values[0]
        for engine in (MPMEngine(runs), shipped("direct"))
    )
    measured = case.setup.targets.measured[0]
    assert abs(truth - measured) < 1.0 < abs(alone - measured), "the model alone is off"


def test_a_model_in_the_working_directory_is_not_the_one_that_ships(tmp_path, monkeypatch):
    for folder in ("direct", "models/direct"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "model.pt").write_text("of somebody else")
    monkeypatch.chdir(tmp_path)
    assert isinstance(shipped("direct"), DirectEngine)


def test_too_few_runs_to_correct_it_are_refused():
    with pytest.raises(InputError, match="paired_runs is 2: none, or at least 3"):
        load_config(None, ["inversion.paired_runs=2"])


@pytest.mark.slow
def test_readings_that_it_does_not_know_are_left_out_of_the_waterfall():
    settings = [one for one in QUICK if "waterfall" not in one] + ["inversion.spacing_factor=2"]
    folder = ROOT / "case_histories" / "lower_san_fernando"
    case = inversion_case(load_case(folder, load_config(None, settings)))
    runs = RunStore(None, threads=1)
    result = back_analysis_by(engine_named("direct"), case, runs, Watch()).run()
    unknown = [line for line in result.remarks if "no answer" in line]
    assert any("simulation.water: buoyant" in line for line in unknown)
    bars = result.waterfall.bars
    assert 2 <= len(bars) <= len(case.waterfall) - len(unknown) + 1
    assert bars[-1].value == pytest.approx(result.answer.parameters[0].value)


def test_posterior_and_prediction_have_its_error(lsfd, setup, monkeypatch):
    engine = engine_of(setup)
    monkeypatch.setattr("inversion.engines.direct_engine.shipped", lambda name: engine)
    case = load_case(lsfd, load_config(None, QUICK))
    model = CaseModel(
        unknowns_of(inversion_case(case)), RunStore(None, threads=1), engine_named("direct")
    )
    middle = np.array([one.at(0.5) for one in model.unknowns], dtype=float)
    asked = model.varied.setup(middle).at(middle[: model.varied.parameters])
    read = len(model.shown)
    assert np.array_equal(model.error_std(middle)[:read], engine.error_std(asked)[model.shown])
    assert np.all(model.error_std(middle)[:read] > 0) and not model.error_std(middle)[read:].any()

    asked_for = prediction_case(case)
    toe = next(one for one in asked_for.entries if one.type == "toe_runout")
    strengths = [KnownStrength(tuple(asked_for.calibrated), 20.0, 0.01, "lognormal")]
    there = replace(asked_for, entries=[toe]).setup(strengths)
    found = predict(engine, there, strengths)
    own = engine.error_std(there.at(np.array([20.0])))
    assert found.samples.std(axis=0) == pytest.approx(own, rel=0.03)
