"""A liquefied layer of few rows of points is said: in it S_r comes out too low."""

from __future__ import annotations

from pathlib import Path

import pytest

from flowslide.commands.check import print_doubts
from geometry.scenes.doubts import doubts, far_feet, far_runouts, thin_layers
from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.scene import Scene, load_scene, scene_from_mapping

ROOT = Path(__file__).parents[2]


def drawn(name: str, spacing: float) -> Scene:
    section = read_section(ROOT / "docs/examples" / f"{name}.csv")
    return section_scene(section, source="a.csv", name="a", unit=None, spacing=spacing)


THIN = [("sheffield", 1.2), ("gallery/stockpile", 1.5), ("gallery/tailings_downstream", 3)]


@pytest.mark.parametrize("name, thick", THIN)
def test_a_thin_layer_is_said_until_it_has_four_rows(name, thick, capsys):
    (line,) = thin_layers(drawn(name, thick / 2))
    assert f"is {thick:g} m thick, 2 rows of points" in line and f"spacing {thick / 6:.3g}" in line
    assert thin_layers(drawn(name, thick / 4)) == []
    print_doubts(drawn(name, thick / 2))
    assert "few points: what liquefied" in capsys.readouterr().out


def test_thin_zones_on_each_other_are_one_thick_layer():
    scene = load_scene(ROOT / "case_histories/lower_san_fernando/scene.yaml")
    assert thin_layers(scene) == [] and scene.spacing == 1.0


def test_a_section_lower_than_its_toe_can_be_read_is_said():
    flume = [(0, 0), (9, 0), (9, 1.2), (4, 1.2)]
    low = scene_from_mapping(
        {
            "name": "flume",
            "domain": {"x_min": -10, "x_max": 20, "y_max": 5},
            "ground": {"points": [[-10, 0], [20, 0]]},
            "zones": [{"name": "sand", "polygon": flume, "material": "sand"}],
            "materials": {"sand": {"friction_deg": 0, "cohesion_kpa": 1, "liquefied": True}},
            "spacing": 0.1,
        }
    )
    (line,) = doubts(low)
    assert "1.2 m high; is the unit of the drawing right" in line
    assert "toes are read where soil is 0.5 m high, so enlarge it" in line
    (zone,) = low.zones
    turned = zone.model_copy(update={"polygon": [(0, 0), (0.6, 0), (0.6, 1.5), (0, 1.5)]})
    assert "are x and y exchanged?" in doubts(low.changed(zones=[turned]))[0]


def test_a_runout_of_thirty_heights_is_doubted():
    scene = drawn("sheffield", 0.6)
    assert far_runouts(scene, [30.0, 200.0]) == []
    (line,) = far_runouts(scene, [30.0, 5000.0])
    assert line.startswith("a runout of 5000 m is ") and "is its unit right?" in line


def test_where_nothing_liquefied_nothing_is_thin():
    scene = drawn("sheffield", 0.6)
    soils = {
        name: soil.model_dump() | {"liquefied": False} for name, soil in scene.materials.items()
    }
    assert thin_layers(scene.changed(materials=soils)) == []


def layered(**zones: list[tuple[float, float]]) -> Scene:
    """Liquefied zones below a fill, with points 0.6 m apart; the ground goes on to both sides."""
    outlines = {**zones, "fill": [(0, 2.4), (50, 2.4), (32, 10), (20, 10)]}
    return scene_from_mapping(
        {
            "name": "layered",
            "domain": {"x_min": -30, "x_max": 80, "y_max": 20, "walls": "open"},
            "ground": {"points": [[-30, 0], [80, 0]]},
            "zones": [
                {"name": name, "polygon": outline, "material": name.split("_")[0]}
                for name, outline in outlines.items()
            ],
            "materials": {
                name: {"friction_deg": 0, "cohesion_kpa": 5, "liquefied": name == "seam"}
                for name in dict.fromkeys(name.split("_")[0] for name in outlines)
            },
            "spacing": 0.6,
        }
    )


def test_a_neck_of_a_layer_is_thin():
    seam = [(-30, 0), (80, 0), (80, 2.4), (52, 2.4), (50, 0.6), (0, 0.6), (-2, 2.4), (-30, 2.4)]
    crust = [(0, 0.6), (50, 0.6), (52, 2.4), (-2, 2.4)]
    (line,) = thin_layers(layered(seam=seam, crust=crust))
    assert "is 0.6 m thick, 1 rows of points" in line


def test_seams_one_above_another_are_not_one_layer():
    def level(low: float, high: float, left: float = -30.0) -> list[tuple[float, float]]:
        return [(left, low), (80, low), (80, high), (left, high)]

    scene = layered(
        seam_low=level(0, 0.9),
        seam_stub=[(-30, 0.9), (-28, 0.9), (-28, 1.5), (-30, 1.5)],
        clay=level(0.9, 1.5, -28.0),
        seam_high=level(1.5, 2.4),
    )
    (line,) = thin_layers(scene)
    assert "is 0.9 m thick, 1.5 rows of points" in line


def test_a_density_in_another_unit_is_doubted():
    scene = drawn("sheffield", 0.6)
    name = next(iter(scene.materials))
    for density, doubted in ((119.0, True), (950.0, False), (2100.0, False), (18600.0, True)):
        soil = scene.materials[name].model_copy(update={"density": density})
        soils = {**scene.materials, name: soil}
        said = [line for line in doubts(scene.changed(materials=soils)) if "density" in line]
        assert bool(said) is doubted, density


def test_a_foot_far_from_the_section_and_a_negative_runout_are_doubted():
    scene = drawn("sheffield", 0.6)
    foot = scene.foot("left")
    assert far_feet(scene, {"left": foot + 0.5}) == []
    (line,) = far_feet(scene, {"left": foot - 34.0, "right": scene.foot("right")})
    assert line.startswith(f"the left foot was surveyed at x = {foot - 34.0:g} m")
    (line,) = far_runouts(scene, [12.0, -34.0])
    assert "outward" in line


def seamed(thick: float, seam_k: float | None, **soil: float) -> Scene:
    """Saturated sand of 1e-4 m/s with a seam across it."""

    def layer(name: str, low: float, high: float) -> dict:
        box = [(0, low), (40, low), (40, high), (0, high)]
        return {"name": name, "polygon": box, "material": "seam" if name == "seam" else "sand"}

    return scene_from_mapping(
        {
            "name": "seamed",
            "domain": {"x_min": -10, "x_max": 50, "y_max": 20},
            "ground": {"points": [[-10, 0], [50, 0]]},
            "zones": [layer("low", 0, 5), layer("seam", 5, 5 + thick), layer("top", 5 + thick, 10)],
            "materials": {
                "sand": {
                    "friction_deg": 0, "cohesion_kpa": 9, "liquefied": True,
                    "permeability_m_per_s": 1e-4,
                    "pre_failure": {"friction_deg": 32, "cohesion_kpa": 60},
                },
                "seam": {
                    "friction_deg": 33, "cohesion_kpa": 0, "permeability_m_per_s": seam_k, **soil,
                },
            },
            "water_level": 8.0,
            "spacing": 0.5,
        }
    )  # fmt: skip


@pytest.mark.parametrize("k", [None, 1e-7, 1e-2])
def test_a_seal_or_drain_of_less_than_two_cells_is_said_until_the_spacing_suits_it(k):
    soil = {} if k else {"friction_deg": 0, "cohesion_kpa": 20}  # clay may be meant to seal
    thin = seamed(0.6, k, **soil)
    (line,) = doubts(thin)
    assert line.startswith("few cells: seam beside sand is about 0.59 m thick, 0.59 cells")
    assert ("it leaks: give it a permeability_m_per_s" in line) == (k is None)
    assert line.field == ("scene", "spacing")
    assert doubts(thin.changed(spacing=float(line.split("spacing ")[1]))) == []
    assert doubts(seamed(0.6, 5e-4)) == [], "water flows in it much as beside it"
    assert doubts(seamed(2.2, k, **soil)) == []


def test_a_permeability_that_does_nothing_is_said():
    wet = seamed(2.5, 1e-4)
    assert doubts(wet) == []
    for level, why in ((None, "no water"), (0.0, "no soil that has one lies below")):
        (line,) = doubts(wet.changed(water_level=level))
        assert line.startswith(f"permeability_m_per_s does nothing: {why}")
    (line,) = doubts(wet.changed(water_level=0.0, materials=_with(wet, "seam", None)))
    assert line.field == ("scene", "materials", "sand", "permeability_m_per_s")


def test_sand_without_a_permeability_is_said_to_seal_wet_or_dry():
    wet = seamed(2.5, None)
    for level in (8.0, 4.0):  # dry sand holds the water up as well
        (line,) = doubts(wet.changed(water_level=level))
        assert line == "seam: without permeability_m_per_s it seals sand, wet or dry"
    assert doubts(seamed(2.5, None, friction_deg=0, cohesion_kpa=20)) == [], "clay"


def test_liquefied_soil_that_regains_no_strength_is_said():
    wet = seamed(2.5, 1e-4)
    for before in (None, {"friction_deg": 0, "cohesion_kpa": 60}):
        (line,) = doubts(wet.changed(materials=_with(wet, "sand", 1e-4, pre_failure=before)))
        assert line.startswith("sand: without pre_failure.friction_deg it keeps S_r")
        assert line.field == ("scene", "materials", "sand", "pre_failure")


def _with(scene: Scene, name: str, k: float | None, **soil: object) -> dict:
    soils = {one: found.model_dump() for one, found in scene.materials.items()}
    soils[name] |= {"permeability_m_per_s": k, **soil}
    return soils


def test_excess_pressure_of_dry_soil_is_said():
    wet = seamed(2.5, 1e-4, excess_pressure_ratio=0.3)
    assert doubts(wet) == []
    (line,) = doubts(wet.changed(water_level=4.0))
    assert line == "seam: excess_pressure_ratio of soil above the water does nothing"
