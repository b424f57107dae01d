"""Cracking: uniaxial tension of one element, a crack that does not heal, a crust that parts."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.one_point import Soil, lead

COHESION = 10e3


def pull(soil: Soil, rate: float, steps: int) -> np.ndarray:
    """Stretch along x; y is free as long as the soil is elastic (plane strain)."""
    side = -soil.poisson_ratio / (1.0 - soil.poisson_ratio)
    return np.tile([rate, 0.0, 0.0, side * rate], (steps, 1))


@pytest.mark.parametrize("friction", [0.0, 0.4, 0.7])
@pytest.mark.parametrize("lost", [0.5, 0.9])
def test_uniaxial_tension_reaches_what_is_left_of_the_tensile_strength(friction, lost):
    soil = Soil(friction=friction, cohesion=COHESION)
    path = lead("cracking", lost, soil, pull(soil, 1e-3, 2000), 1e-3, crack_width_m=10.0)
    whole = COHESION * min(2.0, 1.0 / friction if friction else np.inf)
    angle = np.arctan(friction)
    assert (1.0 - lost) * whole < 2.0 * COHESION * np.cos(angle) / (1.0 + np.sin(angle))
    assert path.stress[:, 0].max() == pytest.approx((1.0 - lost) * whole, rel=2e-3)
    assert path.opening[-1] > 0.0


@pytest.mark.parametrize("friction", [0.5, 0.8])
def test_weak_amplitude_goes_over_into_uncracked_soil(friction):
    soil = Soil(friction=friction, cohesion=COHESION)
    free = lead("bingham", 1.0, soil, pull(soil, 1e-3, 1000), 1e-3)
    near = lead("cracking", 1e-4, soil, pull(soil, 1e-3, 1000), 1e-3)
    assert near.stress[:, 0] == pytest.approx(free.stress[:, 0], rel=2e-3, abs=5.0)


def test_without_tensile_strength_no_tension_is_carried():
    soil = Soil(cohesion=COHESION)
    path = lead("cracking", 1.0, soil, pull(soil, 1e-2, 500), 1e-3)
    assert path.stress[:, :3].max() < 1.0


@pytest.mark.parametrize("cell", [0.5, 2.0])
def test_an_open_crack_takes_its_share_of_the_cohesion_at_a_width_not_a_strain(cell):
    soil = Soil(cohesion=COHESION)
    path = lead("cracking", 0.6, soil, pull(soil, 1e-2, 9000), 1e-3, cell=cell,
                crack_width_m=0.02, cohesion_lost=0.5)  # fmt: skip
    width = path.opening * cell
    left = COHESION * (1.0 - 0.6 * 0.5 * np.minimum(width / 0.02, 1.0))
    assert width[-1] > 0.02
    # The strength of a step is that of the opening before it.
    assert path.strength[1:, 1] == pytest.approx(2.0 * left[:-1], rel=1e-4)
    assert path.strength[1:, 2] == pytest.approx(0.4 * 2.0 * left[:-1], rel=1e-4)


def test_a_crack_that_has_closed_does_not_heal():
    soil = Soil(cohesion=COHESION)
    there = pull(soil, 1e-2, 4000)
    path = lead("cracking", 0.6, soil, np.concatenate([there, -1.5 * there]), 1e-3)
    assert path.opening[3999] > 0.02 and path.opening[-1] == 0.0
    assert path.stress[-1, :3].mean() < -1e3, "it bears pressure again"
    assert path.strength[-1, 1] == pytest.approx(2.0 * COHESION * (1.0 - 0.6 * 0.5), rel=1e-5)


def test_liquefied_soil_does_not_crack():
    soil = Soil(cohesion=COHESION, liquefied=True)
    path = lead("cracking", 1.0, soil, pull(soil, 1e-3, 2000), 1e-3)
    assert path.stress[:, 0].max() > 1.9 * COHESION and path.opening.max() == 0.0


def crust(effects, cohesion=25.0):
    """A clay crust on liquefied sand."""
    return scene_from_mapping(
        {
            "name": "crust",
            "domain": {"x_min": -40, "x_max": 80, "y_max": 20, "walls": "open"},
            "ground": {"points": [[-40, 0], [80, 0]]},
            "zones": [
                {"name": "sand", "material": "sand",
                 "polygon": [[-2, 0], [42, 0], [40, 3], [0, 3]]},
                {"name": "clay", "material": "clay",
                 "polygon": [[2, 3], [38, 3], [28, 9], [12, 9]]},
            ],
            "materials": {
                "sand": {"friction_deg": 0, "cohesion_kpa": 7, "density": 1900, "liquefied": True},
                "clay": {"friction_deg": 0, "cohesion_kpa": cohesion, "density": 1900},
            },
            "spacing": 1.0,
            "effects": effects,
        }
    )  # fmt: skip


@pytest.mark.slow
def test_a_crust_that_cracks_is_carried_farther():
    runs = simulate(
        [crust({}), crust({"cracking": 0.5}), crust({"cracking": 1.0})],
        SimulationSettings(duration_s=12.0),
        threads=1,
    )
    assert all(run.status == "finished" for run in runs)
    width = [np.ptp(run.positions[-1, :, 0]) for run in runs]
    assert width[1] > width[0] + 2.0 and width[2] > width[1] + 2.0
    opened = [run.audit["volume_opened"] for run in runs]
    assert opened[0] == 0.0 < 0.01 < opened[1] < opened[2]
    assert all(abs(run.audit["numerical_share"]) < 0.02 for run in runs)


def test_needs_cohesion_outside_the_liquefied_soil():
    assert effect("cracking").applies(crust({})) == ""
    assert "cohesion" in effect("cracking").applies(crust({}, cohesion=0.0))
