"""Dilatancy: shear at constant volume, energy, and the volume of a slump that sheared."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from geometry.survey.surface_profile import surface_profile
from mpm_taichi.effects import effect
from mpm_taichi.simulate import simulate
from pipeline.config import SimulationSettings
from tests.mpm_taichi.one_point import Soil, lead, pure_shear, simple_shear

SAND = Soil(friction=0.7)
PRESSED = (-200e3, -200e3, -200e3, 0.0)


def plastic_volume(shear, amplitude, critical, most=np.inf):
    """Integral of sin(psi) over plastic shear; `most` is sin(phi)."""
    shear = np.minimum(shear, critical)
    if amplitude <= most:
        return amplitude * (shear - shear**2 / (2.0 * critical))
    until = critical * (1.0 - most / amplitude)  # sin(phi) governs until here
    rest = np.maximum(shear - until, 0.0)
    return most * np.minimum(shear, until) + most * (rest - rest**2 / (2 * (critical - until)))


@pytest.mark.parametrize("amplitude", [0.2, 0.05, -0.02, 0.6])
@pytest.mark.parametrize("form", [pure_shear, simple_shear])
def test_shear_at_constant_volume_raises_the_pressure_until_the_critical_strain(amplitude, form):
    path = lead("dilatancy", amplitude, SAND, form(1.0, 20000), 2e-5, stress=PRESSED,
                critical_strain=0.2)  # fmt: skip
    assert path.shear[-1] > 0.2, "the path must pass the critical strain"
    pressure = -path.stress[:, :3].mean(axis=1)
    sine = 0.7 / np.hypot(1.0, 0.7)
    change = plastic_volume(path.shear, amplitude, 0.2, sine) * SAND.bulk_modulus
    # The volume of the path itself, to second order in a step, is what shear does to an area.
    expected = 200e3 + change - SAND.bulk_modulus * path.volumetric
    assert pressure == pytest.approx(expected, rel=2e-3)
    late = path.shear > 0.2
    assert np.ptp(pressure[late]) < 1e-3 * pressure[-1]


@pytest.mark.parametrize("amplitude", [0.5, -0.02])
def test_work_done_on_a_point_is_stored_or_dissipated(amplitude):
    gradient, dt = pure_shear(1.0, 20000), 1e-5
    path = lead("dilatancy", amplitude, SAND, gradient, dt, stress=PRESSED, critical_strain=0.5)
    before = np.concatenate([[PRESSED], path.stress[:-1]])
    mean = 0.5 * (before + path.stress)
    power = mean[:, 0] * gradient[:, 0] + mean[:, 1] * gradient[:, 3]
    work = np.cumsum(power) * dt
    stored = energy(path.stress) - energy(np.array([PRESSED]))
    assert path.dissipated[-1] > 0.0
    assert stored + path.dissipated == pytest.approx(work, abs=5e-3 * work[-1])


def energy(stress):
    pressure = stress[:, :3].mean(axis=1)
    shear = np.sum((stress[:, :3] - pressure[:, None]) ** 2, axis=1) + 2.0 * stress[:, 3] ** 2
    return 0.5 * pressure**2 / SAND.bulk_modulus + 0.25 * shear / SAND.shear_modulus


def test_soil_without_friction_and_liquefied_soil_shear_at_constant_volume():
    for soil in (Soil(cohesion=5e3), Soil(friction=0.7, liquefied=True)):
        path = lead("dilatancy", 0.3, soil, pure_shear(1.0, 2000), 1e-4, stress=PRESSED)
        base = lead("bingham", 1e-9, soil, pure_shear(1.0, 2000), 1e-4, stress=PRESSED)
        assert path.stress == pytest.approx(base.stress, rel=1e-5)


def column(effects):
    return scene_from_mapping(
        {
            "name": "column",
            "domain": {"x_min": -20, "x_max": 50, "y_max": 20},
            "ground": {"points": [[-20, 0], [50, 0]]},
            "zones": [
                {"name": "a", "material": "sand", "polygon": [[5, 0], [25, 0], [25, 8], [5, 8]]}
            ],
            "materials": {"sand": {"friction_deg": 33, "cohesion_kpa": 0.5}},
            "spacing": 0.5,
            "effects": effects,
        }
    )


def test_what_has_sheared_has_grown_by_half_amplitude_times_critical_strain():
    settings = SimulationSettings(duration_s=6.0)
    entries = [{"dilatancy": {"amplitude": a, "critical_strain": 0.3}} for a in (0.2, -0.1)]
    base, *others = simulate([column({}), *map(column, entries)], settings, threads=1)
    for run, amplitude in zip(others, (0.2, -0.1), strict=True):
        assert run.status == "finished", run.reason
        assert abs(run.audit["numerical_share"]) < abs(base.audit["numerical_share"]) + 0.01
        sheared = run.plastic_shear_strain > 0.4
        assert sheared.sum() > 100
        growth = np.median(run.volume[sheared] / run.initial_volume[sheared] - 1.0)
        calm = np.median(base.volume[sheared] / base.initial_volume[sheared] - 1.0)
        assert growth - calm == pytest.approx(0.5 * amplitude * 0.3, rel=0.1)


def test_a_survey_sees_the_volume_that_soil_has_gained():
    settings = SimulationSettings(duration_s=3.0)
    base, swollen = simulate([column({}), column({"dilatancy": 0.3})], settings, threads=1)
    assert np.array_equal(base.bulk_volume, base.initial_volume.astype(float))
    assert np.array_equal(swollen.bulk_volume, swollen.volume.astype(float))
    x = np.arange(-10.0, 41.0, 0.5)
    area = [
        surface_profile(run.positions[-1], volume, x, spacing=0.5).sum() * 0.5
        for run, volume in (
            (base, base.bulk_volume),
            (swollen, swollen.initial_volume),
            (swollen, swollen.bulk_volume),
        )
    ]
    assert area[1] == pytest.approx(area[0], rel=2e-3), "of the mass"
    assert area[2] - area[0] == pytest.approx(swollen.volume.sum() - 160.0, rel=0.1)
    assert area[2] > area[0] + 1.0


def test_needs_frictional_soil():
    scene = column({}).with_strength("sand", friction_deg=0.0, cohesion_kpa=5.0)
    assert "friction" in effect("dilatancy").applies(scene)
    assert effect("dilatancy").applies(column({})) == ""
