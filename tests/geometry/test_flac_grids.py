from __future__ import annotations

import pytest
from shapely.geometry import Polygon

from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.flac_grids import read_grid
from pipeline.cli import InputError


def _grid(path, columns=8, rows=4, bend=0.0):
    """A trapezoidal dam, 2 m a cell below: core in the middle, shell around; a slot of phases."""
    lines = ["* FLAC2D grid, made for a test", "* GRIDPOINTS"]
    for j in range(rows + 1):
        for i in range(columns + 1):
            y = 2.0 * j + bend * (i % 2)
            x = 2.0 * i * (1 - j / (2 * rows)) + 0.5 * columns * j / rows
            lines.append(f"G {j * (columns + 1) + i + 1:9d} {x:.14E} {y:.14E} ")
    lines.append("* ZONES")
    groups = {"Shell": [], "Core fill": []}
    for j in range(rows):
        for i in range(columns):
            first, number = j * (columns + 1) + i + 1, 2 * (j * columns + i) + 1
            above = first + columns + 1
            lines.append(f"Z Q4 {number} {first} {first + 1} {above} {above + 1}")
            groups["Core fill" if 3 <= i < 5 else "Shell"].append(number)
    lines.append("* GROUPS")
    for name, members in groups.items():
        lines.append(f'ZGROUP "{name}" SLOT "Construction"')
        for k in range(0, len(members), 5):
            lines.append(" " + " ".join(str(one) for one in members[k : k + 5]))
    lines += ['ZGROUP "1" SLOT "Phase"', " 1 3 5", "* FACES", "F E2 1 1 2"]
    lines += ['FGROUP "Base" SLOT "Default"', " 1"]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_groups_of_a_grid_are_zones_without_the_grids_own_vertices(tmp_path):
    zones = read_grid(_grid(tmp_path / "dam.f2grid"))
    assert list(zones) == ["Shell", "Shell_2", "Core_fill"]
    assert {name: len(ring) for name, ring in zones.items()} == dict.fromkeys(zones, 4)
    shapes = {name: Polygon(ring) for name, ring in zones.items()}
    assert sum(shape.area for shape in shapes.values()) == pytest.approx(0.5 * (16 + 8) * 8)
    assert Polygon(zones["Core_fill"]).bounds == pytest.approx((6.0, 0.0, 10.0, 8.0))
    border = shapes["Shell"].intersection(shapes["Core_fill"])
    assert border.length == pytest.approx((8**2 + 1) ** 0.5) and border.area == 0.0


def test_a_grid_becomes_a_scene(tmp_path):
    path = _grid(tmp_path / "dam.f2grid")
    soil = {"friction_deg": 30.0, "cohesion_kpa": 1.0}
    names = ("Shell", "Shell_2", "Core_fill")
    scene = section_scene(read_section(path), source=str(path), name="dam", spacing=0.5,
                          materials=dict.fromkeys(names, soil))  # fmt: skip
    assert scene.extent == (0.0, 8.0) and scene.foot("right") == pytest.approx(16.0)
    with pytest.raises(InputError, match="'Shell'.*has no friction_deg"):
        section_scene(read_section(path), source=str(path), name="dam")


def test_borders_that_bend_stay_common(tmp_path):
    zones = read_grid(_grid(tmp_path / "dam.f2grid", columns=9, bend=0.3))
    shapes = [Polygon(ring) for ring in zones.values()]
    assert all(shape.is_valid for shape in shapes)
    for i, shape in enumerate(shapes):
        for other in shapes[i + 1 :]:
            assert shape.intersection(other).area < 1e-9


@pytest.mark.parametrize("text, words", [
    ("", "no element"),
    ("G 1 0 0\n", "no element"),
    ("G 1 0 zero\n", "line 1: no line"),
    ("G 1 0 0\nZ Q4 1 1 2 3 4\n", "line 2: no line"),
    ("Z B8 1 1 2 3 4 5 6 7 8\n", "line 1: no line"),
    ("G 1 0 0\nG 2 nan 0\nG 3 0 1\nZ T3 1 1 2 3\n", "finite"),
])  # fmt: skip
def test_what_is_no_grid_is_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "dam.f2grid"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as raised:
        read_grid(path)
    assert "\n" not in str(raised.value)


def test_a_group_around_another_is_refused(tmp_path):
    path = _grid(tmp_path / "dam.f2grid", columns=3, rows=3)
    text = path.read_text().split("* GROUPS")[0]
    members = " ".join(str(2 * k + 1) for k in range(9) if k != 4)
    path.write_text(f'{text}ZGROUP "ring" SLOT "a"\n {members}\n')
    with pytest.raises(InputError, match="'ring' surrounds"):
        read_grid(path)
