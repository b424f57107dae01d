"""Judging a model: scores, card, pictures, and the commands evaluate, rollout, schema."""

from __future__ import annotations

import csv
import json
import math
import shutil

import jsonschema
import numpy as np
import pytest
import torch

from geometry.scenes.scene import save_scene
from gns.data.dataset import Windows
from gns.data.distance import described
from gns.evaluation.card import accuracy, known_failures, read_card, schema_text
from gns.evaluation.evaluate import evaluate, one_step_errors, read_mpm_seconds
from gns.evaluation.metrics import runout
from gns.network.simulator import Simulator, read_document
from gns.training.checkpoints import ModelFolder
from gns.training.distributed import ProcessGroup
from gns.training.train import train
from pipeline.cli import InputError, WorkFailed
from pipeline.config import TrainSettings
from pipeline.files import read_yaml
from tests.commands import gns as main
from tests.gns.scenes import small_scene

SETTINGS = TrainSettings(
    width=4, message_passing_steps=1, steps=3, batch_size=1, validate_every=3, validate_runs=1
)


@pytest.fixture(scope="module")
def model(packed, tmp_path_factory):
    """Folder of a model that has taken three steps."""
    folder = tmp_path_factory.mktemp("model")
    group = ProcessGroup(0, 1, torch.device("cpu"))
    train(ModelFolder(folder), Windows(packed, "train"), Windows(packed, "valid"), SETTINGS, group)
    return folder


@pytest.fixture(scope="module")
def found(packed, model):
    simulator = Simulator.load(model / "model.pt")
    seconds = {int(run): 2.5 for run in Windows(packed, "test").runs}
    return evaluate(simulator, Windows(packed, "test"), mpm_seconds=seconds)


class Exact(Simulator):
    """A model that knows the future of one run."""

    def advance(self, window, scene, graph=None):
        # The frame whose positions these are; the one after it.
        frame = int((self.future - window[-1]).abs().sum((1, 2)).argmin())
        return self.future[min(frame + 1, len(self.future) - 1)]


def test_a_model_that_knows_the_future_makes_no_error(packed, model):
    windows = Windows(packed, "test")
    simulator = Simulator.load(model / "model.pt")
    run = int(windows.runs[0])
    simulator.__class__ = Exact
    simulator.future = simulator.scaled(windows.facts(run)).to_spacings(windows.positions(run))
    (one,) = evaluate(simulator, windows, runs=[run])
    assert one.score.position_error_m < 1e-3 and abs(one.score.runout_error_m) < 1e-2
    assert one.one_step_error < 1e-3 < one.constant_velocity_error


def test_errors_of_single_steps(packed, model):
    """Free flight from t = 0: constant velocity misses what gravity does in a frame, g t^2 / 2."""
    windows = Windows(packed, "test")
    run = int(windows.runs[0])
    facts, positions = windows.facts(run), windows.positions(run)
    flying = positions[:3]  # the block is still in the air
    _, constant = one_step_errors(Simulator.load(model / "model.pt"), flying, facts)
    assert constant == pytest.approx(0.5 * 9.81 * facts.frame_time**2 / facts.spacing, rel=0.01)


def test_every_run_of_the_split_is_judged(packed, found):
    windows = Windows(packed, "test")
    assert [one.score.run for one in found] == [int(run) for run in windows.runs]
    assert all(one.seconds > 0 and one.mpm_seconds == 2.5 for one in found)
    assert [one.score.template for one in found] == windows.templates


def test_accuracy_is_made_of_medians(found):
    result = accuracy("test", found, {"guess": {"runout, d": 3.0}})
    assert result.runs == len(found) and result.mpm_seconds_a_run == 2.5
    errors = [abs(one.score.runout_error_spacings) for one in found]
    assert result.by_template["all"]["runout, d"] == pytest.approx(np.median(errors), rel=1e-3)
    far = [one for one in found if one.score.travel_m > 10 * one.score.spacing_m]
    assert result.runs_that_travel_far == len(far)
    assert result.worst[0].runout_error_spacings == pytest.approx(
        max((one.score.runout_error_spacings for one in found), key=abs), rel=1e-3
    )


def test_failures_are_said(packed, model):
    windows = Windows(packed, "test")
    simulator = Simulator.load(model / "model.pt")
    simulator.network.decoder.third.bias.data[:] = math.nan
    found = evaluate(simulator, windows, runs=[int(run) for run in windows.runs[:2]])
    said = known_failures(found)
    assert said[0].startswith("2 of 2 rollouts fail: runs ")
    result = accuracy("test", found, {})
    assert result.by_template["all"]["runout, d"] is None
    assert result.worst[0].runout_error_spacings is None


@pytest.mark.slow
def test_evaluate_writes_a_card_that_fits_its_schema(packed, model, root, tmp_path, capsys):
    table = tmp_path / "runs.csv"
    runs = Windows(packed, "test").runs
    table.write_text("index,wall_time_s\n" + "".join(f"{run},1.5\n" for run in runs))
    main(["evaluate", "--data", str(packed), "--model", str(model), "--mpm", str(table),
          "--name", "tiny", "--note", "a test", "--quiet"])  # fmt: skip
    printed = capsys.readouterr().out
    assert "runout, % of travel" in printed and "sliding-block" in printed
    card = read_card(model / "card.yaml")
    assert card.name == "tiny" and card.note == "a test" and card.training.step == 3
    assert card.accuracy.runs == len(runs) and card.accuracy.mpm_seconds_a_run == 1.5
    assert card.network["width"] == 4 and card.training.settings["steps"] == 3
    assert card.ranges == Windows(packed, "train").metadata.ranges
    jsonschema.validate(read_yaml(model / "card.yaml"), json.loads(schema_text()))
    with (model / "evaluation.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["run"]) for row in rows] == list(runs)
    for picture in ("worst.png", "training.png"):
        assert (model / picture).stat().st_size > 10_000


def test_a_model_is_not_judged_by_what_it_has_learned_from(packed, model, tmp_path, capsys):
    folder = shutil.copytree(model, tmp_path / "model")
    windows = Windows(packed, "test")
    first, *others = map(int, windows.runs)
    simulator = Simulator.load(folder / "model.pt")
    scene = described(windows.positions(first, 0, 1)[0], windows.facts(first))
    simulator.known = simulator.known.joined([scene])
    document = read_document(folder / "model.pt")
    kept = {name: document[name] for name in ("step", "made_from", "learned_from")}
    simulator.save(folder / "model.pt", **kept)
    main(["evaluate", "--data", str(packed), "--model", str(folder), "--runs", "1", "--quiet"])
    assert f"not judged by runs {first}: the model has learned" in capsys.readouterr().out
    with (folder / "evaluation.csv").open() as file:
        assert [int(row["run"]) for row in csv.DictReader(file)] == others[:1]


@pytest.mark.parametrize("command", ["evaluate", "rollout"])
def test_a_device_that_is_not_there_is_refused_in_one_line(
    packed, model, tmp_path, monkeypatch, command
):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    save_scene(small_scene(spacing=2.0), tmp_path / "scene.yaml")
    given = {
        "evaluate": ["--data", str(packed), "--model", str(model)],
        "rollout": [str(tmp_path / "scene.yaml"), "--model", str(model), "--out", str(tmp_path)],
    }[command]
    with pytest.raises(InputError, match="--device cuda: this machine has no CUDA device"):
        main([command, *given, "--device", "cuda"])


def test_rollout_of_a_scene(model, tmp_path, capsys):
    save_scene(small_scene(spacing=2.0), tmp_path / "scene.yaml")
    with pytest.raises(InputError, match="distance to the training: .* give --anywhere"):
        main(["rollout", str(tmp_path / "scene.yaml"), "--model", str(model),
              "--out", str(tmp_path / "out")])  # fmt: skip
    main(["rollout", str(tmp_path / "scene.yaml"), "--model", str(model), "--duration", "1.0",
          "--out", str(tmp_path / "out"), "--quiet", "--anywhere"])  # fmt: skip
    printed = capsys.readouterr()
    assert "outside the training's range" in printed.err
    with np.load(tmp_path / "out" / "rollout.npz") as data:
        positions, time = data["positions"], data["time"]
    assert positions.shape[0] == len(time) == round(1.0 / time[1]) + 1
    assert (tmp_path / "out" / "rollout.png").stat().st_size > 10_000
    from gns.data.scene_facts import start_of
    from pipeline.config import SimulationSettings

    facts, _ = start_of(small_scene(spacing=2.0), SimulationSettings(water="buoyant"))
    assert f"{runout(positions[-1], positions[0], facts, 'right'):.2f}" in printed.out


def test_a_rollout_that_fails_keeps_its_frames(model, tmp_path, capsys, monkeypatch):
    simulator = Simulator.load(model / "model.pt")
    simulator.network.decoder.third.bias.data[:] = math.nan
    monkeypatch.setattr(Simulator, "load", lambda *arguments: simulator)
    save_scene(small_scene(spacing=2.0), tmp_path / "scene.yaml")
    with pytest.raises(WorkFailed, match="not a finite number"):
        main(["rollout", str(tmp_path / "scene.yaml"), "--model", str(model),
              "--out", str(tmp_path / "out"), "--quiet", "--anywhere"])  # fmt: skip
    with np.load(tmp_path / "out" / "rollout.npz") as data:
        assert len(data["positions"]) == 1


def test_a_rollout_that_cannot_be_written_is_not_begun(model, tmp_path, monkeypatch):
    monkeypatch.setattr("gns.rollout.rollout.rollout", None)
    save_scene(small_scene(spacing=2.0), tmp_path / "scene.yaml")
    with pytest.raises(InputError, match="scene.yaml.out: cannot be written"):
        main(["rollout", str(tmp_path / "scene.yaml"), "--model", str(model),
              "--out", str(tmp_path / "scene.yaml" / "out"), "--quiet", "--anywhere"])  # fmt: skip


def test_wrong_input_is_one_line(packed, model, tmp_path):
    with pytest.raises(InputError, match="--scale, or both"):
        main(["evaluate", "--data", str(packed)])
    with pytest.raises(InputError, match="no such file"):
        main(["evaluate", "--data", str(packed), "--model", str(tmp_path)])
    for option, value, words in (
        ("--spacing", "-1", "--spacing -1: must be greater than 0 m"),
        ("--spacing", "50", "--spacing 50: zones: "),
        ("--duration", "nan", "--duration nan: must be greater than 0 s, and finite"),
        ("--duration", "-1", "--duration -1: must be greater than 0 s, and finite"),
        ("--threads", "0", "--threads 0: at least 1"),
    ):
        with pytest.raises(InputError, match=words):
            main(["rollout", "case_histories/la_marquesa", f"{option}={value}", "--model",
                  str(model), "--out", str(tmp_path)])  # fmt: skip
    with pytest.raises(InputError, match="--threads -1: at least 1"):
        main(["evaluate", "--data", str(packed), "--model", str(model), "--threads=-1"])
    (tmp_path / "wrong.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="wall_time_s"):
        read_mpm_seconds(tmp_path / "wrong.csv")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x89PNG\r\n\x1a\n\xff\x00", "not a UTF-8 text file"),
        (b"index,wall_time_s\n1,2.5\n2\n", "no numbers in columns index and wall_time_s"),
        (b"index,wall_time_s\n1,nan\n", "run 1: wall_time_s nan: at least 0"),
    ],
)
def test_times_of_simulations_that_are_none(packed, model, tmp_path, content, words):
    path = tmp_path / "runs.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"runs.csv: .*{words}|runs.csv: {words}"):
        main(["evaluate", "--data", str(packed), "--model", str(model), "--mpm", str(path)])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x89PNG\r\n\x1a\n\xff\x00", "metrics.jsonl: not a UTF-8 text file"),
        (b"[1]\n", r"metrics.jsonl: line 1: '\[1\]' is not a line of a training"),
        (b'{"step": 1, "loss": null}\n', "line 1: .* is not a line of a training"),
        (b'{"step": 1, "validation": {}}\n', "line 1: .* is not a line of a training"),
    ],
)
def test_metrics_that_are_none_are_reported_before_the_rollouts(
    packed, model, tmp_path, content, words
):
    folder = shutil.copytree(model, tmp_path / "model")
    (folder / "metrics.jsonl").write_bytes(content)
    before = sorted(path.name for path in folder.iterdir())
    with pytest.raises(InputError, match=words):
        main(["evaluate", "--data", str(packed), "--model", str(folder), "--quiet"])
    assert sorted(path.name for path in folder.iterdir()) == before
