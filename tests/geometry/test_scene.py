"""The scene document: what it refuses, in which words; that files come back unchanged."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import yaml
from shapely import Polygon

from geometry import Scene, load_scene, save_scene, scene_from_mapping
from geometry.scenes.fill import fill
from geometry.scenes.polygon_checks import gaps
from geometry.scenes.scene import scene_hash
from pipeline.cli import InputError


@pytest.fixture
def document() -> dict:
    """Two squares side by side on a level base."""
    return {
        "name": "two squares",
        "domain": {"x_min": 0.0, "x_max": 60.0, "y_max": 30.0},
        "ground": {"points": [[0.0, 2.0], [60.0, 2.0]]},
        "zones": [
            {"name": "left", "polygon": [[10, 2], [20, 2], [20, 12], [10, 12]], "material": "sand"},
            {
                "name": "right",
                "polygon": [[20, 2], [30, 2], [30, 12], [20, 12]],
                "material": "clay",
            },
        ],
        "materials": {
            "sand": {"friction_deg": 35.0, "cohesion_kpa": 0.0},
            "clay": {"friction_deg": 0.0, "cohesion_kpa": 20.0, "liquefied": True},
        },
        "spacing": 1.0,
    }


def changed(document: dict, path: str, value) -> dict:
    """A copy with the value at a dotted path replaced."""
    document = copy.deepcopy(document)
    *way, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    place = document
    for part in way:
        place = place[part]
    place[last] = value
    return document


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("colour", "red", "colour: unknown key"),
        ("zones.0.colour", "red", "zones.0.colour: unknown key"),
        ("materials.sand.poison_ratio", 0.3, "materials.sand.poison_ratio: unknown key"),
        ("spacing", 0.0, "spacing: Input should be greater than 0 (got 0.0)"),
        ("spacing", float("nan"), "spacing: Input should be a finite number"),
        ("zones.0.polygon.1.0", float("inf"), "zones.0.polygon.1.0: Input should be a finite"),
        ("zones.0.material", "gravel", "known are sand, clay"),
        ("zones.1.name", "left", "two zones are called 'left'"),
        ("zones.0.polygon", [[10, 2], [20, 2]], "zones.0.polygon"),
        ("zones.0.polygon", [[10, 2], [20, 12], [20, 2], [10, 12]], "not a simple polygon"),
        ("zones.0.polygon", [[10, 2], [20, 2], [20, 2.3], [10, 2.3]], "is a sliver"),
        ("zones.0.polygon", [[10, 2], [21, 2], [21, 12], [10, 12]], "overlap by 10 m²"),
        ("zones.0.polygon", [[10, 1], [20, 1], [20, 12], [10, 12]], "below the ground by 10 m²"),
        ("zones.0.polygon", [[-1, 2], [20, 2], [20, 12], [10, 12]], "outside the domain"),
        ("zones.0.polygon", [[10, 2], [20, 2], [20, 40], [10, 40]], "outside the domain"),
        ("domain.x_max", -5.0, "must be greater than x_min"),
        ("domain.walls", "ajar", "'closed' or 'open'"),
        ("ground.points", [[0, 2], [60, 2], [30, 2]], "x must ascend, but 30 follows 60"),
        ("ground.points", [[0, 2], [60, 50]], "not below the domain's y_max"),
        ("ground.contact", "coulomb", "needs a friction_coefficient"),
        ("ground.friction_coefficient", 0.4, "has no effect with contact: rough"),
        ("materials.sand.friction_deg", 95.0, "less than 89 (got 95.0)"),
        ("materials.sand.cohesion_kpa", -1.0, "greater than or equal to 0 (got -1.0)"),
        ("materials.sand.poisson_ratio", 0.5, "less than 0.5"),
        ("materials.sand.saturated_density", 1000.0, "is below density 1800"),
        ("materials.spare", {"friction_deg": 1, "cohesion_kpa": 1}, "'spare' is used by no zone"),
        ("spacing", 1e-4, "places for points; allowed are 5e+07"),
        ("spacing", 1e-200, "spacing: 1e-200 m gives the domain inf places for points"),
        ("spacing", 1e200, "nowhere as wide as the spacing 1e+200 m"),
        ("points_per_cell", 5, "5 is not a square number"),
        ("jitter", 1.0, "less than 1"),
        ("phreatic_line", [[5, 3], [4, 3]], "x must ascend"),
        ("water_level", 500.0, "water_level 500 m: the section lies between 2 and 12 m; allowed"),
        ("water_level", -50.0, "allowed are levels from -8 to 62 m"),
        (
            "materials.sand.density",
            1.8,
            "density 1.8 kg/m³: allowed are 100 to 1e+08; 1.8 t/m³",
        ),
        ("materials.sand.density", 1.8e9, "density 1.8e+09 kg/m³: allowed are 100 to 1e+08"),
        ("materials.sand.saturated_density", 2e9, "saturated_density 2e+09 kg/m³: allowed are 100"),
    ],
)
def test_refusals_name_the_field_and_the_remedy(document, path, value, words):
    with pytest.raises(InputError) as caught:
        scene_from_mapping(changed(document, path, value), "scene.yaml")
    message = str(caught.value)
    assert message.startswith("scene.yaml: ")
    assert words in message
    assert "\n" not in message


def test_a_misspelt_key_is_named_rather_than_the_missing_one(document):
    document["spacin"] = document.pop("spacing")
    with pytest.raises(InputError, match="spacin: unknown key"):
        scene_from_mapping(document, "scene.yaml")


def test_small_overlaps_and_repeated_ends_are_rounding(document):
    ring = [[10, 2], [20.02, 2], [20.02, 12], [10, 12], [10, 2]]
    scene = scene_from_mapping(changed(document, "zones.0.polygon", ring))
    assert len(scene.zones[0].polygon) == 4
    assert len(fill(scene)) == 200


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_files_come_back_unchanged(dam, tmp_path, suffix):
    path = tmp_path / f"scene{suffix}"
    save_scene(dam, path)
    back = load_scene(path)
    assert back == dam
    assert scene_hash(back) == scene_hash(dam)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_bad_files_are_input_errors(tmp_path, document):
    with pytest.raises(InputError, match="no such file"):
        load_scene(tmp_path / "none.yaml")
    path = tmp_path / "list.yaml"
    path.write_text("- 1\n")
    with pytest.raises(InputError, match="a mapping of keys, not list"):
        load_scene(path)
    path.write_text(yaml.safe_dump(changed(document, "spacing", "wide")))
    with pytest.raises(InputError, match=r"list.yaml: spacing: .* \(got 'wide'\)"):
        load_scene(path)


def test_units_are_converted_once(document):
    document["materials"]["sand"]["tension_cap_kpa"] = 2.0
    scene = scene_from_mapping(document)
    sand, clay = (scene.materials[name] for name in scene.material_names)
    assert sand.friction_rad == pytest.approx(0.6108652)
    assert sand.tension_cap_pa == 2000.0 and clay.tension_cap_pa is None
    assert clay.cohesion_pa == 20_000.0
    assert clay.youngs_modulus_pa == 30e6
    assert scene.cell_size == 2.0


def test_water_table(dam):
    assert not dam.has_water
    dam = dam.changed(water_level=35.9)
    x = np.array([-50.0, 100.0, 181.0, 196.15, 211.3, 500.0])
    np.testing.assert_allclose(dam.phreatic_level(x), [35.9, 35.9, 35.9, 18.95, 2.0, 2.0])
    level = dam.changed(phreatic_line=None)
    np.testing.assert_array_equal(level.phreatic_level(x), 35.9)
    dry = dam.changed(water_level=None)
    assert not dry.has_water
    assert np.isneginf(dry.phreatic_level(x)).all()


def test_changed_scenes_are_checked(dam):
    weaker = dam.with_strength("liquefied_hydraulic_fill", cohesion_kpa=18.9)
    assert weaker.materials["liquefied_hydraulic_fill"].cohesion_kpa == 18.9
    assert weaker.materials["clay_core"] == dam.materials["clay_core"]
    with pytest.raises(InputError, match="no material 'lava'"):
        dam.with_strength("lava", cohesion_kpa=1.0)
    with pytest.raises(ValueError, match="greater than 0"):
        dam.changed(spacing=-1.0)


def test_gaps_are_found(document):
    split = changed(document, "zones.1.polygon", [[20.2, 2], [30, 2], [30, 12], [20.2, 12]])
    scene = Scene.model_validate(split)
    found = gaps({zone.name: zone.polygon for zone in scene.zones}, 1.0)
    assert len(found) == 1
    area, (x, y) = found[0]
    assert area == pytest.approx(2.0, rel=0.01)
    assert 20.0 < x < 20.2 and 2.0 < y < 12.0


def test_lower_san_fernando_is_as_described(dam):
    assert gaps({zone.name: zone.polygon for zone in dam.zones}, dam.spacing) == []
    assert dam.foot("left") == 76.02 and dam.foot("right") == 369.2
    assert len(fill(dam)) == 6242
    strengths = {
        zone.name: (m.friction_deg, m.cohesion_kpa)
        for zone in dam.zones
        for m in [dam.materials[zone.material]]
    }
    assert strengths == {
        "1": (0, 21.5),
        "2": (35, 1),
        "3": (0, 30),
        "4": (35, 1),
        "5": (37, 0),
        "6": (30, 1),
        "7": (30, 1),
    }


def rough(document: dict, number: int, thickness: float) -> dict:
    """The left square with a bottom or top of many vertices, `thickness` [m] above the base."""
    x = np.linspace(20.0, 10.0, number)
    y = 2.0 + thickness + 0.02 * np.random.default_rng(0).standard_normal(number)
    outline = [[10.0, 2.0], [20.0, 2.0], *np.column_stack([x, y]).tolist()]
    return changed(document, "zones.0.polygon", outline)


def test_an_outline_of_many_vertices_is_never_shifted(document, monkeypatch):
    """That takes a time and a memory that grow with the square of their number within a spacing."""
    Scene.model_validate(rough(document, 500, 1.2))
    monkeypatch.setattr(Polygon, "buffer", None)
    scene = Scene.model_validate(rough(document, 20_000, 10.0))
    assert 99 <= len([zone for zone in fill(scene).zone if zone == 0]) <= 101
    outlines = {zone.name: zone.polygon for zone in scene.zones}
    with pytest.raises(InputError, match="gaps between zones: not looked for; .* 2000. vertices"):
        gaps(outlines, 1.0)
    with pytest.raises(
        ValueError, match="'left' is hardly as wide as the spacing 1 m, and .* 2000"
    ):
        Scene.model_validate(rough(document, 20_000, 0.98))


@pytest.mark.parametrize("width", [1.0, 0.999])
def test_a_zone_as_wide_as_the_spacing_will_do(document, width):
    """Wherever it lies, and however it is turned: no trial place need be on its axis."""
    along, across = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    start = np.array([12.3, 7.1])
    corners = [start, start + 6.0 * along, start + 6.0 * along + width * across,
               start + width * across]  # fmt: skip
    turned = changed(document, "zones.0.polygon", np.array(corners).tolist())
    Scene.model_validate(turned)
    thinner = [*corners[:2], *(corner - 0.01 * across for corner in corners[2:])]
    with pytest.raises(ValueError, match="'left' is a sliver"):
        Scene.model_validate(changed(document, "zones.0.polygon", np.array(thinner).tolist()))
