"""Sections from a few stated numbers: the file, its distributions, and the sections they allow."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from geometry.dimensions.family import FILL, LIQUEFIED, PRIORS, SectionFamily
from geometry.dimensions.median_section import median_section
from geometry.dimensions.stated import SlideDimensions, StatedNumber, load_dimensions
from geometry.random_scenes.sketch import signed_area
from geometry.scenes.scene import scene_from_mapping
from pipeline.cli import InputError
from pipeline.places import ROOT
from tests.budget import examples

EXAMPLES = [
    *sorted((ROOT / "docs" / "examples").glob("*_dimensions.yaml")),
    *sorted((ROOT / "case_histories").glob("*/dimensions.yaml")),
]
PAGE = ROOT / "docs" / "how-to" / "add-a-slide.md"

FIVE = {
    "slid_face": "upstream",
    "height_m": "20 +- 1",
    "slope_h_per_v": 2.5,
    "crest_width_m": {"low": 4, "high": 8},
    "runout_m": {"value": 25, "low": 20, "high": 30},
}


def family(**changes: object) -> SectionFamily:
    given = {key: value for key, value in {**FIVE, **changes}.items() if value is not None}
    return SectionFamily(SlideDimensions.model_validate(given))


def test_a_number_is_stated_in_four_ways():
    stated = family().stated
    assert (stated.height_m.value, stated.height_m.deviation) == (20.0, 1.0)
    assert stated.slope_h_per_v is not None and stated.slope_h_per_v.deviation == 0.25 * 2.5
    assert stated.crest_width_m is not None
    assert stated.crest_width_m.deviation == pytest.approx(4.0 / math.sqrt(12.0))
    assert stated.runout_m is not None and stated.runout_m.deviation == 2.5
    assert StatedNumber.model_validate({"value": 2.0, "how": "read"}).deviation == 0.1


def test_a_score_is_a_quantile_and_back():
    """A stated value is lognormal, a range uniform: shares of standard scores."""
    for one in family().dimensions:
        for score in (-1.5, 0.0, 0.7):
            assert one.score(one.at(score)) == pytest.approx(score, abs=1e-9)
    crest, height = family()["crest_width_m"], family()["height_m"]
    assert crest.at(norm.ppf(0.25)) == pytest.approx(5.0)
    assert height.at(2.0) == pytest.approx(20.0 * math.exp(0.1))


def test_what_is_not_stated_is_a_prior_with_its_source():
    found = family()
    silent = [one for one in found.dimensions if not one.stated]
    assert [one.key for one in silent] == [
        "other_slope_h_per_v", "liquefied_share", "liquefied_reach", "pool_share", "density",
        "fill_friction_deg",
    ]  # fmt: skip
    for one in silent:
        assert (one.low, one.high) == PRIORS[one.key][:2] and one.source.startswith("not stated: ")
    assert "pool_share" not in family(slid_face="dry").keys
    both = family(slope_h_per_v=None, base_width_m=120)
    assert both.keys[:3] == ["height_m", "base_width_m", "crest_width_m"]


def test_the_median_section_by_hand():
    """20 m high, 1 : 2.5 and 1 : 2.3, crest 6 m, 0.375 of it liquefied as far as 0.85 of 53 m."""
    scene = median_section(family(), "slide")
    liquefied, fill = (zone.polygon for zone in scene.zones)
    inner = 0.85 * 53.0
    assert liquefied == [(0.0, 0.0), (inner, 0.0), (inner, 7.5), (18.75, 7.5)]
    assert fill[1:4] == [(102.0, 0.0), (56.0, 20.0), (50.0, 20.0)]
    areas = sum(signed_area(zone.polygon) for zone in scene.zones)
    assert areas == pytest.approx(0.5 * (102.0 + 6.0) * 20.0)
    assert scene.foot("left") == 0.0 and scene.spacing == 1.0
    assert scene.water_level == pytest.approx(20.0 * 0.615)
    assert scene.materials[LIQUEFIED].liquefied and scene.materials[FILL].friction_deg == 35.0
    assert scene.materials[FILL].density == scene.materials[LIQUEFIED].density == 1950.0


def test_slides_of_the_page_are_there():
    assert len(EXAMPLES) == 4


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_the_slides_of_the_page_have_sections(path):
    stated = load_dimensions(path)
    scene = median_section(SectionFamily(stated), path.stem)
    height = stated.height_m.value or 0.5 * (stated.height_m.low + stated.height_m.high)
    top = max(y for zone in scene.zones for _, y in zone.polygon)
    assert top == pytest.approx(height, rel=0.01)
    assert "/".join(path.parts[-2:]) in PAGE.read_text(encoding="utf-8")


def test_a_section_is_that_of_the_medians_to_a_millimetre():
    """The last bits of a computed place differ between processors; another shape is another."""
    found = family()
    scene = median_section(found, "slide")
    document = scene.model_dump()
    corners = document["zones"][1]["polygon"]
    corners[1] = (corners[1][0] + 1e-4, 0.0)
    assert found.has_median(scene_from_mapping(document, "bits"))
    corners[1] = (corners[1][0] + 0.1, 0.0)
    assert not found.has_median(scene_from_mapping(document, "moved"))
    document["phreatic_line"] = None
    assert not found.has_median(scene_from_mapping(document, "no line"))


def test_base_width_gives_both_faces_the_slope_it_leaves():
    scene = median_section(family(slope_h_per_v=None, base_width_m=106), "slide")
    assert scene.zones[1].polygon[1:4] == [(106.0, 0.0), (56.0, 20.0), (50.0, 20.0)]


@pytest.mark.parametrize(
    ("face", "before", "behind"), [("upstream", True, False), ("downstream", False, True)]
)
def test_the_pool_is_on_the_side_that_is_stated(face, before, behind):
    scene = median_section(family(slid_face=face, pool_m=10), "slide")
    left, right = scene.phreatic_level(np.array([-5.0, 110.0]))
    assert (left == 10.0, right == 10.0) == (before, behind)
    assert not median_section(family(slid_face="dry"), "slide").has_water


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=9, max_size=9), st.sampled_from([0.15, 0.3, 0.6]))
def test_every_section_of_a_family_holds_together(scores, thick):
    """As far as three standard deviations in any direction, with the foot where it was."""
    found = family(liquefied_share={"value": thick, "std": 0.2 * thick})
    base = median_section(found, "slide", 1.0)
    drawn = dict(zip(found.keys, scores, strict=True))
    scene = scene_from_mapping(found.document(base, drawn), "drawn")
    assert scene.foot("left") == 0.0
    values = found.values(drawn)
    assert scene.height == pytest.approx(values["height_m"], abs=1e-3)
    assert scene.materials[FILL].density == pytest.approx(values["density"])
    assert found.has_median(base) and (found.has_median(scene) or any(scores))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"height": 20}, "height: unknown key"),
        ({"height_m": 20000}, "height_m: 20000: allowed are 0.5 to 400 m"),
        ({"slope_h_per_v": 22}, "slope_h_per_v: 22: allowed are 0.5 to 12 .*in degrees"),
        ({"height_m": "twenty"}, "height_m: must look like 42, 42 \\+- 2"),
        ({"crest_width_m": {"low": 8, "high": 4}}, "low 8 must be less than high 4"),
        ({"crest_width_m": {"low": 8}}, "low, high: give both or neither"),
        ({"crest_width_m": {"value": 9, "low": 2, "high": 4}}, "value 9 lies outside"),
        ({"crest_width_m": {"low": 2, "high": 4, "std": 1}}, "std: belongs to a value"),
        ({"crest_width_m": {"how": "read"}}, "give a value, or low and high"),
        ({"liquefied_thickness_m": 21}, "liquefied_thickness_m: 21: allowed are 0.4 to 20 m"),
        ({"liquefied_thickness_m": 0.01}, "0.01: allowed are 0.4 to 20 m, .* of height_m 20"),
        ({"liquefied_thickness_m": 0}, "liquefied_thickness_m.value: Input should be greater"),
        ({"pool_m": {"low": 10, "high": 28}}, "pool_m: 28 m must be less than height_m 20"),
        ({"base_width_m": {"low": 60, "high": 200}}, "60 m leaves no room for crest and faces"),
        ({"height_m": "20 +- 30"}, "height_m: 20 ± 30 says too little.*give low and high"),
        ({"height_m": True}, "height_m: must look like 42, 42 \\+- 2"),
        ({"height_m": "66 ft"}, "height_m: must look like 42.* in the unit of its key"),
        ({"height_m": 500}, "height_m: 500: allowed are 0.5 to 400 m; is it in feet or mm"),
        ({"slope_h_per_v": 0.4}, "slope_h_per_v: 0.4: .*is it vertical per horizontal"),
        ({"final_slope_h_per_v": 2.2}, "2.2 is no flatter than the face was .*2.5.*in degrees"),
        ({"runout_m": 0}, "nothing ran; a slope that stood is drawn, and measured by no_flow"),
        ({"liquefied_thickness_m": 5, "liquefied_share": 0.3}, "give one of them"),
        ({"base_width_m": 100, "other_slope_h_per_v": 2}, "give one of them"),
        ({"base_width_m": 50}, "leaves no room for crest and faces"),
        ({"slid_face": "dry", "pool_m": 5}, "pool_m: there is none"),
        ({"density": 1.9}, "density: 1.9: allowed are 1000 to 3500 kg/m³; is it in t/m³"),
        ({"final_slope_h_per_v": 0.3}, "final_slope_h_per_v: 0.3: allowed are 1 to 200"),
        ({"runout_m": None}, "give runout_m, duration_s or final_slope_h_per_v"),
    ],
)
def test_slips_are_refused_in_one_line(changes, words, tmp_path):
    given = {key: value for key, value in {**FIVE, **changes}.items() if value is not None}
    path = tmp_path / "dimensions.yaml"
    path.write_text(yaml.safe_dump(given))
    with pytest.raises(InputError, match=words) as error:
        load_dimensions(path)
    assert "\n" not in str(error.value) and "dimensions.yaml" in str(error.value)


def test_what_is_hardly_meant_is_doubted():
    odd = family(height_m=140, crest_width_m=300, runout_m=3000).stated
    feet, crest, runout = odd.doubts()
    assert "42.7 m" in feet and "2.1 heights" in crest and "21 heights" in runout
    assert not list(family().stated.doubts())
    (steep,) = family(slope_h_per_v=0.5).stated.doubts()
    assert "vertical per horizontal? Then it is 2" in steep
    (degrees,) = family(final_slope_h_per_v=2.9).stated.doubts()
    assert "is it in degrees? Then it is 19.7" in degrees
    (flat,) = family(final_slope_h_per_v=190).stated.doubts()
    assert "190 is 0.3 degrees" in flat


def test_numbers_that_no_section_has_together_are_doubted():
    """17 of 20 m that liquefied on a 3:1 face take 54 m: more than 0.4 of the way to the crest."""
    told = {"slope_h_per_v": 3, "crest_width_m": 5, "base_width_m": 150}
    (line,) = family(**told, liquefied_thickness_m=17, liquefied_reach=0.4).doubts()
    assert line == "liquefied_reach 0.4: the other numbers leave room for 0.864"
    assert not list(family(**told, liquefied_thickness_m=5, liquefied_reach=0.8).doubts())
    assert not list(family(**told, liquefied_reach=3.0).doubts())
    (line,) = family(**told, liquefied_thickness_m=19.5).doubts()
    assert line == "liquefied_thickness_m 19.5: the other numbers leave room for 18"


def test_a_file_that_is_empty_says_so(tmp_path):
    (tmp_path / "dimensions.yaml").write_text("# nothing yet\n")
    with pytest.raises(InputError, match="is empty; the keys are listed in docs/how-to/add-a-sl"):
        load_dimensions(tmp_path)
