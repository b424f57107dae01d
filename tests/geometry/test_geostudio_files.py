"""`.gsz`: regions become zones, what is not read is listed, what cannot be is refused."""

from __future__ import annotations

import zipfile

import pytest

from flowslide.command_line import main
from geometry.scenes.drawings import read_section
from geometry.scenes.geostudio_files import read_gsz
from geometry.scenes.scene import load_scene
from pipeline.cli import InputError
from pipeline.files import write_text, yaml_text

POINTS = {1: (0, 0), 2: (40, 0), 3: (40, 4), 4: (0, 4), 5: (30, 10), 6: (20, 10), 7: (10, 4)}
REGIONS = {1: "1,2,3,7,4", 2: "7,3,5,6"}
MATERIALS = {1: "Loose sand", 2: "Fill (dense)"}


def document(
    points=POINTS, regions=REGIONS, materials=MATERIALS, uses=({1: 1, 2: 2},), more="", system=""
):
    point = "".join(f'<Point ID="{k}" X="{x}" Y="{y}" />' for k, (x, y) in points.items())
    region = "".join(
        f"<Region><ID>{k}</ID><PointIDs>{corners}</PointIDs></Region>"
        for k, corners in regions.items()
    )
    material = "".join(
        f"<Material><ID>{k}</ID><Name>{name}</Name><SlopeModel>MohrCoulomb</SlopeModel>"
        "<StressStrain><UnitWeight>19</UnitWeight><PhiPrime>33</PhiPrime></StressStrain></Material>"
        for k, name in materials.items()
    )
    contexts = "".join(
        f"<Context><AnalysisID>{number}</AnalysisID><GeometryUsesMaterials Len='{len(use)}'>"
        + "".join(f'<GeometryUsesMaterial ID="Regions-{k}" Entry="{m}" />' for k, m in use.items())
        + "</GeometryUsesMaterials></Context>"
        for number, use in enumerate(uses, start=1)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<GSIData Version="11"><FileInfo Title="a dam" />'
        + (f'<Coordinates><EngCoords UnitSystem="{system}" /></Coordinates>' if system else "")
        + f"<Geometries Len='1'><Geometry><Name>2D</Name><Points Len='9'>{point}</Points>"
        f"<Regions Len='2'>{region}</Regions><MeshId>3</MeshId></Geometry></Geometries>"
        f"<Materials Len='2'>{material}</Materials><Contexts Len='1'>{contexts}</Contexts>{more}"
        "</GSIData>"
    )


def written(tmp_path, text=None, name="dam.xml", **parts):
    path = tmp_path / "dam.gsz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, document(**parts) if text is None else text)
        archive.writestr("1/001/node.csv", "results")
        archive.writestr("Mesh_3.ply", "ply")
    return path


def test_regions_are_zones_of_their_materials(tmp_path):
    section = read_section(written(tmp_path))
    assert section.zones == {
        "Loose_sand_region_1": [(0, 0), (40, 0), (40, 4), (10, 4), (0, 4)],
        "Fill_dense_region_2": [(10, 4), (40, 4), (30, 10), (20, 10)],
    }
    assert section.properties["Loose_sand_region_1"] == {"material": "Loose_sand"}
    assert section.unit is None, "the file does not say in what it was drawn"


def test_a_scene_is_made_with_the_strengths_of_another_file(tmp_path, capsys):
    soils = {
        "Loose_sand": {"friction_deg": 0, "cohesion_kpa": 8, "density": 1900, "liquefied": True},
        "Fill_dense": {"friction_deg": 35, "cohesion_kpa": 1, "density": 2000},
    }
    write_text(tmp_path / "soils.yaml", yaml_text(soils))
    out = tmp_path / "scene.yaml"
    words = ["import", str(written(tmp_path)), "--out", str(out), "--unit", "ft"]
    main([*words, "--materials", str(tmp_path / "soils.yaml")])
    said = capsys.readouterr().out
    assert "read 2 zones, 12.19 m long and 3.048 m high" in said
    assert "left out: strengths, unit weights and water" in said
    scene = load_scene(out)
    assert [zone.material for zone in scene.zones] == ["Loose_sand", "Fill_dense"]
    with pytest.raises(InputError, match="Loose_sand"):
        main(words)  # nothing is made up


@pytest.mark.parametrize(("system", "unit"), [("Imperial", "ft"), ("Metric", "m"), ("odd", "odd")])
def test_the_unit_is_that_of_the_file(tmp_path, system, unit):
    section = read_section(written(tmp_path, system=system))
    assert section.unit == unit
    assert not any("Coordinates" in line for line in section.left_out)


def test_what_is_not_read_is_listed(tmp_path):
    more = "<Reinforcements Len='2'><R /><R /></Reinforcements><Functions Len='0' />"
    found = read_gsz(written(tmp_path, uses=({1: 1}, {1: 2, 2: 2}), more=more))
    assert found.left_out[:3] == [
        "region 2: the first analysis gives it no material",
        "Regions-1 is 'Fill_dense' in analysis 2; 'Loose_sand', of analysis 1, was read",
        "2 of Reinforcements",
    ]
    assert not any("Functions" in line for line in found.left_out)


def test_two_materials_of_one_word_keep_apart(tmp_path):
    found = read_gsz(written(tmp_path, materials={1: "Sand (1)", 2: "Sand 1"}))
    assert set(found.materials.values()) == {"Sand_1_1", "Sand_1_2"}


def test_three_materials_that_would_share_words_keep_apart(tmp_path):
    names = {1: "Sand", 2: "Sand", 3: "Sand 1"}
    found = read_gsz(written(tmp_path, materials=names, uses=({1: 1, 2: 3},)))
    assert set(found.materials.values()) == {"Sand_1", "Sand_1_3"}


def test_a_region_that_an_analysis_leaves_empty_is_left_out(tmp_path):
    found = read_gsz(written(tmp_path, uses=({1: 1, 2: ""},)))
    assert list(found.zones) == ["Loose_sand_region_1"] and "region 2" in found.left_out[0]


def test_a_damaged_stream_is_refused_in_one_line(tmp_path):
    path = written(tmp_path)
    data = bytearray(path.read_bytes())
    data[60:80] = bytes(20)
    path.write_bytes(bytes(data))
    with pytest.raises(InputError, match="damaged|cannot be read|none of GeoStudio"):
        read_gsz(path)


def test_the_document_of_a_renamed_file_is_found(tmp_path):
    assert len(read_gsz(written(tmp_path, name="before.xml")).zones) == 2


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"text": "<GSIData />"}, "holds 0 geometries; save the one of the section alone"),
        ({"text": "<GSIData><Geometries>"}, "its document cannot be read"),
        ({"text": '<!DOCTYPE a [<!ENTITY b "c">]><GSIData />'}, "is none of GeoStudio"),
        ({"name": "1/dam.xml"}, "holds 0 documents"),
        ({"regions": {1: "1,2,99"}}, "region 1: there is no point '99'"),
        ({"regions": {1: "1,2,3,"}}, "region 1: there is no point ''"),
        ({"regions": {1: "1,2,2"}}, "region 1: has fewer than three points"),
        ({"points": {**POINTS, 9: ("inf", 0)}}, r"point 9: lies at \(inf, 0.0\)"),
        ({"text": document().replace('ID="2" X', 'ID="1" X')}, "two points have the number 1"),
        ({"text": document().replace("<ID>2</ID><P", "<ID>1</ID><P")}, "two regions have"),
        ({"text": document().replace("<ID>2</ID><N", "<ID>1</ID><N")}, "two materials have"),
        ({"text": document().encode("utf-16")}, "is none of GeoStudio"),
        ({"regions": {1: ""}}, "a Region has no PointIDs"),
        ({"points": {1: ("a", 0)}}, "a point has .* it needs ID, X and Y"),
        ({"uses": ({1: 7},)}, "Regions-1: there is no material '7'"),
        ({"uses": ()}, "no closed outline was found, .* found: region 1: the first analysis"),
    ],
)
def test_what_is_none_is_refused_in_one_line(tmp_path, parts, words):
    with pytest.raises(InputError, match=words) as error:
        read_section(written(tmp_path, **parts))
    assert "\n" not in str(error.value)


def test_a_zip_that_unfolds_beyond_measure_is_refused(tmp_path):
    with pytest.raises(InputError, match="its document has 60 MB; allowed are 50"):
        read_gsz(written(tmp_path, text="a" * 60_000_000))


@pytest.mark.parametrize("suffix", ["slmd", "sli", "p2dx", "dwg"])
def test_of_other_programs_it_is_said_what_to_export(tmp_path, suffix):
    path = tmp_path / f"dam.{suffix}"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(InputError, match="cannot be read; export the section there as DXF"):
        read_section(path)
    broken = tmp_path / "dam.gsz"
    broken.write_bytes(b"PK\x03\x04")
    with pytest.raises(InputError, match="is no file of GeoStudio"):
        read_section(broken)
