"""Twelve ordinary slides and some 450 ways to draw them: read alike, refused, or doubted.

What a slip makes of a section is known here, so that none is read wrong in silence: another unit
that is named, another order of zones or vertices, axes in other columns are the same section; a
lost zone, a depth for a height, a density in t/m3 are not, and are to be refused or doubted.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from geometry.scenes.doubts import doubts
from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.polygon_checks import area, gaps
from geometry.scenes.scene import Scene
from geometry.sides import SIDES
from pipeline.cli import InputError

GALLERY = Path(__file__).parents[2] / "docs/examples/gallery"
NAMES = sorted(path.stem for path in GALLERY.glob("*.csv"))
FOOT = 0.3048
LINES = ("ground", "water")

Row = dict[str, str]


def rows_of(name: str) -> list[Row]:
    lines = (GALLERY / f"{name}.csv").read_text().splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def unit_of(name: str) -> str:
    return "ft" if name.endswith("_feet") else "m"


def written(rows: list[Row], *, columns: list[str] | None = None, sep: str = ",") -> str:
    columns = columns or list(rows[0])
    return "\n".join([sep.join(columns), *(sep.join(row[c] for c in columns) for row in rows)])


def read(text: str, unit: str | None, folder: Path) -> tuple[Scene | None, list[str]]:
    """The scene of a drawing, or None where it is refused; and what is said of it."""
    path = folder / "section.csv"
    path.write_text(text + "\n")
    try:
        scene = section_scene(read_section(path), source="section.csv", name="a", unit=unit)
    except InputError as error:
        return None, [str(error)]
    shapes = {zone.name: zone.polygon for zone in scene.zones}
    found = [f"gap of {size:.3g} m2" for size, _ in gaps(shapes, scene.spacing)]
    return scene, [*found, *doubts(scene)]


def numbers(rows: list[Row], x: Callable = float, y: Callable = float) -> list[Row]:
    return [{**row, "x": repr(x(float(row["x"]))), "y": repr(y(float(row["y"])))} for row in rows]


def by_zone(rows: list[Row], change: Callable[[list[Row]], list[Row]]) -> list[Row]:
    zones = dict.fromkeys(row["zone"] for row in rows)
    own = {zone: [row for row in rows if row["zone"] == zone] for zone in zones}
    return [row for zone in zones for row in (own[zone] if zone in LINES else change(own[zone]))]


def scaled(rows: list[Row], column: str, factor: float) -> list[Row]:
    return [{**r, column: repr(float(r[column]) * factor) if r[column] else ""} for r in rows]


def same(name: str) -> Iterator[tuple[str, str, str]]:
    """What says the same: a name, the text, its unit."""
    rows, unit = rows_of(name), unit_of(name)
    metres = FOOT if unit == "ft" else 1.0
    for other, size in (("mm", 1e-3), ("cm", 0.01), ("dm", 0.1), ("km", 1e3), ("ft", FOOT),
                        ("in", FOOT / 12.0), ("yd", 3.0 * FOOT)):  # fmt: skip
        factor = metres / size
        changed = numbers(rows, lambda x, k=factor: k * x, lambda y, k=factor: k * y)
        yield f"in {other}", written(changed), other
    columns = ["zone", "y", "x", *list(rows[0])[3:]]
    yield "columns exchanged", written(rows, columns=columns), unit
    yield (
        "vertices from another one on",
        written(by_zone(rows, lambda own: own[1:] + own[:1])),
        unit,
    )
    yield "vertices the other way round", written(by_zone(rows, lambda own: own[::-1])), unit
    yield "zones in another order", written(sorted(rows, key=lambda row: row["zone"])), unit
    yield "a vertex twice", written(by_zone(rows, lambda own: [own[0], *own])), unit
    yield "map coordinates", written(numbers(rows, lambda x: x + 1e5)), unit
    yield "from a spreadsheet", "\ufeff" + written(rows).replace("\n", "\r\n"), unit


def other(name: str) -> Iterator[tuple[str, str, str | None]]:
    """What cannot be meant: a name, the text, its unit."""
    rows, unit = rows_of(name), unit_of(name)
    metres = FOOT if unit == "ft" else 1.0
    for size in (1e3, 1e-3):
        changed = numbers(rows, lambda x, k=size * metres: k * x, lambda y, k=size * metres: k * y)
        yield f"{size:g} times as large, no unit named", written(changed), None
    yield "depths for heights", written(numbers(rows, y=lambda y: -y)), unit
    turned = [{**row, "x": row["y"], "y": row["x"]} for row in rows]
    yield "x and y exchanged", written(turned), unit
    yield "rows in any order", written([rows[k] for k in np.random.default_rng(3).permutation(
        len(rows))]), unit  # fmt: skip
    yield "density in t/m3", written(scaled(rows, "density", 1e-3)), unit
    yield "density in kN/m3", written(scaled(rows, "density", 9.81e-3)), unit
    yield "strength in Pa", written(scaled(rows, "cohesion_kpa", 1e3)), unit
    if any(float(row["friction_deg"] or 0) for row in rows):
        yield "angles in radians", written(scaled(rows, "friction_deg", math.pi / 180.0)), unit
    yield "nothing liquefied", written([{**row, "liquefied": ""} for row in rows]), unit
    yield "semicolons and decimal commas", written(rows, sep=";").replace(".", ","), unit
    for text in ("", "x", "nan", "1e999"):
        yield f"x is {text!r}", written([{**rows[0], "x": text}, *rows[1:]]), unit
    zones = [zone for zone in dict.fromkeys(row["zone"] for row in rows) if zone not in LINES]
    for zone in zones:
        own = [row for row in rows if row["zone"] == zone]
        yield f"{zone} twice", written([*rows, *({**row, "zone": "copy"} for row in own)]), unit
        for column in ("density", "cohesion_kpa", "friction_deg"):
            emptied = [{**row, column: ""} if row in own else row for row in rows]
            if column != "density":  # which has a default
                yield f"{zone} without {column}", written(emptied), unit
        low = min(float(row["y"]) for row in own)
        if len(zones) > 1 and low == min(float(row["y"]) for row in rows):
            yield (
                f"{zone} lifted",
                written(
                    [
                        {**r, "y": repr(float(r["y"]) + 2.0 / metres)} if r in own else r
                        for r in rows
                    ]
                ),
                unit,
            )


def facts(scene: Scene) -> dict:
    """What makes a section: areas, water, soils, ends."""
    soils = {zone.name: scene.materials[zone.material] for zone in scene.zones}
    return {
        "areas": {zone.name: area(zone.polygon) for zone in scene.zones},
        "water": {"level": scene.water_level or 0.0},
        "soils": {name: soil.model_dump() for name, soil in soils.items()},
        "far": {side: scene.domain.goes_on(side) for side in SIDES},
    }


@pytest.mark.parametrize("name", NAMES)
def test_an_ordinary_section_is_read_without_doubt(name, tmp_path):
    scene, said = read(written(rows_of(name)), unit_of(name), tmp_path)
    assert scene is not None and said == []
    assert len((GALLERY / f"{name}.csv").read_text().splitlines()) <= 30


@pytest.mark.parametrize("name", NAMES)
def test_the_same_section_drawn_otherwise_is_the_same(name, tmp_path):
    scene, _ = read(written(rows_of(name)), unit_of(name), tmp_path)
    assert scene is not None
    expected = facts(scene)
    for part in ("areas", "water"):
        expected[part] = pytest.approx(expected[part], rel=1e-6)
    for how, text, unit in same(name):
        found, said = read(text, unit, tmp_path)
        assert found is not None, (how, said)
        assert facts(found) == expected, how


@pytest.mark.parametrize("name", NAMES)
def test_what_cannot_be_meant_is_refused_or_doubted(name, tmp_path):
    for how, text, unit in other(name):
        found, said = read(text, unit, tmp_path)
        assert said, (how, found and facts(found))
        assert all("\n" not in line for line in said), how


def test_the_ways_are_as_many_as_promised():
    assert len(NAMES) == 12
    assert sum(len([*same(name), *other(name)]) for name in NAMES) >= 300
