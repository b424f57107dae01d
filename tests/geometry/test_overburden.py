"""The vertical effective stress of a section, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes.fill import fill
from geometry.scenes.overburden import (
    WATER_DENSITY,
    mean_and_deviation,
    stress_in_kpa,
    vertical_effective_stress,
)

GRAVITY = 9.81
SOIL = 2000.0


def block(make_scene, spacing=0.5, **more):
    """40 m by 8 m on a base at y = 2, in two layers of 5 and 3 m."""
    zones = [[(0.0, 2.0), (40.0, 2.0), (40.0, 7.0), (0.0, 7.0)],
             [(0.0, 7.0), (40.0, 7.0), (40.0, 10.0), (0.0, 10.0)]]  # fmt: skip
    soil = {"friction_deg": 30.0, "cohesion_kpa": 1.0, "density": SOIL}
    return make_scene(
        zones, ground=[[-50.0, 2.0], [90.0, 2.0]], spacing=spacing, materials={"soil": soil}, **more
    )


@pytest.mark.parametrize("spacing", [0.25, 0.5, 1.0])
@pytest.mark.parametrize(
    ("level", "wet"),
    [(None, 0.0), (5.0, None), (10.0, 8.0), (17.0, 8.0)],
    ids=["dry", "half", "to the top", "under a pool"],
)
def test_a_block_is_its_weight_less_the_water(make_scene, spacing, level, wet):
    scene = block(make_scene, spacing, water_level=level)
    points = fill(scene)
    mass = SOIL * points.volume
    found = vertical_effective_stress(scene, points.position, points.volume, mass, GRAVITY)
    depth = 10.0 - points.position[:, 1]
    head = 0.0 if level is None else np.clip(min(level, 10.0) - points.position[:, 1], 0.0, None)
    expected = GRAVITY * (SOIL * depth - WATER_DENSITY * head)
    # A point's weight is wholly buoyed or not at all: half a spacing of water at most.
    assert found == pytest.approx(expected, abs=0.5 * spacing * WATER_DENSITY * GRAVITY + 1.0)
    if wet in (0.0, 8.0):
        assert found == pytest.approx(expected, rel=1e-6)


def test_each_zone_has_its_own_and_the_saturated_density(make_scene):
    scene = block(make_scene, water_level=7.0)
    soil = scene.zones[0].material
    document = scene.model_dump()
    document["materials"][soil]["saturated_density"] = 2200.0
    scene = type(scene).model_validate(document)
    points = fill(scene)
    stress = stress_in_kpa(scene, points.position, points.volume, points.zone, GRAVITY)
    deep, high = (
        mean_and_deviation(stress[points.zone == zone], points.volume[points.zone == zone])
        for zone in range(2)
    )
    above = 3.0 * SOIL * GRAVITY * 1e-3
    assert high[0] == pytest.approx(0.5 * above)
    spread = 5.0 / np.sqrt(12) * 1200.0 * GRAVITY * 1e-3
    assert deep == pytest.approx((above + 2.5 * 1200.0 * GRAVITY * 1e-3, spread), rel=0.01)


def test_mean_and_deviation_go_by_weight():
    values = np.array([1.0, 3.0])
    assert mean_and_deviation(values, np.array([3.0, 1.0])) == pytest.approx((1.5, np.sqrt(0.75)))
