"""Hydroplaning: a rigid sheet that slides out beyond its old foot."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.effects.framework.free_water import FAR
from mpm_taichi.effects.hydroplaning import feet_in_water
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings

LENGTH, FRICTION, SPEED = 30.0, 0.3, 8.0


def sheet(share, *, velocity=SPEED, level=20.0, line=None, contact="coulomb", walls="open"):
    """A strong sheet under water on ground with friction."""
    ground = {"points": [[0, 0], [200, 0]], "contact": contact}
    if contact == "coulomb":
        ground["friction_coefficient"] = FRICTION
    return scene_from_mapping(
        {
            "name": "sheet",
            "domain": {"x_min": 60, "x_max": 60 + LENGTH + 40, "y_max": 20, "walls": walls,
                       "left": "free", "right": "free"},
            "ground": ground,
            "zones": [
                {"name": "a", "material": "s", "initial_velocity": [velocity, 0.0],
                 "polygon": [[70, 0], [70 + LENGTH, 0], [70 + LENGTH, 2], [70, 2]]}
            ],
            "materials": {
                "s": {"friction_deg": 0, "cohesion_kpa": 300, "density": 2000,
                      "youngs_modulus_mpa": 100}
            },
            "water_level": level,
            "phreatic_line": line,
            "spacing": 1.0,
            "effects": {"hydroplaning": share} if share else {},
        }
    )  # fmt: skip


SETTINGS = SimulationSettings(duration_s=3.5, early_stop=False)


def travel(time, share):
    """Way of a rigid sheet whose base beyond the foot has lost `share` of its friction [m].

    s'' = -mu g' (1 - share s / L) for s < L, until it rests.
    """
    braking = FRICTION * 0.5 * 9.81
    if share == 0.0:
        until = np.minimum(time, SPEED / braking)
        return SPEED * until - 0.5 * braking * until**2
    k = np.sqrt(braking * share / LENGTH)
    return LENGTH / share * (1.0 - np.cosh(k * time)) + SPEED / k * np.sinh(k * time)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_sheet_brakes_less_by_what_of_it_lies_beyond_the_old_foot(share, side):
    (run,) = simulate([sheet(share, velocity=side * SPEED)], SETTINGS, threads=1)
    centre = run.positions[:, :, 0].astype(float).mean(axis=1)
    way = side * (centre - 70.0 - 0.5 * LENGTH)
    expected = travel(run.time, share)
    assert expected[-1] < LENGTH
    assert np.abs(way - expected).max() < 0.02 * expected[-1]


def test_base_within_the_old_section_keeps_its_strength():
    resting = sheet(1.0, velocity=0.0)
    (run,) = simulate([resting], SETTINGS, threads=1)
    assert np.abs(run.positions[-1] - run.positions[0]).max() < 0.05


@pytest.mark.slow
def test_adhesion_of_rough_ground_is_lowered_as_well():
    def slump(share):
        scene = sheet(share, velocity=0.0, contact="rough").model_dump()
        scene["materials"]["s"]["cohesion_kpa"] = 2.0
        scene["zones"][0]["polygon"] = [[70, 0], [90, 0], [90, 8], [70, 8]]
        return scene_from_mapping(scene)

    runs = simulate([slump(a) for a in (0.0, 0.3, 0.6)], SimulationSettings(duration_s=15.0))
    assert all(run.status == "finished" for run in runs)
    width = [np.ptp(run.positions[-1, :, 0]) for run in runs]
    assert width[1] > width[0] + 2.0 and width[2] > width[1] + 2.0


def test_only_feet_in_the_pool_with_room_before_them_count():
    assert feet_in_water(sheet(0.5)) == {"left_foot": 70.0, "right_foot": 70.0 + LENGTH}
    left = sheet(0.5, line=[[60, 20], [72, 20], [90, -1], [140, -1]])
    assert feet_in_water(left) == {"left_foot": 70.0, "right_foot": FAR}
    applies = effect("hydroplaning").applies
    assert applies(sheet(0.5)) == ""
    assert "no foot" in applies(sheet(0.5, level=None))
    assert "no foot" in applies(sheet(0.5, level=-1.0))
    assert "bonded" in applies(sheet(0.5, contact="no_slip"))
