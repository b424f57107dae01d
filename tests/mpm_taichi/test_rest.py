"""Runs end at rest: after a slide, and where hardly anything moved."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.rest import STILL, WHILE, stands_still, still_frames
from mpm_taichi.simulate import simulate
from pipeline.config import Config


def bank(size: float, strength_kpa: float):
    """A cut bank `size` times 4 m high, whose ground goes on; strength goes with the size."""
    outline = np.array([[-8, 0], [0, 4], [20, 4], [20, 0]]) * size
    return scene_from_mapping(
        {
            "name": "bank",
            "domain": {"x_min": -40 * size, "x_max": 40 * size, "y_max": 8 * size, "walls": "open"},
            "ground": {"points": [[-400, 0], [400, 0]]},
            "zones": [{"name": "soil", "polygon": outline.tolist(), "material": "soil"}],
            "materials": {"soil": {"friction_deg": 0, "cohesion_kpa": strength_kpa * size,
                                   "youngs_modulus_mpa": 10 * size, "liquefied": True}},
            "spacing": 0.5 * size,
        }
    )  # fmt: skip


@pytest.mark.parametrize("size", [1.0, 10.0])
def test_a_section_that_stands_ends_by_itself_at_every_size(size):
    settings = Config().simulation
    (run,) = simulate([bank(size, 30.0)], settings, threads=1)
    fall = np.sqrt(4.0 * size / settings.gravity_m_per_s2)
    assert run.came_to_rest and run.time[-1] < 4.0 * WHILE * fall
    assert np.abs(run.positions[-1] - run.positions[0]).max() < 0.2 * size


def test_a_slide_is_not_ended_before_it_is_over():
    """The same, followed for good: the front goes no farther than a hair."""
    settings = Config().simulation
    scene = bank(1.0, 4.0)
    ended, followed = (
        simulate([scene], settings.model_copy(update=changes), threads=1)[0]
        for changes in ({}, {"early_stop": False, "duration_s": 30.0})
    )
    assert ended.came_to_rest and ended.time[-1] < 15.0
    ran = [-8.0 - run.positions[-1][:, 0].min() for run in (ended, followed)]
    assert ran[1] > 3.0 and ran[0] == pytest.approx(ran[1], abs=0.1)


def test_stillness_is_of_every_point_and_of_a_while():
    count = still_frames(9.81, 9.81, 0.25)
    assert count == WHILE / 0.25
    frames = [np.zeros((5, 2), np.float32) for _ in range(count + 1)]
    assert stands_still(frames, count, 1.0) and not stands_still(frames[1:], count, 1.0)
    frames[-1] = frames[-1].copy()
    frames[-1][3, 0] = 1.01 * STILL
    assert not stands_still(frames, count, 1.0)
