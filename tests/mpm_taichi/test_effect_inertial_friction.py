"""Inertial friction: one element at any rate, its similarity, and a column on its true scale."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effect
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.effects_slump import slump
from tests.mpm_taichi.one_point import Soil, lead, pure_shear, simple_shear

MU_S, RISE, I_0 = 0.38, 0.26, 0.279
GRAINS = Soil(friction=float(np.tan(np.arcsin(MU_S))))
PRESSURE = 2e3


def steady(rate, *, pressure=PRESSURE, size_mm=5.0, shear=pure_shear, cell=0.01, soil=GRAINS):
    """Shear stress over mean stress in the plane, after enough shear to be steady, and the law."""
    steps = 2000
    path = lead(
        "inertial_friction", RISE, soil, shear(rate, steps), 0.05 / rate / steps,
        stress=(-pressure, -pressure, -pressure, 0.0), cell=cell, grain_size_mm=size_mm,
        inertial_number=I_0, grain_density_kg_m3=2500.0,
    )  # fmt: skip
    xx, yy, _, xy = path.stress[-1]
    mean = -0.5 * (xx + yy)
    inertia = rate * 1e-3 * size_mm / np.sqrt(mean / 2500.0)
    return np.hypot(0.5 * (xx - yy), xy) / mean, MU_S + RISE / (1.0 + I_0 / inertia)


@pytest.mark.parametrize("rate", [0.01, 1.0, 10.0, 100.0, 10000.0])
@pytest.mark.parametrize("shear", [pure_shear, simple_shear])
def test_shear_over_normal_stress_is_the_law(rate, shear):
    found, law = steady(rate, shear=shear)
    assert found == pytest.approx(law, rel=1e-3)


def test_it_is_slow_friction_at_rest_and_the_second_one_in_the_limit():
    assert steady(1e-4)[0] == pytest.approx(MU_S, rel=1e-3)
    assert steady(1e6)[0] == pytest.approx(MU_S + RISE, rel=1e-3)


def test_a_model_enlarged_with_its_grains_has_the_same_friction():
    """Lengths times 400: pressure, stiffness, grains and cells times 400, rates over 20."""
    stiff = replace(GRAINS, youngs_modulus=400.0 * GRAINS.youngs_modulus)
    true, _ = steady(40.0, pressure=1e4, size_mm=1.25)
    large, _ = steady(2.0, pressure=4e6, size_mm=500.0, cell=4.0, soil=stiff)
    assert true > MU_S + 0.01
    assert true == pytest.approx(large, rel=2e-3)


def test_pressure_below_the_weight_of_half_a_spacing_counts_as_that():
    found, _ = steady(10.0, pressure=1e3, cell=2.0)
    inertia = 10.0 * 0.005 / np.sqrt(0.25 * 9.81 * 2.0)
    assert found == pytest.approx(MU_S + RISE / (1.0 + I_0 / inertia), rel=1e-3)


def test_without_pressure_and_with_too_much_friction_it_stays_bounded():
    soil = Soil(friction=float(np.tan(np.radians(60.0))))
    path = lead("inertial_friction", 0.6, soil, pure_shear(1e6, 10), 1e-9)
    assert np.isfinite(path.strength).all()
    assert path.strength[-1, 0] == pytest.approx(0.99, rel=1e-5)


def test_soil_without_friction_is_left_alone():
    path = lead("inertial_friction", 0.5, Soil(cohesion=10e3), pure_shear(10.0, 100), 1e-4)
    assert np.all(path.strength[:, 0] == 0.0)
    assert np.all(path.strength[:, 1] == np.float32(20e3))
    no_friction = {name: {"friction_deg": 0, "cohesion_kpa": 5} for name in ("silt", "sand")}
    assert "friction" in effect("inertial_friction").applies(slump(materials=no_friction))


def column(effects):
    """A column of 0.1 m x 0.1 m of grains of a millimetre next to a wall."""
    return scene_from_mapping(
        {
            "name": "column",
            "domain": {"x_min": 0, "x_max": 0.6, "y_max": 0.15},
            "ground": {"points": [[0, 0], [0.6, 0]]},
            "zones": [
                {"name": "a", "material": "s",
                 "polygon": [[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]}
            ],
            "materials": {
                "s": {"friction_deg": 22.3, "cohesion_kpa": 0, "density": 1800.0,
                      "youngs_modulus_mpa": 0.5}
            },
            "spacing": 0.004,
            "effects": effects,
        }
    )  # fmt: skip


@pytest.mark.slow
def test_the_front_of_a_dry_column_stops_nearer_and_its_body_stays():
    entry = {"inertial_friction": {"amplitude": 0.26, "grain_size_mm": 1.0}}
    fine = {"inertial_friction": {"amplitude": 0.26, "grain_size_mm": 0.001}}
    settings = SimulationSettings(duration_s=1.2, early_stop_hold_s=0.1)
    scenes = [column({}), column(entry), column(fine)]
    base, braked, powder = simulate(scenes, settings, threads=1)
    assert all(run.status == "finished" for run in (base, braked, powder))
    front = [np.sort(run.positions[-1, :, 0])[-4] - 0.1 for run in (base, braked, powder)]
    assert front[1] < 0.92 * front[0]
    assert front[2] == pytest.approx(front[0], rel=0.03), "grains without size brake nothing"
    top = [run.positions[-1, :, 1].max() for run in (base, braked)]
    assert top[1] == pytest.approx(top[0], rel=0.08)
    assert 0.0 < braked.audit["numerical_share"] < 0.05
