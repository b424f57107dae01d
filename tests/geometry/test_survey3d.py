"""Measurements in plan: what they read of a known deposit, and what is refused in one line."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes3d.scene3d import load_scene_3d
from geometry.survey3d.deposit_edge import DepositEdge, distance_inside
from geometry.survey3d.measured import DepositMap, correlation_in_plan
from geometry.survey3d.survey import FILE_NAME, load_survey
from geometry.terrain.raster import Raster, write_raster
from pipeline.cli import InputError
from pipeline.files import write_text, yaml_text

SAID = {"confidence": "published", "source": "drawn"}
SURFACE = {"name": "surface", "type": "surface_after", "file": "after.tif", "every_m": 4.0,
           "std_m": 0.5} | SAID  # fmt: skip
EDGE = {"name": "edge", "type": "deposit_edge", "edge": [[20, 4], [20, 12]], "every_m": 4.0,
        "std_m": 1.0} | SAID  # fmt: skip
ROAD = {"name": "road", "type": "crossed_volume", "line": "road", "value_m3": 5, "std_m3": 1} | SAID
PATH = {"name": "path", "type": "path_runout", "path": "valley", "value_m": 5, "std_m": 1} | SAID
AREA = {"name": "area", "type": "inundated_area", "value_m2": 5, "std_m2": 1} | SAID


def valley(folder, *entries):
    """A block of soil on level ground, rasters of it before and after, and a survey."""
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    x, _ = np.meshgrid(np.arange(0.0, 41.0, 2.0), np.arange(0.0, 17.0, 2.0), indexing="ij")
    rasters = {"base": 0.0 * x, "surface": np.where(x < 12, 4.0, 0.0), "after": 0.1 * x + 1.0}
    for name, values in rasters.items():
        write_raster(Raster((0.0, 0.0), 2.0, values), folder / f"{name}.tif")
    soil = {"friction_deg": 0, "cohesion_kpa": 3, "liquefied": True}
    document = {
        "name": "valley", "spacing": 2.0, "paths": {"valley": [[12, 8], [40, 8]]},
        "lines": {"road": [[20, 0], [20, 16]]},
        "terrain": {"surface": "surface.tif", "base": "base.tif",
                    "zones": [{"name": "soil", "material": "soil"}], "materials": {"soil": soil}},
    }  # fmt: skip
    write_text(folder / "scene3d.yaml", yaml_text(document))
    survey = {"case": "valley", "default_set": "all", "sets": {"all": list(entries)}}
    write_text(folder / FILE_NAME, yaml_text(survey))
    return load_scene_3d(folder)


def deposit(scene, thickness, **readings) -> DepositMap:
    """A simulated deposit, its pixels 4 m wide."""
    x, _ = np.meshgrid(2.0 + 4.0 * np.arange(10), 2.0 + 4.0 * np.arange(4), indexing="ij")
    base, before = (
        Raster((2.0, 2.0), 4.0, values) for values in (0.0 * x, np.where(x < 12, 3.9, 0.0))
    )
    after = Raster((2.0, 2.0), 4.0, before.values + thickness(x))
    return DepositMap(scene.ground.surface, base, before, after, 2.0, readings)


def test_a_surface_is_that_before_plus_what_changed(tmp_path):
    scene = valley(tmp_path, SURFACE)
    (entry,) = load_survey(tmp_path, scene).chosen()
    assert len(entry.values) == len(entry.places) == len(entry.parts) == 40
    # Means over squares of a surface that rises evenly are those at their middles.
    assert entry.values == pytest.approx(0.1 * entry.places[:, 0] + 1.0)
    still = deposit(scene, lambda x: 0.0 * x)
    flat = (entry.places[:, 0] < 8) | (entry.places[:, 0] > 16)
    before = np.where(entry.places[:, 0] < 12, 4.0, 0.0)
    # Where nothing moves the surface is the surveyed one, though the points fill less.
    assert entry.read(still)[flat] == pytest.approx(before[flat])
    risen = deposit(scene, lambda x: 0.0 * x + 0.7)
    assert entry.read(risen) - entry.read(still) == pytest.approx(0.7)
    assert entry.read(risen.at_start) == pytest.approx(entry.read(still))
    assert entry.with_values(entry.values + 1.0).values == pytest.approx(entry.values + 1.0)


def test_squares_outside_a_plan_are_left_out(tmp_path):
    inside = SURFACE | {"plan": [[0, 0], [16, 0], [16, 16], [0, 16]], "correlation_length_m": 8.0}
    (entry,) = load_survey(tmp_path, valley(tmp_path, inside)).chosen()
    assert len(entry.values) == 16
    covariance = entry.covariance()
    apart = np.hypot(*(entry.places[0] - entry.places[5]))
    assert covariance[0, 0] == 0.25
    assert covariance[0, 5] == pytest.approx(0.25 * np.exp(-apart / 8.0))


def test_distance_to_the_edge_of_a_round_deposit():
    x, y = np.meshgrid(np.arange(41.0), np.arange(41.0), indexing="ij")
    radius = np.hypot(x - 20, y - 20)
    found = distance_inside(Raster((0.0, 0.0), 1.0, 12.0 - radius), 2.0)  # its edge is at 10 m
    for at, expected in ((20.0, 10.0), (27.0, 3.0), (33.0, -3.0)):
        assert float(found.at(np.array(at), np.array(20.0))) == pytest.approx(expected, abs=0.2)
    nothing = distance_inside(Raster((0.0, 0.0), 1.0, 0.0 * x), 2.0)
    assert np.all(nothing.values < -40.0)


def test_an_edge_reads_how_far_the_deposit_lies_beyond_it(tmp_path):
    scene = valley(tmp_path, EDGE)
    (entry,) = load_survey(tmp_path, scene).chosen()
    assert isinstance(entry, DepositEdge) and entry.values == pytest.approx([0.0, 0.0, 0.0])
    # Thickness falls from 4 m at x = 6 to 2 m at x = 26, where the deposit ends.
    far = deposit(scene, lambda x: np.where(x < 12, 0.0, 4.6 - 0.1 * x))
    near = deposit(scene, lambda x: np.where(x < 12, 0.0, np.where(x < 16, 4.0, 0.0)))
    assert entry.read(far) == pytest.approx(6.0, abs=0.6)
    assert entry.read(near) == pytest.approx(-4.0, abs=0.6)
    assert entry.with_values(np.ones(3)).values == pytest.approx(1.0)


def test_the_edge_of_a_raster_counts_where_no_soil_lay(tmp_path):
    scene = valley(tmp_path, EDGE | {"edge": None, "file": "inundated.tif", "every_m": 3.0})
    x, y = np.meshgrid(np.arange(0.0, 41.0, 2.0), np.arange(0.0, 17.0, 2.0), indexing="ij")
    covered = (x > 5.0) & (x < 25.0) & (y > 3.0) & (y < 13.0)
    write_raster(Raster((0.0, 0.0), 2.0, covered.astype(float)), tmp_path / "inundated.tif")
    (entry,) = load_survey(tmp_path, scene).chosen()
    places = entry.places
    on_end = np.isclose(places[:, 0], 25.0)
    on_side = np.isclose(places[:, 1], 3.0) | np.isclose(places[:, 1], 13.0)
    assert np.all(on_end | on_side) and on_end.any() and on_side.any()
    assert places[:, 0].min() >= 11.0  # the block of soil begins at 12 m and is not an edge
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    assert apart[~np.eye(len(places), dtype=bool)].min() >= 3.0
    assert len(entry.values) == len(places) and not entry.values.any()


def test_numbers_are_readings_of_the_simulation(tmp_path):
    scene = valley(tmp_path, ROAD, PATH, AREA)
    road, path, area = load_survey(tmp_path, scene).chosen()
    readings = {"volume_across_road_m3": 7.0, "runout_valley_m": np.nan, "inundated_area_m2": 3.0}
    found = deposit(scene, lambda x: 0.0 * x, **readings)
    assert [float(one.read(found)[0]) for one in (road, path, area)] == [7.0, 0.0, 3.0]
    assert path.is_runout and not road.is_runout
    assert [one.unit for one in (road, path, area)] == ["m3", "m", "m2"]


def test_errors_without_a_length_are_independent():
    assert np.array_equal(correlation_in_plan(np.zeros((3, 2)), None), np.eye(3))


@pytest.mark.parametrize(
    "entry, words",
    [
        (SURFACE | {"file": "none.tif"}, "no such file"),
        (SURFACE | {"file": None}, "the terrain has no `after`"),
        (SURFACE | {"every_m": 100.0}, "gives 0 squares"),
        (SURFACE | {"every_m": 0.1}, "1 to 2000 are allowed"),
        (EDGE | {"edge": [[20, 4], [20, 99]]}, "(20, 99) lies outside the rasters, y 0 to 16 m"),
        (EDGE | {"file": "after.tif"}, "give either edge or file"),
        (EDGE | {"edge": None, "file": "base.tif"}, "has no edge where no soil lay before"),
        (ROAD | {"line": "rail"}, "no line 'rail'; the scene has road"),
        (PATH | {"path": "hill"}, "no path 'hill'; the scene has valley"),
        (PATH | {"low_m": 6.0, "high_m": 7.0}, "lies outside low_m to high_m"),
        (AREA | {"std_m2": 0}, "greater than 0"),
        (AREA | {"type": "area"}, "area"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path, entry, words):
    scene = valley(tmp_path, entry)
    with pytest.raises(InputError) as raised:
        load_survey(tmp_path, scene)
    message = str(raised.value)
    assert (
        words in message
        and "\n" not in message
        and FILE_NAME in message.replace("none.tif", FILE_NAME)
    )
