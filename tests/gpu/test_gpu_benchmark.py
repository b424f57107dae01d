"""The benchmark for a GPU: failures are rows, what is there is not done again, time is kept."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from benchmarks.gpu import __main__ as command
from benchmarks.gpu import stages
from benchmarks.gpu.record import Record, row
from pipeline.cli import InputError

MADE = {"device": "cpu", "rehearsal": False}
ORDER = ("first", "second", "third")


@pytest.fixture
def stage(monkeypatch, tmp_path):
    """A stage of three measurements, whose processes are calls in this one."""
    one = stages.Stage("made up", 100.0, "nowhere")
    monkeypatch.setitem(stages.ORDER, one.name, ORDER)
    return one


def record(folder):
    return Record(folder / "rows.json", MADE)


def run(stage, folder, monkeypatch, measurements, ended=None, seconds=100.0):
    """Run a stage; each process runs `work`, or ends as `ended` says."""
    started = []

    def process(options, left):
        started.append(options)
        context = stages.Context("cpu", False, record(folder), stages.time.monotonic() + left)
        code = stages.work(stage, context, measurements)
        return "" if code in (0, stages.FAILED) else "ended"

    monkeypatch.setattr(stages, "_in_a_process", ended or process)
    stages.run_stage(stage, lambda: record(folder), seconds, [])
    return started


def failing(context):
    raise RuntimeError("CUDA error: an illegal\nmemory access")


def test_a_measurement_that_raises_is_a_row_and_the_next_goes_on(stage, tmp_path, monkeypatch):
    measured = {
        "first": lambda context: [row("a", 1.0, "m")],
        "second": failing,
        "third": lambda context: [row("c", 3.0, "s", "beside")],
    }
    started = run(stage, tmp_path, monkeypatch, measured)
    assert len(started) == 2, "what failed may have broken its process: the rest have another"
    rows = record(tmp_path).rows
    assert [one["measurement"] for one in rows] == list(ORDER)
    assert [one.get("failed", False) for one in rows] == [False, True, False]
    table = record(tmp_path).table()
    assert "FAILED: RuntimeError: CUDA error: an illegal memory access" in table
    assert table.splitlines()[-1].split() == ["c", "3", "s", "beside"]


def test_what_is_there_is_not_measured_again_and_what_failed_is(stage, tmp_path, monkeypatch):
    calls = []

    def noted(name):
        return lambda context: calls.append(name) or [row(name, 1.0)]

    run(stage, tmp_path, monkeypatch, {**{name: noted(name) for name in ORDER}, "second": failing})
    kept = record(tmp_path)
    kept.forget_failures()
    kept.add("", "", [])
    run(stage, tmp_path, monkeypatch, {name: noted(name) for name in ORDER})
    assert calls == ["first", "third", "second"]
    assert not any(one.get("failed") for one in record(tmp_path).rows)


def test_a_process_that_dies_costs_the_measurement_it_was_at(stage, tmp_path, monkeypatch):
    def dies_at_second(options, left):
        context = stages.Context("cpu", False, record(tmp_path), stages.time.monotonic() + left)
        waiting = [one for one in ORDER if not context.record.tried(stage.name, one)]
        for name in waiting:
            if name == "second":
                return "ended with code -9"
            context.record.add(stage.name, name, [row(name, 1.0)])
        return ""

    run(stage, tmp_path, monkeypatch, {}, ended=dies_at_second)
    rows = {one["measurement"]: one for one in record(tmp_path).rows}
    assert rows["second"]["failed"] and "ended with code -9" in rows["second"]["beside"]
    assert rows["first"]["value"] == rows["third"]["value"] == 1.0


def test_a_stage_without_time_says_what_it_has_not_reached(stage, tmp_path, monkeypatch):
    started = run(stage, tmp_path, monkeypatch, {}, seconds=0.0)
    assert not started
    assert [one["beside"] for one in record(tmp_path).rows] == [
        "not reached in the time of the stage"
    ] * 3


def test_a_process_is_killed_at_its_limit_with_those_it_started(monkeypatch, tmp_path):
    real = subprocess.Popen
    started = []

    def sleeping(command, **options):
        code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'import time; " \
               "time.sleep(600)'])"  # fmt: skip
        started.append(real([sys.executable, "-c", code], **options))
        return started[-1]

    monkeypatch.setattr(stages.subprocess, "Popen", sleeping)
    assert stages._in_a_process([], 0.2) == "killed"
    assert started[0].returncode < 0


def test_rows_of_another_device_are_refused(tmp_path):
    record(tmp_path).add("true", "slides", [row("toe", 1.0, "m")])
    with pytest.raises(InputError, match="give another --out"):
        Record(tmp_path / "rows.json", {"device": "cuda", "rehearsal": False})
    assert record(tmp_path).value("true", "toe") == 1.0
    assert record(tmp_path).value("true", "crest") is None


def test_the_order_names_every_measurement(monkeypatch):
    """The names are listed apart, so that no process loads what it does not need."""
    for name in ("true", "fast", "learning"):
        assert tuple(stages.STAGES[name].measurements()) == stages.ORDER[name]
    assert set(stages.ORDER) == set(stages.STAGES)


def test_wrong_budget_is_one_line(tmp_path):
    with pytest.raises(InputError, match="--budget 0: must be greater than 0"):
        command.main(["--budget", "0", "--out", str(tmp_path / "rows.json")])


@pytest.mark.slow
@pytest.mark.long
def test_the_rehearsal_measures_everything(root, tmp_path):
    """By the code that a GPU is measured with, on a CPU."""
    out = tmp_path / "rows.json"
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.gpu", "--rehearse", "--out", out, "--budget", "1500"],
        cwd=root, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = json.loads(out.read_text())["rows"]
    assert not [one for one in rows if one.get("failed")], done.stdout
    for name, measurements in stages.ORDER.items():
        assert {one["measurement"] for one in rows if one["stage"] == name} == set(measurements)
    text = done.stdout
    assert "MORE THAN" not in text and "NOT EQUAL" not in text
    again = subprocess.run(
        [sys.executable, "-m", "benchmarks.gpu", "--rehearse", "--out", out],
        cwd=root, capture_output=True, text=True,
    )  # fmt: skip
    assert json.loads(out.read_text())["rows"] == rows and again.returncode == 0
