from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon

from geometry.scenes.scene import load_scene
from inversion.classical.section import (
    OUTSIDE,
    ClassicalSection,
    ClassicalSoil,
    section_of,
    water_line_after,
)
from tests.budget import examples

LSFD = "case_histories/lower_san_fernando_paper/scene.yaml"


@settings(max_examples=examples(60), deadline=None)
@given(
    st.lists(st.floats(0.3, 2.0), min_size=5, max_size=9),
    st.floats(-1.5, 1.5),
    st.floats(-1.5, 1.5),
)
def test_lengths_over_a_point_are_those_of_shapely(radii, x, y):
    x, y = round(x, 9), round(y, 9)  # on a number below 1e-300 shapely's overlay is wrong by 10 %
    angle = np.linspace(0, 2 * np.pi, len(radii), endpoint=False) + 0.1
    ring = np.column_stack([radii * np.cos(angle), radii * np.sin(angle)])
    shape = Polygon(ring)
    section = ClassicalSection(
        [ring], [ClassicalSoil("s", 0.0, 0.0, 1.0, 1.0)], np.array([[0.0, -9.0]])
    )
    column = section.column(np.array([x]), np.array([y]))
    up = shape.intersection(LineString([(x, y), (x, 10.0)])).length
    assert column.thickness[0] == pytest.approx(up, abs=1e-9)
    if shape.exterior.distance(Point(x, y)) > 1e-6:
        inside = shape.contains(Point(x, y))
        assert (section.zone_at(np.array([x]), np.array([y]))[0] != OUTSIDE) == inside


def test_weight_under_water_is_total_less_uplift(soil, section):
    block = section(([[0, 0], [10, 0], [10, 8], [0, 8]], soil(unit_weight_kn=20.0)), water=5.0)
    column = block.column(np.array([5.0]), np.array([1.0]))
    assert column.submerged == pytest.approx(4.0)
    assert column.weight == pytest.approx(20e3 * 7.0)
    assert column.buoyant_weight == pytest.approx(20e3 * 7.0 - 9810.0 * 4.0)
    assert column.first_moment / column.thickness == pytest.approx(4.5)


def test_saturated_density_counts_below_the_water_line(section):
    soil = ClassicalSoil("sand", 0.0, 0.6, density=1500.0, saturated_density=1900.0)
    block = section(([[0, 0], [4, 0], [4, 6], [0, 6]], soil), water=2.0)
    assert block.column(np.array([2.0]), np.array([0.0])).mass == pytest.approx(1500 * 4 + 1900 * 2)


def test_section_of_a_scene_has_its_area_surface_and_zones():
    scene = load_scene(LSFD)
    section = section_of(scene)
    assert section.area == pytest.approx(6246.7, abs=0.1)
    assert section.surface(190.0) == pytest.approx(46.37)
    assert section.surface(-20.0) == pytest.approx(2.0)
    zone = section.zone_at(np.array([120.0, 190.0, 10.0]), np.array([10.0, 10.0, 10.0]))
    assert [section.names[zone[0]], section.names[zone[1]]] == ["1", "3"]
    assert zone[2] == OUTSIDE
    assert section_of(scene, water=False).water is None
    heavy = section_of(scene, unit_weight_factor=1.1)
    assert heavy.soils[0].density == pytest.approx(1980.0)


def test_pool_follows_the_ground_that_sank(dam, section, soil):
    line = [[-40.0, 7.0], [31.0, 7.0], [45.0, 0.0], [80.0, 0.0]]
    before = dam(water=line)
    same = water_line_after(before, before)
    x = np.linspace(-30, 70, 50)
    assert np.interp(x, *same.T) == pytest.approx(before.water_level(x), abs=0.05)
    # The crest sinks below the pool as far as x = 40: the pool reaches the new shore.
    low = section(
        ([[0, 0], [60, 0], [45, 9], [40, 7], [38, 3], [10, 3]], soil()),
        ground=[[-40.0, 0.0], [80.0, 0.0]],
        water=line,
    )
    after = water_line_after(before, low)
    assert np.interp(39.0, *after.T) == pytest.approx(7.0)
    assert np.interp(45.0, *after.T) < 7.0
    assert water_line_after(dam(water=None), low) is None
