"""The three-dimensional solver: return to yield, settling, threads, checkpoints, the plane."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest

from benchmarks.verification.three_dimensions import errors_of_returns, slab_scene, turned_about
from geometry.scenes.scene import Scene
from geometry.terrain.raster import Raster
from mpm_taichi import simulate3d
from mpm_taichi.simulate3d import Flight3d, simulate_3d
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver3d.problem import Problem3d, extruded
from mpm_taichi.trajectory3d import read_run_3d, write_run_3d
from pipeline.cli import InputError
from pipeline.config import SimulationSettings

SHORT = SimulationSettings(duration_s=1.0)
SUDDEN = SimulationSettings(duration_s=1.0, initial_stress="k0")


def slope(**changes: object) -> Problem3d:
    """A small body of clay on ground that slopes across the grid in both directions."""
    scene = Scene.model_validate(slab_scene(spacing=1.0))
    problem = extruded(scene, 6.0, flanks="rough")
    x, y = np.meshgrid(np.arange(0.0, 61.0), np.arange(0.0, 7.0), indexing="ij")
    base = Raster((0.0, 0.0), 1.0, -0.05 * x + 0.02 * y)
    lift = base.at(problem.position[:, 0], problem.position[:, 1])
    position = problem.position + np.stack([0 * lift, 0 * lift, lift], axis=1)
    return replace(problem, base=base, position=position, **changes)


def level_bank(**changes: object) -> Problem3d:
    """The bank of clay on level ground."""
    return replace(extruded(Scene.model_validate(slab_scene(spacing=1.0)), 6.0), **changes)


def test_return_to_yield_equals_enumeration_in_all_regions():
    errors = errors_of_returns(400)
    assert len(errors) >= 9
    assert max(float(np.max(error)) for error in errors.values()) < 1e-5


def test_a_full_turn_about_any_axis_keeps_the_stress():
    assert turned_about(np.array([1.0, 2.0, -0.5]), steps=1000) < 1e-4


@pytest.mark.slow
def test_bits_do_not_depend_on_the_number_of_threads():
    runs = [simulate_3d(slope(), SUDDEN, threads=threads) for threads in (1, 2)]
    assert runs[0].status == "finished"
    assert runs[0].positions.tobytes() == runs[1].positions.tobytes()
    assert runs[0].stress.tobytes() == runs[1].stress.tobytes()


def test_a_killed_run_goes_on_to_the_same_bits(tmp_path, monkeypatch):
    whole = simulate_3d(slope(), SUDDEN, threads=1)
    monkeypatch.setattr(simulate3d, "CHECKPOINT_S", 0.0)
    path = tmp_path / "run.npz"

    def kill(time: float, kinetic: float) -> None:
        if time > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_3d(slope(), SUDDEN, threads=1, checkpoint=path, on_frame=kill)
    assert path.is_file()
    resumed = []
    again = simulate_3d(
        slope(), SUDDEN, threads=1, checkpoint=path, on_frame=lambda t, _: resumed.append(t)
    )
    assert min(resumed) > 0.4
    assert again.positions.tobytes() == whole.positions.tobytes()
    assert again.steps == whole.steps
    assert not path.exists()


def test_a_checkpoint_of_another_run_is_not_used(tmp_path):
    path = tmp_path / "run.npz"
    start("cpu", 1)
    other = Flight3d(slope(), SUDDEN)
    other.resume(path)
    other.settle()
    other.frame()
    other.save(path)
    flight = Flight3d(slope(flanks="no_slip"), SUDDEN)
    flight.resume(path)
    assert not flight.energies


def test_strong_soil_settles_and_stays():
    scene = slab_scene(spacing=1.0)
    scene["materials"]["soil"]["cohesion_kpa"] = 500
    problem = extruded(Scene.model_validate(scene), 6.0)
    run = simulate_3d(problem, SHORT, threads=1)
    assert run.audit["settle_unbalanced"] < 1e-4
    assert np.abs(run.positions[-1] - run.positions[0]).max() < 0.01


def test_strong_soil_settles_on_ground_that_crosses_the_cells_and_stays():
    strong = slope().materials[0].model_copy(update={"cohesion_kpa": 500.0})
    run = simulate_3d(slope(materials=(strong,)), SHORT, threads=1)
    assert run.audit["settle_unbalanced"] < 1e-4
    # The walls hold both ways while the stress settles, and let go afterwards.
    assert np.abs(run.positions[-1] - run.positions[0]).max() < 0.05


def test_flanks_hold_soil_back():
    runs = {
        flanks: simulate_3d(level_bank(flanks=flanks), SHORT, threads=1)
        for flanks in ("smooth", "rough", "no_slip")
    }
    toes = {flanks: float(run.positions[-1, :, 0].max()) for flanks, run in runs.items()}
    assert toes["smooth"] > toes["rough"] > toes["no_slip"] - 0.05


def test_water_carries_and_its_slope_pushes():
    dry = simulate_3d(level_bank(), SHORT, threads=1)
    wet = simulate_3d(level_bank(water=Raster.level(20.0)), SHORT, threads=1)
    carried = wet.initial_stress[:, 2].min() / dry.initial_stress[:, 2].min()
    assert carried == pytest.approx(1.0 - 1000.0 / 1800.0, abs=0.03)
    tilted = Raster((0.0, 0.0), 60.0, np.array([[45.0], [15.0]]))
    with pytest.raises(InputError, match="water_face"):
        simulate_3d(level_bank(water=tilted), SHORT, threads=1)
    still = SHORT.model_copy(update={"water_face": "fixed"})
    pushed = simulate_3d(level_bank(water=tilted), still, threads=1)
    reach = [float(run.positions[-1, :, 0].mean()) for run in (wet, pushed)]
    assert reach[1] > reach[0] + 0.05


def test_guards_stop_a_run_that_cannot_be_right():
    hot = SimulationSettings(duration_s=1.0, time_step_s=0.08, initial_stress="k0")
    run = simulate_3d(slope(), hot, threads=1)
    assert run.status == "failed"
    assert run.reason
    assert np.isfinite(run.positions).all()


def test_a_run_is_read_back_as_it_was_written(tmp_path):
    run = simulate_3d(slope(), SimulationSettings(duration_s=0.3, initial_stress="k0"), threads=1)
    write_run_3d(tmp_path / "run.h5", run)
    back = read_run_3d(tmp_path / "run.h5")
    assert back.positions.tobytes() == run.positions.tobytes()
    assert back.energy.keys() == run.energy.keys()
    assert back.audit == run.audit
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["dimensions"] == 3
    with pytest.raises(InputError, match="not a three-dimensional run"):
        read_run_3d(tmp_path / "none.h5")


@pytest.mark.parametrize(
    ("changes", "word"),
    [({"transfer": "apic"}, "transfer"), ({"local_damping": 0.1}, "local_damping")],
)
def test_settings_that_three_dimensions_lack_are_refused(changes, word):
    with pytest.raises(InputError, match=word):
        simulate_3d(slope(), SimulationSettings(**changes), threads=1)


def test_points_outside_the_domain_are_refused():
    with pytest.raises(InputError, match="outside the domain"):
        simulate_3d(slope(domain=(0.0, 10.0, 0.0, 6.0, 15.0)), SHORT, threads=1)
