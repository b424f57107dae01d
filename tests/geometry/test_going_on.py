"""Random sections whose ground goes on: drawn alike everywhere, sound, with toes to be read."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import shapely

from geometry import draw_scene
from geometry.random_scenes import embankment_on_foundation as fills
from geometry.random_scenes import impoundment as dams
from geometry.random_scenes import standing_dam
from geometry.random_scenes.templates import OTHERS
from geometry.scenes.doubts import doubts, fewest_rows, thin_layers
from geometry.scenes.fill import fill
from geometry.scenes.polygon_checks import gaps
from geometry.scenes.scene import Scene
from geometry.sides import SIDES
from geometry.survey.ends import ends_reached
from geometry.survey.measured import Deposit
from geometry.survey.toe_runout import toe_runout
from gns.data.scene_facts import start_of
from gns.direct.sections import section_of
from pipeline.cli import InputError
from pipeline.config import load_config

FILL, DAM = fills.draw_embankment_on_foundation, dams.draw_impoundment
COUNT, MOST = 60, 6000


@cache
def drawn(draw) -> list[Scene]:
    return [draw(0, number, 2.0, MOST) for number in range(COUNT)]


@pytest.mark.parametrize("draw", [FILL, DAM])
def test_every_section_is_sound(draw):
    for scene in drawn(draw):
        outlines = {zone.name: zone.polygon for zone in scene.zones}
        assert gaps(outlines, scene.spacing) == [] and doubts(scene) == []
        assert thin_layers(scene) == [] and fewest_rows(scene) >= 4.0
        points = fill(scene)
        assert len(points) <= MOST
        areas = np.array([shapely.Polygon(outline).area for outline in outlines.values()])
        volumes = np.bincount(points.zone, weights=points.volume, minlength=len(areas))
        np.testing.assert_allclose(volumes, areas, rtol=2e-3)
        coarse = scene.changed(spacing=2.0 * scene.spacing)
        for side in SIDES:
            if scene.domain.goes_on(side):
                walls = [one.domain.wall(side) for one in (scene, coarse)]
                assert walls == pytest.approx([scene.end(side)] * 2, abs=1e-9)


def test_the_ground_goes_on_where_it_should_and_a_toe_is_left():
    for scene in drawn(FILL):
        assert [scene.domain.goes_on(side) for side in SIDES] == [True, True]
        for side in SIDES:
            front = [scene.zones[n].name for n in scene.front_zones(side)]
            assert front and all(name.startswith("fill_") for name in front)
            assert abs(scene.end(side) - scene.foot(side)) > fills.REACH[0] * top_of(scene) - 1e-3
    far = [[scene.domain.goes_on(side) for side in SIDES] for scene in drawn(DAM)]
    assert {tuple(ends) for ends in far} == {(True, False), (False, True)}, "both ways round"
    for scene, (left, _) in zip(drawn(DAM), far, strict=True):
        open_side, cut = ("right", "left") if left else ("left", "right")
        assert scene.domain.is_open(open_side) and scene.front_zones(cut) == []
        assert scene.foot(open_side) == scene.end(open_side)
        assert scene.domain.wall(cut) == scene.end(cut), "the wall is where the drawing ends"


def top_of(scene: Scene) -> float:
    """Height of a fill or a dam: the ground in front of it is at 0."""
    return max(y for zone in scene.zones for _, y in zone.polygon)


def share(scenes, holds) -> float:
    return float(np.mean([bool(holds(scene)) for scene in scenes]))


def test_variants_have_their_shares():
    """Within two and a half standard deviations of the shares that are stated."""
    names = {id(scene): {zone.name for zone in scene.zones} for scene in drawn(FILL)}
    near = pytest.approx
    assert share(drawn(FILL), lambda s: "crust" in names[id(s)]) == near(
        fills.CRUST_SHARE, abs=0.13
    )
    assert share(drawn(FILL), lambda s: "stiff" in names[id(s)]) == near(
        fills.STIFF_SHARE, abs=0.13
    )
    assert share(drawn(FILL), lambda s: "fill_2" in names[id(s)]) == near(fills.TWO_SHARE, abs=0.16)
    assert share(drawn(FILL), lambda s: not s.has_water) == near(fills.DRY_SHARE, abs=0.13)
    levee = 1.0 - fills.DRY_SHARE - fills.TABLE_SHARE - fills.POOLS_SHARE
    assert share(drawn(FILL), lambda s: s.head_falls) == near(levee, abs=0.14)
    names = {id(scene): {zone.name for zone in scene.zones} for scene in drawn(DAM)}
    assert share(drawn(DAM), lambda s: "shell" in names[id(s)]) == near(dams.SHELL_SHARE, abs=0.15)
    assert share(drawn(DAM), lambda s: not s.has_water) == near(dams.DRY_SHARE, abs=0.1)
    pond = share(drawn(DAM), lambda s: s.has_water and s.surface(far_end(s)) < s.water_level)
    assert pond == near(dams.POND_SHARE, abs=0.15)
    layers = {sum(name.startswith("tailings") for name in found) for found in names.values()}
    assert layers >= {2, 3, 4}


def far_end(scene: Scene) -> float:
    (cut,) = [side for side in SIDES if scene.domain.goes_on(side)]
    return scene.end(cut)


def test_water_stays_in_the_soil_but_for_pools():
    """The table of an impoundment leaves its dam at the foot, and is nowhere above the face."""
    for scene in drawn(DAM):
        if scene.has_water:
            (open_side,) = [side for side in SIDES if scene.domain.is_open(side)]
            foot = scene.foot(open_side)
            assert scene.phreatic_level(foot) == pytest.approx(0.0)
            crest = [x for zone in scene.zones for x, y in zone.polygon if y == top_of(scene)]
            for x in np.linspace(foot, crest[0], 30)[1:-1]:
                assert scene.phreatic_level(x) < scene.surface(x)


def test_strengths_keep_to_their_ranges():
    for draw, span in ((FILL, fills.RESIDUAL), (DAM, dams.RESIDUAL)):
        for scene in drawn(draw):
            soft = [soil for soil in scene.materials.values() if soil.liquefied]
            assert soft
            for soil in soft:
                ratio = soil.cohesion_kpa / (soil.density * 9.81e-3 * top_of(scene))
                assert 0.65 * span[0] < ratio < 1.5 * span[1] and soil.friction_deg == 0.0


@pytest.mark.parametrize("draw", [FILL, DAM])
def test_a_section_follows_from_seed_and_number_and_scales_with_the_spacing(draw, monkeypatch):
    assert draw(0, 3, 2.0, MOST) == drawn(draw)[3] != draw(1, 3, 2.0, MOST)
    small, large = draw(0, 3, 0.25, MOST), drawn(draw)[3]
    assert len(fill(small)) == len(fill(large))
    for one, other in zip(small.zones, large.zones, strict=True):
        assert np.allclose(8.0 * np.array(one.polygon), other.polygon, atol=1e-3)
    few = draw(0, 3, 2.0, 1500)
    assert len(fill(few)) <= 1500 < len(fill(large))
    monkeypatch.setattr(standing_dam, "MOST_DRAWS", 5)
    with pytest.raises(
        InputError, match="none of 5 draws .* at most 100 material points; see geometry.max_points"
    ):
        draw(0, 3, 2.0, 100)


# --- how a scale asks for them ---


def letters(config, numbers) -> list[str]:
    return [draw_scene(config, "coarse", number).origin.template for number in numbers]


def test_a_scale_asks_for_families_in_turn():
    three = "{first: 2, families: [embankment_on_foundation, impoundment, template]}"
    last = "{first: 8, families: [impoundment]}"
    config = load_config(None, [f"scales.coarse.turns=[{three}, {last}]"])
    plain = load_config(None)
    found = letters(config, range(10))
    assert found[2:8] == ["h", "i", found[4], "h", "i", found[7]] and found[8:] == ["i", "i"]
    for number in (0, 1, 4, 7):
        assert draw_scene(config, "coarse", number) == draw_scene(plain, "coarse", number)
    scene = draw_scene(config, "coarse", 2)
    assert (scene.name, scene.origin.scale, scene.spacing) == ("coarse_00002", "coarse", 2.0)
    assert scene.zones == FILL(0, 2, 2.0, MOST).zones


def test_families_can_say_what_the_older_settings_say(root):
    """Scene for scene, and they win over them."""
    older = load_config(root / "config" / "thrust.yaml")
    dams = "{first: 700, families: [embankment_dam]}"
    mixed = "[template, embankment_dam, template, hydraulic_fill_dam]"
    same = load_config(None, [f"scales.coarse.turns=[{dams}, {{first: 1300, families: {mixed}}}]"])
    for number in (699, 700, 1299, 1300, 1301, 1302, 1303, 2003):
        assert draw_scene(same, "coarse", number) == draw_scene(older, "coarse", number)
    wins = load_config(
        root / "config" / "thrust.yaml",
        ["scales.coarse.turns=[{first: 1301, families: [impoundment]}]"],
    )
    assert letters(wins, (700, 1299, 1301, 1302)) == ["f", "f", "i", "i"]
    assert {letter for letter, *_ in OTHERS.values()} == set("fghi")


# --- what reads them ---


@pytest.mark.parametrize("draw", [FILL, DAM])
def test_learned_simulators_refuse_them(draw):
    settings = load_config(None).simulation
    with pytest.raises(InputError, match="the ground goes on to the .* the learned simulator"):
        start_of(drawn(draw)[0], settings)
    with pytest.raises(InputError, match="the ground goes on to the .* the direct model"):
        section_of(drawn(draw)[0], settings.gravity_m_per_s2)


@pytest.mark.parametrize(("draw", "number"), [(FILL, 26), (DAM, 10)])
def test_they_slide_and_come_to_rest_with_a_toe(draw, number):
    """Coarse runs: the toe is read, and the slide stays away from where the ground goes on."""
    from mpm_taichi.simulate import simulate

    scene = drawn(draw)[number].changed(spacing=4.0)
    run = simulate([scene], load_config(None).simulation, threads=1)[0]
    first, last = run.positions[0].astype(float), run.positions[-1].astype(float)
    assert run.status == "finished" and run.came_to_rest
    assert ends_reached(scene, first, last) == ()
    feet = {side: scene.foot(side) for side in SIDES}
    side = next(one for one in SIDES if scene.front_zones(one))

    def toe(position: np.ndarray) -> float:
        deposit = Deposit.on(scene, feet, position, first, run.initial_volume)
        return float(
            toe_runout(
                position,
                run.initial_volume,
                spacing=scene.spacing,
                side=side,
                initial_toe=feet[side],
                front=deposit.front.get(side),
            )
        )

    assert toe(last) - toe(first) > 0.1 * scene.height
