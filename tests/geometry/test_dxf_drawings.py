"""Drawings as CAD programs leave them: every entity is read, listed as left out, or refused.

Each test draws the same section, a fill on sand with ground and water, with one thing drawn in
another way; what is right is stated by the section itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from geometry.scenes import dxf_drawings
from geometry.scenes.drawings import read_section, reading, section_document
from pipeline.cli import InputError

ezdxf = pytest.importorskip("ezdxf", reason="the extra dxf is not installed")

SAND = [(0.0, 0.0), (30.0, 0.0), (30.0, 3.0), (0.0, 3.0)]
FILL = [(6.0, 3.0), (30.0, 3.0), (24.0, 9.0), (12.0, 9.0)]
GROUND = [(-40.0, 0.0), (80.0, 0.0)]
WATER = [(-40.0, 2.0), (0.0, 2.5), (80.0, 2.5)]
Draw = Callable[[Any], None]


def polyline(layer: str, points: list[tuple[float, float]], closed: bool = False) -> Draw:
    return lambda space: space.add_lwpolyline(points, close=closed, dxfattribs={"layer": layer})


def section(**instead: Draw):
    """A drawing with the section; a layer that is named is drawn in that way, or not at all."""
    drawing = ezdxf.new("R2010", units=6)
    usual = {
        "sand": polyline("sand", SAND, True),
        "fill": polyline("fill", FILL, True),
        "ground": polyline("ground", GROUND),
        "water": polyline("water", WATER),
    }
    for draw in {**usual, **instead}.values():
        draw(drawing.modelspace())
    return drawing


def read(drawing, tmp_path):
    drawing.saveas(tmp_path / "s.dxf")
    return read_section(tmp_path / "s.dxf")


def check_fill(found, tolerance: float = 1e-9) -> None:
    """The fill is where it was drawn, from whichever vertex and in whichever direction."""
    assert len(found) == len(FILL)
    for corner in FILL:
        assert min(math.dist(corner, other) for other in found) <= tolerance


def mirrored_polyline(space) -> None:
    mirrored = [(-x, y) for x, y in FILL]
    space.add_lwpolyline(
        mirrored, close=True, dxfattribs={"layer": "fill", "extrusion": (0, 0, -1)}
    )


def mirrored_old_polyline(space) -> None:
    shape = space.add_polyline2d([(-x, y) for x, y in FILL], close=True)
    shape.dxf.layer, shape.dxf.extrusion = "fill", (0, 0, -1)


def hatch(space) -> None:
    space.add_hatch(dxfattribs={"layer": "fill"}).paths.add_polyline_path(FILL)


def solid(space) -> None:
    """The vertices of a SOLID go across."""
    a, b, c, d = FILL
    space.add_solid([a, b, d, c], dxfattribs={"layer": "fill"})


def face(space) -> None:
    space.add_3dface(FILL, dxfattribs={"layer": "fill"})


def nearly_closed(space) -> None:
    space.add_lwpolyline([*FILL, (FILL[0][0] + 4e-10, FILL[0][1])], dxfattribs={"layer": "fill"})


def block(layer_within: str, scale: float = 1.0, at: tuple[float, float] = (0.0, 0.0)) -> Draw:
    """The fill in a block; on layer 0 of it, it is on the layer of the block's place."""

    def draw(space) -> None:
        inner = space.doc.blocks.new("PART")
        moved = [((x - at[0]) / scale, (y - at[1]) / scale) for x, y in FILL]
        inner.add_lwpolyline(moved, close=True, dxfattribs={"layer": layer_within})
        space.add_blockref(
            "PART", at, dxfattribs={"layer": "fill", "xscale": scale, "yscale": scale}
        )

    return draw


@pytest.mark.parametrize(
    "draw",
    [
        mirrored_polyline,
        mirrored_old_polyline,
        hatch,
        solid,
        face,
        nearly_closed,
        block("0"),
        block("fill"),
        block("0", scale=-2.0, at=(3.0, 1.0)),
    ],
)
def test_a_zone_is_where_the_drawing_shows_it(draw, tmp_path):
    found = read(section(fill=draw), tmp_path)
    assert not found.left_out
    check_fill(found.zones["fill"], 1e-9 if draw is not nearly_closed else 1e-8)


def test_curves_are_read_as_chords(tmp_path):
    """A water table as a spline and as an arc, an outline with an arc, and a round zone."""

    def spline(space) -> None:
        space.add_spline(WATER[1:], dxfattribs={"layer": "water"})

    level = read(section(water=spline), tmp_path)
    assert level.water[0] == pytest.approx(WATER[1]) and level.water[-1] == pytest.approx(WATER[2])
    assert all(y == pytest.approx(2.5) for _, y in level.water)

    def arc(space) -> None:
        space.add_arc((15, -100), 105, 60, 120, dxfattribs={"layer": "water"})

    water = read(section(water=arc), tmp_path).water
    assert all(math.dist(place, (15, -100)) == pytest.approx(105.0, rel=1e-4) for place in water)
    for (x, y), (x1, y1) in zip(water, water[1:], strict=False):
        assert 105.0 - math.dist(((x + x1) / 2, (y + y1) / 2), (15, -100)) < 0.05

    def round_crest(space) -> None:
        bulged = [(*FILL[0], 0.0), (*FILL[1], 0.0), (*FILL[2], 0.2), (*FILL[3], 0.0)]
        space.add_lwpolyline(bulged, "xyb", close=True, dxfattribs={"layer": "fill"})

    fill = read(section(fill=round_crest), tmp_path).zones["fill"]
    assert max(y for _, y in fill) == pytest.approx(9.0 + 0.2 * 6.0, abs=2e-3)


def test_what_is_left_out_is_listed(tmp_path):
    drawing = section()
    space = drawing.modelspace()
    space.add_text("fill", dxfattribs={"layer": "notes"})
    space.add_hatch(dxfattribs={"layer": "fill"}).paths.add_polyline_path(FILL)
    drawing.layers.add("old").freeze()
    polyline("old", SAND, True)(space)
    drawing.layers.add("frame").off()
    polyline("frame", GROUND)(space)
    polyline("sheet", SAND, True)(drawing.layout("Layout1"))
    found = read(drawing, tmp_path)
    assert list(found.zones) == ["sand", "fill"]
    assert sorted(found.left_out) == [
        "1 HATCH on layer fill (fills the outline there)",
        "1 LWPOLYLINE in paper space Layout1",
        "1 LWPOLYLINE on layer frame (switched off)",
        "1 LWPOLYLINE on layer old (frozen)",
        "1 TEXT on layer notes",
    ]
    assert [f"left out: {entry}" for entry in found.left_out] == reading(found)[3:]


def other_hatch(space) -> None:
    polyline("fill", FILL, True)(space)
    space.add_hatch(dxfattribs={"layer": "fill"}).paths.add_polyline_path(SAND)


def holed_hatch(space) -> None:
    shape = space.add_hatch(dxfattribs={"layer": "fill"})
    shape.paths.add_polyline_path(FILL)
    shape.paths.add_polyline_path([(14, 5), (16, 5), (15, 6)])


def helix(space) -> None:
    space.add_helix(2, 1, 3, dxfattribs={"layer": "fill"})


def multiline(space) -> None:
    space.add_mline(FILL, dxfattribs={"layer": "fill"})


def mesh(space) -> None:
    space.add_polyface().append_faces([FILL])
    space[-1].dxf.layer = "fill"


def upright(space) -> None:
    space.add_polyline3d([(x, 0, y) for x, y in FILL], close=True, dxfattribs={"layer": "fill"})


def other_drawing(space) -> None:
    space.doc.add_xref_def("other.dxf", "OTHER")
    space.add_blockref("OTHER", (0, 0), dxfattribs={"layer": "fill"})


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (helix, "layer fill: a HELIX cannot be read"),
        (multiline, "layer fill: a MLINE cannot be read"),
        (other_hatch, "two outlines are called 'fill'"),
        (holed_hatch, "a HATCH has 2 outlines"),
        (mesh, "layer fill: a mesh cannot be read"),
        (upright, "is not flat (z varies by 9)"),
        (other_drawing, "block 'OTHER' lies in another drawing"),
        (polyline("axis", GROUND), "a frozen layer of a DXF is left out"),
    ],
)
def test_what_may_be_soil_is_refused(draw, words, tmp_path):
    with pytest.raises(InputError) as caught:
        read(section(fill=draw), tmp_path)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_section_in_the_x_z_plane_says_so(tmp_path):
    drawing = ezdxf.new()
    drawing.modelspace().add_polyline3d([(x, 5.0, y) for x, y in FILL], close=True)
    with pytest.raises(InputError, match="is drawn in the x-z plane"):
        read(drawing, tmp_path)


def test_a_drawing_without_zones_says_what_it_has(tmp_path):
    drawing = ezdxf.new()
    polyline("water", WATER)(drawing.modelspace())
    polyline("fill", FILL, True)(drawing.layout("Layout1"))
    with pytest.raises(InputError) as caught:
        read(drawing, tmp_path)
    assert str(caught.value).endswith(
        "found: an open line 'water', 1 LWPOLYLINE in paper space Layout1"
    )


def test_blocks_that_multiply_are_refused(tmp_path, monkeypatch):
    """Ten in each of eight levels: a hundred million entities of a file of some kilobytes."""
    monkeypatch.setattr(dxf_drawings, "MOST_ENTITIES", 1_000)
    drawing = ezdxf.new()
    drawing.blocks.new("B0").add_point((0, 0))
    for level in range(1, 9):
        inner = drawing.blocks.new(f"B{level}")
        for _ in range(10):
            inner.add_blockref(f"B{level - 1}", (0, 0))
    drawing.modelspace().add_blockref("B8", (0, 0))
    with pytest.raises(InputError, match="more than 1,000 entities"):
        read(drawing, tmp_path)


@pytest.mark.parametrize(
    ("units", "given", "words"),
    [
        (6, None, "30 m long and 9 m high (x 0 to 30, y 0 to 9 m); unit m, as the file says"),
        (0, None, "unit m, the file names none"),
        (1, None, "0.762 m long and 0.2286 m high (x 0 to 0.762, y 0 to 0.2286 m); unit in, as the "
                  "file says; --unit m if it was drawn in metres"),
        (1, "m", "30 m long and 9 m high (x 0 to 30, y 0 to 9 m); unit m, as given"),
    ],
)  # fmt: skip
def test_size_and_unit_are_said(units, given, words, tmp_path):
    drawing = section()
    drawing.header["$INSUNITS"] = units
    found = read(drawing, tmp_path)
    first, *lines = reading(found, given)
    assert words in first
    assert [line.split(",")[0] for line in lines] == ["read the line ground", "read the line water"]


def test_a_line_keeps_the_order_of_its_points(tmp_path):
    def document(**instead: Draw):
        found = read(section(**instead), tmp_path)
        return section_document(found, source="s.dxf", name="s")

    assert document(water=polyline("water", WATER[::-1]))["phreatic_line"] == WATER
    bank = [(-40.0, 0.0), (42.0, 0.0), (38.0, -4.0), (80.0, -4.0)]
    for line in (bank, bank[::-1]):
        with pytest.raises(InputError, match=r"'ground' turns back from \(42, 0\) to \(38, -4\)"):
            document(ground=polyline("ground", line))
    with pytest.raises(
        InputError, match=r"'water' is vertical from \(0, 1\) to \(0, 2.5\) m; move"
    ):
        document(water=polyline("water", [(-40.0, 1.0), (0.0, 1.0), (0.0, 2.5), (80.0, 2.5)]))
