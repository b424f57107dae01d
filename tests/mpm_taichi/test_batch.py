from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from mpm_taichi import batch
from mpm_taichi.batch import parts_folder, run_batch, run_key
from mpm_taichi.trajectory import list_runs, read_run
from pipeline.cli import InputError, WorkFailed
from tests.mpm_taichi.ballistic import FAST, make_scene, simulate

REPOSITORY = Path(__file__).parents[2]


def scenes(*numbers: int):
    return {number: make_scene(number) for number in numbers}


def everything(path: Path) -> dict[str, object]:
    """All datasets (as stored: compressed bytes) and all attributes but the wall time."""
    found: dict[str, object] = {}

    def collect(name, item):
        found[name] = {k: v for k, v in item.attrs.items() if k != "wall_time_s"}
        if isinstance(item, h5py.Dataset):
            chunks = range(item.id.get_num_chunks())
            offsets = [item.id.get_chunk_info(i).chunk_offset for i in chunks]
            found[f"{name} data"] = [item.id.read_direct_chunk(at) for at in offsets]

    with h5py.File(path, "r") as file:
        file.visititems(collect)
    return found


@pytest.fixture
def uninterrupted(tmp_path) -> Path:
    path = tmp_path / "whole" / "batch_000.h5"
    run_batch(scenes(0, 1, 2, 3, 4), FAST, path, simulate=simulate)
    return path


def test_a_batch_becomes_one_file_and_leaves_no_parts(uninterrupted):
    assert [run.index for run in list_runs(uninterrupted)] == [0, 1, 2, 3, 4]
    assert os.listdir(uninterrupted.parent) == ["batch_000.h5"]


@pytest.mark.parametrize("group_size", [1, 2, 7])
def test_the_group_size_does_not_matter(tmp_path, uninterrupted, group_size):
    path = tmp_path / "batch_000.h5"
    run_batch(scenes(4, 2, 0, 1, 3), FAST, path, simulate=simulate, group_size=group_size)
    assert everything(path) == everything(uninterrupted)


def test_a_solver_that_reports_nothing_before_it_returns_will_do(tmp_path, uninterrupted):
    def late(scenes, settings, *, device, threads, on_finished):
        return simulate(scenes, settings)

    path = tmp_path / "batch_000.h5"
    run_batch(scenes(0, 1, 2, 3, 4), FAST, path, simulate=late)
    assert everything(path) == everything(uninterrupted)


def test_an_interrupted_batch_is_continued(tmp_path, uninterrupted):
    path = tmp_path / "batch_000.h5"
    simulated = []

    def dies(scenes, settings, *, on_finished, **options):
        if simulated:
            raise KeyboardInterrupt
        simulated.extend(scene.seed for scene in scenes)
        return simulate(scenes, settings, on_finished=on_finished)

    def counts(scenes, settings, *, on_finished, **options):
        simulated.extend(scene.seed for scene in scenes)
        return simulate(scenes, settings, on_finished=on_finished)

    with pytest.raises(KeyboardInterrupt):
        run_batch(scenes(0, 1, 2, 3, 4), FAST, path, simulate=dies, group_size=2)
    assert not path.exists()
    assert simulated == [0, 1]
    result = run_batch(scenes(0, 1, 2, 3, 4), FAST, path, simulate=counts, group_size=2)
    assert simulated == [0, 1, 2, 3, 4]
    assert result.reused == 2
    assert everything(path) == everything(uninterrupted)


def test_a_finished_batch_is_left_alone(uninterrupted):
    def never(*args, **options):
        raise AssertionError("nothing is left to simulate")

    before = uninterrupted.stat().st_mtime_ns
    result = run_batch(scenes(0, 1, 2, 3, 4), FAST, uninterrupted, simulate=never)
    assert result.reused == 5
    assert uninterrupted.stat().st_mtime_ns == before
    assert os.listdir(uninterrupted.parent) == ["batch_000.h5"]


def test_only_what_changed_is_simulated_again(uninterrupted):
    changed = scenes(0, 1, 2, 3, 4, 5)
    changed[2] = changed[2].with_strength("shell", friction_deg=31)
    simulated = []

    def counts(scenes, settings, **options):
        simulated.extend(scene.seed for scene in scenes)
        return simulate(scenes, settings)

    run_batch(changed, FAST, uninterrupted, simulate=counts)
    assert simulated == [2, 5]
    assert read_run(uninterrupted, 2, fields=[]).scene == changed[2]
    assert len(list_runs(uninterrupted)) == 6


def test_a_shrunken_batch_loses_its_surplus_runs(uninterrupted):
    run_batch(scenes(1, 3), FAST, uninterrupted, simulate=simulate)
    assert [run.index for run in list_runs(uninterrupted)] == [1, 3]


def test_stale_and_damaged_parts_are_not_used(tmp_path, uninterrupted):
    path = tmp_path / "batch_000.h5"

    def dies(scenes, settings, *, on_finished, **options):
        simulate(scenes[:3], settings, on_finished=on_finished)
        raise KeyboardInterrupt

    other = FAST.model_copy(update={"courant": 0.2})
    with pytest.raises(KeyboardInterrupt):
        run_batch(scenes(0, 1, 2, 3, 4), other, path, simulate=dies)
    damaged = parts_folder(path) / "run_00003.h5"
    damaged.write_bytes(uninterrupted.read_bytes()[:3000])
    result = run_batch(scenes(0, 1, 2, 3, 4), FAST, path, simulate=simulate)
    assert result.reused == 0
    assert everything(path) == everything(uninterrupted)


def test_the_key_holds_all_that_decides_the_numbers(monkeypatch):
    scene = make_scene(0)
    keys = {
        run_key(scene, FAST, "cpu"),
        run_key(scene, FAST, "cuda"),
        run_key(make_scene(1), FAST, "cpu"),
        run_key(scene, FAST.model_copy(update={"courant": 0.1}), "cpu"),
    }
    monkeypatch.setattr(batch, "PHYSICS_VERSION", 999)
    keys.add(run_key(scene, FAST, "cpu"))
    assert len(keys) == 5


def test_failed_runs_are_recorded_and_do_not_stop_the_batch(tmp_path):
    path = tmp_path / "batch_000.h5"
    told = []
    result = run_batch(scenes(12, 13, 14), FAST, path, simulate=simulate, on_run=told.append)
    assert [run.index for run in told] == [12, 13, 14]
    (failure,) = result.failures
    assert (failure.index, failure.seed, failure.duration_s) == (13, 13, 1.25)
    assert failure.reason == "energy balance off by 7 %"
    assert read_run(path, 14).status == "finished"


@pytest.mark.parametrize("group_size", [1, 8])
def test_a_scene_on_which_the_solver_raises_is_recorded(tmp_path, group_size):
    path = tmp_path / "batch_000.h5"
    three = scenes(1, 666, 2)
    result = run_batch(three, FAST, path, simulate=simulate, group_size=group_size)
    assert [run.status for run in result.runs] == ["finished", "finished", "failed"]
    assert result.failures[0].reason == "the solver raised RuntimeError: the grid is on fire"

    def mended(scenes, settings, **options):
        assert [scene.seed for scene in scenes] == [666]  # tried again, and nothing else
        return [run for run in simulate([make_scene(665)], settings)]

    run_batch(three, FAST, path, simulate=mended)
    assert [run.status for run in list_runs(path)] == ["finished"] * 3


def test_a_long_message_is_reported_by_its_end():
    error = RuntimeError(
        "File solver.py\n  settle(\n  ^^^^^^^\n" + 200 * "stack " + "\nNaN in row 3"
    )
    text = batch._brief(error)
    assert text.endswith("stack NaN in row 3") and "^" not in text and len(text) < 310


def test_if_nothing_can_be_run_there_is_no_file(tmp_path):
    with pytest.raises(WorkFailed, match="none of the 1 scenes could be run: .* is on fire"):
        run_batch(scenes(666), FAST, tmp_path / "batch_000.h5", simulate=simulate)
    assert not (tmp_path / "batch_000.h5").exists()


def test_bad_input_stops_the_batch(tmp_path):
    def refuses(scenes, settings, **options):
        raise InputError("effects: 'ghosts' is unknown")

    with pytest.raises(InputError, match="ghosts"):
        run_batch(scenes(1), FAST, tmp_path / "batch_000.h5", simulate=refuses)
    with pytest.raises(InputError, match="no scenes"):
        run_batch({}, FAST, tmp_path / "batch_000.h5", simulate=simulate)


def test_two_processes_cannot_work_on_one_batch(tmp_path):
    path = tmp_path / "batch_000.h5"

    def nested(scenes, settings, **options):
        run_batch({0: scenes[0]}, settings, path, simulate=simulate)

    with pytest.raises(WorkFailed, match="another process"):
        run_batch(scenes(0), FAST, path, simulate=nested)


SLOW_JOB = """
import sys, time
from pipeline.cli import main_exit
from mpm_taichi.batch import run_batch
from tests.mpm_taichi import ballistic

def slow(scenes, settings, *, device, threads, on_finished):
    for i, scene in enumerate(scenes):
        time.sleep(0.15)
        on_finished(i, ballistic.fly(scene, settings))
    return []

def main(argv):
    numbers = range(5)
    scenes = {n: ballistic.make_scene(n) for n in numbers}
    run_batch(scenes, ballistic.FAST, sys.argv[1], simulate=slow, group_size=5,
              on_run=lambda run: print("have", run.index, flush=True))

main_exit(main)
"""


def start_slow_job(path: Path) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", SLOW_JOB, str(path)],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("kind", [signal.SIGTERM, signal.SIGKILL])
def test_a_killed_job_continues_to_the_same_bytes(tmp_path, uninterrupted, kind):
    path = tmp_path / "batch_000.h5"
    job = start_slow_job(path)
    seen = [job.stdout.readline().strip() for _ in range(2)]
    assert seen == ["have 0", "have 1"]
    time.sleep(0.05)
    job.send_signal(kind)
    _, complaint = job.communicate(timeout=20)
    assert not path.exists()
    if kind == signal.SIGTERM:
        assert job.returncode == 1
        assert complaint == "error: stopped; 2 of 5 runs are kept, start again to continue\n"
    result = run_batch(scenes(0, 1, 2, 3, 4), FAST, path, simulate=simulate)
    assert result.reused >= 2
    assert everything(path) == everything(uninterrupted)
    assert sorted(os.listdir(tmp_path)) == ["batch_000.h5", "whole"]


def test_a_stop_waits_for_the_file_being_written(tmp_path, monkeypatch):
    path = tmp_path / "batch_000.h5"
    write = batch._write_run

    def stopped_while_writing(file, index, run, *, key):
        os.kill(os.getpid(), signal.SIGTERM)
        write(file, index, run, key=key)

    monkeypatch.setattr(batch, "_write_run", stopped_while_writing)
    with pytest.raises(WorkFailed, match="stopped; 1 of 2 runs are kept"):
        run_batch(scenes(0, 1), FAST, path, simulate=simulate)
    assert (parts_folder(path) / "run_00000.h5").exists()
    assert np.isfinite(list_runs(parts_folder(path) / "run_00000.h5")[0].duration_s)
