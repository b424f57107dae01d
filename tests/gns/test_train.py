"""Learning: what a step sees and minimises, going on after a kill, several processes."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
import torch
from pydantic import ValidationError

from flowslide.commands.gns.train import TRIAL_STEPS, _TrainingWatch, open_windows
from gns.data.dataset import Windows
from gns.data.statistics import run_moments
from gns.network.simulator import Simulator
from gns.training import distributed, processes
from gns.training.checkpoints import ModelFolder
from gns.training.distributed import ProcessGroup
from gns.training.loss import TrainingObjective, soil_points
from gns.training.sampling import Examples, Order
from gns.training.train import learning_rate, simulator_config, steps_in_a_row, train
from gns.training.validation import FAILED_ERROR, choose_runs, score_run, summary
from pipeline.cli import InputError, WorkFailed
from pipeline.config import TrainSettings
from tests.planted import plant, planted, the_command

ALONE = ProcessGroup(0, 1, torch.device("cpu"))
SETTINGS = TrainSettings(
    width=8,
    message_passing_steps=1,
    steps=12,
    batch_size=2,
    learning_rate=3e-3,
    averaging=0.9,
    mirror=True,
    validate_every=5,
    validate_runs=2,
    checkpoint_every=4,
)


def opened(packed, settings: TrainSettings = SETTINGS) -> tuple[Windows, Windows]:
    return open_windows(packed, settings)


def run(folder, packed, settings: TrainSettings = SETTINGS, **more):
    return train(ModelFolder(folder), *opened(packed, settings), settings, ALONE, **more)


def numbers(folder) -> list[dict]:
    """The metrics without what a clock says."""
    return [
        {name: value for name, value in line.items() if name not in ("seconds", "took_s")}
        for line in ModelFolder(folder).read_metrics()
    ]


def weights(folder) -> dict[str, torch.Tensor]:
    return torch.load(folder / "model.pt", weights_only=True)["weights"]


def last_state(folder) -> dict:
    return torch.load(folder / "state" / "last.pt", weights_only=True)


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[n], other[n]) for n in one)


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """As the commands here: sums are taken in another order by more."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def trained(packed, tmp_path_factory):
    """A training that nothing has interrupted."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    outcome = run(folder, packed)
    assert outcome.finished and outcome.step == 12
    return folder


# -- what a step sees -----------------------------------------------------------------------------


def test_every_window_is_seen_once_in_an_epoch_and_in_another_order_in_the_next():
    order = Order(10, seed=3)
    epochs = [[order.window(10 * epoch + place) for place in range(10)] for epoch in range(3)]
    assert all(sorted(epoch) == list(range(10)) for epoch in epochs)
    assert epochs[0] != epochs[1] != epochs[2]
    assert [Order(10, seed=3).window(place) for place in range(10)] == epochs[0]
    assert [Order(10, seed=4).window(place) for place in range(10)] != epochs[0]


def test_an_example_follows_from_its_position_alone(packed):
    one, two = (Examples(opened(packed)[0], SETTINGS) for _ in range(2))
    late = one.at(57)
    for position in (3, 57):
        other = two.at(position)
    assert torch.equal(late.window, other.window) and torch.equal(late.after, other.after)
    assert (late.run, late.frame) == (other.run, other.frame)
    assert not torch.equal(one.at(58).window[-1, :5], late.window[-1, :5])


@pytest.mark.slow
def test_all_of_an_example_is_on_the_device_of_the_training(packed):
    """The device `meta` stands for a GPU."""
    settings = SETTINGS.model_copy(update={"balance": 0.3})
    example = Examples(opened(packed)[0], settings, "meta").at(0)
    tensors = [value for value in vars(example).values() if isinstance(value, torch.Tensor)]
    tensors += [value for value in vars(example.scene).values() if isinstance(value, torch.Tensor)]
    assert len(tensors) > 8
    assert {tensor.device.type for tensor in tensors} == {"meta"}
    cell = opened(packed)[0].facts(example.run)
    simulator = Simulator(simulator_config(settings, opened(packed)[0].metadata,
                                           cell.numbers["cell"] / cell.spacing))  # fmt: skip
    weight = TrainingObjective(simulator.to("meta"), 1, settings.balance)._weight(example)
    assert weight.device.type == "meta"


def test_noise_is_that_of_the_settings_and_the_target_takes_it_back(packed):
    settings = SETTINGS.model_copy(update={"mirror": False, "noise": 0.05})
    learned, _ = opened(packed, settings)
    examples = Examples(learned, settings)
    example = examples.at(0)
    given = learned.at(example.run, example.frame)
    true = example.scene.to_spacings(given.positions)
    walk = example.window - true[:6]
    assert torch.all(walk[0] == 0) and walk[-1].std() > 0.01
    assert torch.equal(example.after[0], true[6]) and torch.all(example.offset == 0)
    other = Examples(learned, settings.model_copy(update={"noise_target": "velocity"})).at(0)
    assert torch.allclose(other.offset, walk[-1], atol=1e-6)
    quiet = Examples(learned, settings.model_copy(update={"noise": 0.0})).at(0)
    assert torch.equal(quiet.window, true[:6])


def test_about_half_of_the_windows_are_seen_in_the_mirror(packed):
    learned, _ = opened(packed)
    examples = Examples(learned, SETTINGS.model_copy(update={"noise": 0.0}))
    mirrored = 0
    for position in range(60):
        example = examples.at(position)
        true = example.scene.to_spacings(learned.at(example.run, example.frame).positions)[:6]
        over = true * torch.tensor([-1.0, 1.0])
        assert torch.equal(example.window, true) or torch.equal(example.window, over)
        mirrored += torch.equal(example.window, over)
    assert 18 <= mirrored <= 42


# -- what it minimises ----------------------------------------------------------------------------


def test_the_loss_is_that_of_the_paper_over_soil_points(packed):
    learned, _ = opened(packed)
    simulator = Simulator(simulator_config(SETTINGS, learned.metadata, 2.0))
    examples = [Examples(learned, SETTINGS).at(position) for position in range(3)]
    held = examples[0].scene.kinematic.clone()
    held[:7] = True
    examples[0] = replace(examples[0], scene=replace(examples[0].scene, kinematic=held))
    found = float(TrainingObjective(simulator)(examples).detach())
    expected, points = 0.0, 0
    for example in examples:
        output = simulator([example.window], [example.scene]).detach().double()
        now, before = example.window[-1].double(), example.window[-2].double()
        acceleration = (example.after[0].double() - 2 * now + before) / 0.4**2
        mean = simulator.acceleration_mean.double()
        wanted = (acceleration - mean) / simulator.acceleration_std.double()
        soil = ~example.scene.kinematic
        expected += float(((output - wanted)[soil] ** 2).mean(dim=1).sum())
        points += int(soil.sum())
    assert found == pytest.approx(expected, rel=1e-5)
    assert soil_points(examples) == points


def test_pushed_examples_start_where_the_model_got(packed):
    settings = SETTINGS.model_copy(update={"pushforward": 2, "mirror": False})
    learned, _ = opened(packed, settings)
    examples = Examples(learned, settings)
    simulator = Simulator(simulator_config(settings, learned.metadata, 2.0))
    counts = {}
    for position in range(40):
        example = examples.at(position)
        counts[example.steps_before] = example
    assert sorted(counts) == [0, 1, 2] and all(len(e.after) == 3 for e in counts.values())
    example = counts[2]
    window = example.window
    with torch.no_grad():
        for _ in range(2):
            window = torch.cat([window[1:], simulator.advance(window, example.scene)[None]])
        output = simulator([window], [example.scene])
    target = simulator.target(window[-2], window[-1], example.after[2], example.scene)
    expected = (output - target).square().mean(1)[~example.scene.kinematic].sum()
    assert torch.allclose(TrainingObjective(simulator)([example]), expected, rtol=1e-5)


def test_an_unrolled_loss_is_that_of_the_positions_where_the_model_goes(packed):
    settings = SETTINGS.model_copy(update={"unroll": 3, "noise": 0.0, "frames_per_step": 2})
    learned, _ = opened(packed, settings)
    simulator = Simulator(simulator_config(settings, learned.metadata, 2.0))
    assert simulator.config.frame_interval == pytest.approx(0.8)
    simulator.acceleration_std.fill_(0.2)  # points of these data all fall alike
    example = Examples(learned, settings).at(5)
    assert len(example.after) == 3
    window, scene = example.window, example.scene
    unit = simulator.acceleration_std * scene.frame_interval**2
    expected = 0.0
    with torch.no_grad():
        for step, drift in enumerate((1.0, 3.0, 6.0)):
            output = simulator([window], [scene])
            pull = output * simulator.acceleration_std + simulator.acceleration_mean
            free = 2.0 * window[-1] - window[-2] + pull * scene.frame_interval**2
            off = (free - example.after[step]) / (unit * drift)
            expected += off.square().mean(1)[~scene.kinematic].sum() / 3.0
            window = torch.cat([window[1:], simulator.advance(window, scene)[None]])
    objective = TrainingObjective(simulator, unroll=3)
    found = objective([example])
    assert torch.allclose(found, expected, rtol=1e-3)
    found.backward()
    assert all(p.grad is not None and torch.isfinite(p.grad).all() for p in simulator.parameters())
    both = TrainingObjective(simulator, unroll=3)([example, example])
    assert torch.allclose(both, 2.0 * expected, rtol=1e-3)


def test_rows_grow_over_the_ramp():
    settings = TrainSettings(steps=100, unroll=4, unroll_ramp=0.6)
    found = [steps_in_a_row(step, settings) for step in range(1, 101)]
    assert found == sorted(found) and set(found) == {1, 2, 3, 4}
    assert [found.count(row) for row in (1, 2, 3)] == [20, 20, 20]
    constant = settings.model_copy(update={"unroll_ramp": 0.0})
    assert {steps_in_a_row(step, constant) for step in range(1, 101)} == {4}


def test_a_balanced_loss_is_over_the_accelerations_of_its_run(packed):
    learned, _ = opened(packed)
    simulator = Simulator(simulator_config(SETTINGS, learned.metadata, 2.0))
    for position in (0, 4):
        example = Examples(learned, SETTINGS).at(position)
        _, moments = run_moments(learned.positions(example.run), learned.facts(example.run))
        own = (moments.std**2 + moments.mean**2) / simulator.acceleration_std.numpy() ** 2
        plain = TrainingObjective(simulator)([example])
        found = TrainingObjective(simulator, balance=0.3)([example])
        assert torch.allclose(found, plain / (float(own.mean()) + 0.3), rtol=1e-4)


def test_so_many_windows_begin_where_their_run_begins(packed):
    plain, _ = opened(packed)
    shares = []
    for share in (0.0, 0.5, 1.0):
        settings = SETTINGS.model_copy(update={"start_share": share})
        frames = [Examples(plain, settings).at(position).frame for position in range(80)]
        shares.append(np.mean(np.array(frames) == 0))
    assert shares[0] < 0.15 and 0.35 < shares[1] < 0.7 and shares[2] == 1.0


def test_learning_rates():
    base = SETTINGS.model_copy(
        update={"steps": 100, "learning_rate": 1e-2, "final_learning_rate": 1e-4}
    )
    for schedule in ("exponential", "cosine"):
        settings = base.model_copy(update={"schedule": schedule, "warmup_steps": 10})
        rates = [learning_rate(step, settings) for step in range(1, 101)]
        assert rates[4] == pytest.approx(5e-3) and rates[9] == pytest.approx(1e-2)
        assert rates[-1] == pytest.approx(1e-4)
        assert all(two < one for one, two in zip(rates[9:], rates[10:], strict=False))
    middle = {
        name: base.model_copy(update={"schedule": name}) for name in ("exponential", "cosine")
    }
    assert learning_rate(50, middle["exponential"]) == pytest.approx(1e-3)
    assert learning_rate(50, middle["cosine"]) == pytest.approx(0.5 * (1e-2 + 1e-4))
    constant = base.model_copy(update={"schedule": "constant"})
    assert learning_rate(1, constant) == learning_rate(100, constant) == 1e-2


def test_rates_of_further_cycles():
    one = SETTINGS.model_copy(
        update={"steps": 60, "schedule": "cosine", "warmup_steps": 10, "learning_rate": 1e-2}
    )
    two = one.model_copy(update={"steps": 100, "restart_at": [60], "restart_share": 0.4})
    rates = [learning_rate(step, two) for step in range(1, 101)]
    assert rates[:60] == [learning_rate(step, one) for step in range(1, 61)]
    assert rates[59] == pytest.approx(one.final_learning_rate)
    assert max(rates[60:]) == rates[69] == pytest.approx(4e-3)
    assert rates[99] == pytest.approx(one.final_learning_rate)
    # A restart that never comes is none.
    late = one.model_copy(update={"restart_at": [60, 80]})
    assert [learning_rate(step, late) for step in range(1, 61)] == rates[:60]
    three = two.model_copy(update={"steps": 140, "restart_at": [60, 100]})
    assert [learning_rate(step, three) for step in range(1, 101)] == rates
    assert [learning_rate(step, three) for step in range(101, 141)] == rates[60:]
    ramped = two.model_copy(update={"unroll": 3, "unroll_ramp": 0.5})
    assert [steps_in_a_row(step, ramped) for step in (1, 16, 31, 61, 100)] == [1, 2, 3, 3, 3]


def test_spreads_hold_the_noise_and_a_mirrored_data_set_has_no_side(packed):
    learned, _ = opened(packed)
    data = learned.metadata.statistics
    config = simulator_config(SETTINGS, learned.metadata, 2.0)
    assert config.velocity_std[1] == pytest.approx(math.hypot(data.velocity_std[1], 0.0214))
    noise = 0.0214 / 0.4
    assert config.acceleration_std[0] == pytest.approx(math.hypot(data.acceleration_std[0], noise))
    assert config.velocity_mean == (0.0, data.velocity_mean[1]) and config.radius == 3.0
    plain = simulator_config(SETTINGS.model_copy(update={"mirror": False}), learned.metadata, 2.0)
    assert plain.velocity_mean == data.velocity_mean
    assert config.ranges == learned.metadata.ranges


# -- learning -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_it_learns(packed, tmp_path, monkeypatch):
    """One window, over and over: where some points fall and others have just hit the ground."""
    monkeypatch.setattr(Order, "window", lambda self, position: 6)
    changes = {"steps": 60, "learning_rate": 1e-2, "validate_every": 60, "noise": 0.0}
    settings = SETTINGS.model_copy(update={**changes, "averaging": 0.0, "mirror": False})
    run(tmp_path, packed, settings)
    losses = [line["loss"] for line in numbers(tmp_path) if "loss" in line]
    assert losses[0] > 0.1 and np.mean(losses[-5:]) < 0.25 * losses[0]


def test_a_training_leaves_a_model_its_metrics_and_its_ranges(trained, packed):
    simulator = Simulator.load(trained / "model.pt")
    metadata = opened(packed)[0].metadata
    assert simulator.config.ranges == metadata.ranges and simulator.config.contacts == ["rough"]
    lines = ModelFolder(trained).read_metrics()
    assert [line["step"] for line in lines if "loss" in line] == list(range(1, 13))
    validations = [line for line in lines if "validation" in line]
    assert [line["step"] for line in validations] == [5, 10, 12]
    document = torch.load(trained / "model.pt", weights_only=True)
    best = min(validations, key=lambda line: line["validation"]["score"])
    assert document["step"] == best["step"] and document["validation"] == best["validation"]
    assert document["made_from"]["data_hash"] == metadata.data_hash


def test_long_gradients_are_shortened(packed, tmp_path):
    """With a tiny limit, plain Adam still moves, but the written norm is that before the cut."""
    seen = []
    original = torch.nn.utils.clip_grad_norm_

    def noting(parameters, limit):
        parameters = list(parameters)
        norm = original(parameters, limit)
        seen.append((float(norm), limit, float(original(parameters, math.inf))))
        return norm

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.nn.utils, "clip_grad_norm_", noting)
        run(tmp_path / "a", packed, SETTINGS.model_copy(update={"steps": 2, "gradient_clip": 1e-3}))
        run(tmp_path / "b", packed, SETTINGS.model_copy(update={"steps": 2, "gradient_clip": 0.0}))
    assert all(after <= 1.001e-3 < before for before, _, after in seen[:2])
    assert all(limit == math.inf and after == before for before, limit, after in seen[2:])
    assert numbers(tmp_path / "a")[0]["gradient_norm"] == pytest.approx(seen[0][0])


def test_averaged_weights_are_the_average(packed, tmp_path):
    """memory m_t = min(0.9, (1 + t) / (10 + t)); the model that is kept has them."""
    states = []
    for steps in (1, 2, 3):
        settings = SETTINGS.model_copy(
            update={"steps": steps, "schedule": "constant", "validate_every": 100}
        )
        run(tmp_path / str(steps), packed, settings)
        states.append(last_state(tmp_path / str(steps)))
    torch.manual_seed(SETTINGS.seed)
    learned, _ = opened(packed)
    average = Simulator(simulator_config(SETTINGS, learned.metadata, 2.0)).state_dict()
    for step, state in enumerate(states, start=1):
        memory = min(0.9, (1 + step) / (10 + step))
        average = {
            name: memory * value + (1 - memory) * state["weights"][name]
            for name, value in average.items()
        }
        for name, value in average.items():
            assert torch.allclose(state["averaged"][name], value, atol=1e-6)
    assert same(weights(tmp_path / "3"), states[2]["averaged"])


def test_a_loss_that_is_not_finite_ends_the_training(packed, tmp_path):
    settings = SETTINGS.model_copy(update={"learning_rate": 1e30, "gradient_clip": 0.0})
    with pytest.raises(WorkFailed, match="not a finite number.*lower learning_rate"):
        run(tmp_path, packed, settings)


# -- going on -------------------------------------------------------------------------------------


class After:
    """A request to stop that comes with a step."""

    def __init__(self, steps: int) -> None:
        self.left, self.cut_short = steps, True

    @property
    def wanted(self) -> bool:
        self.left -= 1
        return self.left < 0


@pytest.mark.parametrize("stops", [(0,), (2, 5), (6,)])
def test_a_stopped_training_goes_on_as_if_it_had_not_been(stops, packed, trained, tmp_path):
    for steps in stops:
        outcome = run(tmp_path, packed, stop=After(steps))
        assert not outcome.finished and outcome.cut_short
    begun = []
    assert run(tmp_path, packed, on_start=begun.append).finished
    assert begun == [sum(steps + 1 for steps in stops)]
    assert numbers(tmp_path) == numbers(trained)
    assert same(weights(tmp_path), weights(trained))
    assert same(last_state(tmp_path)["weights"], last_state(trained)["weights"])
    # Once it has ended, there is nothing left to do.
    assert run(tmp_path, packed).step == 12 and numbers(tmp_path) == numbers(trained)


def test_a_training_that_has_ended_is_made_longer(trained, packed, tmp_path):
    """Cycles added one after the other: as if all had been asked for at once."""
    two = SETTINGS.model_copy(update={"steps": 16, "restart_at": [SETTINGS.steps]})
    three = SETTINGS.model_copy(update={"steps": 20, "restart_at": [SETTINGS.steps, 16]})
    shutil.copytree(trained, tmp_path / "longer")
    # Also by the workflow, which sets aside what is another training.
    assert run(tmp_path / "longer", packed, two, start_over=True).step == 16
    assert not (tmp_path / "longer.before-1").exists()
    assert run(tmp_path / "longer", packed, three).step == 20
    run(tmp_path / "whole", packed, three)
    assert numbers(tmp_path / "longer") == numbers(tmp_path / "whole")
    assert same(weights(tmp_path / "longer"), weights(tmp_path / "whole"))
    # What ended after another number of steps is another training.
    shutil.copytree(trained, tmp_path / "other")
    with pytest.raises(InputError, match="restart_at"):
        run(tmp_path / "other", packed, two.model_copy(update={"restart_at": [10]}))


def command(packed, folder, *more: str) -> list[str]:
    options = []
    for name, value in SETTINGS.model_dump(mode="json").items():
        options += ["--set", f"gns.train.{name}={json.dumps(value)}"]
    places = ["--data", str(packed), "--out", str(folder), "--threads", "1"]
    return ["flowslide", "gns", "train", *places, *options, *more]


def start(arguments: list[str], root) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", *arguments],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def wait_for(process: subprocess.Popen, folder, step: int) -> None:
    """Until the metrics hold a step."""
    for _ in range(6000):
        lines = ModelFolder(folder).read_metrics()
        if lines and lines[-1]["step"] >= step:
            return
        assert process.poll() is None, process.stdout.read()
        time.sleep(0.01)
    raise AssertionError("no metrics in a minute")


@pytest.mark.slow
def test_a_killed_training_goes_on_as_if_it_had_not_been(packed, root, tmp_path):
    """Killed at once (nothing is tidied up), then terminated, then finished."""
    longer = SETTINGS.model_copy(update={"steps": 90, "validate_every": 60})
    more = ["--set", "gns.train.steps=90", "--set", "gns.train.validate_every=60"]
    killed = tmp_path / "killed"
    for number, step in ((signal.SIGKILL, 10), (signal.SIGTERM, 25)):
        process = start(command(packed, killed, *more), root)
        wait_for(process, killed, step)
        process.send_signal(number)
        output = process.communicate(timeout=30)[0]
        assert process.returncode == (-9 if number == signal.SIGKILL else 1), output
    assert "start again to continue" in output.splitlines()[-1]
    assert 25 <= last_state(killed)["progress"]["step"] < 90
    run(killed, packed, longer)
    run(tmp_path / "whole", packed, longer)
    assert numbers(killed) == numbers(tmp_path / "whole")
    assert same(weights(killed), weights(tmp_path / "whole"))


def test_another_training_in_the_same_folder_is_refused(trained, packed, tmp_path):
    shutil.copytree(trained, tmp_path / "model")
    with pytest.raises(InputError, match=r"learning_rate = 0\.003, not 0\.1"):
        run(tmp_path / "model", packed, SETTINGS.model_copy(update={"learning_rate": 0.1}))
    # How often the state is kept is nobody's business.
    run(tmp_path / "model", packed, SETTINGS.model_copy(update={"checkpoint_every": 7}))
    (tmp_path / "model" / "state" / "last.pt").unlink()
    with pytest.raises(InputError, match="holds a model, but no state"):
        run(tmp_path / "model", packed)


def test_another_training_is_set_aside_when_asked(trained, packed, tmp_path):
    shutil.copytree(trained, tmp_path / "model")
    (tmp_path / "model" / "card.yaml").write_text("of the old one")
    other = SETTINGS.model_copy(update={"steps": 2})
    for _ in range(2):  # the second time it is the same training
        run(tmp_path / "model", packed, other, start_over=True)
        aside = tmp_path / "model.before-1"
        assert same(weights(aside), weights(trained)) and numbers(aside) == numbers(trained)
        assert (aside / "card.yaml").read_text() == "of the old one"
        assert not (tmp_path / "model.before-2").exists()
        assert numbers(tmp_path / "model")[-1]["step"] == 2
    run(aside, packed)  # it can go on there: it is done
    assert same(weights(aside), weights(trained))


def test_two_trainings_in_one_folder_are_refused(tmp_path):
    with (
        ModelFolder(tmp_path).alone(),
        pytest.raises(WorkFailed, match="another process"),
        ModelFolder(tmp_path).alone(),
    ):
        pass


# -- several processes ----------------------------------------------------------------------------


@pytest.mark.slow
def test_two_processes_are_one_with_the_joint_batch(packed, root, trained, tmp_path):
    """Through torchrun and the command; each process sees its own windows (gloo).

    They are started in a folder whose files must not run.
    """
    case, model = tmp_path / "case", tmp_path / "model"
    case.mkdir()
    plant(case)
    words = command(packed, model, "--joint-batch", "--processes", "3")  # 2 share it evenly
    done = subprocess.run(
        [sys.executable, the_command(tmp_path), *words[1:]], cwd=case, capture_output=True,
        env={**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not planted(case)
    one, two = numbers(trained), numbers(model)
    assert [line["step"] for line in one] == [line["step"] for line in two]
    for line, other in zip(one, two, strict=True):
        if "loss" in line:
            assert other["loss"] == pytest.approx(line["loss"], rel=1e-5)
            assert other["gradient_norm"] == pytest.approx(line["gradient_norm"], rel=1e-4)
        else:
            assert other["validation"] == pytest.approx(line["validation"], rel=1e-4)
    state, other = last_state(trained), last_state(model)
    for name, value in state["weights"].items():
        assert torch.allclose(other["weights"][name], value, atol=1e-6)


@pytest.mark.slow
def test_processes_end_with_one_line_and_the_code_of_the_command(packed, root, trained, tmp_path):
    shutil.copytree(trained, tmp_path / "model")
    several = ("--joint-batch", "--processes", "2")
    other = command(packed, tmp_path / "model", *several, "--set", "gns.train.width=9")
    process = start(other, root)
    output = process.communicate(timeout=120)[0]
    assert process.returncode == 2
    assert output.count("\n") == 1 and "width = 8, not 9" in output


@pytest.mark.slow
def test_several_processes_stop_and_go_on(packed, root, trained, tmp_path):
    many = ("--joint-batch", "--processes", "2", "--set", "gns.train.steps=400")
    process = start(command(packed, tmp_path, *many), root)
    wait_for(process, tmp_path, 8)
    process.send_signal(signal.SIGTERM)
    output = process.communicate(timeout=60)[0]
    assert process.returncode == 1 and "start again to continue" in output
    assert 8 <= last_state(tmp_path)["progress"]["step"] < 400


def test_another_process_that_fails_is_heard(tmp_path, monkeypatch, capfd):
    """The first one waits for it in vain, and has nothing to say."""
    (tmp_path / "lost.py").write_text(
        "import os, sys, time\n"
        "if os.environ['RANK'] == '0':\n    time.sleep(60)\n"
        "print('threads', os.environ['OMP_NUM_THREADS'], file=sys.stderr)\n"
        "sys.exit('error: out of memory')\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(processes, "GRACE_S", 0.2)
    assert processes.in_processes(2, ["lost"]) == 1
    said = capfd.readouterr().err
    assert "process 1 of 2 failed:" in said and "error: out of memory" in said
    assert f"threads {max(len(os.sched_getaffinity(0)) // 2, 1)}" in said


def test_a_gpu_for_each_process_or_for_none(monkeypatch):
    """Some on GPUs and some without would wait for each other for ever."""
    monkeypatch.setenv("WORLD_SIZE", "3")
    monkeypatch.setenv("LOCAL_WORLD_SIZE", "3")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    backends = []
    monkeypatch.setattr(torch.distributed, "init_process_group", backends.append)
    monkeypatch.setattr(torch.distributed, "destroy_process_group", lambda: None)
    for rank in range(3):
        monkeypatch.setenv("RANK", str(rank))
        monkeypatch.setenv("LOCAL_RANK", str(rank))
        with distributed.group() as members:
            assert members.device.type == "cpu"
        with (
            pytest.raises(InputError, match="3 processes on this machine, and 2 GPUs"),
            distributed.group("cuda"),
        ):
            pass
    assert backends == ["gloo"] * 3


# -- learning on from a model ---------------------------------------------------------------------


def test_learning_on_from_a_model(trained, packed, tmp_path):
    start_from = Simulator.load(trained / "model.pt")
    narrow = {**start_from.config.ranges, "cohesion": (1.0, 9.0)}
    start_from.config = start_from.config.model_copy(update={"ranges": narrow})
    settings = SETTINGS.model_copy(update={"learning_rate": 1e-9, "averaging": 0.0, "width": 99})
    run(tmp_path, packed, settings, start=start_from)
    result = Simulator.load(tmp_path / "model.pt")
    # Its form and its normalisation are the model's; at this rate so are its weights.
    assert result.config.width == 8
    assert result.config.velocity_std == start_from.config.velocity_std
    for name, value in start_from.state_dict().items():
        assert torch.allclose(result.state_dict()[name], value, atol=1e-6)
    low, _ = opened(packed)[0].metadata.ranges["cohesion"]
    assert result.config.ranges["cohesion"] == (min(low, 1.0), 9.0)
    learned, _ = opened(packed)
    assert len(result.known.features) == 2 * len(learned.runs), "the same scenes count once"


# -- validation and the command -------------------------------------------------------------------


def test_validation_runs_are_spread_over_the_templates(packed):
    learned, _ = opened(packed)
    chosen = choose_runs(learned, 7)
    letters = [learned.templates[list(learned.runs).index(run)] for run in chosen]
    assert len(set(chosen)) == 7 and set(letters) == set("abcde")
    assert max(letters.count(letter) for letter in "abcde") == 2
    assert choose_runs(learned, 1000) == sorted(int(run) for run in learned.runs)


def test_a_rollout_that_fails_counts_as_a_large_error(packed):
    _, held_out = opened(packed)
    simulator = Simulator(simulator_config(SETTINGS, held_out.metadata, 2.0))
    good = score_run(simulator, held_out, int(held_out.runs[0]))
    simulator.network.decoder.third.bias.data[:] = math.nan
    bad = score_run(simulator, held_out, int(held_out.runs[0]))
    assert good.finite and not bad.finite
    assert summary([bad]).score == FAILED_ERROR and summary([bad]).failed == 1
    both = summary([good, bad])
    assert both.score == pytest.approx(
        0.5 * (FAILED_ERROR + good.final_position_error_m / good.spacing_m)
    )


def test_weeks_without_a_gpu_have_to_be_meant(monkeypatch):
    settings = SETTINGS.model_copy(update={"steps": 3_500_000})
    clock = iter(np.arange(0.0, 100.0, 2.0))
    for confirmed in (False, True):
        watch = _TrainingWatch(settings, True, ALONE, confirmed)
        watch.begin(0)
        monkeypatch.setattr(time, "monotonic", lambda: float(next(clock)))
        for step in range(1, 1 + TRIAL_STEPS):
            watch.step(step, 1.0)
        if confirmed:
            watch.step(1 + TRIAL_STEPS, 1.0)
        else:
            with pytest.raises(WorkFailed, match="weeks .*give --yes"):
                watch.step(1 + TRIAL_STEPS, 1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--data", "x"], "--scale, or both --data and --out"),
        (["--scale", "huge"], "scale 'huge' is unknown"),
        (["--scale", "coarse", "--steps", "0"], "--steps 0: at least 1"),
        (["--scale", "coarse", "--threads", "0"], "--threads 0: at least 1"),
        (["--scale", "coarse", "--processes", "-1"], "--processes -1: at least 1"),
        (["--scale", "coarse", "--minutes", "nan"], "--minutes nan: must be greater than 0"),
        (["--scale", "coarse", "--data", "/nowhere"], "no packed data"),
        (["--scale", "coarse", "--set", "gns.train_of_scale.coarse.width=0"], "width"),
    ],
)
def test_wrong_input_is_one_line(arguments, message, capsys):
    from tests.commands import gns as main

    with pytest.raises(InputError, match=message):
        main(["train", *arguments])


def test_a_single_restart_may_be_given_as_a_number():
    given = TrainSettings(restart_at=60)
    assert given.restart_at == [60] and TrainSettings(restart_at=0).restart_at == []
    with pytest.raises(ValidationError, match="ascending"):
        TrainSettings(restart_at=[60, 20])
