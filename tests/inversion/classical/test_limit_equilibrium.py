from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inversion.classical.limit_equilibrium import (
    bishop,
    force_balance,
    ordinary,
    required_strength,
    spencer,
    spencer_inclination,
)
from inversion.classical.slices import Circle, Polyline, cut

METHODS = {"ordinary": ordinary, "force": force_balance, "spencer": spencer}
FOOT, PSF, PCF = 0.3048, 47.880259e-3, 9.80665 * 16.018463e-3  # m, kPa, kN/m3


@pytest.fixture
def slab(soil, section):
    """A slab 4 m thick (vertically) at 25 degrees, and its lower face."""

    def make(cohesion=6.0, friction=20.0, water=None):
        rise = 100 * np.tan(np.radians(25))
        lower = np.array([[0, 0], [100, rise]])
        zone = [*(lower - [0, 5]), *(lower + [0, 4])[::-1]]
        ground = lower - [0, 5]
        made = section((zone, soil(cohesion, friction, 19.0)), ground=ground, water=water)
        inner = np.array([[20, 0.2 * rise], [80, 0.8 * rise]])
        return made, Polyline(inner)

    return make


def infinite_slope(cohesion, friction, unit_weight):
    slope = np.radians(25)
    driving = unit_weight * 4.0 * np.sin(slope) * np.cos(slope)
    return cohesion / driving + np.tan(np.radians(friction)) / np.tan(slope)


@pytest.mark.parametrize(("cohesion", "friction"), [(6.0, 20.0), (0.0, 33.0), (15.0, 0.0)])
def test_infinite_slope(slab, cohesion, friction):
    section, slip = slab(cohesion, friction)
    slices = cut(section, slip, "left", count=40)
    expected = infinite_slope(cohesion, friction, 19.0)
    assert ordinary(slices) == pytest.approx(expected, rel=1e-9)
    assert force_balance(slices) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("form", ["buoyant", "pore_pressure"])
def test_infinite_slope_deep_under_still_water(slab, form):
    section, slip = slab(6.0, 20.0, water=90.0)
    slices = cut(section, slip, "left", form=form, count=40)
    expected = infinite_slope(6.0, 20.0, 19.0 - 9.81)
    assert ordinary(slices) == pytest.approx(expected, rel=1e-6)


@pytest.fixture
def fredlund_krahn(soil, section):
    """The example of Fredlund and Krahn (1977): 2:1, 40 ft high, and its circle."""
    zone = np.array([[0, -40], [220, -40], [220, 20], [140, 20], [60, 60], [0, 60]]) * FOOT
    made = section((zone, soil(600 * PSF, 20.0, 120 * PCF)), ground=-40 * FOOT)
    radius, x, y = 80.0, 120.0, 90.0
    left, right = x - np.sqrt(radius**2 - 30**2), x + np.sqrt(radius**2 - 70**2)
    return made, Circle(*(FOOT * value for value in (x, y, radius, left, right)))


def test_fredlund_and_krahn_1977(fredlund_krahn):
    section, circle = fredlund_krahn
    slices = cut(section, circle, "right", count=100)
    assert ordinary(slices, side_water=False) == pytest.approx(1.928, rel=2e-3)
    assert bishop(slices, circle) == pytest.approx(2.080, rel=4e-3)
    factor, inclination = spencer_inclination(slices)
    assert factor == pytest.approx(2.073, rel=2e-3)
    assert np.degrees(inclination) == pytest.approx(14.8, abs=0.6)
    # Two independent methods agree.
    assert bishop(slices, circle) == pytest.approx(float(spencer(slices)), rel=5e-3)


def test_fredlund_and_krahn_1977_with_pore_pressure_ratio(fredlund_krahn):
    section, circle = fredlund_krahn
    slices = cut(section, circle, "right", count=100)
    wet = replace(slices, pore=0.25 * slices.weight / slices.width)
    assert ordinary(wet, side_water=False) == pytest.approx(1.607, rel=4e-3)
    assert bishop(wet, circle) == pytest.approx(1.766, rel=4e-3)
    assert spencer(wet) == pytest.approx(1.761, rel=3e-3)
    assert spencer(wet) == pytest.approx(1.761, rel=4e-3)


def test_block_and_wedge_by_hand(soil, section):
    """A block on a level, liquefied base is pushed by a wedge on a plane of 45 degrees."""
    weak, rock = soil(10.0, liquefied=True, name="weak"), soil(5.0, 25.0, name="rock")
    made = section(
        ([[0, 0], [10, 0], [10, 10], [0, 10]], weak), ([[10, 0], [20, 10], [10, 10]], rock)
    )
    slip = Polyline(np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 10.0]]))
    slices = cut(made, slip, "left", count=20)
    weight, length, friction = 50 * 20e3, 10 * np.sqrt(2), np.tan(np.radians(25))
    half = np.sqrt(0.5)
    # Ordinary slices: D - T over the level base.
    by_hand = (weight * half - 5e3 * length - weight * half * friction) / 10.0
    assert required_strength(slices, "ordinary") == pytest.approx(by_hand, rel=1e-6)
    # Level forces between slices: the push of the wedge over the level base.
    push = (weight * half * (1 - friction) - 5e3 * length) / (half * (1 + friction))
    assert required_strength(slices, "force") == pytest.approx(push / 10.0, rel=1e-6)
    held = slices.with_strength(push / 10.0)
    assert force_balance(held) == pytest.approx(1.0, rel=1e-6)
    alone = required_strength(slices, "ordinary", others=0.0)
    assert alone == pytest.approx(weight * half / 10.0, rel=1e-6)


@pytest.mark.parametrize("water", [3.0, 7.0, 12.0])
def test_still_water_by_weight_or_by_pressure(soil, section, water):
    """Weights less uplift against pool, pore and side pressures: the same in still water."""
    zone = [[0, -8], [90, -8], [90, 10], [40, 10], [20, 0], [0, 0]]
    made = section((zone, soil(8.0, 24.0, 19.0)), ground=-8.0, water=water)
    x, y = 26.0, 21.0
    radius = 24.0
    left = x - np.sqrt(radius**2 - y**2)
    right = x + np.sqrt(radius**2 - (y - 10) ** 2)
    circle = Circle(x, y, radius, left, right)
    weights = cut(made, circle, "left", form="buoyant", count=400)
    pressures = cut(made, circle, "left", form="pore_pressure", count=400)
    assert pressures.weight.sum() > 1.2 * weights.weight.sum()
    assert bishop(pressures, circle) == pytest.approx(float(bishop(weights, circle)), rel=1e-4)
    assert ordinary(pressures) == pytest.approx(float(ordinary(weights)), rel=1e-4)
    assert force_balance(pressures) == pytest.approx(float(force_balance(weights)), rel=1e-4)
    # Water between slices is level; Spencer inclines it with the soil's forces: nearly the same.
    assert spencer(pressures) == pytest.approx(float(spencer(weights)), rel=4e-3)


def test_both_at_once_is_not_possible(slab):
    section, slip = slab(water=90.0)
    buoyant = cut(section, slip, "left", form="buoyant")
    assert not np.any(buoyant.pore) and not np.any(buoyant.push) and not np.any(buoyant.side_water)
    pressure = cut(section, slip, "left", form="pore_pressure")
    total = 19e3 * 4.0 * 60.0
    pool = pressure.weight.sum() - total
    assert pool > 0 and np.all(pressure.pore > 0)
    assert buoyant.weight.sum() == pytest.approx((19e3 - 9810.0) * 4.0 * 60.0)


def test_a_falling_water_line_pushes_towards_its_lower_side(dam):
    falling = dam(water=[[-40.0, 7.0], [31.0, 7.0], [45.0, 0.0], [80.0, 0.0]])
    slip = Polyline(np.array([[0.0, 0.0], [28.0, 0.0], [40.0, 10.0]]))
    seepage = cut(falling, slip, "left", form="pore_pressure")
    none = cut(falling, slip, "left", form="buoyant")
    # Seepage runs to the right: it holds a slide to the left back.
    assert required_strength(seepage, "force") < required_strength(none, "force")


@pytest.mark.parametrize("method", [ordinary, force_balance, spencer])
def test_factor_of_safety_goes_with_the_strength(dam, method):
    slip = Polyline(np.array([[0.0, 0.0], [28.0, 0.0], [40.0, 10.0]]))
    slices = cut(dam(), slip, "left")
    double = replace(slices, cohesion=2 * slices.cohesion, friction=2 * slices.friction)
    assert method(double) == pytest.approx(2 * float(method(slices)), rel=1e-6)


@pytest.mark.parametrize("form", ["buoyant", "pore_pressure"])
def test_left_is_right_in_the_mirror(dam, mirrored, form):
    slip = np.array([[0.0, 0.0], [28.0, 0.0], [40.0, 10.0]])
    water = [[-40.0, 7.0], [31.0, 7.0], [45.0, 0.0], [80.0, 0.0]]
    left = cut(dam(water=water), Polyline(slip), "left", form=form)
    other = Polyline((slip * [-1, 1])[::-1])
    right = cut(mirrored(dam(water=water)), other, "right", form=form)
    for method in (ordinary, force_balance, spencer):
        assert method(right) == pytest.approx(float(method(left)), rel=1e-9)
    # The other way up nothing drives the mass.
    assert np.isnan(ordinary(cut(dam(water=water), Polyline(slip), "right", form=form)))


@pytest.mark.parametrize("method", ["ordinary", "force", "spencer"])
@pytest.mark.parametrize("factor", [1.0, 1.3])
def test_the_strength_found_gives_the_factor_asked_for(dam, method, factor):
    slip = Polyline(np.array([[0.0, 0.0], [28.0, 0.0], [36.0, 5.0], [40.0, 10.0]]))
    slices = cut(dam(), slip, "left")
    strength = required_strength(slices, method, factor=factor)
    assert strength > 0
    found = METHODS[method](slices.with_strength(float(strength)))
    assert found == pytest.approx(factor, rel=1e-5)


def test_bishop_finds_its_strength_on_a_circle(dam):
    circle = Circle(18.0, 24.0, 23.0, 18 - np.sqrt(23**2 - 21**2), 18 + np.sqrt(23**2 - 14**2))
    slices = cut(dam(), circle, "left")
    strength = required_strength(slices, "bishop", circle)
    assert slices.liquefied.any()
    again = bishop(slices.with_strength(float(strength)), circle)
    assert again == pytest.approx(1.0, rel=1e-6)
    with pytest.raises(ValueError, match="needs the circle"):
        required_strength(slices, "bishop")


def test_no_liquefied_base_has_no_strength_to_find(dam):
    slices = cut(dam(), Polyline(np.array([[34.0, 2.0], [50.0, 4.0]])), "left")
    assert np.isnan(required_strength(slices, "ordinary"))
    slices = replace(slices, weight=0.0 * slices.weight)
    assert not np.isfinite(ordinary(slices)), "nothing drives it"


def test_a_slip_surface_outside_the_soil_is_refused(dam):
    slip = Polyline(np.array([[-10.0, 0.0], [28.0, 0.0], [40.0, 10.0]]))
    with pytest.raises(ValueError, match="leaves the soil at x = -9"):
        cut(dam(), slip, "left")
    assert cut(dam(), slip, "left", outside_liquefied=True).liquefied[0]
