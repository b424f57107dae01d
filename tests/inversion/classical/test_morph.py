from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Polygon

from inversion.classical.limit_equilibrium import ordinary
from inversion.classical.morph import MorphedSlide
from inversion.classical.slices import Polyline, cut
from inversion.classical.slide_forces import sum_forces
from pipeline.cli import InputError

SLIP = np.array([[0.0, 0.0], [28.0, 0.0], [38.0, 10.0]])
AFTER = np.array(
    [[-14.0, 0.0], [-12.0, 1.6], [0.0, 3.4], [15.0, 5.0], [30.0, 5.8], [34.0, 6.4], [38.0, 10.0]]
)


@pytest.fixture
def slide(dam):
    return MorphedSlide(dam(), Polyline(SLIP), AFTER, "left")


def test_area_of_every_section_is_that_of_the_first(slide):
    slide.check()
    for share in (0.0, 0.1, 0.45, 0.9, 1.0):
        stage = slide.section(share)
        assert stage.section.area == pytest.approx(slide.before.area, rel=1e-3)
        # Also zone by zone: no soil becomes another.
        for name in slide.before.names:
            area = [
                sum(
                    Polygon(p).area
                    for p, n in zip(section.polygons, section.names, strict=True)
                    if n == name
                )
                for section in (slide.before, stage.section)
            ]
            assert area[1] == pytest.approx(area[0], rel=5e-3)


def test_first_and_last_section_are_those_given(slide):
    x = np.linspace(0.5, 37.5, 60)
    first = slide.section(0.0).section
    assert first.surface(x) == pytest.approx(slide.before.surface(x), abs=0.02)
    x = np.linspace(-13.5, 37.5, 60)
    last = slide.section(1.0).section.surface(x)
    height = slide.after_surface(x) - slide.base(x)
    assert last == pytest.approx(slide.base(x) + slide.area_factor * height, abs=0.08)
    assert slide.toe_after == pytest.approx(-14.0, abs=0.05)


def test_centre_goes_in_proportion_to_the_share(slide):
    centres = np.array(
        [sum_forces(slide.slices(slide.section(f))).centre for f in (0.0, 0.25, 0.5, 1.0)]
    )
    travelled = (centres[:, 0] - centres[0, 0]) / (centres[-1, 0] - centres[0, 0])
    assert travelled == pytest.approx([0.0, 0.25, 0.5, 1.0], abs=5e-3)
    assert np.all(np.diff(centres[:, 1]) < 0)


def test_slices_of_the_first_section_are_those_of_the_section_before(slide):
    for base in ("weaker", "place", "carried"):
        moved = slide.slices(slide.section(0.0), base=base)
        given = cut(slide.before, slide.slip, "left")
        assert float(ordinary(moved)) == pytest.approx(float(ordinary(given)), rel=5e-3)


def test_strength_of_the_base_by_place_by_what_came_and_the_weaker(slide):
    stage = slide.section(0.8)
    lengths = {
        base: sum_forces(slide.slices(stage, base=base)).liquefied_length
        for base in ("place", "carried", "weaker")
    }
    # By place: from the new toe to the old one (no soil lay there), and zone 0, 4 to 30 m.
    toe = stage.slip.ends[0]
    rest = np.sqrt(2) * 3.0  # of the ramp within zone 0, up to where it leaves it
    assert lengths["place"] == pytest.approx(-toe + 24.0 + rest, abs=1e-3)
    assert lengths["weaker"] > max(lengths["place"], lengths["carried"])
    # The shell's toe, 4 m long before, is carried along and stays frictional.
    assert lengths["carried"] < lengths["place"]


def test_mirror(slide, mirrored):
    flip = np.array([-1.0, 1.0])
    other = MorphedSlide(
        mirrored(slide.before), Polyline((SLIP * flip)[::-1]), (AFTER * flip)[::-1], "right"
    )
    left = sum_forces(slide.slices(slide.section(0.4)))
    right = sum_forces(other.slices(other.section(0.4)))
    assert right.static_strength == pytest.approx(left.static_strength, rel=2e-3)
    assert right.centre == pytest.approx(left.centre * flip, abs=0.01)


@pytest.mark.parametrize(
    ("slip", "after", "words"),
    [
        (SLIP + [0.0, -1.0], AFTER, "below the rigid base"),
        ([[0, 0], [10, 8], [38, 10]], AFTER, "above the soil before the slide at x = 1"),
        (SLIP, [[-14, 0], [0, 1], [36, 3], [38, 10]], "above the surface after the slide"),
        (SLIP, [[-14, 0], [-10, 6], [30, 9], [38, 10]], "area of the sliding mass"),
    ],
)
def test_sections_that_do_not_belong_together_are_refused(dam, slip, after, words):
    slip, after = np.asarray(slip, dtype=float), np.asarray(after, dtype=float)
    with pytest.raises(InputError, match=words):
        MorphedSlide(dam(), Polyline(slip), after, "left").check()


def test_share_beyond_the_displacement_is_refused(slide):
    with pytest.raises(ValueError, match="0 to 1"):
        slide.section(1.2)
