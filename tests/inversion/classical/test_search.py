from __future__ import annotations

import numpy as np
import pytest

from inversion.classical.limit_equilibrium import required_strength, spencer
from inversion.classical.search import critical_circle, critical_polyline
from inversion.classical.slices import Polyline, cut
from pipeline.cli import WorkFailed


@pytest.mark.parametrize(("slope_deg", "stability_number"), [(90, 0.261), (75, 0.219), (60, 0.191)])
def test_taylors_chart_without_friction(soil, section, slope_deg, stability_number):
    """Taylor (1937): c / (gamma H) at failure of a slope in clay, toe circles."""
    height = 10.0
    run = height / np.tan(np.radians(slope_deg)) if slope_deg < 90 else 1e-3
    zone = [[0, -30], [80, -30], [80, height], [20 + run, height], [20, 0], [0, 0]]
    clay = soil(stability_number * 20.0 * height, 0.0, 20.0)
    made = section((zone, clay), ground=-30.0)
    found = critical_circle(made, "left", head=(20 + run + 0.5, 45.0), toe=(19.99, 20.0))
    assert found.value == pytest.approx(1.0, abs=0.015)
    assert found.tried > 1000


def test_acads_example_1a(soil, section):
    """ACADS (1989) example 1(a): referee value 1.00; others' programs 0.99 by both methods."""
    zone = [[20, 20], [70, 20], [70, 35], [50, 35], [30, 25], [20, 25]]
    made = section((zone, soil(3.0, 19.6, 20.0)), ground=20.0)
    found = critical_circle(made, "left", head=(50.0, 60.0), toe=(25.0, 34.0))
    assert found.value == pytest.approx(0.987, abs=0.006)
    slices = cut(made, found.circle, "left", count=100)
    assert spencer(slices) == pytest.approx(0.986, abs=0.008)


@pytest.mark.slow
def test_circle_of_the_highest_strength(dam):
    found = critical_circle(dam(), "left", head=(26.0, 45.0), toe=(0.1, 20.0), wanted="strength")
    slices = cut(dam(), found.circle, "left", count=60)
    strength = required_strength(slices, "bishop", found.circle)
    assert found.value == pytest.approx(float(strength), rel=0.03)
    least = critical_circle(dam(), "left", head=(26.0, 45.0), toe=(0.1, 20.0))
    other = cut(dam(), least.circle, "left", count=60)
    assert found.value > 0.97 * float(required_strength(other, "bishop", least.circle))


def test_polyline_needs_more_strength_than_others(dam):
    found = critical_polyline(
        dam(), "left", toe=0.0, head=36.0, head_level=10.0, foot_range=(10.0, 34.0)
    )
    for points in ([[0, 0], [26, 0], [36, 10]], [[0, 0], [24, 0], [36, 10]]):
        slices = cut(dam(), Polyline(np.array(points, dtype=float)), "left")
        assert found.strength > float(required_strength(slices, "spencer"))
    exact = required_strength(cut(dam(), found.polyline, "left"), "spencer")
    assert found.strength == pytest.approx(float(exact), rel=0.03)


def test_polyline_stays_below_the_surface_after(dam):
    after = Polyline(np.array([[-10.0, 0.0], [10.0, 3.0], [30.0, 4.0], [36.0, 10.0]]))
    found = critical_polyline(
        dam(),
        "left",
        toe=0.0,
        head=36.0,
        head_level=10.0,
        foot_range=(10.0, 34.0),
        not_above=after,
    )
    x = np.linspace(0, 36, 200)
    assert np.all(found.polyline.level(x) <= after.level(x) + 1e-3)


def test_mirror(dam, mirrored):
    left = critical_circle(dam(), "left", head=(26.0, 45.0), toe=(0.1, 20.0))
    right = critical_circle(mirrored(dam()), "right", head=(-45.0, -26.0), toe=(-20.0, -0.1))
    assert right.value == pytest.approx(left.value, rel=1e-6)
    assert right.circle.x == pytest.approx(-left.circle.x, rel=1e-6)


def test_nothing_to_find_is_said(dam):
    with pytest.raises(WorkFailed, match="no circle"):
        critical_circle(dam(), "left", head=(70.0, 75.0), toe=(65.0, 69.0))
