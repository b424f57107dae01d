"""Drawn scenes: within the table, valid, the same alone as in a row, the same bits as ever."""

from __future__ import annotations

import json
import math
from functools import cache

import numpy as np
import pytest

from geometry import PHYSICS_VERSION, draw_scene
from geometry.random_scenes import templates
from geometry.random_scenes.materials import RANGES
from geometry.random_scenes.sketch import signed_area
from geometry.scenes.fill import fill
from geometry.scenes.polygon_checks import gaps
from geometry.scenes.scene import scene_hash
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.random_numbers import Stream, number_of, unit_array

COUNT = 300
ZONES = {
    "a": {"lower", "middle", "upper"},
    "b": {"lower", "middle", "upper", "shell"},
    "c": {"upstream_shell", "core", "downstream_base", "downstream_shell"},
}


@cache
def drawn(scale: str):
    config = load_config(None)
    return [draw_scene(config, scale, index) for index in range(COUNT)]


@pytest.mark.parametrize("scale", ["large", "small", "coarse"])
def test_every_scene_is_valid(config, scale):
    size = config.scale(scale)
    for scene in drawn(scale):
        points = fill(scene)
        area = sum(signed_area(zone.polygon) for zone in scene.zones)
        counts = np.bincount(points.zone, minlength=len(scene.zones))
        assert len(points) <= 6000
        assert counts.min() >= config.geometry.min_points_per_zone
        assert points.volume.sum() == pytest.approx(area, rel=1e-9)
        assert gaps({zone.name: zone.polygon for zone in scene.zones}, scene.spacing) == []
        letter = scene.origin.template
        if letter != "e":
            assert len(scene.materials) == len(scene.zones) >= 3
            by = scene.domain.width / size.domain_width_m
            assert scene.ground.points[0][1] == pytest.approx(
                2.0 * size.scale_factor * by, abs=1e-4
            )
        if letter in ZONES:
            assert {zone.name for zone in scene.zones} == ZONES[letter]
        assert scene.domain.walls == "closed"
        if scale == "coarse":  # some of it is enlarged
            continue
        assert (scene.domain.width, scene.domain.y_max) == (
            size.domain_width_m,
            size.domain_height_m,
        )


def test_all_templates_and_water_are_drawn():
    for scale in ("large", "small"):
        letters = [scene.origin.template for scene in drawn(scale)]
        assert all(40 <= letters.count(letter) <= 80 for letter in "abcde")
        wet = [scene for scene in drawn(scale) if scene.has_water]
        assert 0.12 < len(wet) / COUNT < 0.3
        assert any(scene.phreatic_line for scene in wet)
        for scene in wet:
            base = scene.ground.lowest
            crest = max(y for zone in scene.zones for _, y in zone.polygon)
            assert base < scene.water_level < crest
            assert scene.origin.template != "e"


def corners(scale: str, letter: str, zone: str, number: int, factor: float) -> np.ndarray:
    """A vertex of a zone in all scenes of a template, in template metres."""
    found = [
        z.polygon[number]
        for scene in drawn(scale)
        if scene.origin.template == letter
        for z in scene.zones
        if z.name == zone
    ]
    return np.array(found) / factor


@pytest.mark.parametrize(
    ("letter", "zone", "vertex", "x", "y"),
    [  # Table A.1
        ("a", "lower", 1, (120, 130), (2, 2)),
        ("a", "lower", 3, (0, 0), (17, 17)),
        ("a", "middle", 3, (0, 0), (34, 34)),
        ("a", "upper", 2, (70, 80), (37, 47)),
        ("a", "upper", 3, (70, 80), (37, 47)),
        ("a", "upper", 4, (0, 0), (34.5, 57)),
        ("b", "shell", 1, (90, 110), (2, 2)),
        ("b", "shell", 0, (75, 100), (2, 2)),
        ("b", "shell", 2, (70, 80), (37, 47)),
        ("b", "shell", 3, (60, 75), (37, 47)),
        ("b", "upper", 3, (35, 40), (37, 47)),
        ("b", "upper", 4, (0, 0), (32, 58)),
        ("b", "upper", 0, (0, 0), (32, 32)),
        ("c", "upstream_shell", 0, (5, 5), (2, 2)),
        ("c", "upstream_shell", 1, (31, 57.5), (2, 2)),
        ("c", "upstream_shell", 3, (45, 55), (35, 50)),
        ("c", "downstream_base", 1, (135, 180), (2, 2)),
        ("c", "downstream_shell", 2, (75, 90), (35, 50)),
    ],
)
@pytest.mark.parametrize(("scale", "factor"), [("large", 1.0), ("small", 0.25)])
def test_vertices_keep_to_the_table(scale, factor, letter, zone, vertex, x, y):
    places = corners(scale, letter, zone, vertex, factor)
    for values, (low, high) in zip(places.T, (x, y), strict=True):
        assert (values >= low - 4e-4).all() and (values <= high + 4e-4).all()
        if high > low:
            # The range is used, not only kept.
            assert np.ptp(values) > 0.5 * (high - low)


def test_interpolated_vertices():
    for zone, share in (("lower", 1 / 3), ("middle", 2 / 3)):
        inner = corners("large", "a", zone, 2, 1.0)
        start, end = corners("large", "a", "lower", 1, 1.0), corners("large", "a", "upper", 2, 1.0)
        np.testing.assert_allclose(inner, start + share * (end - start), atol=2e-4)


def test_blocks():
    for scale, factor in (("large", 1.0), ("small", 0.25)):
        numbers = set()
        for scene in drawn(scale):
            if scene.origin.template != "e":
                continue
            numbers.add(len(scene.zones))
            ground = np.array(scene.ground.points)
            assert len(ground) == 5
            assert (np.diff(ground[:, 0]) >= 20.0 * factor - 1e-3).all()
            assert ((ground[:, 1] >= 2.0 * factor) & (ground[:, 1] <= 16.0 * factor)).all()
            for zone in scene.zones:
                ring = np.array(zone.polygon)
                sides = np.ptp(ring, axis=0) / factor
                assert ((sides >= 9.999) & (sides <= 40.001)).all()
                speed = np.hypot(*zone.initial_velocity)
                assert speed <= 10.0 * np.sqrt(factor) + 1e-3
                assert (ring[:, 1] >= scene.ground.height(ring[:, 0]) - 1e-6).all()
        assert numbers == {1, 2, 3}


@pytest.mark.parametrize("scale", ["large", "small"])
@pytest.mark.parametrize("option", ["paper", "wide"])
def test_strengths_keep_to_their_ranges(scale, option):
    config = load_config(None, [f"geometry.materials={option}", "geometry.water_share=0"])
    cohesion = {1: [], 2: [], 3: []}
    for index in range(100):
        scene = draw_scene(config, scale, index)
        assert not scene.has_water
        for name, material in scene.materials.items():
            soil = int(name[-1])
            limits = RANGES[option, scale][soil]
            assert limits.friction_deg[0] <= material.friction_deg <= limits.friction_deg[1]
            assert limits.cohesion_kpa[0] <= material.cohesion_kpa <= limits.cohesion_kpa[1]
            assert material.liquefied == (soil == 3)
            assert (material.density, material.youngs_modulus_mpa) == (1800.0, 30.0)
            cohesion[soil].append(material.cohesion_kpa)
    assert max(cohesion[1]) == 0.0 if option == "paper" else max(cohesion[1]) > 3.0
    assert (min(cohesion[3]) < 10.0) == ((option, scale) != ("paper", "large"))


def test_a_scale_for_every_spacing_is_drawn_in_units_of_the_spacing(config):
    """Cohesions are even over their logarithm; a fifth of the scenes is enlarged as a whole."""
    size = config.scale("coarse")
    unit = 1.8 * 9.81 * size.spacing_m
    cohesion: dict[int, list[float]] = {1: [], 2: [], 3: []}
    enlarged = []
    for scene in drawn("coarse"):
        by = scene.domain.width / size.domain_width_m
        assert scene.domain.y_max == pytest.approx(by * size.domain_height_m)
        assert scene.spacing == size.spacing_m
        if by > 1.0:
            enlarged.append(by)
        for name, material in scene.materials.items():
            cohesion[int(name[-1])].append(material.cohesion_kpa / unit)
            assert 20.0 <= material.friction_deg <= 47.0 or name.endswith("3")
    assert 0.13 < len(enlarged) / COUNT < 0.27
    assert 1.0 < min(enlarged) < 1.1 and 1.6 < max(enlarged) <= 1.7
    assert 0.0 <= min(cohesion[1]) and max(cohesion[1]) <= 0.141
    for soil in (2, 3):
        logarithm = np.log(np.array(cohesion[soil]) / 0.1) / np.log(70.0)
        assert logarithm.min() > -0.01 and logarithm.max() < 1.001
        shares = np.histogram(logarithm, bins=4, range=(-0.01, 1.01))[0] / len(logarithm)
        assert np.all(np.abs(shares - 0.25) < 0.09), shares


def test_any_zone_of_a_dam_may_liquefy():
    liquefied = {
        zone.name
        for scene in drawn("large")
        if scene.origin.template == "c"
        for zone in scene.zones
        if scene.materials[zone.material].liquefied
    }
    assert liquefied == ZONES["c"]
    for scene in drawn("large"):
        if scene.origin.template in "ab":
            assert scene.materials[scene.zones[0].material].liquefied


def test_a_scene_drawn_alone_is_the_scene_drawn_in_a_row(config):
    for index in (299, 7, 150):
        assert draw_scene(config, "large", index) == drawn("large")[index]
    assert draw_scene(config, "large", 3) != draw_scene(config, "small", 3)
    other = load_config(None, ["geometry.seed=1"])
    assert draw_scene(other, "large", 3) != drawn("large")[3]


def test_settings_that_concern_something_else_shift_nothing(config):
    """Materials, water and jitter have streams of their own: outlines stay when they change."""
    other = load_config(
        None, ["geometry.materials=paper", "geometry.water_share=0.9", "geometry.jitter=0.2"]
    )
    for index in range(20):
        here, there = drawn("large")[index], draw_scene(other, "large", index)
        assert [z.polygon for z in here.zones] == [z.polygon for z in there.zones]
    fewer = load_config(None, ["scales.large.number_of_scenes=10"])
    assert draw_scene(fewer, "large", 5) == drawn("large")[5]


def test_template_shares_and_points_have_an_effect():
    only = [f"geometry.template_shares.{letter}=0" for letter in "abce"]
    config = load_config(None, only)
    assert {draw_scene(config, "large", i).origin.template for i in range(30)} == {"d"}
    config = load_config(None, [*only, "geometry.max_points=3000"])
    counts = [len(fill(draw_scene(config, "large", i))) for i in range(30)]
    assert max(counts) <= 3000


def test_redraws_are_counted_and_explained(config):
    again = [scene for scene in drawn("large") if scene.origin.draws > 1]
    assert again
    for scene in again[:3]:
        key = (config.geometry.seed, number_of("large"), scene.origin.index)
        size = templates._size_of(key, config.scale("large"))
        for attempt in range(scene.origin.draws):
            stream = Stream(*key, templates._OUTLINES, attempt)
            sketch = templates._draw_outlines(stream, scene.origin.template, config.geometry, size)
            given_up = isinstance(sketch, templates.Rejected)
            assert given_up == (attempt < scene.origin.draws - 1)
            assert not given_up or sketch.reason


def test_impossible_settings_end_with_one_line():
    config = load_config(None, ["geometry.max_points=100", "geometry.template_shares.e=0"])
    with pytest.raises(InputError, match="no valid template .* too many points; see geometry.max"):
        draw_scene(config, "large", 0)
    with pytest.raises(InputError, match="allowed are large, small, coarse"):
        draw_scene(config, "huge", 0)
    with pytest.raises(InputError, match="numbered from 0"):
        draw_scene(config, "large", -1)


# --- the bits ---

#: SHA-256 of canonical JSON. A change here needs a higher geometry.PHYSICS_VERSION.
GOLDEN = {
    "physics_version": 1,
    "scenes": {
        "large_0": "892552f59af59b2b",
        "large_1": "5efa5780d7447c12",
        "large_2": "60d1a6dd8c668cd2",
        "large_3": "152c685100abfb85",
        "large_11": "d7dd7f7b11c8858a",
        "small_0": "61c383dcf74a3c98",
        "small_1": "d3dea7f7251f6874",
        "small_2": "4228b89a5679399a",
        "small_3": "8d0555299bee4aac",
        "small_11": "fe6ab643e665b252",
        "coarse_0": "e3b6c12438626cd9",
        "coarse_1": "ef5e9e470025b781",
        "coarse_2": "85e0bf58704f0463",
        "coarse_3": "1501375d9a691c2c",
        "coarse_11": "52d68ebc30053644",
    },
    "sum_of_points": 344075.0928867457,
    "stream": [0.7198955456932165, 0.012702050455707714, 0.09963616681365695],
    "array": [[0.46881748695593284], [0.42614583623918467]],
}


def test_golden_bits(config, root):
    assert PHYSICS_VERSION == GOLDEN["physics_version"]
    found = {
        f"{scale}_{index}": scene_hash(draw_scene(config, scale, index))[:16]
        for scale in ("large", "small", "coarse")
        for index in (0, 1, 2, 3, 11)
    }
    assert found == GOLDEN["scenes"], json.dumps(found)
    points = fill(drawn("large")[3].changed(jitter=0.3, seed=12345)).position
    total = math.fsum(points.ravel())  # exact, so that the order of summing does not matter
    assert total == GOLDEN["sum_of_points"], repr(total)


def test_random_numbers_are_those_of_the_first_version():
    stream = Stream(1, 2, 3)
    assert [stream.unit() for _ in range(3)] == GOLDEN["stream"], stream
    assert unit_array(7, (2, 1)).tolist() == GOLDEN["array"]
    assert number_of("large") == 465491355493


def test_random_numbers_are_even():
    stream = Stream(5)
    values = np.array([stream.unit() for _ in range(4000)])
    assert values.min() >= 0.0 and values.max() < 1.0
    assert values.mean() == pytest.approx(0.5, abs=0.02)
    assert {stream.integer(2, 4) for _ in range(100)} == {2, 3, 4}
    assert {stream.pick([0.0, 1.0, 0.0, 2.0]) for _ in range(100)} == {1, 3}
    directions = np.array([stream.direction() for _ in range(400)])
    np.testing.assert_allclose(np.hypot(*directions.T), 1.0)
    assert np.abs(directions.mean(axis=0)).max() < 0.15


def test_a_scale_may_go_on_with_free_standing_dams(root):
    """They leave the scenes before them as they are, and have a pool and their own density."""
    alone, config = load_config(None), load_config(root / "config" / "thrust.yaml")
    assert config.scale("coarse").dams_from == 700 and alone.scale("coarse").dams_from is None
    assert draw_scene(config, "coarse", 699) == draw_scene(alone, "coarse", 699)
    dams = [draw_scene(config, "coarse", number) for number in range(700, 712)]
    assert {dam.origin.template for dam in dams} == {"f"}
    assert draw_scene(alone, "coarse", 700).origin.template != "f"
    assert [dam.name for dam in dams[:2]] == ["coarse_00700", "coarse_00701"]
    assert all(dam.spacing == 2.0 and dam.domain.walls == "open" for dam in dams)
    assert sum(dam.head_falls for dam in dams) >= 4
    densities = {material.density for dam in dams for material in dam.materials.values()}
    assert len(densities) > 6


def test_a_scale_may_go_on_with_templates_and_dams_in_turn(root):
    """They leave the scenes before them as they are; every fourth is a dam of hydraulic fill."""
    config = load_config(root / "config" / "thrust.yaml")
    mixed = config.scale("coarse").mixed_from
    assert draw_scene(config, "coarse", mixed - 1).origin.template == "f"
    letters = [
        draw_scene(config, "coarse", number).origin.template for number in range(mixed, mixed + 8)
    ]
    assert letters[1::4] == ["f", "f"] and letters[3::4] == ["g", "g"]
    assert set(letters[0::2]) <= set("abcde")
