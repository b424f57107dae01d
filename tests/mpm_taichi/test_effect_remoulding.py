"""Remoulding: one element at any strain, a cut that holds at its peak and fails remoulded."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import slump
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

CLAY = Soil(cohesion=30e3)


@pytest.mark.parametrize("amplitude", [0.3, 0.75])
@pytest.mark.parametrize("cell", [1.0, 2.0, 4.0])
def test_stress_follows_the_law_through_the_whole_strain(amplitude, cell):
    path = lead("remoulding", amplitude, CLAY, pure_shear(1.0, 8000), 1.5e-4, cell=cell)
    reference = 0.3 * np.sqrt(2.0 / cell)
    law = 30e3 * (1.0 - amplitude * (1.0 - np.exp(-path.shear / reference)))
    found = 0.5 * (path.stress[:, 0] - path.stress[:, 1])
    yielded = path.shear > 0.01
    assert path.shear[-1] > 2.0 * reference
    assert found[yielded] == pytest.approx(law[yielded], rel=2e-3)


def test_friction_stays_and_cohesion_alone_is_lost():
    soil = Soil(cohesion=30e3, friction=0.5)
    path = lead("remoulding", 1.0, soil, pure_shear(1.0, 4000), 1e-3, stress=(-2e5,) * 3 + (0.0,))
    assert np.ptp(path.strength[:, 0]) == 0.0
    assert path.strength[-1, 1] < 0.01 * path.strength[0, 1]


def test_the_work_is_that_of_the_law():
    """Dissipation per volume: the integral of c over the plastic shear strain."""
    path = lead("remoulding", 0.6, CLAY, pure_shear(1.0, 8000), 1.5e-4, cell=2.0)
    g = path.shear[-1]
    law = 30e3 * (0.4 * g + 0.6 * 0.3 * (1.0 - np.exp(-g / 0.3)))
    assert path.dissipated[-1] == pytest.approx(law, rel=5e-3)


def test_liquefied_soil_is_left_alone():
    soil = Soil(cohesion=10e3, liquefied=True)
    path = lead("remoulding", 1.0, soil, pure_shear(1.0, 2000), 1e-3)
    assert np.all(path.strength[:, 1] == np.float32(20e3))


def cut(cohesion_kpa, effects):
    """A vertical cut 10 m high in clay; N = gamma H / c = 3.8 is its limit (Pastor et al. 2000)."""
    return scene_from_mapping(
        {
            "name": "cut",
            "domain": {"x_min": 0, "x_max": 90, "y_max": 25, "walls": "closed"},
            "ground": {"points": [[0, 0], [90, 0]]},
            "zones": [
                {"name": "a", "material": "clay",
                 "polygon": [[0, 0], [90, 0], [90, 5], [40, 5], [40, 15], [0, 15]]},
            ],
            "materials": {
                "clay": {"friction_deg": 0, "cohesion_kpa": cohesion_kpa, "density": 1900.0}
            },
            "spacing": 1.0,
            "effects": effects,
        }
    )  # fmt: skip


@pytest.mark.slow
def test_a_cut_that_is_strong_enough_stands_and_one_that_yields_works_back():
    """Above its limit no soil shears, so none is remoulded; below it the scarp goes back."""
    settings = SimulationSettings(duration_s=15.0)
    strong, plain, soft = simulate(
        [
            cut(90.0, {"remoulding": 0.75}),
            cut(36.0, {}),
            cut(36.0, {"remoulding": 0.75}),
        ],
        settings,
        threads=1,
    )
    assert all(run.status == "finished" for run in (strong, plain, soft))
    runs = (strong, plain, soft)
    moved = [np.abs(run.positions[-1] - run.positions[0]).max(axis=1) for run in runs]
    assert moved[0].max() < 0.3
    top = plain.positions[0, :, 1] > 13.0
    x = plain.positions[0, :, 0]
    back = [40.0 - x[top & (one > 1.0)].min() for one in moved[1:]]
    assert back[1] > 1.3 * back[0]
    assert moved[2].max() > 2.0 * moved[1].max()


def test_needs_cohesion_that_is_not_residual_strength():
    assert effect("remoulding").applies(slump()) == ""
    bare = {"silt": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True},
            "sand": {"friction_deg": 30, "cohesion_kpa": 0}}  # fmt: skip
    assert "cohesion" in effect("remoulding").applies(slump(materials=bare))
