"""A liquefied layer of few rows of points is said: in it S_r comes out too low."""

from __future__ import annotations

from pathlib import Path

import pytest

from flowslide.commands.check import print_doubts
from geometry.scenes.doubts import thin_layers
from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.scene import Scene, load_scene

ROOT = Path(__file__).parents[2]


def drawn(name: str, spacing: float) -> Scene:
    section = read_section(ROOT / "docs/examples" / f"{name}.csv")
    return section_scene(section, source="a.csv", name="a", unit=None, spacing=spacing)


THIN = [("sheffield", 1.2), ("gallery/stockpile", 1.5), ("gallery/tailings_downstream", 3)]


@pytest.mark.parametrize("name, thick", THIN)
def test_a_thin_layer_is_said_until_it_has_four_rows(name, thick, capsys):
    (line,) = thin_layers(drawn(name, thick / 2))
    assert f"is {thick:g} m thick, 2 rows of points" in line and f"spacing {thick / 4:g}" in line
    assert thin_layers(drawn(name, thick / 4)) == []
    print_doubts(drawn(name, thick / 2))
    assert "few points: what liquefied" in capsys.readouterr().out


def test_thin_zones_on_each_other_are_one_thick_layer():
    scene = load_scene(ROOT / "case_histories/lower_san_fernando/scene.yaml")
    assert thin_layers(scene) == [] and scene.spacing == 1.0


def test_where_nothing_liquefied_nothing_is_thin():
    scene = drawn("sheffield", 0.6)
    soils = {
        name: soil.model_dump() | {"liquefied": False} for name, soil in scene.materials.items()
    }
    assert thin_layers(scene.changed(materials=soils)) == []
