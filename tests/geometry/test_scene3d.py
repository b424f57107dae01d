"""`scene3d.yaml`: sections and terrains, their filling, what is refused."""

from __future__ import annotations

import re
import shutil
from typing import get_args

import numpy as np
import pytest

from geometry.scenes.polygon_checks import area
from geometry.scenes.scene import save_scene
from geometry.scenes3d.fill3d import drawn_volume, fill_terrain, volume_left_out
from geometry.scenes3d.scene3d import Scene3dDocument, load_scene_3d, plan_domain
from geometry.survey3d.survey import LIBRARY, Survey3d
from geometry.terrain.raster import Raster, write_raster
from pipeline.cli import InputError
from pipeline.files import parse_yaml, write_text, yaml_text

SOILS = {
    "fill": {"friction_deg": 35.0, "cohesion_kpa": 5.0},
    "slimes": {"friction_deg": 0.0, "cohesion_kpa": 5.0, "liquefied": True},
}


@pytest.fixture
def section(tmp_path, make_scene):
    """A folder with a section, and what writes its scene3d.yaml."""
    save_scene(make_scene([[(0, 0), (20, 0), (10, 5)]]), tmp_path / "scene.yaml")

    def write(**fields) -> object:
        document = {"name": "s", "section": {"file": "scene.yaml", "width_m": 8.0}, **fields}
        write_text(tmp_path / "scene3d.yaml", yaml_text(document))
        return tmp_path

    return write


@pytest.fixture
def terrain(tmp_path):
    """A folder with a tilted base and a surface 4 m above it, and what writes its scene3d.yaml."""
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    x = 1000.0 + 2.0 * np.arange(21)
    y = 500.0 + 2.0 * np.arange(11)
    base = np.add.outer(-0.1 * (x - x[0]), 0.0 * y)
    write_raster(Raster((x[0], y[0]), 2.0, base), tmp_path / "base.tif")
    write_raster(Raster((x[0], y[0]), 2.0, base + 4.0), tmp_path / "surface.tif")
    write_raster(Raster((x[0], y[0]), 2.0, base + 2.0), tmp_path / "layer.tif")

    def write(zones: list, materials: dict = SOILS, **fields) -> object:
        ground = {"surface": "surface.tif", "base": "base.tif", "origin": [1000.0, 500.0]}
        document = {
            "name": "t", "spacing": 1.0,
            "terrain": {**ground, "zones": zones, "materials": materials, **fields},
        }  # fmt: skip
        write_text(tmp_path / "scene3d.yaml", yaml_text(document))
        return tmp_path

    return write


def test_a_section_takes_walls_and_spacing_from_the_document(section):
    folder = section(spacing=0.5)
    scene = load_scene_3d(folder)
    assert (scene.spacing, scene.section.spacing, scene.section.domain.walls) == (
        0.5,
        0.5,
        "closed",
    )
    wide = {"file": "scene.yaml", "width_m": 8.0, "x_min": -30.0, "x_max": 60.0}
    scene = load_scene_3d(section(section=wide) / "scene3d.yaml", spacing=2.0)
    assert (scene.section.domain.x_min, scene.section.domain.x_max) == (-30.0, 60.0)
    assert scene.section.spacing == 2.0


def test_strength_and_water_are_changed_in_both_kinds(section, terrain):
    scene = load_scene_3d(section()).changed(strengths_kpa={"soil": 7.0})
    assert scene.section.materials["soil"].cohesion_kpa == 7.0
    zones = [{"name": "all", "material": "slimes"}]
    slimes = {"slimes": SOILS["slimes"]}
    scene = load_scene_3d(terrain(zones, slimes, water_level=3.0))
    other = scene.changed(strengths_kpa={"slimes": 7.0}, water=False).document.terrain
    assert (other.materials["slimes"].cohesion_kpa, other.water_level) == (7.0, None)
    assert scene.document.terrain.water_level == 3.0
    with pytest.raises(InputError, match="t has no material 'sand'; it has slimes"):
        scene.changed(strengths_kpa={"sand": 7.0})


def test_a_terrain_is_filled_between_base_and_surface(terrain):
    zones = [{"name": "all", "material": "slimes"}]
    scene = load_scene_3d(terrain(zones, {"slimes": SOILS["slimes"]}))
    points = fill_terrain(scene)
    assert points.volume.sum() == pytest.approx(40.0 * 20.0 * 4.0, rel=1e-6)
    low = scene.ground.base.at(points.position[:, 0], points.position[:, 1])
    above = points.position[:, 2] - low
    assert above.min() > 0.0 and above.max() < 4.0


@pytest.mark.parametrize("spacing", [0.35, 0.7, 1.0, 1.3, 2.0, 2.9])
def test_points_hold_the_volume_of_every_zone_at_any_spacing(terrain, spacing):
    corners = [[5.0, 2.0], [33.0, 4.0], [20.0, 15.0]]
    zones = [
        {"name": "wedge", "material": "fill", "plan": corners, "bottom": "layer.tif"},
        {"name": "below", "material": "slimes", "top": "layer.tif"},
        {"name": "above", "material": "slimes"},
    ]
    scene = load_scene_3d(terrain(zones), spacing=spacing)
    x_min, x_max, y_min, y_max = plan_domain(scene)
    half = 2.0 * (x_max - x_min) * (y_max - y_min)
    wedge = 2.0 * area(corners)
    points = fill_terrain(scene)
    for zone, volume in enumerate((wedge, half, half - wedge)):
        held = points.volume[points.zone == zone]
        # Where a plan cuts columns, its area is as good as the places that are read.
        exact = 0.001 if zone == 1 else 0.006
        assert held.sum() == pytest.approx(volume, rel=exact)
        assert 0.0 < held.min() and held.max() < 1.6 * spacing**3
    assert points.volume.sum() == pytest.approx(2.0 * half, rel=0.001)


@pytest.mark.parametrize("spacing", [1.0, 1.5, 2.9])
def test_soil_beyond_the_last_whole_cell_is_counted(terrain, spacing):
    zones = [{"name": "all", "material": "fill"}]
    scene = load_scene_3d(terrain(zones, {"fill": SOILS["fill"]}), spacing=spacing)
    held = fill_terrain(scene).volume.sum()
    assert held + volume_left_out(scene) == pytest.approx(40.0 * 20.0 * 4.0, rel=1e-5)
    assert (volume_left_out(scene) == 0.0) == (spacing == 1.0)


def test_the_height_is_that_of_the_soil(terrain):
    zones = [{"name": "all", "material": "fill"}]
    scene = load_scene_3d(terrain(zones, {"fill": SOILS["fill"]}))
    assert scene.sliding_height == pytest.approx(4.0, abs=1e-5)


def test_a_layer_within_another_parts_it(terrain):
    zones = [
        {"name": "seam", "material": "fill", "plan": [[10, 0], [20, 0], [20, 20], [10, 20]],
         "bottom": -0.5, "top": 0.5},
        {"name": "rest", "material": "slimes"},
    ]  # fmt: skip
    scene = load_scene_3d(terrain(zones))
    points = fill_terrain(scene)
    x, _, z = points.position.T
    seam = points.zone == 0
    assert points.volume[seam].sum() == pytest.approx(10.0 * 20.0 * 1.0)
    assert np.abs(z[seam]).max() < 0.5
    beside = ~seam & (x > 10.5) & (x < 19.5)
    assert np.abs(z[beside]).min() > 0.5 and (z[beside] < 0.0).any() and (z[beside] > 0.0).any()
    assert points.volume.sum() == pytest.approx(40.0 * 20.0 * 4.0)


@pytest.mark.parametrize("spacing", [0.1, 0.3, 0.4, 0.7, 0.8, 0.9])
def test_a_terrain_is_filled_up_to_its_walls_at_any_spacing(terrain, spacing):
    zones = [{"name": "all", "material": "slimes"}]
    folder = terrain(zones, {"slimes": SOILS["slimes"]}, origin=[1000.1, 500.1])
    scene = load_scene_3d(folder, spacing=spacing)
    x_min, x_max, y_min, y_max = plan_domain(scene)
    x, y, _ = fill_terrain(scene).position.T
    assert x.min() - x_min == pytest.approx(0.5 * spacing) == x_max - x.max()
    assert y.min() - y_min == pytest.approx(0.5 * spacing) == y_max - y.max()


def test_the_domain_is_whole_cells(terrain):
    zones = [{"name": "all", "material": "slimes"}]
    folder = terrain(zones, {"slimes": SOILS["slimes"]})
    assert plan_domain(load_scene_3d(folder)) == (0.0, 40.0, 0.0, 20.0)
    assert plan_domain(load_scene_3d(folder, spacing=1.5)) == (0.0, 39.0, 0.0, 18.0)
    with pytest.raises(InputError, match="do not overlap by a cell of 24 m"):
        plan_domain(load_scene_3d(folder, spacing=12.0))


def test_the_first_zone_that_holds_a_point_has_it(terrain):
    zones = [
        {"name": "dam", "material": "fill", "plan": [[10, 0], [20, 0], [20, 20], [10, 20]]},
        {"name": "below", "material": "slimes", "top": "layer.tif"},
        {"name": "above", "material": "slimes", "bottom": "layer.tif"},
    ]
    scene = load_scene_3d(terrain(zones))
    points = fill_terrain(scene)
    x = points.position[:, 0]
    assert np.array_equal(points.zone == 0, (x > 10.0) & (x < 20.0))
    assert np.array_equal(points.material, np.where(points.zone == 0, 0, 1))
    above = points.position[:, 2] - scene.ground.base.at(x, points.position[:, 1])
    assert above[points.zone == 1].max() < 2.0 < above[points.zone == 2].min()


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"section": None}, "give either section or terrain"),
        ({"width": 3.0}, "width"),
        ({"section": {"file": "no.yaml", "width_m": 8.0}}, r"no\.yaml: no such file"),
        ({"section": {"file": "scene.yaml", "width_m": 0.0}}, "section.width_m"),
        ({"spacing": 9.0}, "at 9 m spacing: zones: zone 'zone_0' is a sliver"),
        ({"paths": {"p": [[0, 0]]}}, "paths.p: needs two places"),
        ({"lines": {"l": [[0, 0], [0, 0]]}}, "lines.l: needs two places"),
    ],
)
def test_a_bad_section_is_refused_in_one_line(section, fields, words):
    with pytest.raises(InputError, match=words) as error:
        load_scene_3d(section(**fields))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("zones", "fields", "words"),
    [
        ([{"name": "a", "material": "sand"}], {}, "has material 'sand'; known are fill, slimes"),
        ([{"name": "a", "material": "fill"}], {}, "'slimes' is used by no zone"),
        (
            [{"name": n, "material": m} for n, m in (("a", "fill"), ("a", "slimes"))],
            {},
            "two zones are called 'a'",
        ),
        (
            [
                {"name": "a", "material": "fill", "plan": [[900, 0], [910, 0], [910, 10]]},
                {"name": "b", "material": "slimes"},
            ],
            {},
            "zone 'a': plan lies outside the base raster",
        ),
        (
            [{"name": "a", "material": "fill"}, {"name": "b", "material": "slimes"}],
            {"contact": "coulomb"},
            "friction_coefficient belongs to contact: coulomb",
        ),
    ],
)
def test_a_bad_terrain_is_refused_in_one_line(terrain, zones, fields, words):
    with pytest.raises(InputError, match=words):
        load_scene_3d(terrain(zones, **fields))


def test_a_zone_without_points_is_refused(terrain):
    zones = [{"name": "a", "material": "fill"}, {"name": "b", "material": "slimes"}]
    with pytest.raises(InputError, match="zone 'b' holds no point at a spacing of 1 m"):
        fill_terrain(load_scene_3d(terrain(zones)))


def test_rasters_without_soil_between_them_are_refused(terrain):
    folder = terrain([{"name": "all", "material": "fill"}], {"fill": SOILS["fill"]})
    shutil.copy(folder / "base.tif", folder / "surface.tif")
    scene = load_scene_3d(folder)
    with pytest.raises(InputError, match="zone 'all' holds no point"):
        fill_terrain(scene)
    assert drawn_volume(scene) == 0.0 == scene.sliding_height


def test_the_documents_of_the_page_are_valid(root):
    page = (root / "docs/how-to/three-dimensions.md").read_text("utf-8")
    documents = [
        parse_yaml(text, name="page") for text in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    ]
    survey = Survey3d.model_validate(documents.pop())
    assert {entry.type for entry in survey.chosen()} == {
        get_args(kind.model_fields["type"].annotation)[0] for kind in LIBRARY
    }
    kinds = [Scene3dDocument.model_validate(one).terrain is not None for one in documents]
    assert kinds == [False, True]
