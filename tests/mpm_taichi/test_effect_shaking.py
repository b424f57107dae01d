"""Shaking: a block on shaken ground against Newmark's, and the work in the energy account."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings

GRAVITY = 9.81


def block(entry, friction=0.2):
    return scene_from_mapping(
        {
            "name": "block",
            "domain": {
                "x_min": 0,
                "x_max": 60,
                "y_max": 20,
                "walls": "open",
                "left": "free",
                "right": "free",
            },
            "ground": {
                "points": [[0, 0], [60, 0]],
                "contact": "coulomb",
                "friction_coefficient": friction,
            },
            "zones": [
                {"name": "a", "material": "rock", "polygon": [[20, 0], [36, 0], [36, 4], [20, 4]]}
            ],
            "materials": {
                "rock": {"friction_deg": 0, "cohesion_kpa": 5000, "youngs_modulus_mpa": 300}
            },
            "spacing": 1.0,
            "effects": {"shaking": entry},
        }
    )


def ground_acceleration(time, amplitude, frequency_hz, start_s, duration_s):
    since = time - start_s
    pulse = np.sin(np.pi * since / duration_s) ** 2
    pulse = pulse * np.cos(2 * np.pi * frequency_hz * (since - 0.5 * duration_s))
    return np.where((since > 0) & (since < duration_s), amplitude * GRAVITY * pulse, 0.0)


def newmark(times, friction, **entry):
    """Displacement of a rigid block relative to the ground at `times` [m], in steps of 0.1 ms."""
    dt, limit = 1e-4, friction * GRAVITY
    steps = np.arange(0.0, times[-1] + dt, dt)
    push = -ground_acceleration(steps, **entry)
    way, speed, places = 0.0, 0.0, []
    for acceleration in push:
        places.append(way)
        moved = speed + dt * acceleration
        speed = np.sign(moved) * max(abs(moved) - dt * limit, 0.0)
        way += dt * speed
    return np.interp(times, steps, places)


@pytest.mark.parametrize(
    ("amplitude", "frequency_hz", "start_s"), [(0.5, 0.5, 0.0), (-0.5, 0.5, 0.5), (0.8, 1.0, 0.0)]
)
def test_a_block_slides_as_newmarks(amplitude, frequency_hz, start_s):
    entry = {"amplitude": amplitude, "frequency_hz": frequency_hz, "start_s": start_s,
             "duration_s": 4.0}  # fmt: skip
    settings = SimulationSettings(duration_s=6.0, early_stop=False)
    (run,) = simulate([block(entry)], settings, threads=1)
    way = (run.positions[:, :, 0].astype(float) - run.positions[0, :, 0]).mean(axis=1)
    expected = newmark(run.time, 0.2, **entry)
    assert np.abs(expected).max() > 0.02
    assert np.abs(way - expected).max() < 0.05 * np.abs(expected).max()


def test_below_the_friction_nothing_slides():
    entry = {"amplitude": 0.15, "frequency_hz": 0.5, "duration_s": 4.0}
    (run,) = simulate([block(entry)], SimulationSettings(duration_s=5.0), threads=1)
    way = (run.positions[-1, :, 0].astype(float) - run.positions[0, :, 0]).mean()
    assert abs(way) < 0.002


def test_work_of_the_shaking_is_what_friction_takes():
    entry = {"amplitude": 0.5, "frequency_hz": 0.5, "duration_s": 4.0}
    (run,) = simulate([block(entry)], SimulationSettings(duration_s=6.0), threads=1)
    given, taken = run.energy["effect_work"][-1], run.energy["contact_loss"][-1]
    assert given > 1e4
    assert taken == pytest.approx(given, rel=0.05)
    assert abs(run.audit["numerical_share"]) < 0.05


def test_a_run_does_not_end_before_the_shaking():
    late = {"amplitude": 0.5, "frequency_hz": 0.5, "start_s": 4.0, "duration_s": 4.0}
    (run,) = simulate([block(late)], SimulationSettings(duration_s=30.0), threads=1)
    assert 8.0 < run.time[-1] < 15.0
    assert np.abs(run.positions[-1] - run.positions[0]).max() > 0.1


def test_the_ground_ends_at_rest_where_it_was():
    time = np.linspace(0.0, 10.0, 200_001)
    push = ground_acceleration(time, 0.2, 1.0, 0.0, 10.0)
    speed = np.cumsum(push) * (time[1] - time[0])
    way = np.cumsum(speed) * (time[1] - time[0])
    assert abs(speed[-1]) < 1e-4 * np.abs(speed).max()
    assert abs(way[-1]) < 1e-3 * np.abs(way).max()
    assert push[100_000] == pytest.approx(0.2 * GRAVITY)
