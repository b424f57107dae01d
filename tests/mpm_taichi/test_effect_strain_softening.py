"""Strain softening: one element against the law, its dissipation, and no hanging on the cell."""

import numpy as np
import pytest

from tests.mpm_taichi.one_point import Soil, lead, pure_shear

SOIL = Soil(cohesion=10e3, liquefied=True)


@pytest.mark.parametrize("amplitude", [0.3, 3.0])
def test_sheared_element_follows_the_law(amplitude):
    path = lead("strain_softening", amplitude, SOIL, pure_shear(1.0, 6000), 2e-4, cell=2.0)
    shear_stress = 0.5 * (path.stress[:, 0] - path.stress[:, 1])
    before = np.concatenate([[0.0], path.shear[:-1]])  # what the strength of a step was made of
    law = 10e3 * (1.0 + amplitude * np.exp(-before / 0.3))
    yielding = path.shear > 0.01
    assert yielding.sum() > 5000
    assert shear_stress[yielding] == pytest.approx(law[yielding], rel=1e-4)
    assert shear_stress[-1] < 10e3 * (1.0 + 0.03 * amplitude)


def test_energy_of_softening_is_the_area_under_the_law():
    path = lead("strain_softening", 2.0, SOIL, pure_shear(1.0, 6000), 2e-4, cell=2.0)
    g = path.shear[-1]
    area = 10e3 * (g + 2.0 * 0.3 * (1.0 - np.exp(-g / 0.3)))
    assert path.dissipated[-1] == pytest.approx(area, rel=2e-3)


def test_with_exponent_one_a_slip_costs_the_same_strength_in_a_band_of_any_cell():
    slip, left = 0.5, []
    for cell in (0.5, 1.0, 4.0):
        steps = 4000
        gradients = pure_shear(1.0, steps)
        path = lead("strain_softening", 2.0, SOIL, gradients, slip / cell / steps, cell=cell,
                    cell_exponent=1.0)  # fmt: skip
        plastic = path.shear[-1] * cell
        left.append((path.strength[-1, 1] / 20e3 - 1.0) / (2.0 * np.exp(-plastic / (0.3 * 2.0))))
    assert left == pytest.approx([1.0] * 3, rel=2e-3)


def test_parameters_and_other_soil():
    slow = lead("strain_softening", 1.0, SOIL, pure_shear(1.0, 1000), 1e-3, cell=2.0)
    fast = lead("strain_softening", 1.0, SOIL, pure_shear(1.0, 1000), 1e-3, cell=2.0,
                reference_strain=0.05)  # fmt: skip
    doubled = lead("strain_softening", 1.0, SOIL, pure_shear(1.0, 1000), 1e-3, cell=2.0,
                   reference_strain=0.15, reference_cell_m=8.0)  # fmt: skip
    assert fast.strength[-1, 1] < 0.99 * slow.strength[-1, 1]
    assert doubled.strength[-1, 1] == pytest.approx(slow.strength[-1, 1], rel=1e-5)
    other = lead("strain_softening", 1.0, Soil(cohesion=10e3), pure_shear(1.0, 100), 1e-3)
    assert np.all(other.strength[:, 1] == np.float32(20e3))
