"""Bingham viscosity: one element, and a slump that it slows but does not hold."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

LIQUEFIED = Soil(cohesion=10e3, liquefied=True)


@pytest.mark.parametrize("viscosity_kpa_s", [0.5, 5.0, 50.0])
@pytest.mark.parametrize("rate", [0.1, 2.0])
def test_steady_shear_resists_by_yield_stress_plus_viscosity_times_rate(viscosity_kpa_s, rate):
    path = lead("bingham", viscosity_kpa_s, LIQUEFIED, pure_shear(rate, 2000), 0.1 / rate / 1000)
    shear_stress = 0.5 * (path.stress[-1, 0] - path.stress[-1, 1])
    assert shear_stress == pytest.approx(10e3 + 1e3 * viscosity_kpa_s * rate, rel=1e-4)


def test_stress_follows_the_rate_and_falls_to_the_yield_stress_when_it_stops():
    rates = np.concatenate([np.full(500, 1.0), np.full(500, 0.25), np.full(500, 1e-6)])
    path = lead("bingham", 4.0, LIQUEFIED, pure_shear(1.0, 1500) * rates[:, None], 1e-4)
    shear_stress = 0.5 * (path.stress[:, 0] - path.stress[:, 1])
    expected = [14e3, 11e3, 10e3]
    assert shear_stress[[499, 999, 1499]] == pytest.approx(expected, rel=1e-4)
    assert shear_stress.max() < 14e3 * (1 + 1e-5)


def test_dissipation_is_stress_times_plastic_strain():
    path = lead("bingham", 4.0, LIQUEFIED, pure_shear(1.0, 4000), 1e-4)
    assert path.dissipated[-1] == pytest.approx(14e3 * path.shear[-1], rel=2e-3)


def test_soil_that_did_not_liquefy_is_left_alone():
    path = lead("bingham", 50.0, Soil(cohesion=10e3), pure_shear(1.0, 200), 1e-4)
    assert np.all(path.strength[:, 1] == np.float32(20e3))


def slump(effects):
    return scene_from_mapping(
        {
            "name": "slump",
            "domain": {"x_min": 0, "x_max": 60, "y_max": 20},
            "ground": {"points": [[0, 0], [60, 0]]},
            "zones": [
                {"name": "a", "material": "s", "polygon": [[20, 0], [40, 0], [40, 8], [20, 8]]}
            ],
            "materials": {"s": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True}},
            "spacing": 1.0,
            "effects": effects,
        }
    )


@pytest.mark.slow
def test_viscosity_slows_a_slump_more_than_it_shortens_it():
    settings = SimulationSettings(duration_s=20.0)
    base, slow = simulate([slump({}), slump({"bingham": 5.0})], settings, threads=1)
    assert slow.status == "finished", slow.reason
    top = [run.audit["peak_speed_m_per_s"] for run in (base, slow)]
    way = [np.ptp(run.positions[-1, :, 0]) - 20.0 for run in (base, slow)]
    assert top[1] < 0.85 * top[0]
    assert 0.6 < way[1] / way[0] < 0.97
    assert abs(slow.audit["numerical_share"]) < 0.05
