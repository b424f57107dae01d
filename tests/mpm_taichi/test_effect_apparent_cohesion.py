"""Apparent cohesion: one element, where it acts, and the height at which a cut in sand stands."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.effects.apparent_cohesion import share
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import slump
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

SETTINGS = SimulationSettings(duration_s=3.0)


@pytest.mark.parametrize("amplitude", [2.0, 20.0])
@pytest.mark.parametrize("part", [1.0, 0.25])
def test_a_point_has_the_sum_of_both(amplitude, part):
    soil = Soil(cohesion=5e3, friction=0.6)
    path = lead("apparent_cohesion", amplitude, soil, pure_shear(1.0, 2000), 1e-5,
                stress=(-5e4, -5e4, -5e4, 0.0), field=part)  # fmt: skip
    sine, cosine = np.sin(np.arctan(0.6)), np.cos(np.arctan(0.6))
    xx, yy = path.stress[-1, :2]
    law = (5e3 + 1e3 * amplitude * part) * cosine - 0.5 * (xx + yy) * sine
    assert path.shear[-1] > 0.0
    assert 0.5 * (xx - yy) == pytest.approx(law, rel=1e-4)


def test_liquefied_soil_is_left_alone():
    soil = Soil(cohesion=10e3, liquefied=True)
    path = lead("apparent_cohesion", 50.0, soil, pure_shear(1.0, 10), 1e-4, field=1.0)
    assert np.all(path.strength[:, 1] == np.float32(20e3))
    everything = {name: {"cohesion_kpa": 5, "friction_deg": 0, "liquefied": True}
                  for name in ("silt", "sand")}  # fmt: skip
    assert effect("apparent_cohesion").applies(slump(materials=everything))


def test_below_the_phreatic_line_it_has_its_share():
    place = np.array([[25.0, 6.9], [25.0, 7.1], [38.0, 2.9], [38.0, 3.1]])
    assert share(slump(), place, 10.0, {"share_below_water": 0.25}) == pytest.approx(
        [0.25, 1.0, 0.25, 1.0]
    )
    dry = slump(water_level=None, phreatic_line=None)
    assert share(dry, place, 10.0, {"share_below_water": 0.25}) == pytest.approx(1.0)


def cut(cohesion_kpa, effects):
    """A vertical cut 6 m high in sand of 30 degrees."""
    return scene_from_mapping(
        {
            "name": "cut",
            "domain": {"x_min": 0, "x_max": 24, "y_max": 10, "walls": "closed"},
            "ground": {"points": [[0, 0], [24, 0]]},
            "zones": [
                {"name": "a", "material": "sand",
                 "polygon": [[0, 0], [24, 0], [24, 1], [10, 1], [10, 7], [0, 7]]},
            ],
            "materials": {
                "sand": {"friction_deg": 30, "cohesion_kpa": cohesion_kpa, "density": 1800.0,
                         "youngs_modulus_mpa": 10}
            },
            "spacing": 0.5,
            "effects": effects,
        }
    )  # fmt: skip


@pytest.mark.slow
def test_a_cut_in_sand_stands_where_its_height_allows():
    """H = 3.83 c tan(45 + phi / 2) / gamma (upper bound, Chen 1975): 6 m at 16 kPa."""
    falls, stands, material = simulate(
        [
            cut(0.0, {"apparent_cohesion": 9.0}),
            cut(0.0, {"apparent_cohesion": 24.0}),
            cut(24.0, {}),
        ],
        SETTINGS,
        threads=1,
    )
    moved = [
        np.abs(run.positions[-1] - run.positions[0]).max() for run in (falls, stands, material)
    ]
    assert moved[0] > 1.0
    assert moved[1] < 0.1
    assert moved[2] == pytest.approx(moved[1], abs=0.02), "the same as cohesion of the material"
