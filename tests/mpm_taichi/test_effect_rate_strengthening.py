"""Rate strengthening: one element at rates over six decades."""

import numpy as np
import pytest

from tests.mpm_taichi.one_point import Soil, lead, pure_shear, simple_shear

SOIL = Soil(cohesion=10e3, liquefied=True)


@pytest.mark.parametrize("rate", [0.001, 0.01, 0.1, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize("amplitude", [0.05, 0.2])
def test_strength_grows_by_a_share_for_each_decade_above_the_reference(rate, amplitude):
    path = lead("rate_strengthening", amplitude, SOIL, pure_shear(rate, 1000), 0.1 / rate / 1000)
    shear_stress = 0.5 * (path.stress[-1, 0] - path.stress[-1, 1])
    law = 10e3 * (1.0 + amplitude * max(np.log10(rate / 0.01), 0.0))
    assert shear_stress == pytest.approx(law, rel=1e-4)


def test_the_rate_is_that_of_shear_in_any_direction_and_no_turn():
    along = lead("rate_strengthening", 0.1, SOIL, pure_shear(2.0, 10), 1e-4)
    simple = lead("rate_strengthening", 0.1, SOIL, simple_shear(2.0, 10), 1e-4)
    turn = lead("rate_strengthening", 0.1, SOIL, np.tile([0.0, 5.0, -5.0, 0.0], (10, 1)), 1e-4)
    assert simple.strength[-1, 1] == pytest.approx(along.strength[-1, 1], rel=1e-6)
    assert turn.strength[-1, 1] == pytest.approx(20e3, rel=1e-6)


def test_reference_rate_and_other_soil():
    near = lead("rate_strengthening", 0.1, SOIL, pure_shear(1.0, 10), 1e-4,
                reference_rate_per_s=1.0)  # fmt: skip
    assert near.strength[-1, 1] == pytest.approx(20e3, rel=1e-5)
    other = lead("rate_strengthening", 0.1, Soil(cohesion=10e3), pure_shear(1.0, 10), 1e-4)
    assert np.all(other.strength[:, 1] == np.float32(20e3))
