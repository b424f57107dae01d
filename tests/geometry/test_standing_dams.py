"""Random dams that stand free: drawn alike everywhere, without cracks, around the real dams."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from geometry.case import load_case
from geometry.random_scenes import hydraulic_fill_dam as ranges
from geometry.random_scenes.embankment_dam import draw_dam
from geometry.random_scenes.hydraulic_fill_dam import draw_hydraulic_fill_dam
from geometry.random_scenes.materials import GRAVITY
from geometry.random_scenes.standing_dam import RESIDUAL
from geometry.scenes.polygon_checks import gaps
from tests.conftest import ROOT

KINDS = (draw_dam, draw_hydraulic_fill_dam)
SAN_FERNANDO = ("lower_san_fernando", "upper_san_fernando")


@pytest.mark.parametrize("draw", KINDS)
def test_a_dam_is_one_body_without_cracks_that_stands_on_its_ground(draw):
    for number in range(20):
        scene = draw(0, number, 2.0)
        outlines = {zone.name: zone.polygon for zone in scene.zones}
        assert gaps(outlines, scene.spacing) == []
        bodies = [shapely.Polygon(outline).buffer(1e-3) for outline in outlines.values()]
        body = shapely.union_all(bodies)
        assert body.geom_type == "Polygon"
        feet = [point for outline in outlines.values() for point in outline]
        left, right = min(feet), max(feet)
        for x, y in (left, right):
            assert y == pytest.approx(float(scene.ground.height(x)), abs=1e-3)


@pytest.mark.parametrize("draw", KINDS)
def test_a_dam_follows_from_seed_and_number_and_scales_with_the_spacing(draw):
    assert draw(0, 3, 2.0) == draw(0, 3, 2.0) != draw(1, 3, 2.0)
    small, large = draw(0, 3, 1.0), draw(0, 3, 2.0)
    for one, other in zip(small.zones, large.zones, strict=True):
        assert np.allclose(2.0 * np.array(one.polygon), other.polygon, atol=1e-3)


def test_hydraulic_fill_lies_in_layers_and_some_of_them_liquefy():
    scenes = [draw_hydraulic_fill_dam(0, number, 2.0) for number in range(100)]
    layers = [sum(zone.name.startswith("first_") for zone in scene.zones) for scene in scenes]
    assert set(layers) == {1, 2, 3, 4, 5}
    liquefied = [
        any(scene.materials[z.material].liquefied for z in scene.zones) for scene in scenes
    ]
    assert 0.8 < np.mean(liquefied) < 1.0


@pytest.mark.parametrize("name", SAN_FERNANDO)
def test_the_ranges_hold_the_dam(name):
    scene = load_case(ROOT / "case_histories" / name).scene
    outlines = {zone.name: np.array(zone.polygon) for zone in scene.zones}
    points = np.concatenate(list(outlines.values()))
    height = np.ptp(points[:, 1])
    dam = (points - [0.0, points[:, 1].min()]) / height
    crest = dam[dam[:, 1] > 1.0 - 1e-3, 0]
    within(ranges.CREST, np.ptp(crest))
    left, right = dam[:, 0].min(), dam[:, 0].max()
    within(ranges.FACE, crest.min() - left)
    within((ranges.FACE[0], ranges.FACE[1] + ranges.BERM_WIDTH[1]), right - crest.max())
    core = (outlines["core"] - points.min(axis=0)) / height
    within(ranges.FILL, core[:, 1].max())
    unit = scene.materials["liquefied_fill"].density * GRAVITY * height / 1000.0
    within(RESIDUAL, 15.0 / unit)
    for material in ("core", "rolled_fill"):
        within(ranges.CLAY, scene.materials[material].cohesion_kpa / unit)
    for material, span in (("fill", ranges.FRICTION), ("starter_dike", ranges.DIKE_FRICTION)):
        within(span, scene.materials[material].friction_deg)
    dike = (outlines["upstream_starter_dike"] - points.min(axis=0)) / height
    within(ranges.DIKE, dike[1, 0] - dike[0, 0])


def within(span: tuple[float, float], value: float) -> None:
    assert span[0] <= value <= span[1]
