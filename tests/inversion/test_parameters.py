"""Transforms of parameters, and values put into scenes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry.scenes.scene import Scene
from inversion.estimation.unknowns import RATIO_STD, Parameters
from inversion.problem.question import Prior
from inversion.problem.scene_changes import with_properties
from inversion.problem.state import DIGITS
from tests.inversion.analytic import angle, strength

low_and_width = st.tuples(st.floats(0.1, 60.0), st.floats(1.05, 50.0))


@st.composite
def any_parameters(draw):
    specs = []
    for place in range(draw(st.integers(1, 4))):
        low, ratio = draw(low_and_width)
        high = min(low * ratio, 88.0) if place % 2 else low * ratio
        start = low + draw(st.floats(0.0, 1.0)) * (high - low)
        start = min(max(start, low), high)
        prior = None
        if draw(st.booleans()):
            prior = Prior(mean=start, std=draw(st.floats(0.01, 10.0)))
        make = angle if place % 2 else strength
        specs.append(make(f"p{place}", start=start, low=low, high=high, prior=prior))
    return Parameters(specs)


@given(any_parameters(), st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4))
def test_values_come_back_from_fitted_numbers(parameters, shares):
    share = np.array(shares[: len(parameters.specs)])
    values = parameters.low + share * (parameters.high - parameters.low)
    values = parameters.clipped(values)
    again = parameters.to_values(parameters.to_fitted(values))
    np.testing.assert_allclose(again, values, rtol=1e-9)


@given(any_parameters(), st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=4))
def test_values_stay_within_the_bounds(parameters, fitted):
    values = parameters.to_values(np.array(fitted[: len(parameters.specs)]))
    assert np.all(values >= parameters.low) and np.all(values <= parameters.high)


@given(any_parameters())
def test_chain_rule_against_differences(parameters):
    values = np.sqrt(parameters.low * parameters.high)
    fitted = parameters.to_fitted(values)
    step = 1e-6 * np.maximum(np.abs(fitted), 1.0)
    plain = Parameters(
        [spec.model_copy(update={"low": 1e-6, "high": 1e9}) for spec in parameters.specs]
    )
    scale = parameters.prior_std / plain.prior_std

    def values_of(numbers):  # without the bounds, which would cut a difference at an end
        return plain.to_values(numbers * scale)

    difference = (values_of(fitted + step) - values_of(fitted - step)) / (2 * step)
    np.testing.assert_allclose(difference, parameters.value_per_fitted(values), rtol=1e-5)


def test_a_prior_of_a_strength_is_relative():
    parameters = Parameters([strength("a", prior=Prior(mean=20, std=2)), strength("b")])
    assert parameters.prior_std[0] == pytest.approx(0.1)
    assert parameters.prior_std[1] == pytest.approx(np.log(90 / 5) / np.sqrt(12))


def test_bounds_are_noticed():
    parameters = Parameters([strength("a"), angle("b"), angle("c")])
    assert parameters.at_bound(np.array([5.0, 30.0, 37.0])) == ["low", None, "high"]


def box(name: str, x: float, material: str) -> dict:
    return {
        "name": name,
        "material": material,
        "polygon": [(x, 0.0), (x + 10, 0.0), (x + 10, 10.0), (x, 10.0)],
    }


@pytest.fixture
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "boxes",
            "domain": {"x_min": 0, "x_max": 60, "y_max": 20},
            "ground": {"points": [(0, 0), (60, 0)]},
            "zones": [box("left", 0, "soil"), box("middle", 10, "soil"), box("right", 20, "rock")],
            "materials": {
                "soil": {"friction_deg": 0, "cohesion_kpa": 20, "saturated_density": 2000},
                "rock": {"friction_deg": 40, "cohesion_kpa": 5},
            },
            "spacing": 1.0,
        }
    )


def test_a_zone_that_is_not_named_keeps_its_soil(scene):
    changed = with_properties(scene, [("middle", "cohesion_kpa", 7.0)])
    soil = {zone.name: changed.materials[zone.material] for zone in changed.zones}
    assert soil["left"].cohesion_kpa == 20 and soil["right"].cohesion_kpa == 5
    assert soil["middle"].cohesion_kpa == 7 and soil["middle"].friction_deg == 0


def test_zones_that_share_a_value_share_a_material(scene):
    changes = [("left", "cohesion_kpa", 9.0), ("middle", "cohesion_kpa", 9.0)]
    changed = with_properties(scene, changes)
    assert len(changed.materials) == 2
    assert with_properties(scene, changes[::-1]) == changed, "the order means nothing"


def test_saturated_density_goes_with_density(scene):
    changed = with_properties(scene, [("left", "density", 1900.0)])
    material = changed.materials[changed.zones[0].material]
    assert (material.density, material.saturated_density) == (1900, 2100)


def test_values_go_to_their_zones(scene):
    spec = strength("left").model_copy(update={"zones": ["left", "right"]})
    changed = Parameters([spec]).scene(scene, np.array([12.5]))
    found = [changed.materials[zone.material].cohesion_kpa for zone in changed.zones]
    assert found == [12.5, 20, 12.5]


def test_values_that_differ_by_rounding_make_one_run(scene):
    parameters = Parameters([strength("left", start=12.345678912, low=1)])
    made = [
        parameters.scene(scene, [value])
        for value in (12.345678912, 12.345678912 + 1e-12, 12.345678912 - 1e-12)
    ]
    assert made[0] == made[1] == made[2]
    used = made[0].materials[made[0].zones[0].material].cohesion_kpa
    assert used == pytest.approx(12.345678912, rel=10.0 ** (1 - DIGITS))
    assert parameters.scene(scene, [12.3456]) != made[0]


def test_a_common_prior_counts_deviations_from_the_mean():
    """As many rows as are independent: no decomposition, whose signs are arbitrary, is needed."""
    parameters = Parameters([strength("a"), angle("b"), strength("c", high=60.0), strength("d")])
    rows, constants = parameters.prior
    assert np.linalg.matrix_rank(rows) == len(rows) == 3
    values = np.array([20.0, 31.0, 40.0, 11.0])
    ratios = np.log(values / parameters.start)[[0, 2, 3]] / RATIO_STD
    off = (values[1] - parameters.start[1]) / parameters.prior_std[1]
    found = rows @ parameters.to_fitted(values) - constants
    assert found @ found == pytest.approx(off**2 + np.sum((ratios - ratios.mean()) ** 2))
