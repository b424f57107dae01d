"""Readings of a deposit in plan, against bodies whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.survey3d.deposit import (
    Plan,
    inundated_area,
    runout_along,
    samples_along,
    threshold,
    toe_line,
    volume_beyond,
)


def slab(length: float, width: float, height: float, d: float = 1.0) -> tuple:
    """Points of a block from the corner (0, 0, 0), and their volumes."""
    axes = [d * (np.arange(round(edge / d)) + 0.5) for edge in (length, width, height)]
    position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return position, np.full(len(position), d**3)


@pytest.mark.parametrize("width", [8.0, 9.0, 7.0])
def test_a_slab_has_its_thickness_up_to_the_edge_of_the_domain(width):
    plan = Plan.over((0.0, 20.0, 0.0, width), 2.0)
    thickness = plan.thickness(*slab(20.0, width, 3.0))
    assert thickness.values == pytest.approx(3.0, rel=1e-3)
    assert plan.area.sum() == pytest.approx(20.0 * width)
    assert (thickness.values * plan.area).sum() == pytest.approx(60.0 * width)


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_toe_is_where_the_slab_ends_on_either_side(side):
    position, volume = slab(10.0, 8.0, 4.0)
    position[:, 0] += 10.0
    deposit = Plan.over((0.0, 30.0, 0.0, 8.0), 2.0).thickness(position, volume)
    y, toe = toe_line(deposit, 1.0, side)
    assert y == pytest.approx([1.0, 3.0, 5.0, 7.0])
    assert toe == pytest.approx(10.0 if side == "left" else 20.0, abs=1.0)


def test_runout_along_a_bent_path_is_its_way():
    deposit = Plan.over((0.0, 40.0, 0.0, 40.0), 2.0).thickness(*slab(20.0, 20.0, 2.0))
    path = np.array([[10.0, 10.0], [10.0, 16.0], [38.0, 16.0]])
    assert runout_along(deposit, path, 1.0) == pytest.approx(6.0 + 10.0, abs=1.0)
    assert np.isnan(runout_along(deposit, path + 25.0, 1.0))
    way, places = samples_along(path, 1.0)
    assert way[-1] == pytest.approx(34.0)
    assert places[6] == pytest.approx([10.0, 16.0])


def test_area_and_volume_beyond_a_line():
    plan = Plan.over((0.0, 40.0, 0.0, 8.0), 2.0)
    position, volume = slab(10.0, 8.0, 4.0)
    after = position.copy()
    after[:, 0] = 2.0 * after[:, 0] + 4.0  # over 4 to 24 m at half the thickness
    before, now = plan.thickness(position, volume), plan.thickness(after, volume)
    assert inundated_area(before, now, 1.0) == pytest.approx(14.0 * 8.0)
    assert volume_beyond(after, volume, (14.0, 0.0), (14.0, 8.0)) == pytest.approx(160.0)
    assert volume_beyond(after, volume, (14.0, 8.0), (14.0, 0.0)) == pytest.approx(160.0)
    assert volume_beyond(after, volume, (22.0, 0.0), (22.0, 8.0)) == pytest.approx(32.0)
    assert volume_beyond(after, volume, (22.0, 8.0), (22.0, 0.0)) == pytest.approx(288.0)


def test_the_largest_value_of_each_pixel_and_none_where_no_point_is():
    plan = Plan.over((0.0, 6.0, 0.0, 2.0), 2.0)
    found = plan.largest(np.array([[1.0, 1.0], [1.4, 0.2], [5.0, 1.0]]), np.array([1.0, 3.0, 2.0]))
    assert np.array_equal(found.values, [[3.0], [np.nan], [2.0]], equal_nan=True)


def test_a_deposit_is_thicker_than_half_a_metre_and_than_a_point():
    assert (threshold(0.1), threshold(4.0)) == (0.5, 4.0)
