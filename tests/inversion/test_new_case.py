"""`flowslide new`: what it makes works as it is, and what it cannot make it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flowslide.command_line import main
from geometry.case import load_case
from geometry.scenes.drawings import read_section
from geometry.scenes.scene import load_scene, scene_from_mapping
from geometry.survey.measured import single_lengths
from geometry.survey.measurements import load_measurements
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.result import load_result
from inversion.new_case.case_files import strength_bounds
from pipeline.cli import InputError

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
SECTION = EXAMPLES / "road_embankment.csv"
AFTER = EXAMPLES / "road_embankment_after.csv"
#: S_r with which the deposit of the example was made [kPa].
TRUE_STRENGTH = 5.5

DRY = """zone,x,y,friction_deg,cohesion_kpa
base,0,0,0,8
base,20,0,,
base,15,4,,
base,5,4,,
cap,5,4,33,1
cap,15,4,,
cap,12,7,,
cap,8,7,,
"""


def new(folder: Path, *options: object, section: Path = SECTION) -> Path:
    main(["new", str(folder), "--section", str(section), *map(str, options)])
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """The example of docs/start/your-own-case.md."""
    folder = tmp_path_factory.mktemp("cases") / "road_embankment"
    return new(folder, "--profile", AFTER, "--profile-std", 0.3, "--spacing", 0.5)


@pytest.fixture
def dry(tmp_path) -> Path:
    path = tmp_path / "dry.csv"
    path.write_text(DRY)
    return path


def test_the_folder_is_whole_and_checks(made, capsys):
    assert {path.name for path in made.iterdir()} == {
        "scene.yaml", "measurements.yaml", "inversion.yaml", "README.md",
        "post_failure_profile.csv",
    }  # fmt: skip
    main(["check", str(made)])
    assert "measurements 'field': 22 values, 0 held out, 0 constructed" in capsys.readouterr().out
    case = inversion_case(load_case(made))
    assert case.setup.targets.roles[:2] == ["fitted", "compared"]
    assert [v.name for v in case.question.variants][0] == "without water"
    (spec,) = case.question.parameters
    assert (spec.zones, spec.start, spec.low, spec.high) == (["loose_sand"], 10.0, 0.34, 50.0)
    for name in ("scene.yaml", "measurements.yaml", "inversion.yaml"):
        text = (made / name).read_text()
        assert text.startswith("# ") and "FILL IN" in text and "*id" not in text
    assert (
        "| loose_sand | S_r 10 kPa, a first guess of what is to be found"
        in (made / "README.md").read_text()
    )


@pytest.mark.slow
def test_the_strength_of_the_example_is_found(made, tmp_path):
    """A deposit made on other points, at 0.4 m, from its surveyed toe alone, at 1 m."""
    out = tmp_path / "out"
    main(["invert", str(made), "--quick", "--spacing", "1", "--threads", "1", "--quiet",
          "--out", str(out)])  # fmt: skip
    (answer,) = load_result(out / "result.json").answer.parameters
    assert answer.value == pytest.approx(TRUE_STRENGTH, rel=0.2)
    assert json.loads((out / "result.json").read_text())["answer"]["reached"]


def test_a_runout_in_numbers_and_no_water(dry, tmp_path):
    folder = new(tmp_path / "dry_dam", "--liquefied", "base", "--runout", "left=3±0.4",
                 "--runout", "right=6", "--upstream", "right", section=dry)  # fmt: skip
    scene, measurements = load_scene(folder / "scene.yaml"), load_measurements(folder)
    assert scene.spacing == 0.25 and not scene.has_water  # 7 m / 25, the next smaller round one
    assert scene.materials["base"].liquefied and not scene.materials["cap"].liquefied
    left, right = single_lengths(measurements.chosen())
    assert (left.value_m, left.std_m, left.std_is) == (3.0, 0.4, "published")
    assert (right.value_m, right.std_m, right.std_is) == (6.0, 0.6, "assumed")
    assert measurements.upstream == "right" and not measurements.profiles
    assert inversion_case(load_case(folder)).question.variants == []
    assert not (folder / "post_failure_profile.csv").exists()


def test_a_check_reads_the_question_as_well(dry, tmp_path):
    folder = new(tmp_path / "dam", "--liquefied", "base", "--runout", "left=3", section=dry)
    question = (folder / "inversion.yaml").read_text()
    (folder / "inversion.yaml").write_text(question.replace("[base]", "[bas]"))
    with pytest.raises(InputError, match="bas"):
        main(["check", str(folder)])


def test_deep_water_has_no_uncertain_level(dry, tmp_path):
    for name, level, stated in (("deep", -10, False), ("high", -2, True)):
        low = tmp_path / f"{name}.csv"
        low.write_text(f"{dry.read_text().rstrip()}\nwater,-20,{level},\nwater,40,{level},\n")
        folder = new(tmp_path / name, "--liquefied", "base", "--runout", "left=3", section=low)
        assert load_scene(folder / "scene.yaml").water_level == level
        question = (folder / "inversion.yaml").read_text()
        assert ("kind: water_level" in question) is stated
        main(["check", str(folder)])


def test_water_may_come_from_the_command_line(dry, tmp_path):
    water = ("--water-level", 2.5)
    folder = new(tmp_path / "wet", "--liquefied", "base", "--runout", "left=3", *water, section=dry)
    assert load_scene(folder / "scene.yaml").water_level == 2.5
    assert load_measurements(folder).initial.pool_y_m == 2.5
    assert [v.water for v in inversion_case(load_case(folder)).question.variants] == ["none"]


def test_a_head_that_falls_is_asked_about(dry, tmp_path):
    dry.write_text(DRY + "water,0,3,,\nwater,20,1,,\n")
    folder = new(tmp_path / "dam", "--liquefied", "base", "--runout", "left=3", section=dry)
    question = inversion_case(load_case(folder)).question
    assert [v.water for v in question.variants] == ["none", "buoyant"]
    assert {"water_face": "fixed"} in [
        entry.simulation for entry in question.sensitivities if entry.kind == "simulation"
    ]


def test_every_format_makes_the_same_scene(made, tmp_path):
    section = read_section(SECTION)
    features = [
        {"type": "Feature", "properties": {"name": name, **section.properties[name]},
         "geometry": {"type": "Polygon", "coordinates": [[list(p) for p in [*ring, ring[0]]]]}}
        for name, ring in section.zones.items()
    ]  # fmt: skip
    water = {"type": "LineString", "coordinates": [list(p) for p in section.water]}
    features.append({"type": "Feature", "properties": {"name": "water"}, "geometry": water})
    drawing = tmp_path / "section.txt"
    drawing.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    survey = ("--profile", AFTER, "--spacing", 0.5)
    expected = load_scene(made / "scene.yaml").model_dump(exclude={"name", "description"})
    one = new(tmp_path / "json_case", *survey, "--format", "geojson", section=drawing)
    assert load_scene(one / "scene.yaml").model_dump(exclude={"name", "description"}) == expected
    pytest.importorskip("ezdxf")
    dxf, materials = EXAMPLES / "road_embankment.dxf", EXAMPLES / "road_embankment_materials.yaml"
    other = new(tmp_path / "dxf_case", *survey, "--materials", materials, section=dxf)
    assert load_scene(other / "scene.yaml").model_dump(exclude={"name", "description"}) == expected


def test_the_profile_keeps_its_numbers_and_has_room(dry, tmp_path):
    survey = tmp_path / "survey.csv"
    survey.write_text("x_m,y_m\n-31.23456789,0\n-3,2.25\n10,5\n20,0\n")
    folder = new(tmp_path / "far", "--liquefied", "base", "--profile", survey, section=dry)
    (entry,) = load_measurements(folder, load_scene(folder / "scene.yaml")).profiles
    assert entry.profile.x[0] == -31.23456789
    (toe,) = single_lengths(load_measurements(folder).chosen())
    assert (toe.side, toe.value_m) == ("left", 31.235)
    domain = load_scene(folder / "scene.yaml").domain
    assert domain.x_min < -31.24 and np.isclose(domain.width % 0.5, 0.0)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (
            ["--runout", "left=3"],
            "no zone is liquefied; name those .* with --liquefied ZONE; there are base, cap",
        ),
        (["--liquefied", "toe"], "--liquefied toe: no such zone; there are base, cap"),
        (["--liquefied", "cap"], "'cap' is liquefied: its friction_deg must be 0"),
        (["--liquefied", "base", "--runout", "up=3"], "--runout up=3: must look like left=53"),
        (["--liquefied", "base", "--runout", "left=far"], "must look like left=53"),
        (["--liquefied", "base", "--runout", "left=3+-0"], "must be greater than 0"),
        (["--liquefied", "base", "--runout", "left=3", "--runout", "left=4"], "given twice"),
        (["--liquefied", "base", "--runout", "left=3", "--spacing", "-1"], "--spacing -1"),
        (["--liquefied", "base", "--runout", "left=3", "--spacing", "6"], "is a sliver"),
        (
            ["--liquefied", "base", "--runout", "left=3", "--water-level", "90"],
            "allowed are levels",
        ),
        (["--liquefied", "base", "--runout", "left=3", "--profile-std", "0"], "--profile-std 0"),
        (["--liquefied", "base", "--profile", "none.csv"], "none.csv: no such file"),
    ],
)
def test_what_cannot_be_made_is_refused_and_leaves_nothing(dry, tmp_path, options, complaint):
    with pytest.raises(InputError, match=complaint):
        new(tmp_path / "cases" / "dam", *options, section=dry)
    assert not (tmp_path / "cases").exists()


@pytest.mark.parametrize("liquefied", [[], ["--liquefied", "base"]])
def test_a_section_alone_is_a_case_to_be_simulated(dry, tmp_path, capsys, liquefied):
    folder = new(tmp_path / "dam", *liquefied, "--water-level", "12", section=dry)
    said = capsys.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == ["README.md", "scene.yaml"]
    assert "no slide was measured" in said and "flowslide simulate" in said
    assert "invert" not in said and ("flowslide predict" in said) is bool(liquefied)
    assert "measurements.yaml" not in (folder / "README.md").read_text()
    case = load_case(folder)
    assert case.survey is None and case.scene.water_level == 12.0, "deeper than the section is high"


def test_a_survey_that_reaches_no_toe_is_no_slide(dry, tmp_path):
    survey = tmp_path / "survey.csv"
    survey.write_text("x_m,y_m\n3,2.25\n10,5\n")
    with pytest.raises(InputError, match="no runout is known: give --runout SIDE=M, or --profile"):
        new(tmp_path / "dam", "--liquefied", "base", "--profile", survey, section=dry)


def test_a_profile_that_cannot_be_is_refused_and_leaves_nothing(dry, tmp_path):
    survey = tmp_path / "survey.csv"
    survey.write_text("x_m,y_m\n-6,0\n3,2.25\n10,90\n20,0\n")
    with pytest.raises(InputError, match=r"dam/measurements.yaml: .* \(10, 90\) lies outside"):
        new(tmp_path / "cases" / "dam", "--liquefied", "base", "--profile", survey, section=dry)
    assert not list((tmp_path / "cases").iterdir())


def test_a_place_where_nothing_can_be_written(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: cannot be written"):
        new(tmp_path / "file" / "dam", "--runout", "left=5")


def test_nothing_is_overwritten(made, dry, tmp_path):
    before = {path.name: path.read_bytes() for path in made.iterdir()}
    with pytest.raises(InputError, match="exists already; nothing is overwritten"):
        new(made, "--liquefied", "base", "--runout", "left=3", section=dry)
    assert {path.name: path.read_bytes() for path in made.iterdir()} == before
    for name, complaint in (("Dam 1", "small letters"), ("large", "is taken; so are large")):
        with pytest.raises(InputError, match=complaint):
            new(tmp_path / name, "--liquefied", "base", "--runout", "left=3", section=dry)


def test_shared_materials_must_be_parted(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text(DRY.replace("friction_deg", "material,friction_deg").replace(
        "base,0,0,0,8", "base,0,0,soil,0,8").replace("cap,5,4,33,1", "cap,5,4,soil,0,8").replace(
        ",,\n", ",,,\n"))  # fmt: skip
    with pytest.raises(InputError, match="its material 'soil' is also that of cap"):
        new(tmp_path / "d", "--liquefied", "base", "--runout", "left=3", section=path)
    both = new(tmp_path / "d", "--liquefied", "base", "--liquefied", "cap", "--runout", "left=3",
               section=path)  # fmt: skip
    (spec,) = inversion_case(load_case(both)).question.parameters
    assert spec.zones == ["base", "cap"]


@pytest.mark.parametrize("name", ["1", "sand #1", "Zone 1: sand", "yes", "null"])
def test_a_material_may_have_any_name(dry, tmp_path, name):
    dry.write_text(
        DRY.replace("y,friction", "y,material,friction").replace("0,0,0,8", f'0,0,"{name}",0,8')
        .replace("cap,5,4,33", "cap,5,4,cap,33").replace(",,\n", ",,,\n")
    )  # fmt: skip
    folder = new(tmp_path / "dam", "--liquefied", "base", "--runout", "left=5", section=dry)
    scene = load_scene(folder / "scene.yaml")
    assert list(scene.materials) == [name, "cap"] and scene.zones[0].material == name


def test_ground_that_was_drawn_as_a_zone_is_remarked(dry, tmp_path, capsys):
    foundation = "foundation,-40,-4,30,5\nfoundation,80,-4,,\nfoundation,80,0,,\n"
    dry.write_text(DRY + foundation + "foundation,20,0,,\nfoundation,0,0,,\nfoundation,-40,0,,\n")
    new(tmp_path / "dam", "--liquefied", "base", "--runout", "left=5", section=dry)
    said = capsys.readouterr().out
    assert "the ground goes on to the left of x = -40 m, beyond a face of 4 m" in said
    main(["check", str(tmp_path / "dam")])
    assert said.count("goes on to") == 2 == capsys.readouterr().out.count("goes on to")


def test_bounds_of_a_strength_are_what_runs_anyway_and_what_holds_any_slope():
    scene = scene_from_mapping(
        {
            "name": "heap",
            "domain": {"x_min": -60.0, "x_max": 80.0, "y_max": 40.0},
            "ground": {"points": [[-60.0, 0.0], [80.0, 0.0]]},
            "zones": [
                {"name": "a", "polygon": [[0, 0], [10, 10], [15, 10], [25, 0]], "material": "a"}
            ],
            "materials": {
                "a": {"cohesion_kpa": 5.0, "friction_deg": 0.0, "density": 2000.0,
                      "youngs_modulus_mpa": 20.0, "poisson_ratio": 0.3, "liquefied": True}
            },
            "spacing": 1.0,
        },
        "test",
    )  # fmt: skip
    # rho g H is 196 kPa.
    assert strength_bounds(scene) == (0.39, 59.0)


def test_the_sensitivity_that_waits_lifts_the_whole_top(dry, tmp_path):
    path = (
        new(tmp_path / "lifted", "--runout", "left=6", "--liquefied", "base", section=dry)
        / "inversion.yaml"
    )
    text = path.read_text()
    (entry,) = [line for line in text.splitlines() if "vertices:" in line]
    assert "at: [15, 4]" in entry and "at: [5, 4]" in entry and "[20, 0]" not in entry
    start = text.index("  # - name: top of the liquefied zone")
    end = text.index("\n", text.index("vertices:"))
    path.write_text(text[:start] + text[start:end].replace("  # ", "  ") + text[end:])
    found = inversion_case(load_case(path.parent)).question.sensitivities
    assert "top of the liquefied zone" in [one.name for one in found]
