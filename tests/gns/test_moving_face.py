"""A pool that follows the soil: the simulator's force of water is that of the solver."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gns.data.scene_facts import first_window, head_line, start_of
from gns.network.features import body_force
from gns.network.units import scaled
from gns.rollout.differentiate import jacobian, reverse_jacobian
from mpm_taichi.solver.water import MovingFace, head_places, level_and_fall, water_force
from pipeline.config import SimulationSettings
from tests.gns.scenes import simulator, small_scene

MOVING = SimulationSettings()


def dam():
    """A dam with a pool on its left, and its points after they have slumped to the left."""
    zones = small_scene().model_dump()["zones"][:2]
    scene = small_scene(walls="open").changed(zones=zones)
    facts, start = start_of(scene, MOVING)
    moved = np.where((facts.type == 0)[:, None], start * [1.0, 0.8] - [1.7, 0.0], start)
    return scene, facts, start, moved


def test_the_force_is_that_of_the_solver_where_the_soil_is_now():
    scene, facts, start, moved = dam()
    assert facts.numbers["moving_face"] == 1 and facts.numbers["pool_level"] == 4.4
    cell = facts.numbers["cell"]
    nodes = cell * np.arange(-2, 12)
    head = MovingFace.at_start(scene, start).head(head_places(nodes, cell), moved)
    level, fall = level_and_fall(head, cell)
    line = head_line(facts.moving_face(), moved, cell)

    def at(x):
        return np.interp(x, line[:, 0], line[:, 1])

    np.testing.assert_allclose(at(nodes), level[:, 0], atol=1e-5)
    slope = (at(nodes - 0.5 * cell) - at(nodes + 0.5 * cell)) / cell
    np.testing.assert_allclose(slope, fall[:, 0], atol=1e-5)
    # The force at a point is that of a node at its place.
    point = np.argmax(facts.body_force(moved)[:, 0])
    x, y = moved[point]
    own = (at(x - 0.5 * cell) - at(x + 0.5 * cell)) / cell
    across, upward = water_force(at(x), own, y, cell, 9.81)
    expected = np.array([across, upward]) / (9.81 * facts.properties[point, 2]) - [0.0, 1.0]
    np.testing.assert_allclose(facts.body_force(moved)[point], expected, atol=1e-6)
    assert expected[0] > 0.02


def test_in_the_units_of_the_model_and_in_the_mirror_it_is_the_same():
    _, facts, start, moved = dam()
    scene = scaled(facts, dtype=torch.float64)
    flip = torch.tensor([-1.0, 1.0], dtype=torch.float64)
    for positions in (start, moved):
        there = scene.to_spacings(positions)
        expected = facts.body_force(positions)
        found = body_force(there, scene.at(there)).numpy()
        # A bend of the line between two places where the head is found is cut off.
        np.testing.assert_allclose(found, expected, atol=0.02)
        mirror = scene.mirrored()
        mirrored = body_force(there * flip, mirror.at(there * flip)).numpy() * [-1.0, 1.0]
        np.testing.assert_allclose(mirrored, found, atol=0.1)
    fixed = body_force(scene.to_spacings(moved), scene).numpy()
    assert np.abs(fixed - found).max() > 0.05, "the pool has followed the soil"


def test_where_the_water_stays_nothing_moves_with_the_soil():
    still = SimulationSettings(water="pore_pressure", water_face="fixed")
    facts, start = start_of(small_scene(), still)
    scene = scaled(facts)
    assert facts.moving_face() is None and scene.at(scene.to_spacings(start)) is scene
    level, _ = start_of(small_scene(water=None), MOVING)
    assert level.numbers["moving_face"] == level.numbers["pool_level"] == 0


def symmetric_model(**changes):
    still = {"acceleration_mean": (0.0, -0.05), "acceleration_std": (0.4, 0.4), "seed": 3}
    return simulator(torch.float64, thrust=True, **{**still, **changes})


def test_a_symmetric_model_moves_a_dam_and_its_mirror_image_alike():
    """To rounding, with a pool that follows the soil; another model moves them apart."""
    _, facts, start, _ = dam()
    flip = torch.tensor([-1.0, 1.0], dtype=torch.float64)
    gaps = []
    for symmetric in (True, False):
        model = symmetric_model(symmetric=symmetric)
        scene = model.scaled(facts)
        window = scene.to_spacings(first_window(start, facts, model.config.history))
        with torch.no_grad():
            moved = model.advance(window, scene)
            mirrored = model.advance(window * flip, scene.mirrored()) * flip
        gaps.append(float((moved - mirrored).abs().max()))
    assert gaps[0] < 1e-9 and gaps[1] > 1e-3, gaps


@pytest.mark.slow
@pytest.mark.parametrize("symmetric", [False, True])
def test_both_ways_to_the_derivative_see_the_same_water(symmetric):
    _, facts, start, _ = dam()
    model = symmetric_model(symmetric=symmetric)
    base = model.scaled(facts)
    weak = torch.from_numpy(facts.type == 0)

    def scene_of(theta):
        scene = base.with_strength(weak, cohesion_pa=1e3 * theta[0])
        return scene.with_water_raised(theta[1])

    def readings(frames):
        return frames[-1, :3, 0], {len(frames) - 1: np.eye(len(start))[:3, :, None] * [1.0, 0.0]}

    window, theta = first_window(start, facts), np.array([8.0, 0.1])
    forward = jacobian(model, scene_of, theta, window, 5, readings)
    reverse = reverse_jacobian(model, scene_of, theta, window, 5, readings)
    np.testing.assert_allclose(forward[2], reverse[2], atol=1e-9)
    np.testing.assert_allclose(forward[1], reverse[1], rtol=1e-6, atol=1e-12)
    assert np.abs(forward[1]).min(axis=0).max() > 0
