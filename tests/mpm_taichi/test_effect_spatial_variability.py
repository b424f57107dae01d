"""Spatial variability: statistics of the field, mean kept, and what it does to a slump."""

import numpy as np
import pytest

from geometry.scenes.fill import fill
from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects.spatial_variability import gaussian_field, multiplier
from mpm_taichi.simulate import simulate
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

SEEDS = range(600)


def test_field_has_mean_nil_variance_one_and_exponential_correlation():
    x = np.array([0.0, 1.0, 5.0, 10.0, 30.0])
    field = np.array([gaussian_field(x, correlation_length=10.0, seed=seed) for seed in SEEDS])
    spread = 1.0 / np.sqrt(len(SEEDS))
    assert np.abs(field.mean(axis=0)).max() < 3.5 * spread
    assert field.var(axis=0) == pytest.approx(np.ones(5), abs=3.5 * np.sqrt(2.0) * spread)
    correlation = (field * field[:, :1]).mean(axis=0)
    assert correlation == pytest.approx(np.exp(-x / 10.0), abs=4.0 * spread)


def test_value_at_a_place_does_not_depend_on_the_other_places():
    line = np.linspace(-50.0, 400.0, 901)
    whole = gaussian_field(line, correlation_length=20.0, seed=3)
    assert np.allclose(gaussian_field(line[::9], correlation_length=20.0, seed=3), whole[::9])


def strip(length: float, spacing: float = 1.0, **effect):
    """A liquefied strip under a firm one."""
    return scene_from_mapping(
        {
            "name": "strip",
            "domain": {"x_min": -100, "x_max": length + 100, "y_max": 20},
            "ground": {"points": [[0, 0], [length, 0]]},
            "zones": [
                {"name": "a", "material": "soft",
                 "polygon": [[0, 0], [length, 0], [length, 4], [0, 4]]},
                {"name": "b", "material": "firm",
                 "polygon": [[0, 4], [length, 4], [length, 7], [0, 7]]},
            ],
            "materials": {
                "soft": {"friction_deg": 0, "cohesion_kpa": 3, "liquefied": True},
                "firm": {"friction_deg": 30, "cohesion_kpa": 3},
            },
            "spacing": spacing,
            "effects": {"spatial_variability": effect} if effect else {},
        }
    )  # fmt: skip


def values(scene, amplitude, length=5.0, seed=1):
    points = fill(scene)
    parameters = {"correlation_length_m": length, "seed": seed}
    soft = points.material == 0
    return multiplier(scene, points.position, amplitude, parameters), soft, points.position


def test_mean_of_the_liquefied_soil_is_kept():
    for seed in (1, 2, 3):
        factor, soft, _ = values(strip(60.0), 0.4, length=20.0, seed=seed)
        assert factor[soft].mean() == pytest.approx(1.0, abs=1e-12)
        assert factor.min() > 0.0


def test_amplitude_is_the_coefficient_of_variation_and_the_field_is_lognormal():
    for amplitude in (0.1, 0.4):
        factor, soft, _ = values(strip(10000.0), amplitude)
        logs = np.log(factor[soft])
        assert factor[soft].std() == pytest.approx(amplitude, rel=0.08)
        assert logs.std() == pytest.approx(np.sqrt(np.log1p(amplitude**2)), rel=0.08)
        skew = np.mean((logs - logs.mean()) ** 3) / logs.std() ** 3
        assert abs(skew) < 0.3


def test_pattern_is_the_same_at_every_spacing_and_differs_from_seed_to_seed():
    coarse, soft, position = values(strip(100.0, spacing=1.0), 0.3, length=20.0)
    fine, soft_fine, place = values(strip(100.0, spacing=0.5), 0.3, length=20.0)
    at = np.interp(position[soft, 0], *_line(place[soft_fine, 0], fine[soft_fine]))
    assert np.corrcoef(at, coarse[soft])[0, 1] > 0.99
    other, _, _ = values(strip(100.0), 0.3, length=20.0, seed=2)
    assert abs(np.corrcoef(other[soft], coarse[soft])[0, 1]) < 0.9


def _line(x, value):
    places, first = np.unique(x, return_index=True)
    return places, value[first]


def test_strength_of_a_liquefied_point_is_multiplied():
    shear = pure_shear(1.0, 100)
    soft = lead("spatial_variability", 0.3, Soil(cohesion=10e3, liquefied=True), shear, 1e-4,
                field=1.3)  # fmt: skip
    assert soft.strength[-1, 1] == pytest.approx(26e3)
    firm = lead("spatial_variability", 0.3, Soil(cohesion=10e3), shear, 1e-4, field=1.3)
    assert firm.strength[-1, 1] == pytest.approx(20e3)


@pytest.mark.slow
def test_it_breaks_the_symmetry_of_a_slump_as_its_seed_says():
    settings = SimulationSettings(duration_s=8.0)
    even, one, two = simulate(
        [
            strip(40.0),
            strip(40.0, amplitude=0.5, correlation_length_m=10.0, seed=1),
            strip(40.0, amplitude=0.5, correlation_length_m=10.0, seed=2),
        ],
        settings,
        threads=1,
    )
    ends = [
        (-run.positions[-1, :, 0].min(), run.positions[-1, :, 0].max() - 40.0)
        for run in (even, one, two)
    ]
    assert ends[0][0] == pytest.approx(ends[0][1], abs=0.02)
    assert abs(ends[1][0] - ends[1][1]) > 0.5
    assert np.abs(np.subtract(ends[1], ends[2])).max() > 0.5


@pytest.mark.slow
def test_a_seed_is_a_whole_number():
    scene = strip(40.0, amplitude=0.3, seed=1.5)
    with pytest.raises(InputError, match=r"seed 1.5: allowed are whole numbers"):
        simulate([scene], SimulationSettings(duration_s=1.0))


def test_needs_liquefied_soil():
    scene = strip(40.0).model_dump()
    scene["materials"]["soft"]["liquefied"] = False
    scene["effects"] = {"spatial_variability": 0.3}
    with pytest.raises(InputError, match="no material is marked liquefied"):
        simulate([scene_from_mapping(scene)], SimulationSettings(duration_s=1.0))
