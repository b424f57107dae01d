"""The load of the soil above each point, against bodies whose weight is known."""

from __future__ import annotations

import pytest
import torch

from gns.network.features import overburden_features


def lattice(columns: int, height) -> torch.Tensor:
    """Points one spacing apart, `height(x)` of them in a column."""
    points = [
        (x + 0.5, y + 0.5) for x in range(columns) for y in range(int(round(height(x + 0.5))))
    ]
    return torch.tensor(points, dtype=torch.float64)


def described(points: torch.Tensor, density: float = 1.8, factor: float = 1.0):
    ones = torch.ones(len(points), dtype=points.dtype)
    found = overburden_features(points, density * ones, factor * ones)
    slopes = found[:, 2:] / (1.0 - found[:, 2:].square()).sqrt()
    return torch.expm1(found[:, :2]), slopes


def test_a_block_weighs_what_lies_above():
    points = lattice(40, lambda x: 12)
    inside = (points[:, 0] > 6) & (points[:, 0] < 34)
    level, slope = described(points)
    deep = inside & (points[:, 1] > 2) & (points[:, 1] < 8)  # sums are smoothed over a cell
    torch.testing.assert_close(level[deep, 0], 12.0 - points[deep, 1], rtol=0, atol=0.3)
    torch.testing.assert_close(
        level[inside, 1], torch.full_like(level[inside, 1], 12.0), rtol=0, atol=0.02
    )
    assert float(slope[inside].abs().max()) < 0.05


@pytest.mark.parametrize(("rise", "side"), [(0.5, 1.0), (0.5, -1.0), (1.0, 1.0)])
def test_a_slope_is_felt_as_steep_as_it_is(rise, side):
    points = lattice(40, lambda x: rise * (x if side > 0 else 40 - x))
    inside = (points[:, 0] > 12) & (points[:, 0] < 28) & (points[:, 1] < 4)
    _, slope = described(points)
    for kind in (0, 1):  # above the point, and of the whole column
        torch.testing.assert_close(
            slope[inside, kind].mean(),
            torch.tensor(side * rise, dtype=torch.float64),
            rtol=0.06,
            atol=0.0,
        )


def test_weight_is_in_units_of_the_own_soil_and_less_under_water():
    points = lattice(20, lambda x: 10)
    dry, wet = described(points)[0], described(points, factor=0.5)[0]
    torch.testing.assert_close(wet, 0.5 * dry)
    torch.testing.assert_close(described(points, density=2.4)[0], dry)
    density = torch.where(points[:, 1] > 5, 3.6, 1.8)
    ones = torch.ones_like(density)
    level = torch.expm1(overburden_features(points, density, ones)[:, :2])
    low = (points[:, 0] > 6) & (points[:, 0] < 14) & (points[:, 1] < 1)
    assert float(level[low, 0].mean()) == pytest.approx(9.5 + 5.0, abs=0.5)


def test_derivatives_are_those_of_finite_differences():
    generator = torch.Generator().manual_seed(0)
    points = 8.0 * torch.rand(20, 2, generator=generator, dtype=torch.float64)
    points.requires_grad_()
    ones = torch.ones(20, dtype=torch.float64)
    weights = torch.randn(20, 4, generator=generator, dtype=torch.float64)

    def number(at):
        return (weights * overburden_features(at, ones, ones)).sum()

    (slope,) = torch.autograd.grad(number(points), points)
    step = 1e-6
    for place in range(20):
        for axis in range(2):
            ends = []
            for sign in (1.0, -1.0):
                moved = points.detach().clone()
                moved[place, axis] += sign * step
                ends.append(float(number(moved)))
            assert float(slope[place, axis]) == pytest.approx(
                (ends[0] - ends[1]) / (2 * step), rel=1e-4, abs=1e-6
            )
