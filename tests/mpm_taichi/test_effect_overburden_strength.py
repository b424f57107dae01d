"""Overburden strength: the law at one point, and a column of soil against weight x depth."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi import layout
from mpm_taichi.effects.framework.registry import kernel_effects
from mpm_taichi.effects.framework.table import OVERBURDEN
from mpm_taichi.materials.mohr_coulomb import INTERCEPT
from mpm_taichi.solver.initial_state import prepare
from mpm_taichi.solver.kernels import build_kernels
from mpm_taichi.solver.runtime import Slots, start
from pipeline.config import SimulationSettings
from tests.mpm_taichi.one_point import Soil, lead, pure_shear


@pytest.mark.parametrize("amplitude", [0.25, 1.0])
@pytest.mark.parametrize("ratio", [0.0, 0.4, 1.0, 2.5])
def test_strength_of_a_point(amplitude, ratio):
    soil = Soil(cohesion=10e3, liquefied=True, overburden=ratio * 80e3, mean_overburden=80e3)
    path = lead("overburden_strength", amplitude, soil, pure_shear(1.0, 200), 1e-4)
    law = 10e3 * ((1.0 - amplitude) + amplitude * ratio)
    assert path.strength[-1, 1] == pytest.approx(2.0 * law, rel=1e-5, abs=1e-2)
    shear_stress = 0.5 * (path.stress[-1, 0] - path.stress[-1, 1])
    assert shear_stress == pytest.approx(law, rel=1e-4, abs=1.0)


def test_without_a_stress_before_failure_nothing_changes():
    soil = Soil(cohesion=10e3, liquefied=True)
    path = lead("overburden_strength", 1.0, soil, pure_shear(1.0, 10), 1e-4)
    assert np.all(path.strength[:, 1] == np.float32(20e3))


def column(**changes):
    """A layer 16 m high from wall to wall, the lower half liquefied, 1800 kg/m3."""
    document = {
        "name": "column",
        "domain": {"x_min": 0, "x_max": 8, "y_max": 24, "walls": "closed"},
        "ground": {"points": [[0, 0], [8, 0]]},
        "zones": [
            {"name": "a", "material": "silt", "polygon": [[0, 0], [8, 0], [8, 8], [0, 8]]},
            {"name": "b", "material": "sand", "polygon": [[0, 8], [8, 8], [8, 16], [0, 16]]},
        ],
        "materials": {
            "silt": {"friction_deg": 0, "cohesion_kpa": 40, "liquefied": True},
            "sand": {"friction_deg": 30, "cohesion_kpa": 5},
        },
        "spacing": 1.0,
        "effects": {"overburden_strength": 1.0},
    }
    return scene_from_mapping({**document, **changes})


@pytest.mark.parametrize(("water", "weight"), [(None, 1800.0), (20.0, 800.0)])
def test_stress_before_failure_is_effective_weight_times_depth(water, weight):
    scene = column(water_level=water)
    prepared = prepare(scene, SimulationSettings(duration_s=1.0))
    start("cpu", 1)
    kernels = build_kernels(affine=True, averaged=True, corrected=True,
                            effects=kernel_effects(scene))  # fmt: skip
    slots = Slots(1, len(prepared.order), prepared.grid.nodes, 1, device="cpu", kernels=kernels)
    slots.admit(0, prepared)
    slots.run()
    y = prepared.points.position[prepared.order, 1]
    liquefied = prepared.soil[prepared.row, 0] > 0.5
    by_hand = weight * 9.81 * (16.0 - y)
    found, below = slots.facts[:, OVERBURDEN], y < 13.0
    assert found[below] == pytest.approx(by_hand[below], rel=0.01)
    # In the cell at the surface F-bar gives all points one volumetric strain.
    assert np.abs(found - by_hand).max() < weight * 9.81 * 1.0
    mean = weight * 9.81 * 12.0
    assert slots.numbers[0, layout.MEAN_OVERBURDEN] == pytest.approx(mean, rel=0.01)
    strength = 40e3 * by_hand[liquefied] / mean
    assert 0.5 * slots.own_strength[liquefied, INTERCEPT] == pytest.approx(strength, rel=0.01)
    assert 0.5 * slots.own_strength[~liquefied, INTERCEPT] == pytest.approx(
        5e3 * np.cos(np.pi / 6), rel=1e-5
    )
