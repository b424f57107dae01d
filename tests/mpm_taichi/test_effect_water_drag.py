"""Water drag: the fall of a block towards its terminal velocity, and where the pool ends."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.effects.framework.free_water import Pool, pool_of, soil_in_pool
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings

GRAVITY = 9.81
DENSITY = 2000.0


def falling(drag, *, line=None, level=100.0, velocity=(0.0, 0.0), x=10.0):
    """A strong block of 4 m that hangs 60 m above the ground, in a pool."""
    return scene_from_mapping(
        {
            "name": "falling",
            "domain": {"x_min": 0, "x_max": 60, "y_max": 80},
            "ground": {"points": [[0, 0], [60, 0]]},
            "zones": [
                {"name": "a", "material": "s", "initial_velocity": velocity,
                 "polygon": [[x, 60], [x + 4, 60], [x + 4, 64], [x, 64]]}
            ],
            "materials": {"s": {"friction_deg": 0, "cohesion_kpa": 1000, "density": DENSITY}},
            "water_level": level,
            "phreatic_line": line,
            "spacing": 1.0,
            "effects": {"water_drag": drag} if drag else {},
        }
    )  # fmt: skip


SETTINGS = SimulationSettings(duration_s=3.0, early_stop=False)


@pytest.mark.slow
def test_a_block_falls_towards_its_terminal_velocity():
    # L = 16 m2 / 64 m, so C_d = 0.1 is that of a slide with L = 2.5 m and C_d = 1.
    (run,) = simulate([falling(0.1)], SETTINGS, threads=1)
    effective = GRAVITY * (1.0 - 1000.0 / DENSITY)
    terminal = np.sqrt(2.0 * 2.5 * (DENSITY - 1000.0) * GRAVITY / 1000.0)
    fall = terminal**2 / effective * np.log(np.cosh(effective * run.time / terminal))
    way = 62.0 - run.positions[:, :, 1].astype(float).mean(axis=1)
    assert np.abs(way - fall).max() < 0.005 * fall[-1]
    speed = -run.velocity[:, 1].astype(float).mean()
    assert speed == pytest.approx(terminal * np.tanh(effective * run.time[-1] / terminal), rel=0.01)
    assert speed > 0.9 * terminal


def test_drag_turns_with_the_motion():
    (run,) = simulate([falling(0.1, velocity=(6.0, 8.0))], SETTINGS, threads=1)
    (free,) = simulate([falling(None, velocity=(6.0, 8.0))], SETTINGS, threads=1)
    state = np.array([6.0, 8.0])
    place, step = np.array([12.0, 62.0]), 1e-4
    for _ in range(int(run.time[-1] / step)):
        pull = np.array([0.0, -0.5 * GRAVITY])
        state = state + step * (pull - 0.5 / 2.5 * 0.5 * np.hypot(*state) * state)
        place = place + step * state
    assert run.positions[-1].astype(float).mean(axis=0) == pytest.approx(place, abs=0.1)
    assert free.positions[-1, :, 0].mean() > place[0] + 5.0


def test_energy_taken_by_the_water_is_counted():
    (run,) = simulate([falling(0.1)], SETTINGS, threads=1)
    assert run.audit["contact_share"] > 0.3
    assert abs(run.audit["numerical_share"]) < 0.01


def test_dry_soil_and_soil_outside_the_pool_are_not_braked():
    line = [[0, 100], [20, 100], [21, 61], [60, 61]]
    beside = falling(0.1, line=line, x=30.0)
    assert pool_of(beside) == Pool(100.0, -1e9, 20.0)
    assert "no soil stands in the pool" in effect("water_drag").applies(beside)
    assert "no pool" in effect("water_drag").applies(falling(0.1, level=None))
    low = falling(0.1, level=62.0)
    assert soil_in_pool(low, pool_of(low)) == (pytest.approx(8.0), pytest.approx(62.0))
    drained = low.changed(effects={"water_drag": 0.1, "pool_level": -5.0})
    (run,) = simulate([drained], SETTINGS.model_copy(update={"duration_s": 1.0}), threads=1)
    assert run.positions[-1, :, 1].mean() - 62.0 == pytest.approx(
        -0.5 * GRAVITY * run.time[-1] ** 2, rel=0.01
    )
    one, other = simulate(
        [falling(0.1, level=61.0, velocity=(0.0, 30.0)), falling(None, level=61.0,
                                                                velocity=(0.0, 30.0))],
        SETTINGS.model_copy(update={"duration_s": 1.0}), threads=1,
    )  # fmt: skip
    risen = [run.positions[-1, :, 1].astype(float).mean() for run in (one, other)]
    assert risen[1] - risen[0] < 0.05 * (risen[1] - 62.0)


def sliding(drag):
    """A strong block of 8 m x 3 m under water on a smooth slope of 30 degrees."""
    angle = np.radians(30.0)
    along, across = (
        np.array([np.cos(angle), -np.sin(angle)]),
        np.array([np.sin(angle), np.cos(angle)]),
    )
    foot = np.array([10.0, 60.0 - 10.0 * np.tan(angle)])
    corners = [foot + a * along + b * across for a, b in ((0, 0), (8, 0), (8, 3), (0, 3))]
    return scene_from_mapping(
        {
            "name": "sliding",
            "domain": {"x_min": 0, "x_max": 100, "y_max": 80, "walls": "closed"},
            "ground": {"points": [[0, 60], [100, 60 - 100 * np.tan(angle)]]},
            "zones": [{"name": "a", "material": "s", "polygon": [list(p) for p in corners]}],
            "materials": {"s": {"friction_deg": 0, "cohesion_kpa": 2000, "density": DENSITY}},
            "water_level": 75.0,
            "spacing": 0.5,
            "effects": {"weak_base": 1.0, **({"water_drag": drag} if drag else {})},
        }
    )  # fmt: skip


@pytest.mark.slow
def test_a_block_on_a_slope_moves_by_the_law_of_slides_under_water():
    """s = u_t^2 / a_0 ln cosh(a_0 t / u_t), Watts et al. (2003, read in a report of
    Geoscience Australia), but for the added mass."""
    for drag in (0.0, 0.6):
        scene = sliding(drag)
        (run,) = simulate([scene], SimulationSettings(duration_s=5.0, early_stop=False), threads=1)
        place = run.positions.astype(float).mean(axis=1)
        way = np.linalg.norm(place - place[0], axis=1)
        pull = GRAVITY * np.sin(np.radians(30.0)) * (1.0 - 1000.0 / DENSITY)
        expected = 0.5 * pull * run.time**2
        if drag:
            area, height = soil_in_pool(scene, pool_of(scene))
            terminal = np.sqrt(2.0 * area / height * pull * DENSITY / (1000.0 * drag))
            expected = terminal**2 / pull * np.log(np.cosh(pull * run.time / terminal))
            assert pull * run.time[-1] > 2.0 * terminal
        assert np.abs(way - expected).max() < 0.002 * expected[-1]
