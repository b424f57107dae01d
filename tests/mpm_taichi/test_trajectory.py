from __future__ import annotations

import hashlib
import time
from dataclasses import replace

import h5py
import numpy as np
import pytest

from mpm_taichi import PHYSICS_VERSION
from mpm_taichi.trajectory import (
    FIELDS,
    POINT_FIELDS,
    Run,
    list_runs,
    outward_travel,
    read_run,
    write_run,
    write_runs,
)
from pipeline.cli import InputError
from tests.mpm_taichi.ballistic import FAST, fly, make_scene


@pytest.fixture
def run() -> Run:
    return fly(make_scene(1), FAST)


@pytest.fixture
def path(tmp_path, run):
    path = tmp_path / "batch_000.h5"
    write_runs(path, {4: run, 7: fly(make_scene(2), FAST)})
    return path


def dataset_bytes(path) -> dict[str, str]:
    """Stored (compressed) bytes of every dataset."""
    found = {}

    def collect(name, item):
        if isinstance(item, h5py.Dataset):
            chunks = [
                item.id.read_direct_chunk(item.id.get_chunk_info(i).chunk_offset)[1]
                for i in range(item.id.get_num_chunks())
            ]
            found[name] = hashlib.sha256(b"".join(chunks)).hexdigest()

    with h5py.File(path, "r") as file:
        file.visititems(collect)
    return found


def test_a_run_comes_back_as_it_was(path, run):
    back = read_run(path, 4)
    assert back.scene == run.scene
    assert back.settings == run.settings
    for name in ("positions", "time", *POINT_FIELDS):
        ours, theirs = getattr(run, name), getattr(back, name)
        assert theirs.dtype == ours.dtype and np.array_equal(ours, theirs), name
    assert back.energy.keys() == run.energy.keys()
    assert np.array_equal(back.energy["kinetic"], run.energy["kinetic"])
    assert (back.audit, back.wall_contact, back.steps) == (run.audit, run.wall_contact, run.steps)
    assert (back.status, back.wall_time_s) == ("finished", run.wall_time_s)


def test_points_of_earlier_files_have_the_volume_of_a_square(path, run):
    with h5py.File(path, "r+") as file:
        group = file["run_00004"]
        del group["initial_volume"]
        group.attrs["format_version"] = 1
    back = read_run(path, 4)
    assert back.initial_volume == pytest.approx(np.full(run.points, run.scene.spacing**2))


def test_a_run_cut_off_at_the_frame_nearest_to_its_duration_is_not_at_rest(run):
    frame_time = run.time[1] - run.time[0]
    for share, at_rest in ((-0.49, False), (0.0, False), (0.49, False), (1.0, True), (7.0, True)):
        settings = run.settings.model_copy(
            update={"duration_s": float(run.time[-1] + share * frame_time)}
        )
        assert replace(run, settings=settings).came_to_rest == at_rest
    assert not replace(run, settings=settings, status="failed").came_to_rest


def test_the_layout_is_the_documented_one(path, run):
    with h5py.File(path) as file:
        assert list(file) == ["run_00004", "run_00007"]
        group = file["run_00004"]
        assert group["positions"].shape == (run.frames, run.points, 2)
        assert group["positions"].dtype == np.float32
        assert group["positions"].compression == "gzip" and group["positions"].shuffle
        assert group["time"].dtype == np.float64
        assert group["kinematic"].dtype == bool
        assert group.attrs["physics_version"] == PHYSICS_VERSION
        assert group.attrs["code_version"]


def test_single_fields_can_be_read(path, run):
    back = read_run(path, 4, fields=["positions", "material"])
    assert np.array_equal(back.positions, run.positions)
    assert np.array_equal(back.material, run.material)
    assert back.stress.shape == (0, 4) and back.energy == {}
    with pytest.raises(InputError, match="'position' is unknown; allowed: positions, time"):
        read_run(path, 4, fields=["position"])


def test_the_list_needs_no_array_and_describes_each_run(path, run):
    first, second = list_runs(path)
    assert (first.index, second.index) == (4, 7)
    assert (first.scene, first.seed, first.status) == ("block_1", 1, "finished")
    assert (first.points, first.frames, first.steps) == (run.points, run.frames, 1000)
    assert first.wall_contact == "right" and second.wall_contact == ""
    assert first.point_steps_per_s == pytest.approx(run.points * 1000 / 0.01)
    assert first.duration_s == run.time[-1]
    assert second.travel_right_m > 0


def test_travel_is_not_decided_by_one_point():
    first = np.stack([np.linspace(0, 100, 1001), np.zeros(1001)], axis=1)
    last = first + [2.0, 0.0]
    last[-1] += 500.0
    left, right = outward_travel(first, last)
    assert left == pytest.approx(-2.0, abs=0.1)
    assert right == pytest.approx(2.0, abs=0.2)


def test_data_bytes_do_not_depend_on_the_clock(tmp_path, run):
    write_runs(tmp_path / "one.h5", {0: run})
    time.sleep(1.1)  # HDF5 would store times in whole seconds
    run.wall_time_s = 99.0
    write_runs(tmp_path / "two.h5", {0: run})
    one = dataset_bytes(tmp_path / "one.h5")
    assert one and one == dataset_bytes(tmp_path / "two.h5")


def test_a_run_without_frames_is_kept(tmp_path):
    empty = Run.empty(make_scene(3), FAST, reason="the solver raised ValueError")
    write_runs(tmp_path / "x.h5", {0: empty})
    back = read_run(tmp_path / "x.h5", 0)
    assert (back.status, back.reason, back.frames) == ("failed", empty.reason, 0)
    assert list_runs(tmp_path / "x.h5")[0].points == 0


def test_a_run_with_nan_is_kept(tmp_path, run):
    run.positions[-1] = np.nan
    run.audit["energy_error"] = float("nan")
    write_runs(tmp_path / "x.h5", {0: run})
    assert list_runs(tmp_path / "x.h5")[0].travel_right_m == 0.0
    assert np.isnan(read_run(tmp_path / "x.h5", 0).audit["energy_error"])


def test_a_scene_of_more_than_64_kb_fits_into_the_attributes(tmp_path, run):
    run.scene = run.scene.changed(description="survey " * 30_000)
    write_runs(tmp_path / "x.h5", {0: run})
    assert read_run(tmp_path / "x.h5", 0).scene == run.scene


def test_contradicting_arrays_are_refused(tmp_path, run):
    run.stress = run.stress[:-1]
    with (
        pytest.raises(ValueError, match=r"run.stress has shape"),
        h5py.File(tmp_path / "x.h5", "w") as file,
    ):
        write_run(file, 0, run)


def test_errors_are_one_line(path, tmp_path):
    with pytest.raises(InputError, match="no run 5; it holds 2 runs, 4 to 7"):
        read_run(path, 5)
    with pytest.raises(InputError, match="no such file"):
        list_runs(tmp_path / "missing.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["something"] = 1
    with pytest.raises(InputError, match="holds no run_NNNNN group"):
        list_runs(tmp_path / "other.h5")


def test_any_cut_gives_an_input_error(path, tmp_path):
    whole = path.read_bytes()
    damaged = tmp_path / "damaged.h5"
    for share in (0.0, 0.001, 0.1, 0.5, 0.9, 0.999):
        damaged.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError) as caught:
            read_run(damaged, 7)
        assert "\n" not in str(caught.value) and "damaged.h5" in str(caught.value)


def test_a_flipped_byte_in_the_data_is_noticed(path, tmp_path):
    with h5py.File(path) as file:
        chunk = file["run_00007/positions"].id.get_chunk_info(0)
    data = bytearray(path.read_bytes())
    data[chunk.byte_offset + chunk.size // 2] ^= 0xFF
    (tmp_path / "flipped.h5").write_bytes(data)
    with pytest.raises(InputError, match="cannot be read, damaged"):
        read_run(tmp_path / "flipped.h5", 7)


@pytest.mark.parametrize(
    ("name", "change", "complaint"),
    [
        ("positions", lambda a: a[:-1], r"positions: float32 \(.*the run says numbers"),
        ("positions", lambda a: a[:, :, 0], "positions: float32"),
        ("positions", lambda a: a.astype("S9"), r"positions: \|S9"),
        ("time", lambda a: a[:-1], "time: float64"),
        ("stress", lambda a: a[:, :3], "stress: float32"),
        ("zone", lambda a: a[:-1], "zone: int32"),
        ("zone", lambda a: a + 7, "zone: 7 to 8; its scene has 0 to 1"),
        ("energy/kinetic", lambda a: a[:-1], "energy/kinetic: float64"),
        ("energy", lambda a: np.zeros(3), "cannot be read, damaged"),
    ],
)
def test_arrays_of_another_size_are_reported(path, name, change, complaint):
    with h5py.File(path, "r+") as file:
        group = file["run_00007"]
        values = change(group[name][...] if name != "energy" else None)
        del group[name]
        group[name] = values
    with pytest.raises(InputError, match=complaint) as caught:
        read_run(path, 7)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    assert read_run(path, 4).frames


def test_every_field_is_listed():
    assert set(FIELDS) == {"positions", "time", "energy", *POINT_FIELDS}
