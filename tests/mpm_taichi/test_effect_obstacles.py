"""Obstacles: a rigid sheet that slides out beyond its old foot, and where they stand."""

import numpy as np
import pytest

from mpm_taichi.effects import effect
from mpm_taichi.effects.framework.free_water import FAR
from mpm_taichi.effects.obstacles import feet_with_room
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.test_effect_hydroplaning import FRICTION, LENGTH, SPEED, sheet

SETTINGS = SimulationSettings(duration_s=3.5, early_stop=False)


def with_obstacles(force, **more):
    """The sheet of the tests of hydroplaning, without water."""
    return sheet(0.0, level=None, **more).changed(effects={"obstacles": force} if force else {})


def travel(time, force):
    """Way of a rigid sheet with a force per volume [N/m3] on what of it lies beyond the foot [m].

    s'' = -mu g - (f / rho) s / L until it rests.
    """
    braking, k = FRICTION * 9.81, np.sqrt(force / 2000.0 / LENGTH)
    s = SPEED / k * np.sin(k * time) - braking / k**2 * (1.0 - np.cos(k * time))
    rest = np.arctan2(SPEED * k, braking) / k
    return np.where(time < rest, s, np.interp(rest, time, s))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_sheet_is_held_back_by_what_of_it_lies_beyond_the_old_foot(side):
    (run,) = simulate([with_obstacles(4.0, velocity=side * SPEED)], SETTINGS, threads=1)
    (free,) = simulate([with_obstacles(0.0, velocity=side * SPEED)], SETTINGS, threads=1)
    way, unhindered = (
        side * (one.positions[:, :, 0].astype(float).mean(axis=1) - 70.0 - 0.5 * LENGTH)
        for one in (run, free)
    )
    expected = travel(run.time, 4e3)
    assert np.abs(way - expected).max() < 0.02 * expected[-1]
    assert unhindered[-1] > 1.1 * way[-1]
    assert abs(run.audit["numerical_share"]) < 0.01


def test_they_stand_before_feet_that_have_room():
    assert feet_with_room(sheet(0.0)) == {"left_foot": 70.0, "right_foot": 70.0 + LENGTH}
    closed = sheet(0.0, walls="closed").model_dump()
    closed["domain"] |= {"x_min": 70.0, "x_max": 70.0 + LENGTH}
    boxed = sheet(0.0).changed(domain=closed["domain"])
    assert feet_with_room(boxed) == {"left_foot": -FAR, "right_foot": FAR}
    assert "no foot of the section has room" in effect("obstacles").applies(boxed)
    assert effect("obstacles").applies(sheet(0.0)) == ""
