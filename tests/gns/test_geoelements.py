"""The layout of the public codes, read as those codes read it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gns.data.dataset import Windows
from gns.data.geoelements import ground_points, write_geoelements
from gns.data.metadata import read_metadata
from gns.data.pack import plan_packing
from gns.data.scene_facts import start_of
from pipeline.cli import InputError
from pipeline.config import PackSettings, SimulationSettings
from tests.commands import gns as main
from tests.gns.conftest import SETTINGS
from tests.gns.runs import write_batch
from tests.mpm_taichi.ballistic import make_scene


def load_as_they_do(path: Path):
    """What their `load_npz_data` does: the array under `gns_data`, else one item for each key."""
    with np.load(path, allow_pickle=True) as file:
        assert file.files == ["gns_data"]
        return file["gns_data"]


def sample_as_they_do(data, trajectory: int, time: int, length: int = 6):
    """One training sample as their data set makes it of the first `length` frames before `time`."""
    positions = data[trajectory][0][time - length : time]
    positions = np.transpose(positions, (1, 0, 2))
    types = np.full(positions.shape[0], data[trajectory][1], dtype=int)
    properties = np.full(positions.shape[0], data[trajectory][2], dtype=float)
    return positions, types, properties, data[trajectory][0][time]


@pytest.fixture(scope="module")
def written(batches, tmp_path_factory) -> dict[str, Path]:
    folders = {}
    for properties in ("both", "friction"):
        folders[properties] = tmp_path_factory.mktemp(properties)
        write_geoelements(
            plan_packing(batches, SETTINGS), folders[properties], properties=properties
        )
    return folders


def test_the_exact_layout(written, packed):
    folder = written["both"]
    assert sorted(path.name for path in folder.iterdir()) == [
        "metadata.json", "test.npz", "train.npz", "valid.npz",
    ]  # fmt: skip
    for split in ("train", "valid", "test"):
        windows = Windows(packed, split)
        data = load_as_they_do(folder / f"{split}.npz")
        assert data.dtype == object and data.shape == windows.runs.shape
        for entry, run in zip(data, windows.runs, strict=True):
            assert type(entry) is tuple and len(entry) == 3
            positions, types, properties = entry
            assert (positions.dtype, types.dtype, properties.dtype) == (
                np.float32, np.int32, np.float32,
            )  # fmt: skip
            frames, points, _ = windows.positions(run).shape
            assert positions.shape == (frames, len(types), 2)
            assert properties.shape == (len(types), 2)
            facts = windows.facts(run)
            np.testing.assert_array_equal(positions[:, :points], windows.positions(run))
            assert set(types[:points]) == {6} and set(types[points:]) == {3}
            np.testing.assert_array_equal(properties[:points, 0], facts.properties[:, 0])
            np.testing.assert_allclose(
                properties[:points, 1], facts.properties[:, 1] / 100e3, rtol=1e-6
            )
            assert np.ptp(positions[:, points:], axis=0).max() == 0.0, "the ground rests"


def test_the_metadata(written, packed):
    document = json.loads((written["both"] / "metadata.json").read_text())
    assert set(document) == {
        "bounds", "sequence_length", "default_connectivity_radius", "dim", "dt",
        "vel_mean", "vel_std", "acc_mean", "acc_std",
    }  # fmt: skip
    assert document["dim"] == 2
    assert document["default_connectivity_radius"] == pytest.approx(1.5 * 4.0)
    metadata = read_metadata(packed)
    assert document["dt"] == pytest.approx(metadata.frame_time_s)
    windows = [Windows(packed, split) for split in ("train", "valid", "test")]
    assert document["sequence_length"] == min(one.frames.min() for one in windows)
    (left, right), (low, high) = document["bounds"]
    assert left <= 0 and right >= 60 and low <= 2.0 and high >= 30
    # Per frame and frame^2, of the moving points of the training runs.
    step = 2.0 * metadata.frame_interval
    found = metadata.statistics
    np.testing.assert_allclose(document["vel_std"], np.multiply(found.velocity_std, step))
    np.testing.assert_allclose(
        document["acc_std"], np.multiply(found.acceleration_std, step * metadata.frame_interval)
    )
    np.testing.assert_allclose(document["vel_mean"], np.multiply(found.velocity_mean, step))
    run = windows[0].positions(windows[0].runs[0]).astype(float)
    fastest = np.abs(np.diff(run, axis=0)).max()
    assert 0.1 < document["vel_std"][0] / fastest < 1.0, "metres a frame, not a second"


def test_the_published_reader_takes_friction_alone(written):
    data = load_as_they_do(written["friction"] / "train.npz")
    positions, types, properties, target = sample_as_they_do(data, 0, 6)
    assert positions.shape == (len(types), 6, 2) and target.shape == (len(types), 2)
    assert set(types) == {3, 6}
    expected = [0.0, np.tan(np.radians(20))]
    np.testing.assert_allclose(np.unique(properties), expected, rtol=1e-6)
    with pytest.raises(ValueError, match="broadcast"):
        sample_as_they_do(load_as_they_do(written["both"] / "train.npz"), 0, 6)


def test_kinematic_points_are_stationary_ones(tmp_path):
    def fix(number, run):
        zones = run.scene.model_dump()["zones"]
        zones[0]["kinematic"] = True
        run.scene = run.scene.changed(zones=zones)
        run.kinematic = run.zone == 0

    batch = write_batch(tmp_path / "batch_000.h5", range(3), alter=fix)
    write_geoelements(plan_packing([batch], PackSettings()), tmp_path / "out")
    for positions, types, _ in load_as_they_do(tmp_path / "out" / "train.npz"):
        own = types[: np.flatnonzero(types == 6)[-1] + 1]
        assert set(own) == {3, 6}
        moved = np.hypot(*(positions[-1] - positions[0]).T) > 0
        assert not np.any(moved & (types == 3))


def test_the_ground_in_points():
    ground = {"points": [[0, 2], [29, 2], [39, 9], [60, 9]]}
    facts, _ = start_of(make_scene(spacing=0.5).changed(ground=ground), SimulationSettings())
    points = ground_points(facts).astype(float)
    gaps = np.hypot(*np.diff(points, axis=0).T)
    assert gaps.min() > 0.45 and gaps.max() < 0.55, "one spacing apart, on slopes too"
    np.testing.assert_allclose(points[:, 1], facts.ground_height(points[:, 0]) - 0.25, atol=1e-5)
    assert points[0, 0] < 0.5 and points[-1, 0] > 59.5


def test_one_run_in_memory_at_a_time(batches, tmp_path, monkeypatch):
    """Every run is read, written and let go before the next: nothing holds on to it."""
    import weakref

    from gns.data import geoelements

    alive: list[weakref.ref] = []
    most = 0

    def watched(positions, facts, properties="both"):
        nonlocal most
        values = as_tuple(positions, facts, properties)
        alive.append(weakref.ref(values[0]))
        most = max(most, sum(one() is not None for one in alive))
        return values

    as_tuple = geoelements.as_tuple
    monkeypatch.setattr(geoelements, "as_tuple", watched)
    write_geoelements(plan_packing(batches, SETTINGS), tmp_path)
    assert len(alive) == 30 and most <= 2


def test_the_same_input_leaves_the_same_bytes(batches, tmp_path, written):
    command = ["pack", *map(str, batches), "--out", str(tmp_path), "--format", "geoelements"]
    settings = [f"gns.pack.{name}={value}" for name, value in SETTINGS.model_dump().items()]
    main([*command, *[part for one in settings for part in ("--set", one)], "--quiet"])
    for path in tmp_path.iterdir():
        assert path.read_bytes() == (written["both"] / path.name).read_bytes()


def test_our_own_data_are_not_written_over(packed, batches):
    with pytest.raises(InputError, match="--format geoelements needs another --out"):
        write_geoelements(plan_packing(batches, SETTINGS), packed)


def test_our_own_reader_runs_no_pickle(packed):
    """Reading packed data never unpickles, whatever the shard holds."""
    script = (
        "import pickle, sys\n"
        "def refuse(*a, **k): raise SystemExit('unpickled')\n"
        "pickle.load = pickle.loads = pickle.Unpickler = refuse\n"
        "import numpy.lib.format, numpy.lib._npyio_impl\n"
        "from gns.data.dataset import Windows\n"
        "w = Windows(sys.argv[1], 'train')\n"
        "[w[i] for i in range(0, len(w), 50)]; w.scene(int(w.runs[0])); print(len(w))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(packed)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and int(done.stdout) > 50, done.stderr
