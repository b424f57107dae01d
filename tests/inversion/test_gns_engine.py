"""The engine of the learned simulator: derivatives, memory, what is kept, what is refused."""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml

from gns.data.distance import FARTHEST, KnownScenes, described
from gns.data.scene_facts import start_of
from gns.rollout.rollout import Rest, rollout
from inversion.engines.gns_engine import GNSEngine
from inversion.engines.rollout_store import RolloutStore
from inversion.engines.trained_model import TrainedModel, load_model
from inversion.estimation.forward import Forward
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.inversion.small_slide import SPECS, model, setup, simulator

VALUES = np.array([18.0, 30.0, 1.0, 1800.0, 4.4])
STEPS = np.array([1e-3, 1e-3, 1e-4, 0.5, 1e-4])
"""Of central differences; half a kg/m3 has an exact form in single precision, as facts have it."""


class Asked(GNSEngine):
    """An engine that is asked one question alone, by values."""

    def __init__(self, setup, *arguments, **more) -> None:
        super().__init__(*arguments, **more)
        self.setup = setup

    def predict(self, values):
        return super().predict([self.setup.at(one) for one in values])

    def derivative(self, values, steps):
        return super().derivative(self.setup.at(values), steps)


def engine(folder=None, *, of=None, **more) -> Asked:
    duration = more.pop("duration_s", 0.9)
    return Asked(setup(duration_s=duration), RolloutStore(folder), of or model(), **more)


def settings_of(asked: Asked) -> SimulationSettings:
    return asked.model.simulator.settings(asked.setup.settings)


def central_differences(asked: Asked) -> np.ndarray:
    """(m, p), every point a rollout of its own with its own neighbours."""
    found = []
    for step, axis in zip(STEPS, np.eye(len(VALUES)), strict=True):
        ahead, behind = asked.predict([VALUES + step * axis, VALUES - step * axis])
        found.append((ahead.values - behind.values) / (2.0 * step))
    return np.stack(found, axis=1)


@pytest.fixture(scope="module")
def smooth() -> tuple[Asked, np.ndarray, np.ndarray]:
    """An engine with a smooth cut-off, its derivative, and that by differences."""
    asked = engine(mode="forward")
    prediction, derivative, steps = asked.derivative(VALUES, STEPS)
    assert not prediction.failed and not np.any(steps)
    return asked, derivative, central_differences(asked)


def test_it_is_an_engine(smooth):
    assert isinstance(smooth[0], Forward)
    assert smooth[0].setup.targets.names[:3] == ["toe", "crest", "marker dx"]


def test_derivative_of_every_measurement_by_every_parameter_is_that_of_differences(smooth):
    """Toe, crest, marker, profile, toe history and velocity; strengths, density and water level."""
    _, derivative, expected = smooth
    largest = np.abs(expected).max(axis=0)
    assert np.all(largest > 1e-7)  # every parameter matters
    assert np.allclose(derivative / largest, expected / largest, rtol=1e-5, atol=1e-5)


@pytest.mark.slow
def test_reverse_mode_gives_the_same_rows_of_what_is_fitted(smooth):
    asked, forward, _ = smooth
    derivative = engine(mode="reverse").derivative(VALUES, STEPS)[1]
    fitted = asked.setup.targets.fitted
    assert not fitted.all() and np.isnan(derivative[~fitted]).all()
    assert np.allclose(derivative[fitted], forward[fitted], rtol=1e-9, atol=1e-15)


def test_the_cheaper_way_is_taken():
    asked = engine()
    assert asked.way(asked.setup) == "forward"  # 5 parameters, 8 numbers
    targets = asked.setup.targets
    roles = ["fitted", *["compared"] * (len(targets.names) - 1)]
    asked.setup = replace(asked.setup, targets=replace(targets, roles=roles))
    assert asked.way(asked.setup) == "reverse"  # one number: 4 steps against 6
    asked.setup = replace(asked.setup, parameters=setup(SPECS[:2]).parameters)
    assert asked.way(asked.setup) == "forward"


@pytest.mark.slow
def test_with_a_sharp_cut_off_finite_steps_see_neighbours_come_and_go():
    """The derivative is that of a fixed graph. Over 23 frames in which the graph changes, messages
    that appear and vanish make a finite step of 3 mm of the pool wrong by two thirds (by nine
    tenths at 1 mm, as jumps do); faded ones leave the usual error of a finite step."""
    worst = {}
    for cutoff in ("smooth", "sharp"):
        asked = engine(of=model(cutoff=cutoff), mode="forward", duration_s=3.0)
        derivative = asked.derivative(VALUES, STEPS)[1]
        step = 0.003 * np.eye(len(VALUES))[4]
        ahead, behind = asked.predict([VALUES + step, VALUES - step])
        expected = (ahead.values - behind.values) / 0.006
        worst[cutoff] = np.nanmax(np.abs(derivative[:, 4] - expected)) / np.abs(expected).max()
    assert worst["smooth"] < 0.005 and worst["sharp"] > 0.1, worst


def test_a_rollout_starts_and_ends_as_any_other():
    """The same as `gns.rollout.rollout` from the scene alone, rest and all."""
    asked = engine()
    prediction = asked.predict([VALUES])[0]
    facts, start = start_of(asked.setup.at(VALUES).scene, settings_of(asked))
    same = rollout(asked.model.simulator, facts, start, 8)
    assert np.allclose(prediction.positions, same.positions[-1], atol=1e-5)
    assert not prediction.at_rest
    moved = np.abs(prediction.positions - start).max()
    assert moved > 0.3


def test_frames_are_those_of_the_model_whatever_the_settings_say():
    asked = Asked(setup(frame_interval=0.2), RolloutStore(None), model())
    assert settings_of(asked).frame_interval == 0.4
    same = engine().predict([VALUES])[0]
    assert np.array_equal(asked.predict([VALUES])[0].values, same.values)


@pytest.mark.slow
def test_at_rest_a_rollout_ends_and_so_does_its_derivative():
    """A block that falls, and lies where the floor stops it: nothing pulls or pushes."""
    falling = model(acceleration_mean=(0.0, 0.0), acceleration_std=(1e-12, 1e-12))
    given = setup(SPECS[:1], duration_s=30.0)
    zones = [zone.model_dump() for zone in given.scene.zones]
    zones[1]["initial_velocity"] = (0.0, -4.0)
    settings = given.settings.model_copy(update={"early_stop": True})
    given = replace(given, scene=given.scene.changed(zones=zones), settings=settings)
    told = []
    asked = Asked(
        given, RolloutStore(None), falling, on_frame=lambda frame, of: told.append((frame, of))
    )
    prediction, derivative, _ = asked.derivative(VALUES[:1], STEPS[:1])
    assert prediction.at_rest and len(told) < 60
    assert told[-1][0] == told[-1][1] > 200  # reported as done, and how many there might have been
    facts, start = start_of(asked.setup.at(VALUES[:1]).scene, settings_of(asked))
    same = rollout(falling.simulator, facts, start, 200, rest=Rest())
    assert same.at_rest and len(same.positions) == len(told) + 1
    assert np.isfinite(derivative[:6]).all()


# -- memory ---------------------------------------------------------------------------------------


def peak_of_kept_tensors(work) -> int:
    """Most bytes that autograd holds for a backward pass at any time while `work` runs."""
    held, peak = 0, 0

    def let_go(size):
        nonlocal held
        held -= size

    class Kept:
        def __init__(self, tensor):
            self.tensor = tensor

    def pack(tensor):
        nonlocal held, peak
        size = tensor.nbytes
        held += size
        peak = max(peak, held)
        kept = Kept(tensor)
        weakref.finalize(kept, let_go, size)
        return kept

    with torch.autograd.graph.saved_tensors_hooks(pack, lambda kept: kept.tensor):
        work()
    return peak


@pytest.mark.slow
def test_memory_of_a_derivative_does_not_grow_with_the_frames():
    """Reverse mode holds one step whatever the number of frames; forward mode holds none."""
    quiet = model(acceleration_std=(0.01, 0.01))  # about as many neighbours at every frame
    frame_s = engine(of=quiet)._slide(setup().at(VALUES)).facts.frame_time
    peaks = {}
    for mode in ("reverse", "forward"):
        for frames in (10, 20, 40):
            asked = engine(of=quiet, mode=mode, duration_s=(frames - 1) * frame_s)
            targets = asked.setup.targets
            roles = ["fitted", *["compared"] * (len(targets.names) - 1)]
            asked.setup = replace(asked.setup, targets=replace(targets, roles=roles))
            assert asked._slide(asked.setup.at(VALUES)).frames == frames
            peaks[mode, frames] = peak_of_kept_tensors(
                lambda asked=asked: asked.derivative(VALUES, STEPS)
            )
    assert peaks["reverse", 10] > 1e5
    # The block falls and has a few neighbours more at the end; four times the frames held at once
    # would be four times as much.
    assert peaks["reverse", 20] < 1.1 * peaks["reverse", 10], peaks
    assert peaks["reverse", 40] < 1.25 * peaks["reverse", 10], peaks
    assert peaks["forward", 40] < 0.1 * peaks["reverse", 10], peaks


# -- what is kept ---------------------------------------------------------------------------------


def test_what_is_known_is_not_computed_again(tmp_path):
    first = engine(tmp_path)
    prediction, derivative, _ = first.derivative(VALUES, STEPS)
    assert (first.store.computed, first.store.differentiated) == (1, 1)
    again = engine(tmp_path)
    same, known, _ = again.derivative(VALUES, STEPS)
    assert (again.store.computed, again.store.differentiated) == (0, 0) and again.runs == 1
    assert np.array_equal(known, derivative, equal_nan=True)
    assert np.array_equal(same.values, prediction.values)
    assert np.array_equal(again.predict([VALUES])[0].positions, prediction.positions)
    assert again.store.computed == 0


@pytest.mark.parametrize(
    "other",
    [
        {"of": TrainedModel(simulator(), "untrained", "1" * 64)},
        {"of": model(torch.float32)},
        {"duration_s": 1.2},
    ],
)
def test_other_weights_numbers_or_settings_are_another_rollout(tmp_path, other):
    engine(tmp_path).predict([VALUES])
    changed = engine(tmp_path, **other)
    changed.predict([VALUES])
    assert changed.store.computed == 1


def test_settings_that_a_rollout_does_not_know_change_nothing(tmp_path):
    engine(tmp_path).predict([VALUES])
    changed = Asked(setup(courant=0.2, transfer="flip"), RolloutStore(tmp_path), model())
    changed.predict([VALUES])
    assert changed.store.computed == 0


@pytest.mark.slow
def test_a_derivative_goes_on_from_a_rollout_that_is_kept(tmp_path):
    """As when the process was killed between the two; and a damaged file is made again."""
    run = engine(tmp_path).predict([VALUES])[0]
    later = engine(tmp_path)
    prediction, derivative, _ = later.derivative(VALUES, STEPS)
    assert (later.store.computed, later.store.differentiated) == (0, 1)
    assert np.array_equal(prediction.values, run.values)
    assert np.allclose(derivative, engine().derivative(VALUES, STEPS)[1], equal_nan=True)
    for path in tmp_path.glob("*.npz"):
        path.write_bytes(path.read_bytes()[:-100])
    later = engine(tmp_path)
    again = later.derivative(VALUES, STEPS)[1]
    assert (later.store.computed, later.store.differentiated) == (1, 1)
    assert np.allclose(again, derivative, rtol=1e-12, equal_nan=True)


def test_a_rollout_that_fails_is_a_failed_prediction(tmp_path):
    broken = model()
    broken.simulator.network.decoder.third.bias.data.fill_(float("nan"))
    asked = engine(tmp_path, of=broken)
    prediction, derivative, _ = asked.derivative(VALUES, STEPS)
    assert prediction.status == "failed" and "at frame 1: a position" in prediction.reason
    assert np.isnan(prediction.values).all() and np.isnan(derivative).all()
    again = engine(tmp_path, of=broken)
    assert again.derivative(VALUES, STEPS)[0].reason == prediction.reason
    assert again.store.computed == 0


# -- models ---------------------------------------------------------------------------------------


def test_a_model_is_read_from_its_folder(tmp_path):
    simulator(torch.float32, ranges={"height": (1.0, 2.0)}).save(tmp_path / "small" / "model.pt")
    found = load_model(tmp_path / "small")
    assert found.name == "small" and len(found.sha256) == 64
    assert not any(weight.requires_grad for weight in found.simulator.parameters())
    outside = engine(of=found).outside(setup().at(VALUES))
    assert any("highest point" in line for line in outside)


def test_wrong_models_are_one_line(tmp_path):
    with pytest.raises(InputError, match=r"nowhere/model.pt: no such file; a model is a folder"):
        load_model(tmp_path / "nowhere")
    path = tmp_path / "model.pt"
    path.write_bytes(b"no model at all")
    with pytest.raises(InputError, match="is damaged or not a model"):
        load_model(tmp_path)
    torch.save({"format_version": 1, "run": Forward}, path)  # anything but plain numbers
    with pytest.raises(InputError, match="is damaged or not a model"):
        load_model(tmp_path)
    # Weights for another number of features than the configuration next to them says.
    simulator(torch.float32).save(path)
    document = torch.load(path, weights_only=True)
    document["config"] = simulator(history=4).config.model_dump_json()
    torch.save(document, path)
    with pytest.raises(InputError, match="is not a model of this program"):
        load_model(tmp_path)


def test_a_card_must_belong_to_the_weights(tmp_path):
    simulator(torch.float32).save(tmp_path / "model.pt")
    card = {
        "name": "small", "network": {}, "parameters": 1, "ranges": {}, "contacts": [],
        "training": {"step": 1, "settings": {}, "data_hash": "", "data_scale": "", "runs": 1,
                     "spacing_m": 1.0, "validation": {}},
        "accuracy": {"split": "test", "runs": 1, "runs_that_travel_far": 0, "by_template": {},
                     "far": {}, "one_step_error_spacings": None,
                     "constant_velocity_error_spacings": None, "baselines": {}, "worst": [],
                     "seconds_a_run": 1.0, "mpm_seconds_a_run": None},
        "known_failures": [], "weights_sha256": load_model(tmp_path).sha256, "manifest": {},
    }  # fmt: skip
    path = tmp_path / "card.yaml"
    path.write_text(yaml.safe_dump(card))
    assert load_model(tmp_path).sha256 == card["weights_sha256"]
    path.write_text(yaml.safe_dump({**card, "weights_sha256": "0" * 64}))
    with pytest.raises(InputError, match=r"card.yaml: weights_sha256: is not that of model.pt"):
        load_model(tmp_path)


@pytest.mark.slow
def test_single_precision_is_good_enough(smooth):
    """A shipped model is in single precision: its derivative to a thousandth, positions to mm."""
    prediction, derivative, _ = engine(of=model(torch.float32)).derivative(VALUES, STEPS)
    exact = smooth[0].predict([VALUES])[0]
    assert prediction.positions.dtype == np.float32
    assert np.allclose(prediction.positions, exact.positions, atol=1e-3)
    largest = np.abs(smooth[1]).max(axis=0)
    assert np.allclose(derivative / largest, smooth[1] / largest, atol=1e-3)


def test_a_section_far_from_the_training_is_refused_unless_asked_for():
    far = model()
    asked = engine(of=far)
    facts, start = start_of(asked.setup.at(VALUES).scene, settings_of(asked))
    far.simulator.known = KnownScenes.of([described(start, facts) + shift for shift in (3.0, 3.1)])
    request = asked.setup.at(VALUES)
    with pytest.raises(InputError, match="from the training of the model .*outside_training"):
        asked.distance(request)
    assert asked.distance(request, anywhere=True) > FARTHEST
    far.simulator.known = KnownScenes.of([described(start, facts) + shift for shift in (0.0, 3.0)])
    assert asked.distance(request) == pytest.approx(0.0, abs=1e-9)
    far.simulator.known = None
    assert asked.distance(request) is None
