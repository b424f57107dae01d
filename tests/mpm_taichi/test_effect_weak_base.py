"""Weak base: sheets and blocks that slide to rest, against the law of friction."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings

SPEED = 8.0


def thrown(effects, *, contact, material, height=1.05):
    """A sheet 40 m long on level ground that starts with 8 m/s to the right."""
    ground = {"points": [[0, 0], [140, 0]], **contact}
    zone = {"name": "a", "material": "soil", "initial_velocity": [SPEED, 0.0],
            "polygon": [[20, 0], [60, 0], [60, height], [20, height]]}  # fmt: skip
    return scene_from_mapping(
        {
            "name": "sheet",
            "domain": {"x_min": 0, "x_max": 140, "y_max": 20, "walls": "open"},
            "ground": ground,
            "zones": [zone],
            "materials": {"soil": {"density": 1800.0, **material}},
            "spacing": 1.0,
            "effects": effects,
        }
    )


def check_braking(scene, braking, tolerance):
    """The way of the middle against v t - b t^2 / 2 until rest."""
    (run,) = simulate([scene], SimulationSettings(duration_s=3.0, early_stop=False), threads=1)
    assert run.status == "finished", run.reason
    way = run.positions[:, :, 0].astype(float).mean(axis=1) - 40.0
    time = np.minimum(run.time, SPEED / braking)
    expected = SPEED * time - 0.5 * braking * time**2
    assert np.abs(way - expected).max() < tolerance * expected[-1]
    shares = [run.audit[name] for name in ("plastic_share", "contact_share", "numerical_share")]
    assert shares[1] > 0.75 or braking < 1.5, shares
    assert -0.01 < shares[2] < 0.1


ROUGH = {"contact": "rough"}


@pytest.mark.parametrize("a", [0.2, 0.8])
def test_sand_brakes_by_what_is_left_of_its_friction(a):
    sand = {"friction_deg": 30, "cohesion_kpa": 0}
    check_braking(thrown({"weak_base": a}, contact=ROUGH, material=sand),
                  (1 - a) * 0.5 * 9.81, 0.02)  # fmt: skip


@pytest.mark.parametrize("a", [0.2, 0.8])
def test_liquefied_soil_brakes_by_what_is_left_of_its_strength(a):
    # One layer of points: (1 - a) S_r over the mass of a square metre.
    soil = {"friction_deg": 0, "cohesion_kpa": 9, "liquefied": True}
    check_braking(thrown({"weak_base": a}, contact=ROUGH, material=soil),
                  (1 - a) * 9000.0 / 1800.0, 0.03)  # fmt: skip


def test_a_block_on_coulomb_ground():
    stiff = {"friction_deg": 0, "cohesion_kpa": 500}
    coulomb = {"contact": "coulomb", "friction_coefficient": 0.5}
    scene = thrown({"weak_base": 0.5}, contact=coulomb, material=stiff, height=4.0)
    check_braking(scene, 0.25 * 9.81, 0.02)


def test_beyond_its_window_the_base_is_as_strong_as_ever():
    sand = {"friction_deg": 30, "cohesion_kpa": 0}
    window = {"weak_base": {"amplitude": 0.5, "x_from_m": -50.0, "x_to_m": 10.0}}
    check_braking(thrown(window, contact=ROUGH, material=sand), 0.5 * 9.81, 0.02)
    within = {"weak_base": {"amplitude": 0.5, "x_from_m": 0.0, "x_to_m": 139.0}}
    check_braking(thrown(within, contact=ROUGH, material=sand), 0.25 * 9.81, 0.02)


def test_a_smooth_base_does_not_brake_at_all():
    soil = {"friction_deg": 0, "cohesion_kpa": 9, "liquefied": True}
    scene = thrown({"weak_base": 1.0}, contact=ROUGH, material=soil)
    (run,) = simulate([scene], SimulationSettings(duration_s=2.0, early_stop=False), threads=1)
    way = run.positions[-1, :, 0].astype(float).mean() - 40.0
    assert way == pytest.approx(SPEED * run.time[-1], rel=0.005)
    assert abs(run.audit["contact_share"]) < 0.01
