"""Strength contrast: its shape, one point, and what it does to a bank and a slump."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.effects.framework.faults import faults
from mpm_taichi.effects.strength_contrast import inside, multiplier
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import slump
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

LENS = {"x_m": 30.0, "y_m": 3.0, "half_width_m": 4.0, "half_height_m": 2.0, "edge": 0.5}
LAYER = {"y_m": 1.0, "half_height_m": 1.0, "edge": 0.01}


def defaults(**given):
    return {p.name: p.default for p in effect("strength_contrast").parameters} | given


def test_shape_is_one_within_nil_outside_and_half_on_the_edge():
    x = np.array([30.0, 33.0, 34.0, 35.0, 26.0, 40.0, -1e5])
    assert inside(x, 30.0, 4.0, 0.5) == pytest.approx([1, 1, 0.5, 0, 0.5, 0, 0], abs=1e-12)
    # A quarter of the edge within: 3/4 of the way up the cubic t^2 (3 - 2 t).
    assert inside(np.array([33.5]), 30.0, 4.0, 0.5) == pytest.approx([0.75**2 * 1.5])


@pytest.mark.parametrize("edge", [0.1, 0.5, 2.0])
def test_windows_side_by_side_add_up_to_one(edge):
    x = np.linspace(0.0, 40.0, 401)
    total = sum(inside(x, centre, 5.0, edge) for centre in (-5.0, 5.0, 15.0, 25.0, 35.0, 45.0))
    assert np.abs(total - 1.0).max() < 1e-12


def test_multiplier_is_the_product_of_both_directions():
    place = np.array([[30.0, 3.0], [34.0, 3.0], [34.0, 5.0], [30.0, 5.0], [30.0, 8.0]])
    factor = multiplier(slump(), place, -1.2, LENS)
    assert np.log(factor) == pytest.approx([-1.2, -0.6, -0.3, -0.6, 0.0], abs=1e-12)
    layer = multiplier(slump(), place, 0.7, defaults(y_m=3.0, half_height_m=1.0))
    assert np.log(layer) == pytest.approx([0.7, 0.7, 0.0, 0.0, 0.0], abs=1e-12)
    stretch = multiplier(slump(), place, 0.7, defaults(x_m=30.0, half_width_m=2.0))
    assert np.log(stretch) == pytest.approx([0.7, 0.0, 0.0, 0.7, 0.7], abs=1e-12)


def test_strength_of_a_liquefied_point_is_multiplied_and_of_no_other():
    shear = pure_shear(1.0, 200)
    soft = lead("strength_contrast", 0.5, Soil(cohesion=10e3, liquefied=True), shear, 1e-4,
                field=1.6)  # fmt: skip
    assert 0.5 * (soft.stress[-1, 0] - soft.stress[-1, 1]) == pytest.approx(16e3, rel=1e-4)
    firm = lead("strength_contrast", 0.5, Soil(cohesion=10e3), shear, 1e-4, field=1.6)
    assert np.all(firm.strength[:, 1] == np.float32(20e3))


def bank(effects):
    """A bank of liquefied soil, 60 m x 4 m."""
    return scene_from_mapping(
        {
            "name": "bank",
            "domain": {"x_min": 0, "x_max": 80, "y_max": 12},
            "ground": {"points": [[0, 0], [80, 0]]},
            "zones": [
                {"name": "soft", "material": "soft",
                 "polygon": [[10, 0], [70, 0], [70, 4], [10, 4]]},
            ],
            "materials": {"soft": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True}},
            "spacing": 1.0,
            "effects": effects,
        }
    )  # fmt: skip


@pytest.mark.slow
def test_both_signs_move_a_slump_and_a_layer_shears_where_it_lies():
    settings = SimulationSettings(duration_s=12.0)
    weak = {"strength_contrast": {"amplitude": -1.0, **LAYER}}
    strong = {"strength_contrast": {"amplitude": 1.0, **LAYER}}
    base, loose, stiff = simulate([bank({}), bank(weak), bank(strong)], settings,
                                  threads=1)  # fmt: skip
    assert all(run.status == "finished" for run in (base, loose, stiff))
    width = [np.ptp(run.positions[-1, :, 0]) for run in (base, loose, stiff)]
    assert width[1] > width[0] + 1.0 and width[2] < width[0] - 0.3
    low = base.positions[0, :, 1] < 2.0
    share = [
        run.plastic_shear_strain[low].sum() / run.plastic_shear_strain.sum()
        for run in (base, loose, stiff)
    ]
    assert share[1] > share[0] > share[2]


@pytest.mark.slow
def test_an_endless_part_is_another_strength_of_all():
    settings = SimulationSettings(duration_s=4.0)
    all_of_it = slump({"strength_contrast": np.log(1.6)})
    stronger = slump(materials={"silt": {"friction_deg": 0, "cohesion_kpa": 8, "liquefied": True},
                                "sand": {"friction_deg": 30, "cohesion_kpa": 5}})  # fmt: skip
    one, other = simulate([all_of_it, stronger], settings, threads=1)
    assert np.abs(one.positions[-1] - other.positions[-1]).max() < 1e-2


def test_the_place_of_an_effect_is_of_its_parameters():
    one = effect("strength_contrast")
    assert faults(one) == ""
    assert "'width' is none of its parameters" in faults(replace(one, place=("width",)))
    assert "a tuple of names" in faults(replace(one, place="x_m"))


def test_needs_liquefied_soil():
    assert "liquefied" in effect("strength_contrast").applies(
        slump(materials={"silt": {"friction_deg": 0, "cohesion_kpa": 5},
                         "sand": {"friction_deg": 30, "cohesion_kpa": 5}})
    )  # fmt: skip
