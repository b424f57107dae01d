"""Level of the pool: the line that is drawn along, and the run that it amounts to."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import acting_scene, effect, effects_on
from mpm_taichi.effects.pool_level import moved
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings


def dam(effects=None, *, water_level=6.0, phreatic_line=None):
    """A liquefied mound in a pool that stands on its left."""
    return scene_from_mapping(
        {
            "name": "dam",
            "domain": {"x_min": 0, "x_max": 70, "y_max": 20, "walls": "open"},
            "ground": {"points": [[0, 0], [70, 0]]},
            "zones": [
                {"name": "a", "material": "s", "polygon": [[20, 0], [45, 0], [38, 8], [30, 8]]}
            ],
            "materials": {
                "s": {"friction_deg": 0, "cohesion_kpa": 6, "density": 2000, "liquefied": True}
            },
            "water_level": water_level,
            "phreatic_line": phreatic_line,
            "spacing": 1.0,
            "effects": effects or {},
        }
    )


LINE = [[0, 6], [30, 6], [45, 1], [70, 1]]


@pytest.mark.parametrize(
    ("offset", "heights"),
    [
        (1.0, [7.0, 7.0, 1.0, 1.0]),
        (-2.5, [3.5, 3.5, 1.0, 1.0]),
        (-5.0, [1.0, 1.0, 1.0, 1.0]),
        (-6.0, [0.0, 0.0, 0.0, 0.0]),
    ],
)
def test_the_line_keeps_its_tailwater_and_scales_with_the_head(offset, heights):
    scene = moved(dam(phreatic_line=LINE), offset, {})
    assert scene.water_level == 6.0 + offset
    assert [y for _, y in scene.phreatic_line] == pytest.approx(heights)
    assert [x for x, _ in scene.phreatic_line] == [0, 30, 45, 70]


def test_between_pool_and_tailwater_the_head_keeps_its_proportion():
    scene = moved(dam(phreatic_line=[[0, 6], [30, 6], [38, 4], [45, 1], [70, 1]]), 2.0, {})
    assert scene.phreatic_line[2][1] == pytest.approx(1.0 + 3.0 * 7.0 / 5.0)


def test_a_level_line_moves_as_a_whole():
    scene = moved(dam(phreatic_line=[[0, 6], [70, 6]]), 0.7, {})
    assert {y for _, y in scene.phreatic_line} == {6.7}
    assert moved(dam(), -0.7, {}).water_level == pytest.approx(5.3)


def test_run_is_to_the_bit_that_of_a_scene_with_the_other_level():
    settings = SimulationSettings(duration_s=3.0)
    risen = dam(water_level=8.0, phreatic_line=[[0, 8], [30, 8], [45, 1], [70, 1]])
    given, written = simulate(
        [dam({"pool_level": 2.0}, phreatic_line=LINE), risen], settings, threads=1
    )
    assert np.array_equal(given.positions, written.positions)
    assert given.scene.water_level == 6.0, "measurements refer to the scene as given"


def test_a_higher_pool_shortens_the_runout_and_a_lower_one_lengthens_it():
    scenes = [dam({"pool_level": a} if a else {}) for a in (-2.0, 0.0, 1.5)]
    runs = simulate(scenes, SimulationSettings(duration_s=12.0), threads=1)
    width = [np.ptp(run.positions[-1, :, 0]) for run in runs]
    assert width[0] > width[1] + 0.5 and width[1] > width[2] + 0.5


def test_needs_water():
    assert "no water" in effect("pool_level").applies(dam(water_level=None))
    scene = dam({"pool_level": 1.0})
    assert acting_scene(scene, effects_on(scene)).water_level == 7.0
