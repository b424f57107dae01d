"""Excess pore pressure: effective strength of a point, and a sheet that brakes as it fades."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

SAND = Soil(friction=0.7, cohesion=2e3)
PRESSED = (-50e3, -50e3, -50e3, 0.0)


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("time", [0.0, 10.0, 1000.0])
def test_strength_is_that_of_the_effective_stress(ratio, time):
    path = lead("pore_pressure", ratio, SAND, pure_shear(0.1, 1000), 1e-3, stress=PRESSED,
                field=1.0, start_time=time, dissipation_time_s=10.0)  # fmt: skip
    shear_stress = 0.5 * (path.stress[:, 0] - path.stress[:, 1])
    now = ratio * np.exp(-(time + 0.999) / 10.0)
    friction = np.arctan(0.7 * (1.0 - now))
    # The circle of radius s sin(phi) + c cos(phi) touches t = c + s_n tan(phi).
    middle = -0.5 * (path.stress[-1, 0] + path.stress[-1, 1])
    assert middle == pytest.approx(50e3, rel=2e-3)
    expected = middle * np.sin(friction) + 2e3 * np.cos(friction)
    assert shear_stress[-1] == pytest.approx(expected, rel=1e-4)


def test_strength_comes_back_as_the_pressure_fades():
    path = lead("pore_pressure", 0.8, SAND, pure_shear(1.0, 6000), 5e-3, stress=PRESSED, field=1.0,
                dissipation_time_s=3.0)  # fmt: skip
    shear_stress = 0.5 * (path.stress[:, 0] - path.stress[:, 1])
    assert np.all(np.diff(shear_stress[200:]) > -5.0)
    full = lead("pore_pressure", 1e-6, SAND, pure_shear(1.0, 6000), 5e-3, stress=PRESSED)
    ends = [0.5 * (one.stress[-1, 0] - one.stress[-1, 1]) for one in (path, full)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-3)


def test_dry_soil_and_soil_without_friction_are_left_alone():
    for soil, field in ((SAND, 0.0), (Soil(cohesion=2e3), 1.0)):
        with_it = lead("pore_pressure", 0.8, soil, pure_shear(1.0, 100), 1e-3, stress=PRESSED,
                       field=field)  # fmt: skip
        sine = soil.friction / np.hypot(1.0, soil.friction)
        assert with_it.strength[0, 0] == pytest.approx(sine, rel=1e-6)
        assert with_it.strength[0, 1] == pytest.approx(2 * 2e3 * np.sqrt(1 - sine**2), rel=1e-6)


def sheet(effects, level=5.0):
    """One layer of sand under water, thrown along the ground."""
    return scene_from_mapping(
        {
            "name": "sheet",
            "domain": {"x_min": 0, "x_max": 160, "y_max": 20, "walls": "open"},
            "ground": {"points": [[0, 0], [160, 0]]},
            "zones": [
                {
                    "name": "a",
                    "material": "sand",
                    "polygon": [[20, 0], [60, 0], [60, 1.05], [20, 1.05]],
                    "initial_velocity": [6.0, 0.0],
                }
            ],
            "materials": {"sand": {"friction_deg": 30, "cohesion_kpa": 0, "density": 2000}},
            "water_level": level,
            "spacing": 1.0,
            "effects": effects,
        }
    )


def test_a_sheet_under_water_brakes_by_its_effective_friction():
    entry = {"pore_pressure": {"amplitude": 0.6, "dissipation_time_s": 2.0}}
    settings = SimulationSettings(duration_s=3.0, early_stop=False)
    (run,) = simulate([sheet(entry)], settings, threads=1)
    way = run.positions[:, :, 0].astype(float).mean(axis=1) - 40.0
    time = np.linspace(0.0, run.time[-1], 20001)
    ratio = 0.6 * np.exp(-time / 2.0)
    braking = 0.5 * 9.81 * np.sin(np.arctan((1.0 - ratio) * np.tan(np.radians(30.0))))
    step = time[1]
    speed = np.maximum(6.0 - np.cumsum(braking) * step, 0.0)
    expected = np.interp(run.time, time, np.cumsum(speed) * step)
    assert np.abs(way - expected).max() < 0.02 * expected[-1]


def test_only_soil_below_the_phreatic_line_at_the_start_is_saturated():
    field = effect("pore_pressure").field
    position = np.array([[30.0, 0.4], [30.0, 0.9]])
    assert field(sheet({}, level=0.5), position, 0.5, {}).tolist() == [1.0, 0.0]


def test_scenes_without_frictional_soil_under_water_are_left_out():
    applies = effect("pore_pressure").applies
    assert applies(sheet({})) == ""
    assert "no water" in applies(sheet({}).changed(water_level=None))
    assert "phreatic line" in applies(sheet({}).changed(water_level=-1.0))
    # A line that rises into the sand between two of its corners.
    mound = [(0.0, -1.0), (30.0, -1.0), (40.0, 0.8), (50.0, -1.0), (160.0, -1.0)]
    assert applies(sheet({}).changed(phreatic_line=mound)) == ""
