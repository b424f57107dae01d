"""The simulator's facts about a scene are those that the solver computes with."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.scenes.fill import fill
from gns.data.scene_facts import (
    KINEMATIC,
    NUMBERS,
    SOIL,
    before,
    first_window,
    start_of,
    with_known_water,
)
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.gns.runs import scene_of
from tests.mpm_taichi.ballistic import make_scene

SETTINGS = SimulationSettings(water="buoyant")
FIXED = SimulationSettings(water="pore_pressure", water_face="fixed")
LINE = [[0.0, 9.0], [20.0, 8.0], [40.0, 3.0]]


def wet(**changes):
    materials = make_scene().model_dump()["materials"]
    materials["shell"]["saturated_density"] = 2000.0
    return make_scene(spacing=0.5).changed(
        water_level=9.0, phreatic_line=LINE, materials=materials, **changes
    )


def test_properties_are_the_materials():
    facts, start = start_of(wet(), SETTINGS)
    shell = facts.zone == 1
    soaked = start[:, 1] < np.interp(start[:, 0], *np.transpose(LINE))
    assert 0.2 < soaked[shell].mean() < 0.9
    np.testing.assert_allclose(facts.properties[shell, 0], np.tan(np.radians(20)), rtol=1e-6)
    np.testing.assert_allclose(facts.properties[shell, 1], 0.0)
    np.testing.assert_allclose(facts.properties[~shell, 0], 0.0)
    np.testing.assert_allclose(facts.properties[~shell, 1], 18.7e3)
    np.testing.assert_array_equal(
        facts.properties[shell, 2], np.where(soaked[shell], 2000.0, 1800.0)
    )
    assert set(facts.numbers) == set(NUMBERS)
    assert facts.frame_interval == pytest.approx(SETTINGS.frame_interval)
    assert facts.numbers["cell"] == 1.0
    assert facts.numbers["youngs_modulus"] == pytest.approx(30e6)


@pytest.mark.parametrize("settings", [SETTINGS, FIXED])
def test_body_force_is_that_of_the_solver(settings):
    from mpm_taichi import layout
    from mpm_taichi.solver.boundary import make_grid, node_tables

    scene = wet()
    facts, start = start_of(scene, settings)
    grid = make_grid(scene)
    _, surroundings = node_tables(
        scene, grid, wall_contact="smooth", water=settings.water, water_face="fixed", gravity=9.81
    )
    x, y = grid.coordinates()
    nodes = np.stack([x, y], axis=-1).reshape(-1, 2)[: len(start)]
    water = surroundings[: len(start), [layout.WATER_X, layout.WATER_Y]].astype(float)
    expected = water / (9.81 * facts.properties[:, 2, None]) + [0.0, -1.0]
    np.testing.assert_allclose(facts.body_force(nodes), expected, atol=1e-6)
    assert np.ptp(expected[:, 1]) > 0.4
    assert (np.ptp(expected[:, 0]) > 0.02) == (settings is FIXED), "thrust, or none"
    np.testing.assert_allclose(facts.properties[:, 3:5], facts.body_force(start), atol=1e-6)
    level = scene.phreatic_level(start[:, 0])
    np.testing.assert_allclose(facts.properties[:, 5], level, rtol=1e-6)


def test_a_dry_scene_weighs_all_it_weighs():
    facts, start = start_of(make_scene(), SETTINGS)
    assert not facts.has_water
    np.testing.assert_array_equal(facts.body_force(start), np.tile([0.0, -1.0], (len(start), 1)))


def test_a_pool_without_a_line_is_level():
    facts, start = start_of(make_scene(water=7.0), SETTINGS)
    deep = start.copy()
    deep[:, 0], deep[:, 1] = 1e3, 3.0
    np.testing.assert_allclose(facts.body_force(deep)[:, 1], 1000 / 1800 - 1, rtol=1e-6)


def test_kinematic_points_are_told_apart():
    zones = make_scene().model_dump()["zones"]
    zones[1]["kinematic"] = True
    facts, _ = start_of(make_scene().changed(zones=zones), SETTINGS)
    np.testing.assert_array_equal(facts.type, np.where(facts.zone == 1, KINEMATIC, SOIL))


def test_the_frames_before_the_first():
    scene = make_scene(3)
    facts, start = start_of(scene, SETTINGS)
    window = first_window(start, facts)
    assert window.shape == (6, len(start), 2) and window.dtype == np.float32
    still = facts.zone == 0
    assert np.ptp(window[:, still], axis=0).max() == 0.0, "at rest: equal frames"
    step = np.diff(window[:, ~still].astype(float), axis=0) / facts.frame_time
    np.testing.assert_allclose(step, np.broadcast_to([11.0, 4.0], step.shape), atol=1e-4)
    assert before(start, facts.initial_velocity, facts.frame_time, 0).shape == (0, *start.shape)


def test_points_are_in_the_order_of_the_solver(batches):
    from mpm_taichi.trajectory import read_run

    run = read_run(batches[0], 4)
    facts, start = start_of(run.scene, run.settings)
    np.testing.assert_allclose(start, run.positions[0], atol=1e-5)
    np.testing.assert_array_equal(facts.zone, run.zone)
    assert len(fill(run.scene)) == facts.points


def test_what_no_model_has_seen_is_refused():
    with pytest.raises(InputError, match="block_0: effects: strain_softening is on"):
        start_of(scene_of(0, effects={"strain_softening": 0.5}), SETTINGS)
    start_of(scene_of(0, effects={"strain_softening": 0.0}), SETTINGS)


def test_the_water_of_a_model_is_said():
    moving = SimulationSettings()
    for thrust, settings, water, said in (
        (False, moving, "buoyant", "reduced weight alone"),
        (False, FIXED, "buoyant", "reduced weight alone"),
        (True, moving, "pore_pressure", ""),
        (True, FIXED, "pore_pressure", ""),
        (False, SETTINGS, "buoyant", ""),
    ):
        known, words = with_known_water(wet(), settings, thrust=thrust)
        assert known.water == water and said in words and bool(said) == bool(words)
        start_of(wet(), known)
    assert with_known_water(make_scene(water=7.0), moving, thrust=False) == (moving, "")
