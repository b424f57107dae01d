"""The solver as a factory: same bits in any company, guards that name what went wrong, kill -9."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from flowslide.command_line import main
from geometry.random_scenes.templates import draw_scene
from geometry.scenes.scene import Scene, save_scene, scene_from_mapping
from mpm_taichi.batch import parts_folder, run_batch
from mpm_taichi.simulate import simulate
from mpm_taichi.trajectory import Run, list_runs, read_run
from pipeline.config import SimulationSettings, load_config

ROOT = Path(__file__).resolve().parents[2]
CONFIG = load_config(None)
SHORT = CONFIG.simulation_for("coarse").model_copy(update={"duration_s": 1.5})


def drawn(*indices: int) -> list[Scene]:
    return [draw_scene(CONFIG, "coarse", index) for index in indices]


def bits(run: Run) -> dict[str, bytes]:
    """Every number of a run."""
    arrays = {
        name: getattr(run, name)
        for name in (
            "positions", "time", "velocity", "stress", "initial_stress", "plastic_shear_strain",
            "volume",
        )
    }  # fmt: skip
    arrays |= {f"energy {name}": values for name, values in run.energy.items()}
    found = {name: np.ascontiguousarray(values).tobytes() for name, values in arrays.items()}
    audit = {name: value for name, value in sorted(run.audit.items())}
    return found | {"audit": repr((audit, run.steps, run.status)).encode()}


# --- the same bits ---


@pytest.fixture(scope="module")
def alone() -> dict[int, dict[str, bytes]]:
    """Three scenes (embankment, dam, thrown blocks), each alone on one thread."""
    return {
        index: bits(simulate([scene], SHORT, threads=1)[0])
        for index, scene in zip(CHOSEN, drawn(*CHOSEN), strict=True)
    }


CHOSEN = (3, 7, 12)


def test_the_chosen_scenes_differ_in_kind(alone):
    templates = {scene.origin.template for scene in drawn(*CHOSEN)}
    assert len(templates) == 3
    assert len({content["positions"] for content in alone.values()}) == 3


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_of_3_has_the_bits_of_single_runs(alone, threads):
    runs = simulate(drawn(*CHOSEN), SHORT, threads=threads)
    for index, run in zip(CHOSEN, runs, strict=True):
        assert bits(run) == alone[index], f"scene {index} on {threads} threads"


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.slow
def test_a_batch_of_16_has_the_bits_of_single_runs(alone, threads):
    """More scenes than slots, of different sizes: arrays grow and slots change hands."""
    runs = simulate(drawn(*range(16)), SHORT, threads=threads)
    assert len({run.points for run in runs}) > 8
    for index in CHOSEN:
        assert bits(runs[index]) == alone[index], f"scene {index} on {threads} threads"


@pytest.mark.slow
def test_order_and_company_do_not_matter(alone):
    runs = simulate(drawn(12, 5, 3, 7), SHORT, threads=1)
    assert [bits(runs[place]) for place in (2, 3, 0)] == [alone[index] for index in CHOSEN]


# --- guards ---


def block(name: str, *, velocity=(0.0, 0.0), base=2.0, youngs_modulus_mpa=30.0, **domain) -> Scene:
    """A block of 20 m x 10 m, resting or thrown."""
    return scene_from_mapping(
        {
            "name": name,
            "domain": {"x_min": 0, "x_max": 60, "y_max": 30, **domain},
            "ground": {"points": [[0, 2], [60, 2]]},
            "zones": [
                {
                    "name": "a",
                    "material": "soil",
                    "polygon": [[20, base], [40, base], [40, base + 10], [20, base + 10]],
                    "initial_velocity": list(velocity),
                }
            ],
            "materials": {
                "soil": {
                    "friction_deg": 20,
                    "cohesion_kpa": 1,
                    "youngs_modulus_mpa": youngs_modulus_mpa,
                }
            },
            "spacing": 2.0,
            "seed": 7,
        }
    )


# A fixed step that suits ordinary soil (courant 0.75), so that one scene can be too stiff for it.
FIXED = SimulationSettings(duration_s=2.0, time_step_s=0.02)
GOOD = (0, 5)
BAD = {
    1: (block("numbers", velocity=(1e19, 0), base=4.0), "a position or an energy is not a number"),
    2: (
        block("flight", velocity=(0, 60), base=4.0, walls="open"),
        "left the domain: a point at y",
    ),
    3: (block("stiff", youngs_modulus_mpa=1e6), "energy balance: .* % of the released energy out"),
    4: (
        block("shot", velocity=(0, 1e3), base=4.0),
        "a point moved more than a cell in one time step",
    ),
}


@pytest.fixture(scope="module")
def mixed() -> dict[int, Scene]:
    """Good scenes among scenes that cannot end well."""
    good = {index: block(f"good_{index}") for index in GOOD}
    return dict(sorted((good | {index: scene for index, (scene, _) in BAD.items()}).items()))


@pytest.mark.slow
def test_guards_stop_what_cannot_be_right_and_nothing_else(mixed):
    runs = dict(zip(mixed, simulate(list(mixed.values()), FIXED, threads=2), strict=True))
    (good,) = simulate([block("good_0")], FIXED, threads=1)
    for index in GOOD:
        assert runs[index].status == "finished" and runs[index].reason == ""
        assert np.array_equal(runs[index].positions, good.positions), "a neighbour's end shows"
    for index, (scene, reason) in BAD.items():
        run = runs[index]
        assert run.failed, scene.name
        assert re.search(reason, run.reason), run.reason
        assert 0.0 < run.end_time_s < 2.0
        assert np.isfinite(run.positions).all(), "only frames that were right are kept"
        assert run.frames < good.frames


def test_a_batch_records_its_failures_and_goes_on(mixed, tmp_path, capsys):
    for index, scene in mixed.items():
        save_scene(scene, tmp_path / f"{index}.json")
    files = [str(tmp_path / f"{index}.json") for index in mixed]
    settings = ["--set", "simulation.duration_s=2.0", "--set", "simulation.time_step_s=0.02"]
    code = main(
        [
            "scenes",
            "simulate",
            *files,
            "--out",
            str(tmp_path),
            "--threads",
            "1",
            "--quiet",
            *settings,
        ]
    )
    assert not code, "failed runs are a result, not an error"
    errors = capsys.readouterr().err
    listed = {run.index: run for run in list_runs(tmp_path / "runs.h5")}
    assert list(listed) == list(mixed)
    for index, (scene, _) in BAD.items():
        assert listed[index].status == "failed" and listed[index].reason
        line = f"failed: run {index} ({scene.name}, seed 7) at {listed[index].duration_s:.3g} s: "
        assert line + listed[index].reason in errors
        assert read_run(tmp_path / "runs.h5", index).reason == listed[index].reason
    assert [run.status for run in listed.values()].count("finished") == len(GOOD)
    main(["runs", "status", str(tmp_path / "runs.h5")])
    assert "6 runs, 4 failed" in capsys.readouterr().out


def test_too_large_a_time_step_is_seen_by_the_energy():
    settings = SimulationSettings(duration_s=2.0, time_step_s=0.2)
    (run,) = simulate([block("block")], settings, threads=1)
    assert run.failed and "energy balance" in run.reason


def test_soil_that_reaches_a_wall_is_no_failure():
    scene = block("wall", velocity=(15.0, 2.0), base=4.0, x_max=45)
    (run,) = simulate([scene], SimulationSettings(duration_s=2.0), threads=1)
    assert run.status == "finished"
    assert 0.0 < run.wall_contact["right"] < 2.0 and "left" not in run.wall_contact
    assert run.positions[..., 0].max() < 45.0 + scene.spacing


# --- kill -9 ---

JOB = ["--scale", "coarse", "--batch", "0", "--threads", "1", "--group", "1", "--quiet"]
SETTINGS = {
    "scales.coarse.runs_per_batch": 5,
    "scales.coarse.duration_s": 6.0,
}


def start_job(folder: Path) -> subprocess.Popen:
    settings = [part for key, value in SETTINGS.items() for part in ("--set", f"{key}={value}")]
    return subprocess.Popen(
        [
            sys.executable,
            "-m",
            "flowslide",
            "scenes",
            "simulate",
            *JOB,
            *settings,
            "--out",
            str(folder),
        ],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def data_of(path: Path) -> dict[str, object]:
    """All data of a file as stored, and all attributes but the wall time."""
    found: dict[str, object] = {}

    def collect(name: str, item: h5py.Group | h5py.Dataset) -> None:
        found[name] = {key: value for key, value in item.attrs.items() if key != "wall_time_s"}
        if isinstance(item, h5py.Dataset):
            offsets = [item.id.get_chunk_info(i).chunk_offset for i in range(chunks_of(item))]
            found[f"{name} data"] = [item.id.read_direct_chunk(at) for at in offsets]

    with h5py.File(path, "r") as file:
        file.visititems(collect)
    return found


def chunks_of(dataset: h5py.Dataset) -> int:
    return dataset.id.get_num_chunks()


@pytest.mark.slow
def test_kill_9_and_a_new_start_give_the_bytes_of_an_uninterrupted_job(tmp_path):
    killed = tmp_path / "killed" / "batch_000.h5"
    job = start_job(killed.parent)
    deadline = time.monotonic() + 60
    while not list(parts_folder(killed).glob("run_*.h5")):
        assert job.poll() is None and time.monotonic() < deadline, job.stderr.read()
        time.sleep(0.005)
    job.send_signal(signal.SIGKILL)
    job.communicate(timeout=20)
    kept = list(parts_folder(killed).glob("run_*.h5"))
    assert not killed.exists() and 1 <= len(kept) < 5

    again = start_job(killed.parent)
    _, complaint = again.communicate(timeout=60)
    assert again.returncode == 0, complaint
    assert os.listdir(killed.parent) == ["batch_000.h5"]

    config = load_config(None, [f"{key}={value}" for key, value in SETTINGS.items()])
    scenes = {index: draw_scene(config, "coarse", index) for index in range(5)}
    whole = tmp_path / "whole.h5"
    run_batch(scenes, config.simulation_for("coarse"), whole, threads=2)
    assert data_of(killed) == data_of(whole)
