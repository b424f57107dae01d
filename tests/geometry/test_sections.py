"""Import of drawn sections: the same zones from every format, and what is refused."""

from __future__ import annotations

import csv
import json
import math
from unittest.mock import Mock

import numpy as np
import pytest
import yaml

from geometry import load_scene
from geometry.scenes import drawings
from geometry.scenes.drawings import (
    DrawnSection,
    read_materials,
    read_section,
    section_document,
    section_scene,
    with_room,
)
from geometry.scenes.fill import fill
from geometry.scenes.scene import scene_hash
from pipeline.cli import InputError


def as_csv(scene, path, factor=1.0):
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["zone", "x", "y", "material", "friction_deg", "cohesion_kpa", "liquefied"])
        for zone in scene.zones:
            m = scene.materials[zone.material]
            for number, (x, y) in enumerate(zone.polygon):
                # Strengths in the first row of a zone are enough.
                more = [zone.material, m.friction_deg, m.cohesion_kpa, str(m.liquefied).lower()]
                rows.writerow([zone.name, x / factor, y / factor, *(more if number == 0 else [])])
        for x, y in scene.ground.points:
            rows.writerow(["ground", x / factor, y / factor])
        for x, y in scene.phreatic_line:
            rows.writerow(["water", x / factor, y / factor])


def as_geojson(scene, path):
    def feature(kind, coordinates, **properties):
        geometry = {"type": kind, "coordinates": coordinates}
        return {"type": "Feature", "geometry": geometry, "properties": properties}

    features = [
        feature(
            "Polygon",
            [[*zone.polygon, zone.polygon[0]]],
            name=zone.name,
            material=zone.material,
            **scene.materials[zone.material].model_dump(
                include={"friction_deg", "cohesion_kpa", "liquefied", "density"}
            ),
        )
        for zone in scene.zones
    ]
    features.append(feature("LineString", scene.ground.points, name="Ground"))
    features.append(feature("LineString", scene.phreatic_line, name="water"))
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))


def as_dxf(scene, path, factor=1.0, units=6):
    ezdxf = pytest.importorskip("ezdxf", reason="the extra dxf is not installed")
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = units
    space = drawing.modelspace()
    for zone in scene.zones:
        ring = [(x / factor, y / factor) for x, y in zone.polygon]
        space.add_lwpolyline(ring, close=True, dxfattribs={"layer": zone.name})
    for layer, line in (("ground", scene.ground.points), ("water", scene.phreatic_line)):
        space.add_lwpolyline(
            [(x / factor, y / factor) for x, y in line], dxfattribs={"layer": layer}
        )
    drawing.saveas(path)


def materials_of(scene):
    return {
        zone.name: scene.materials[zone.material].model_dump(exclude_none=True)
        for zone in scene.zones
    }


def check_same(scene, original, same_names=True):
    for here, there in zip(scene.zones, original.zones, strict=True):
        assert here.name == there.name
        for a, b in zip(here.polygon, there.polygon, strict=True):
            assert a == pytest.approx(b, abs=1e-9)
        mine, theirs = scene.materials[here.material], original.materials[there.material]
        assert (mine.friction_deg, mine.cohesion_kpa) == (theirs.friction_deg, theirs.cohesion_kpa)
        assert mine.liquefied == theirs.liquefied
        assert not same_names or here.material == there.material
    assert scene.water_level == pytest.approx(35.9)
    assert scene.phreatic_level(196.15) == pytest.approx(18.95)
    assert scene.ground.height(100.0) == pytest.approx(2.0)
    assert scene.domain.walls == "open"
    assert len(fill(scene)) == len(fill(original))


def imported(path, **options):
    options = {"name": "x", "spacing": 1.0, **options}
    return section_scene(read_section(path), source=str(path), **options)


def test_csv_round_trip(dam, tmp_path):
    as_csv(dam, tmp_path / "dam.csv")
    check_same(imported(tmp_path / "dam.csv"), dam)


def test_csv_in_feet(dam, tmp_path):
    as_csv(dam, tmp_path / "dam.csv", factor=0.3048)
    check_same(imported(tmp_path / "dam.csv", unit="ft", snap=1e-6), dam)


def test_geojson_round_trip(dam, tmp_path):
    as_geojson(dam, tmp_path / "dam.geojson")
    check_same(imported(tmp_path / "dam.geojson"), dam)


@pytest.mark.parametrize(
    ("units", "factor"), [(6, 1.0), (4, 1e-3), (2, 0.3048), (1, 0.0254), (10, 0.9144)]
)
def test_dxf_round_trip(dam, tmp_path, units, factor):
    """The drawing's own unit is used; strengths come from a file, by the names of the layers."""
    as_dxf(dam, tmp_path / "dam.dxf", factor, units)
    scene = imported(tmp_path / "dam.dxf", materials=materials_of(dam), snap=1e-6)
    check_same(scene, dam, same_names=False)


def test_a_unit_that_nobody_knows_is_asked_for(dam, tmp_path):
    as_dxf(dam, tmp_path / "dam.dxf", 0.3048, 11)  # angstrom
    strengths = {"materials": materials_of(dam), "snap": 1e-6}
    with pytest.raises(InputError, match=r"states its unit of length as \$INSUNITS 11"):
        imported(tmp_path / "dam.dxf", **strengths)
    check_same(imported(tmp_path / "dam.dxf", unit="ft", **strengths), dam, same_names=False)


@pytest.mark.parametrize("name", ["Ground", "WATER"])
def test_a_closed_outline_is_a_zone_whatever_its_name(dam, tmp_path, name):
    strong = {"friction_deg": 40.0, "cohesion_kpa": 5.0}
    renamed = dam.zones[0].model_copy(update={"name": name})
    as_dxf(dam.model_copy(update={"zones": [renamed, *dam.zones[1:]]}), tmp_path / "dam.dxf")
    scene = imported(tmp_path / "dam.dxf", materials={**materials_of(dam), name: strong}, snap=1e-6)
    assert [zone.name for zone in scene.zones][0] == name
    assert scene.ground.height(100.0) == pytest.approx(2.0)
    assert scene.water_level == pytest.approx(35.9)


def test_domain_and_base_are_made_when_the_drawing_has_none(tmp_path):
    path = tmp_path / "heap.csv"
    path.write_text(
        "zone,x,y,friction_deg,cohesion_kpa\nheap,0,5,30,1\nheap,40,5,30,1\nheap,20,25,30,1\n"
    )
    scene = imported(path)
    assert scene.ground.lowest == 5.0
    assert scene.domain.x_min == -40.0 and scene.domain.x_max == 80.0
    assert scene.domain.y_max > 25.0
    assert not scene.has_water


def test_materials_file(tmp_path):
    path = tmp_path / "materials.yaml"
    path.write_text(yaml.safe_dump({"materials": {"sand": {"friction_deg": 30}}}))
    assert read_materials(path) == {"sand": {"friction_deg": 30}}
    path.write_text("sand: 30\n")
    with pytest.raises(InputError, match="must hold materials"):
        read_materials(path)


ROWS = "a,0,0,30,0\na,10,0,30,0\na,10,10,30,0\n"
HEAD = "zone,x,y,friction_deg,cohesion_kpa\n"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("s.csv", "zone,x\na,1\n", "no column 'y'"),
        ("s.csv", "zone,x,y,colour\n", "unknown column 'colour'"),
        ("s.csv", HEAD, "no closed outline"),
        ("s.csv", HEAD + "a,one,2,30,0\n", "row 2: x is 'one', not a number"),
        ("s.csv", HEAD + "a,nan,2,30,0\n", "row 2: x is nan; numbers must be finite"),
        ("s.csv", HEAD + ",1,2,30,0\n", "row 2: the zone has no name"),
        ("s.csv", HEAD + "a,0,0,30,0\na,1,0,31,0\n", "row 3: friction_deg is 31"),
        ("s.csv", HEAD + "a,0,0,30\na,10,0\na,10,10\n", "has no cohesion_kpa; give it in"),
        ("s.csv", HEAD + "a,0,0,30,0\na,10,10,30,0\na,10,0,30,0\na,0,10,30,0\n", "not a simple"),
        ("s.geojson", "[]", "not a GeoJSON FeatureCollection"),
        ("s.geojson", '{"features": [{"geometry": null}]}', "feature 0: has no geometry"),
        (
            "s.geojson",
            '{"features": [{"geometry": {"type": "Point", "coordinates": [1, 2]}}]}',
            "is a Point; allowed are Polygon and LineString",
        ),
        (
            "s.geojson",
            '{"features": [{"geometry": {"type": "LineString", "coordinates": [[1, 2], [3, 4]]}}]}',
            "the line 'zone_1' is not closed",
        ),
        (
            "s.geojson",
            '{"features": [{"properties": {"name": "ground"}, "geometry": {"type": "LineString", '
            '"coordinates": [[0, 0], [9, 0]]}}, {"properties": {"name": "ground"}, "geometry": '
            '{"type": "LineString", "coordinates": [[9, 0], [30, 3]]}}]}',
            "two lines are called 'ground'; join them into one",
        ),
        (
            "s.geojson",
            '{"features": [{"properties": "x", "geometry": {"type": "LineString", '
            '"coordinates": [[0, 0], [9, 0]]}}]}',
            "feature 0: properties must be a mapping",
        ),
        (
            "s.geojson",
            '{"features": [{"geometry": {"type": "Polygon", "coordinates": {"a": 1}}}]}',
            "coordinates must be a list of [x, y]",
        ),
        (
            "s.geojson",
            '{"features": [{"geometry": {"type": "Polygon", "coordinates": [[]]}}]}',
            "coordinates must be a list of [x, y]",
        ),
        ("s.csv", HEAD + "a,0,5,0,30,0\n", "row 2: has more values than there are columns (5)"),
        ("s.csv", "zone,x,y,x\na,0,0,5\n", "two columns are called 'x'"),
        ("s.geojson", '{"features": [1', "not valid JSON"),
        ("s.dxf", "no drawing", "no readable DXF file"),
        ("s.txt", "", "sections end in .csv"),
    ],
)
def test_refusals(tmp_path, name, text, words):
    if name.endswith(".dxf"):
        pytest.importorskip("ezdxf", reason="the extra dxf is not installed")
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        imported(path)
    assert words in str(caught.value)
    assert name in str(caught.value)


def test_a_file_in_another_encoding_is_refused(tmp_path):
    path = tmp_path / "s.csv"
    path.write_bytes("# Straße\n".encode("latin-1") + HEAD.encode())
    with pytest.raises(InputError, match="is not text in UTF-8"):
        imported(path)


def test_two_values_for_one_material(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text(
        "zone,x,y,material,friction_deg,cohesion_kpa\n"
        "a,0,0,sand,30,0\na,10,0,,,\na,10,10,,,\nb,20,0,sand,31,0\nb,30,0,,,\nb,30,10,,,\n"
    )
    with pytest.raises(InputError, match="other values than a zone before; use two names"):
        imported(path)


def test_command(dam, tmp_path, run_module):
    as_csv(dam, tmp_path / "dam.csv")
    out = tmp_path / "scene.yaml"
    done = run_module("flowslide", "import", tmp_path / "dam.csv", "--out", out)
    assert done.returncode == 0, done.stderr
    assert "7 zones, 6242 points" in done.stdout
    check_same(load_scene(out), dam)


def test_room_is_made_for_what_is_drawn_and_surveyed():
    zones = [{"name": "a", "material": "a", "polygon": [[0, 0], [50, 0], [25, 10]]}]
    found = with_room({"zones": zones})
    assert found["spacing"] == 0.25
    assert found["domain"] == {"x_min": -20.0, "x_max": 70.0, "y_max": 13.0, "walls": "open"}
    assert found["ground"] == {"points": [[-20.0, 0], [70.0, 0]]}
    assert with_room(found) == found, "what there is stays"
    assert with_room(found, [-33.3])["domain"]["x_min"] == -33.5
    contact = with_room({"zones": zones, "ground": {"contact": "no_slip"}})["ground"]
    assert contact["contact"] == "no_slip" and len(contact["points"]) == 2
    closed = {"x_min": 10, "x_max": 20, "y_max": 5, "walls": "closed"}
    assert with_room({"zones": zones, "domain": closed}, [-40])["domain"] == closed


def test_the_source_of_a_material_is_a_note_and_no_part_of_a_run(tmp_path):
    path = tmp_path / "dam.csv"
    path.write_text(
        "zone,x,y,friction_deg,cohesion_kpa,source\na,0,0,30,1,report 12\na,9,0,,,\na,4,4,,,\n"
    )
    scene = section_scene(read_section(path), source=str(path), name="dam")
    assert scene.materials["a"].source == "report 12"
    assert scene_hash(scene) == scene_hash(scene.changed(materials={
        "a": {"friction_deg": 30.0, "cohesion_kpa": 1.0},
    }))  # fmt: skip


def test_a_vertex_is_compared_with_few_others(monkeypatch):
    """A drawing may have very many; and the first of those near it counts."""
    compared = Mock(side_effect=math.dist)
    monkeypatch.setattr(drawings.math, "dist", compared)
    places = np.random.default_rng(2).uniform(0.0, 5.0, (400, 2)).round(1)
    moved = places + np.random.default_rng(3).uniform(-0.03, 0.03, places.shape)
    ring = [tuple(map(float, place)) for place in moved]
    section = DrawnSection(zones={"soil": ring})
    document = section_document(section, source="x", name="x", snap=0.05)
    assert compared.call_count < 10 * len(ring)
    found, known = document["zones"][0]["polygon"], []
    for place in ring:
        first = next((one for one in known if math.hypot(*np.subtract(one, place)) <= 0.05), place)
        known += [first] * (first is place)
    assert set(found) == set(known) and len(known) < 400
