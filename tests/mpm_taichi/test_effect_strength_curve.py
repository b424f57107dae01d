"""The unknown curve: it can be any other law of strength, and is the hat functions it says."""

import numpy as np
import pytest

from geometry.scenes.scene import scene_from_mapping
from mpm_taichi.effects import effects_on
from mpm_taichi.effects.strength_curve import MOST_KNOTS, VARIABLES, entry
from pipeline.cli import InputError
from tests.mpm_taichi.one_point import Soil, lead, pure_shear

SOIL = Soil(cohesion=10e3, liquefied=True, overburden=60e3, mean_overburden=80e3)


def multiplier(variable, knots, coefficients, rate=1.0, start_time=0.0, steps=500):
    numbers = entry(variable, knots, coefficients)
    amplitude = numbers.pop("amplitude")
    path = lead("strength_curve", amplitude, SOIL, pure_shear(rate, steps), 1e-3,
                start_time=start_time, **numbers)  # fmt: skip
    return path, path.strength[:, 1] / 20e3


@pytest.mark.parametrize("count", [4, MOST_KNOTS])
def test_log_of_the_multiplier_is_the_interpolated_coefficients(count):
    knots = np.linspace(0.0, 0.5, count)
    coefficients = np.random.default_rng(count).normal(0, 0.5, count)
    path, found = multiplier("strain", knots, coefficients, rate=2.0)
    strain = np.concatenate([[0.0], path.shear[:-1]])
    assert strain[-1] > 0.6
    assert np.log(found) == pytest.approx(np.interp(strain, knots, coefficients), abs=2e-5)


@pytest.mark.parametrize(
    ("variable", "knots", "value"),
    [
        ("strain_rate", [-3, -2, -1, 0, 1], np.log10(0.2)),
        ("time", [0, 10, 20, 30], 17.0),
        ("overburden", [20, 40, 60, 80], 60.0),
        ("position", [-2, -1, 0, 1], 0.0),
    ],
)
def test_each_variable(variable, knots, value):
    coefficients = 0.1 * np.arange(len(knots)) ** 2
    _, found = multiplier(variable, knots, coefficients, rate=0.2, start_time=17.0, steps=1)
    assert np.log(found[0]) == pytest.approx(np.interp(value, knots, coefficients), abs=1e-4)


def test_it_can_be_the_library_s_rate_law():
    knots = [-2.0, -1.0, 0.0, 1.0, 2.0]
    law = np.log(1.0 + 0.1 * (np.array(knots) + 2.0))
    _, curve = multiplier("strain_rate", knots, law, rate=1.0, steps=10)
    rate = lead("rate_strengthening", 0.1, SOIL, pure_shear(1.0, 10), 1e-3)
    assert curve[-1] == pytest.approx(rate.strength[-1, 1] / 20e3, rel=1e-5)


def test_what_cannot_be_a_curve_is_refused():
    for wrong, message in (
        (("speed", [0, 1], [0, 0]), "variable 'speed' is unknown; known are: strain_rate, "),
        (("time", [0, 1, 3], [0, 0, 0]), "must ascend in equal steps"),
        (("time", [1, 0], [0, 0]), "must ascend in equal steps"),
        (("time", [0, 1, 2], [0, 0]), "3 knots and 2 coefficients"),
        (("time", list(range(8)), [0.0] * 8), "8 knots and 8 coefficients"),
    ):
        with pytest.raises(InputError, match=message):
            entry(*wrong)


@pytest.mark.parametrize("variable", VARIABLES)
def test_an_entry_is_one_of_a_scene(variable):
    scene = scene_from_mapping(
        {
            "name": "s",
            "domain": {"x_min": 0, "x_max": 10, "y_max": 10},
            "ground": {"points": [[0, 0]]},
            "zones": [{"name": "a", "material": "m", "polygon": [[2, 0], [8, 0], [8, 4], [2, 4]]}],
            "materials": {"m": {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": True}},
            "spacing": 1.0,
            "effects": {"strength_curve": entry(variable, [0, 1, 2, 3], [0.1, 0.0, -0.1, 0.2])},
        }
    )
    (active,) = effects_on(scene)
    assert active.parameters["variable"] == VARIABLES.index(variable)
    assert [active.parameters[f"c{j}"] for j in range(5)] == [0.1, 0.0, -0.1, 0.2, 0.0]
