"""The same slide on a base that lies anywhere between the lines of the grid."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.verification.infinite_slope import (
    DENSITY,
    GRAVITY,
    THICKNESS,
    Slab,
    lower_in_stages,
)
from benchmarks.verification.lab import Lab
from geometry.scenes.scene import scene_from_mapping
from mpm_taichi import layout
from mpm_taichi.simulate import simulate
from mpm_taichi.solver import boundary, initial_state
from pipeline.config import SimulationSettings


def block(contact, friction_deg, cohesion_kpa):
    """A block, 2 m between its points, that collapses to the right."""
    ground = {"points": [[0, 0], [260, 0]], "contact": contact}
    if contact == "coulomb":
        ground["friction_coefficient"] = 0.1
    outline = [[0, 0], [100, 0], [80, 16], [0, 16]]
    soil = {"friction_deg": friction_deg, "cohesion_kpa": cohesion_kpa, "density": 1900}
    return scene_from_mapping(
        {
            "name": "block",
            "domain": {"x_min": 0, "x_max": 260, "y_max": 30},
            "ground": ground,
            "zones": [{"name": "a", "material": "soil", "polygon": outline}],
            "materials": {"soil": {**soil, "youngs_modulus_mpa": 20, "poisson_ratio": 0.4}},
            "spacing": 2,
        }
    )


@pytest.fixture
def slide(monkeypatch):
    """Mean way along x and elevation of the lowest 1 % [m] with the grid `offset` cells lower."""

    def run(scene, offset):
        def make_grid(of):
            grid = boundary.make_grid(of)
            low = (grid.origin[0], grid.origin[1] - offset * grid.cell)
            return replace(grid, origin=low, shape=(grid.shape[0], grid.shape[1] + 1))

        monkeypatch.setattr(initial_state, "make_grid", make_grid)
        (found,) = simulate([scene], SimulationSettings(duration_s=20), threads=1)
        assert found.status == "finished", found.reason
        way = found.positions[-1][:, 0] - found.positions[0][:, 0]
        return float(way.mean()), float(np.percentile(found.positions[-1][:, 1], 1))

    return run


@pytest.mark.parametrize(
    ("contact", "friction_deg", "cohesion_kpa", "within"),
    [("rough", 0, 15, 0.05), ("coulomb", 20, 2, 0.06)],
)
def test_a_slide_runs_as_far_wherever_its_base_lies_in_the_cells(
    slide, contact, friction_deg, cohesion_kpa, within
):
    # With the nodes below the base alone to hold it up, the soil sank to them: +49 % at 0.9.
    scene = block(contact, friction_deg, cohesion_kpa)
    way, _ = slide(scene, 0.0)
    for offset in (0.25, 0.5, 0.9):
        other, lowest = slide(scene, offset)
        assert other == pytest.approx(way, rel=within), offset
        assert lowest > -0.1 * scene.cell_size, "soil does not sink to the nodes below"


def test_bonded_ground_holds_between_the_lines_too(slide):
    scene = block("no_slip", 0, 15)
    rough, _ = slide(block("rough", 0, 15), 0.0)
    for offset in (0.25, 0.5, 0.9):
        way, lowest = slide(scene, offset)
        assert way < 0.75 * rough, "bonded soil runs less far"
        assert lowest > 0.0


@pytest.mark.parametrize("friction_deg", [0.0, 20.0])
def test_a_slab_that_is_strong_enough_stays_on_a_slope_across_the_cells(friction_deg):
    slab = Slab(friction_deg, 0.15 if friction_deg else 0.4, "rough", level=False)
    lab = Lab(slab.scene())
    lab.run(0)
    lab.reduce_strength("soil", 0.85 * slab.without_dilation(slab.formula))
    middle = np.abs(lab.start[:, 0] - lab.start[:, 0].mean()) < THICKNESS
    lab.run(round(3.0 / lab.frame_time))
    before = lab.position[middle].mean(axis=0)
    lab.run(round(2.0 / lab.frame_time))
    crept = np.hypot(*(lab.position[middle].mean(axis=0) - before))
    assert crept < 1e-3 * THICKNESS


@pytest.mark.parametrize("friction_deg", [0.0, 20.0])
def test_a_slab_settles_on_a_slope_across_the_cells(friction_deg):
    # With the whole force damped, 6000 steps left two thirds of the weight unbalanced.
    slab = Slab(friction_deg, 0.15 if friction_deg else 0.4, "rough", level=False)
    lab = Lab(slab.scene())
    lab.run(0)
    assert lab.slots.numbers[0, layout.UNBALANCED] <= layout.SETTLE_TOLERANCE
    assert lab.slots.integers[0, layout.SETTLE_STEPS] < 400
    # On planes along the base act the parts of the weight above, sin(b) and cos(b) of it.
    b = slab.slope
    middle = np.abs(lab.start[:, 0] - lab.start[:, 0].mean()) < 2.0 * THICKNESS
    xx, yy, _, xy = lab.stress[middle].mean(axis=0)
    normal = -(xx * np.sin(b) ** 2 + yy * np.cos(b) ** 2 + 2.0 * xy * np.sin(b) * np.cos(b))
    shear = (yy - xx) * np.sin(b) * np.cos(b) + xy * (np.sin(b) ** 2 - np.cos(b) ** 2)
    above = lab.start[middle, 1] - lab.scene.ground.height(lab.start[middle, 0])
    weight = DENSITY * GRAVITY * (THICKNESS / np.cos(b) - above.mean()) * np.cos(b)
    assert normal == pytest.approx(weight * np.cos(b), rel=0.01)
    assert abs(shear) == pytest.approx(weight * np.sin(b), rel=0.01)


@pytest.mark.parametrize(
    "ground",
    [[[0, 4], [60, 0]], [[0, 0.7], [50, 0.7], [52, 0], [60, 0]]],
    ids=["sloping", "between two lines"],
)
def test_a_bank_settles_on_ground_across_the_cells_and_stays(ground):
    foot = float(np.interp(25.0, *np.transpose(ground)))
    scene = scene_from_mapping(
        {
            "name": "bank",
            "domain": {"x_min": 0, "x_max": 60, "y_max": 15},
            "ground": {"points": ground},
            "zones": [
                {
                    "name": "a",
                    "material": "soil",
                    "polygon": [ground[0], [25, foot], [15, 10], [0, 10]],
                }
            ],
            "materials": {"soil": {"friction_deg": 0, "cohesion_kpa": 500, "density": 1900,
                                   "youngs_modulus_mpa": 20, "poisson_ratio": 0.4}},
            "spacing": 0.5,
        }
    )  # fmt: skip
    (run,) = simulate([scene], SimulationSettings(duration_s=2.0), threads=1)
    assert run.audit["settle_unbalanced"] <= layout.SETTLE_TOLERANCE
    assert run.audit["settle_steps"] < 600
    assert np.abs(run.positions[-1] - run.positions[0]).max() < 0.1 * scene.spacing


@pytest.mark.slow
def test_factor_of_safety_of_a_slab_on_a_slope_across_the_cells():
    slab = Slab(20.0, 0.15, "rough", level=False, spacing=0.5)
    expected = slab.without_dilation(slab.formula)
    assert lower_in_stages(slab, 0.9).found == pytest.approx(expected, rel=0.05)
