"""Side shear and side friction: a sliding block brakes, a resting one stays to the bit."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings

DENSITY, HEIGHT, SPEED = 2000.0, 4.0, 5.0
SETTINGS = SimulationSettings(duration_s=3.0, early_stop=False)


SMOOTH = {"points": [[0, 0], [100, 0]], "contact": "coulomb", "friction_coefficient": 0.0}
ROUGH = {"points": [[0, 0], [100, 0]]}


def block(effects, *, velocity=SPEED, friction_deg=0.0, cohesion_kpa=50.0, ground=SMOOTH):
    """A block 12 m long."""
    return scene_from_mapping(
        {
            "name": "block",
            "domain": {"x_min": 0, "x_max": 100, "y_max": 20},
            "ground": ground,
            "zones": [
                {"name": "a", "material": "s", "initial_velocity": [velocity, 0.0],
                 "polygon": [[20, 0], [32, 0], [32, HEIGHT], [20, HEIGHT]]}
            ],
            "materials": {
                "s": {"friction_deg": friction_deg, "cohesion_kpa": cohesion_kpa,
                      "density": DENSITY, "youngs_modulus_mpa": 100}
            },
            "spacing": 1.0,
            "effects": effects,
        }
    )  # fmt: skip


def braked(time, braking):
    until = np.minimum(time, SPEED / braking)
    return SPEED * until - 0.5 * braking * until**2


def way_of(run):
    return run.positions[:, :, 0].astype(float).mean(axis=1) - 26.0


@pytest.mark.parametrize(("ratio", "strength"), [(0.1, 1.0), (0.4, 0.5), (0.4, 1.0)])
def test_side_shear_brakes_a_block_by_two_strengths_over_the_width(ratio, strength):
    entry = {"side_shear": {"amplitude": ratio, "side_strength": strength}}
    (run,) = simulate([block(entry)], SETTINGS, threads=1)
    braking = 2.0 * strength * 50e3 * ratio / HEIGHT / DENSITY
    expected = braked(run.time, braking)
    assert np.abs(way_of(run) - expected).max() < 0.005 * expected[-1]
    assert abs(run.audit["numerical_share"]) < 0.02


@pytest.mark.parametrize("ratio", [0.3, 1.0])
def test_side_friction_brakes_a_block_by_the_stress_on_its_flanks(ratio):
    entry = {"side_friction": {"amplitude": ratio, "earth_pressure_ratio": 0.6}}
    (run,) = simulate([block(entry, friction_deg=30.0)], SETTINGS, threads=1)
    # The mean of the vertical stress is half the weight: a = 2 mu K (rho g H / 2) / (rho B).
    braking = np.tan(np.radians(30.0)) * 0.6 * 9.81 * ratio
    expected = braked(run.time, braking)
    assert np.abs(way_of(run) - expected).max() < 0.03 * expected[-1]


def test_without_flanks_the_block_slides_on():
    (run,) = simulate([block({})], SETTINGS, threads=1)
    assert way_of(run)[-1] == pytest.approx(SPEED * run.time[-1], rel=1e-3)


def at_rest(effects):
    return block(effects, velocity=0.0, friction_deg=30.0, ground=ROUGH)


def test_a_block_that_rests_stays_to_the_bit():
    (run,) = simulate([at_rest({"side_shear": 0.5})], SETTINGS, threads=1)
    assert np.array_equal(run.positions[-1], run.positions[0])
    assert not run.velocity.any()


def test_friction_leaves_a_resting_block_as_still_as_it_is_without():
    # Settling leaves a ten-thousandth of the weight unbalanced, and at the top there is no stress
    # on the flanks to hold it: there the block stirs as it does without them, and no more.
    free, held = simulate([at_rest({}), at_rest({"side_friction": 0.5})], SETTINGS, threads=1)
    stirred = [np.linalg.norm(run.positions[-1] - run.positions[0], axis=1) for run in (free, held)]
    assert stirred[1].max() <= stirred[0].max() < 1e-3
    assert stirred[1].sum() < 0.5 * stirred[0].sum()
    assert np.array_equal(held.positions[-1, :12], held.positions[0, :12]), "the lowest row"


@pytest.mark.parametrize("name", ["side_shear", "side_friction"])
def test_it_never_moves_a_block_backwards(name):
    (run,) = simulate([block({name: 5.0}, friction_deg=30.0)], SETTINGS, threads=1)
    way = way_of(run)
    assert np.diff(way).min() > -0.01 and way[-1] > 0.1
    speed = np.abs(run.velocity).max()
    assert speed < 0.05


def slump(effects):
    scene = block(effects, velocity=0.0, cohesion_kpa=6.0, ground=ROUGH).model_dump()
    scene["zones"][0]["polygon"] = [[40, 0], [60, 0], [60, 8], [40, 8]]
    scene["materials"]["s"]["youngs_modulus_mpa"] = 30.0
    return scene_from_mapping(scene)


def test_flanks_shorten_the_runout_of_a_slump_until_they_hold_it():
    entries = [{}, *({"side_shear": ratio} for ratio in (0.2, 1.0))]
    # 2 k c / B = 2 x 2 x 6 kPa x 10 / 8 m = 30 kN/m3, more than the weight of 19.6.
    entries.append({"side_shear": {"amplitude": 10.0, "side_strength": 2.0}})
    runs = simulate(
        [slump(entry) for entry in entries], SimulationSettings(duration_s=10.0), threads=1
    )
    moved = [np.abs(run.positions[-1] - run.positions[0]).max() for run in runs]
    assert moved[0] > 1.05 * moved[1] and moved[1] > 1.2 * moved[2]
    assert moved[3] < 0.02


def test_each_needs_its_kind_of_strength():
    assert "friction" in effect("side_friction").applies(block({}))
    assert "cohesion" in effect("side_shear").applies(
        block({}, friction_deg=30.0, cohesion_kpa=0.0)
    )
