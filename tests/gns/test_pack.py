"""Packing: the layout, what is left out, kills and restarts, input that is wrong."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest

import gns
from gns.data.metadata import read_metadata
from gns.data.pack import pack, plan_packing
from gns.data.scene_facts import NUMBERS, PROPERTIES, start_of
from gns.data.shard import MEMBERS, Shard
from gns.data.trajectories import list_sources, read_left_out, read_source
from gns.training.train import simulator_config
from mpm_taichi.trajectory import read_run
from pipeline.cli import InputError, WorkFailed
from pipeline.config import PackSettings, SimulationSettings, TrainSettings
from tests.commands import gns as main
from tests.gns.conftest import SETTINGS
from tests.gns.runs import scene_of, write_batch

BUOYANT = SimulationSettings(duration_s=2.0, frame_interval=0.4, water="buoyant")


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def pack_into(folder: Path, batches, settings=SETTINGS, left_out=None):
    return pack(plan_packing(batches, settings, left_out), folder, {"made": "by a test"})


def test_the_layout_is_plain_arrays_stored_as_they_are(packed, batches):
    metadata = read_metadata(packed)
    assert sorted(path.name for path in packed.iterdir()) == [
        "metadata.json", "test_000.npz", "train_000.npz", "train_001.npz", "train_002.npz",
        "valid_000.npz",
    ]  # fmt: skip
    seen = []
    for split, shards in metadata.splits.items():
        for entry in shards:
            path = packed / entry.file
            assert entry.file.startswith(split) and len(entry.runs) <= SETTINGS.runs_per_shard
            with zipfile.ZipFile(path) as archive:
                assert archive.testzip() is None
                kinds = {item.compress_type for item in archive.infolist()}
                assert kinds == {zipfile.ZIP_STORED}
            with np.load(path, allow_pickle=False) as arrays:
                assert arrays["run_numbers"].tolist() == [run.run for run in entry.runs]
                assert arrays["layout_version"] == 3 and str(arrays["key"]) == entry.key
                assert tuple(arrays["number_names"]) == NUMBERS
                assert tuple(arrays["property_names"]) == PROPERTIES
                for run in entry.runs:
                    check_run(arrays, run, batches)
                    seen.append(run.run)
    assert sorted(seen) == list(range(30))


def check_run(arrays, entry, batches):
    """A run as numpy reads it is the run of the trajectory file."""
    run = read_run(batches[entry.run // 20], entry.run)
    stored = {name: arrays[f"run_{entry.run:05d}/{name}"] for name in MEMBERS}
    for name, (dtype, shape) in MEMBERS.items():
        assert stored[name].dtype == dtype and stored[name].ndim == len(shape)
    np.testing.assert_array_equal(stored["positions"], run.positions)
    assert stored["positions"].shape == (entry.frames, entry.points, 2)
    facts, _ = start_of(run.scene, run.settings)
    np.testing.assert_array_equal(stored["properties"], facts.properties)
    np.testing.assert_array_equal(stored["type"], facts.type)
    np.testing.assert_array_equal(stored["ground"], run.scene.ground.points)
    assert dict(zip(NUMBERS, stored["numbers"], strict=True)) == facts.numbers
    assert json.loads(stored["scene"].tobytes()) == run.scene.model_dump(mode="json")
    assert entry.template == run.scene.origin.template


def test_what_was_packed_is_read_back(packed, batches):
    entry = read_metadata(packed).splits["valid"][0]
    shard = Shard(packed / entry.file)
    for run in entry.runs:
        given = read_source(list_sources(batches)[run.run])
        found = shard.read_run(run.run)
        for name, values in given.arrays().items():
            np.testing.assert_array_equal(values, found.arrays()[name])
    with pytest.raises(InputError, match=r"no run 999; it holds \d+ runs"):
        shard.positions(999)


def test_the_thrust_of_water_is_packed_and_a_model_of_it_knows_it(tmp_path):
    thrust = SimulationSettings(
        duration_s=2.0, frame_interval=0.4, water="pore_pressure", water_face="fixed"
    )
    wet = {"water_level": 9.0, "phreatic_line": [[0.0, 9.0], [30.0, 4.0]]}
    moving = thrust.model_copy(update={"water_face": "moving"})
    cases = (("thrust", thrust, True), ("moving", moving, True), ("lift", BUOYANT, False))
    for name, settings, known in cases:
        batch = write_batch(tmp_path / f"{name}.h5", range(10), settings=settings, **wet)
        metadata = pack_into(tmp_path / name, [batch]).metadata
        entry = metadata.splits["train"][0]
        facts = Shard(tmp_path / name / entry.file).facts(entry.runs[0].run)
        assert np.any(facts.properties[:, 3] > 0.02) == known
        assert facts.numbers["moving_face"] == (name == "moving")
        assert np.all(facts.properties[:, 4] >= -1.0) and np.any(facts.properties[:, 4] > -0.6)
        assert simulator_config(TrainSettings(), metadata, 2.0).thrust == known


def test_failed_runs_are_left_out_by_name(tmp_path):
    def fail(number, run):
        if number == 3:
            run.status, run.reason = "failed", "energy balance off by 7 %"
        if number == 5:
            run.positions, run.time = run.positions[:1], run.time[:1]
            run.energy = {}

    batch = write_batch(tmp_path / "batch_000.h5", range(10), alter=fail)
    listed = {8: "thrown out by hand", 77: "of another batch"}
    result = pack_into(tmp_path / "out", [batch], left_out=listed)
    found = {entry.run: entry.reason for entry in read_metadata(tmp_path / "out").left_out}
    assert found == {
        3: "energy balance off by 7 %",
        5: "1 frames, at least 2 are needed",
        8: "thrown out by hand",
    }
    packed_runs = {
        run.run for split in result.metadata.splits for run in result.metadata.runs(split)
    }
    assert packed_runs == set(range(10)) - set(found)


KILLED = """
import os, signal, sys
from pathlib import Path
from gns.data.pack import pack, plan_packing
from tests.gns.conftest import SETTINGS
last, out, *batches = sys.argv[1:]
done = 0
def tell(count, note):
    global done
    done += count
    if done >= int(last):
        os.kill(os.getpid(), signal.SIGKILL)
pack(plan_packing([Path(batch) for batch in batches], SETTINGS), out, {"made": "by a test"}, tell)
"""


@pytest.mark.parametrize("last", [1, 9, 20, 30])
def test_a_killed_and_continued_packing_leaves_the_same_bytes(last, batches, tmp_path, root):
    whole = tmp_path / "whole"
    pack_into(whole, batches)
    out = tmp_path / "out"
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(last), str(out), *map(str, batches)], cwd=root
    )
    assert done.returncode == -signal.SIGKILL
    assert not (out / "metadata.json").exists(), "a data set without it is incomplete"
    with pytest.raises(InputError, match="packing has not ended"):
        read_metadata(out)
    shards_left = len(list(out.glob("t*_0*.npz")) + list(out.glob("valid_0*.npz")))
    result = pack_into(out, batches)
    assert result.reused == shards_left and result.written == 5 - shards_left
    assert files_of(out) == files_of(whole)


def test_a_second_start_keeps_everything(batches, tmp_path):
    pack_into(tmp_path, batches)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.npz")}
    result = pack_into(tmp_path, batches)
    assert result.written == 0 and result.reused == 5
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.npz")} == before


def test_other_settings_leave_nothing_of_the_old(batches, tmp_path):
    pack_into(tmp_path / "out", batches)
    other = PackSettings(valid_share=0.1, test_share=0.3, runs_per_shard=30)
    pack_into(tmp_path / "out", batches, other)
    pack_into(tmp_path / "fresh", batches, other)
    assert files_of(tmp_path / "out") == files_of(tmp_path / "fresh")


def test_other_trajectories_are_packed_again(batches, tmp_path):
    path = tmp_path / "batch_000.h5"
    write_batch(path, range(10))
    first = pack_into(tmp_path / "out", [path]).metadata
    settings = SimulationSettings(duration_s=2.5, frame_interval=0.4)
    write_batch(path, range(10), settings=settings)
    second = pack_into(tmp_path / "out", [path])
    assert second.reused == 0 and second.metadata.data_hash != first.data_hash


def test_a_damaged_shard_is_written_again(batches, tmp_path):
    pack_into(tmp_path, batches)
    whole = files_of(tmp_path)
    flipped = bytearray(whole["test_000.npz"])
    flipped[len(flipped) // 2] ^= 0x10
    for spoilt in (whole["test_000.npz"][:-200], bytes(flipped)):
        (tmp_path / "test_000.npz").write_bytes(spoilt)
        assert pack_into(tmp_path, batches).written == 1
        assert files_of(tmp_path) == whole


def test_the_physics_version_is_part_of_the_key(batches, tmp_path, monkeypatch):
    pack_into(tmp_path, batches)
    monkeypatch.setattr(gns, "PHYSICS_VERSION", gns.PHYSICS_VERSION + 1)
    assert pack_into(tmp_path, batches).reused == 0


# --- input that is wrong ---


def spoil(path: Path, change) -> None:
    with h5py.File(path, "r+") as file:
        change(file["run_00004"])


def shorten(group):
    values = group["positions"][:-3]
    del group["positions"]
    group["positions"] = values


def put_nan(group):
    group["positions"][2, 5, 0] = np.nan


def other_version(group):
    group.attrs["format_version"] = 99


def lose_points(group):
    for name in ("positions", "kinematic"):
        values = group[name][..., :-1, :] if name == "positions" else group[name][:-1]
        del group[name]
        group[name] = values
    group.attrs["points"] = group.attrs["points"] - 1


def move_start(group):
    group["positions"][...] = group["positions"][...] + np.float32(0.5)


def change_time(group):
    group["time"][...] = group["time"][...] * 1.1


def lose_positions(group):
    del group["positions"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (shorten, r"run_00004: positions: .* the file is cut short"),
        (put_nan, r"run_00004: positions: frame 2 holds a value that is not finite"),
        (other_version, r"format_version: 99; this program reads 2"),
        (lose_points, r"\d+ points, but its scene holds \d+"),
        (move_start, r"a point starts 0.25 spacings from where the scene has it; allowed is 0.1"),
        (change_time, r"time: frames are .* s apart; its settings say"),
        (lose_positions, r"cannot be read, damaged"),
    ],
)
def test_a_wrong_trajectory_is_one_line(change, message, tmp_path):
    batch = write_batch(tmp_path / "batch_000.h5", range(6))
    spoil(batch, change)
    with pytest.raises(InputError, match=message) as caught:
        main(["pack", str(batch), "--out", str(tmp_path / "out"), "--quiet"])
    assert str(batch) in str(caught.value) and "\n" not in str(caught.value)
    assert not (tmp_path / "out" / "metadata.json").exists()


def test_a_truncated_file_is_one_line(tmp_path, run_module):
    batch = write_batch(tmp_path / "batch_000.h5", range(6))
    batch.write_bytes(batch.read_bytes()[: batch.stat().st_size // 2])
    done = run_module("flowslide", "gns", "pack", batch, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {batch}: cannot be read, damaged")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scale": "large"}, "scale: large, but run 0 of .* has coarse; runs of one data set"),
        ({"spacing": 1.5}, "spacing: 1.5, but run 0 of .* has 2.0"),
        (
            {"settings": SimulationSettings(duration_s=2.0, frame_interval=0.5)},
            "simulation.frame_interval: 0.5, but run 0",
        ),
        (
            {"settings": SimulationSettings(duration_s=2.0, gravity_m_per_s2=1.62)},
            "simulation.gravity_m_per_s2: 1.62, but run 0",
        ),
    ],
)
def test_runs_that_do_not_belong_together(changes, message, batches, tmp_path):
    other = write_batch(tmp_path / "batch_009.h5", [40], **changes)
    with pytest.raises(InputError, match=message):
        list_sources([batches[0], other])


def test_a_run_that_is_there_twice(batches, tmp_path):
    other = write_batch(tmp_path / "batch_009.h5", [40, 7])
    with pytest.raises(InputError, match="run 7 is also in .*batch_000.h5"):
        list_sources([batches[0], other])


def test_effects_are_refused(tmp_path):
    def switch_on(number, run):
        run.scene = scene_of(number, effects={"strain_softening": 0.5})

    batch = write_batch(tmp_path / "batch_000.h5", range(3), alter=switch_on)
    with pytest.raises(InputError, match="strain_softening is on"):
        pack_into(tmp_path / "out", [batch])


def test_nothing_left_and_nothing_that_moves(tmp_path):
    def fail(number, run):
        run.status, run.reason = "failed", "why not"

    def rest(number, run):
        run.positions[:] = run.positions[0]
        run.scene = run.scene.changed(
            zones=[{**zone.model_dump(), "initial_velocity": (0, 0)} for zone in run.scene.zones]
        )

    failed = write_batch(tmp_path / "failed.h5", range(3), alter=fail)
    with pytest.raises(InputError, match="no run is left to pack; 3 failed"):
        pack_into(tmp_path / "out", [failed])
    still = write_batch(tmp_path / "still.h5", range(3), alter=rest)
    with pytest.raises(WorkFailed, match="nothing moves"):
        pack_into(tmp_path / "out", [still])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--out", "OUT"], "name trajectory files, or a --scale"),
        (["BATCH"], "--out: say where to"),
        (["BATCH", "--out", "OUT", "--scale", "large"], "of the scale coarse, not of large"),
        (["BATCH", "--out", "OUT", "--scale", "huge"], "scale 'huge' is unknown"),
        (["BATCH", "--out", "OUT", "--properties", "both"], "--properties: is for --format geo"),
        (["BATCH", "--out", "OUT", "--leave-out", "BATCH"], "cannot be read"),
        (["none.h5", "--out", "OUT"], "none.h5: no such file"),
        (
            ["BATCH", "--out", "OUT", "--set", "gns.pack.valid_share=0.95"],
            "leave no run to learn from",
        ),
        (["BATCH", "--out", "OUT", "--set", "gns.pack.sed=1"], "did you mean seed"),
    ],
)
def test_wrong_options_are_one_line(arguments, message, batches, tmp_path):
    names = {"BATCH": str(batches[0]), "OUT": str(tmp_path / "out")}
    with pytest.raises(InputError, match=message) as caught:
        main(["pack", *[names.get(word, word) for word in arguments]])
    assert "\n" not in str(caught.value)


def test_a_list_that_is_no_list(tmp_path):
    (tmp_path / "failed.txt").write_text("3\tbad\nfour\tworse\n")
    with pytest.raises(InputError, match="failed.txt: line 2: 'four' is not the number of a run"):
        read_left_out(tmp_path / "failed.txt")


def test_the_command_says_what_there_is(batches, tmp_path, run_module):
    (tmp_path / "failed.txt").write_text("3\tcoarse_00003, seed 3, at 1 s: bad\n")
    done = run_module(
        "flowslide", "gns", "pack", *batches, "--out", tmp_path / "out",
        "--leave-out", tmp_path / "failed.txt", "--scale", "coarse", "--quiet",
    )  # fmt: skip
    assert done.returncode == 0 and done.stderr == ""
    assert "left out: run 3: coarse_00003, seed 3, at 1 s: bad" in done.stdout
    assert "3 shards written, 0 were there already" in done.stdout
    metadata = read_metadata(tmp_path / "out")
    assert metadata.scale == "coarse" and len(metadata.runs("train")) == 29 - 2 * 3
    for word in ("made", "machine"):
        assert word not in metadata.manifest, "the same input leaves the same bytes"
