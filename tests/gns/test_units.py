"""Units and features: their meaning, the same at every scale, and their derivatives."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gns.data.scene_facts import first_window, start_of
from gns.network.features import (
    body_force,
    edge_features,
    fading_of,
    ground_distance,
    height_on_line,
    point_feature_names,
    point_features,
)
from gns.network.graph import radius_graph
from gns.network.units import scaled
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from tests.gns.scenes import simulator, small_scene, start

OPTIONS = {
    "radius": 3.0,
    "velocity_mean": torch.tensor([0.1, -0.2], dtype=torch.float64),
    "velocity_std": torch.tensor([0.5, 0.7], dtype=torch.float64),
}


def scene_and_window(**changes):
    facts, positions = start(**changes)
    scene = scaled(facts, dtype=torch.float64)
    # As `first_window`, in double precision.
    velocity = facts.initial_velocity.astype(float) * facts.frame_time
    window = positions + np.arange(-5, 1)[:, None, None] * velocity
    return scene, scene.to_spacings(window), positions, facts


def test_metres_and_spacings_are_the_reverse_of_each_other():
    scene, _, positions, _ = scene_and_window(spacing=0.25)
    there = scene.to_spacings(positions)
    assert np.allclose(scene.to_metres(there), positions, atol=1e-12)
    apart = np.linalg.norm(positions[1] - positions[0]) / 0.25
    assert float((there[1] - there[0]).norm()) == pytest.approx(apart)


def test_a_scene_looks_the_same_at_every_scale():
    """The same shape, strengths in proportion, speeds as the root: the same features."""
    small, window, positions, facts = scene_and_window(spacing=1.0)
    large, there, places, other = scene_and_window(spacing=4.0)
    assert np.allclose(places, 4.0 * positions)
    # The speeds of the scene are in m/s: made twice as fast, as the root of its size.
    velocity = 2.0 * other.initial_velocity.astype(float) * other.frame_time
    there = large.to_spacings(places + np.arange(-5, 1)[:, None, None] * velocity)
    one = point_features(window, small, **OPTIONS)
    two = point_features(there, large, **OPTIONS)
    assert one.shape == (len(positions), len(point_feature_names(6)))
    # All but the cohesion of the shell, which is 1 kPa at both scales.
    cohesion = 16
    keep = [place for place in range(one.shape[1]) if place != cohesion]
    assert torch.allclose(one[:, keep], two[:, keep], atol=1e-6)
    liquefied = torch.from_numpy(facts.properties[:, 0] == 0.0)
    assert torch.allclose(one[liquefied], two[liquefied], atol=1e-6)
    assert not torch.allclose(one[:, cohesion], two[:, cohesion], atol=1e-3)


def test_features_are_where_they_should_be():
    scene, window, positions, facts = scene_and_window()
    found = point_features(window, scene, **OPTIONS, strength="linear")
    velocity = facts.initial_velocity.astype(float) / np.sqrt(9.81)
    for step in range(5):
        expected = (velocity - [0.1, -0.2]) / [0.5, 0.7]
        assert np.allclose(found[:, 2 * step : 2 * step + 2], expected, atol=1e-6)
    above, slope, left, right, kinematic, friction, cohesion, body = found[:, 10:].T.numpy()
    foot = (positions[:, 0] < 7) & (positions[:, 1] < 3)
    assert np.allclose(above[foot], (positions[foot, 1] - 1.0) / 3.0)
    assert np.allclose(slope[foot & (positions[:, 0] < 6)], 0.0)
    on_slope = (positions[:, 0] > 9) & (positions[:, 0] < 15) & (positions[:, 1] < 4.5)
    assert on_slope.any() and np.all(slope[on_slope] < 0)  # the ground rises to the right
    assert np.allclose(left, np.clip(positions[:, 0] / 3, -1, 1)) and np.all(right == 1.0)
    assert np.array_equal(kinematic == 1.0, facts.type == 1)
    assert np.allclose(friction, facts.properties[:, 0])
    weight = facts.properties[:, 2] * 9.81
    assert np.allclose(cohesion, facts.properties[:, 1] / weight)
    assert np.allclose(-body, facts.body_force(positions)[:, 1]) and body.min() < 0.6


def test_the_thrust_of_water_is_a_feature_where_it_is_known():
    settings = SimulationSettings(water="pore_pressure", water_face="fixed")
    facts, positions = start_of(small_scene(), settings)
    scene = scaled(facts, dtype=torch.float64)
    window = scene.to_spacings(first_window(positions, facts))
    found = point_features(window, scene, **OPTIONS, thrust=True)
    assert found.shape[1] == len(point_feature_names(6, thrust=True))
    push = found[:, -1].numpy()
    assert np.allclose(push, facts.body_force(positions)[:, 0], atol=1e-6) and push.max() > 0.05
    mirrored = point_features(window * torch.tensor([-1.0, 1.0]), scene.mirrored(), **OPTIONS,
                              thrust=True)  # fmt: skip
    assert np.allclose(mirrored[:, -1].numpy(), -push, atol=1e-6)
    with pytest.raises(InputError, match="this model knows water as reduced weight"):
        simulator().scaled(facts)
    assert simulator(thrust=True).scaled(facts).thrust


def test_an_open_domain_has_no_walls():
    scene, window, _, _ = scene_and_window(walls="open")
    found = point_features(window, scene, **OPTIONS)
    assert torch.all(found[:, 12:14] == 1.0)


def test_height_and_distance_agree_with_numpy_and_geometry():
    line = torch.tensor([[0.0, 1.0], [4.0, 1.0], [7.0, 5.0], [9.0, 0.0]], dtype=torch.float64)
    x = torch.linspace(-3, 12, 61, dtype=torch.float64)
    expected = np.interp(x.numpy(), *line.T.numpy())
    assert np.allclose(height_on_line(x, line), expected)
    assert torch.all(height_on_line(x, line[:1]) == 1.0)
    places = torch.tensor(
        [[2.0, 4.0], [2.0, 0.5], [-50.0, 3.0], [80.0, 2.0], [7.0, 8.0]], dtype=torch.float64
    )
    distance, slope = ground_distance(places, line)
    assert torch.allclose(distance, torch.tensor([3.0, -0.5, 2.0, 2.0, 3.0], dtype=torch.float64))
    assert torch.allclose(slope[:4], torch.zeros(4, dtype=torch.float64))
    inclined, there = ground_distance(torch.tensor([[5.5 - 0.8, 3.0 + 0.6]]).double(), line)
    assert float(inclined) == pytest.approx(1.0) and float(there) == pytest.approx(-0.8)


def test_edges_are_seen_from_their_receiver():
    positions = torch.tensor([[0.0, 0.0], [1.5, 2.0]], dtype=torch.float64)
    graph = radius_graph(positions, 3.0)
    features = edge_features(positions, graph, 3.0)
    assert graph.receivers.tolist() == [0, 1]
    assert torch.allclose(features[0], torch.tensor([0.5, 2 / 3, 2.5 / 3], dtype=torch.float64))
    assert torch.allclose(features[1], torch.tensor([-0.5, -2 / 3, 2.5 / 3], dtype=torch.float64))


def test_messages_fade_out_smoothly_before_the_radius():
    length = torch.linspace(0, 1.0001, 500, dtype=torch.float64)
    features = torch.stack([length, 0 * length, length], 1).requires_grad_()
    fading = fading_of(features)[:, 0]
    assert torch.all(fading[length < 0.75] == 1.0) and fading[-1] == 0.0
    (slope,) = torch.autograd.grad(fading.sum(), features)
    assert torch.all(slope[:, 2].diff().abs() < 0.2)  # no jump in the slope
    assert torch.all(slope[:, 2] <= 0)


def test_features_differentiate():
    scene, window, _, _ = scene_and_window()
    window = window[:, ::5] + 0.01 * torch.randn(window[:, ::5].shape, dtype=torch.float64)

    def features(window, friction, cohesion, density, line, rise):
        changed = dataclasses.replace(
            scene,
            kinematic=scene.kinematic[::5],
            friction=friction,
            cohesion=cohesion,
            density=density,
            phreatic_line=line,
        ).with_water_raised(rise)
        return point_features(window, changed, **OPTIONS)

    given = [window, scene.friction[::5], scene.cohesion[::5], scene.density[::5]]
    given += [scene.phreatic_line, torch.zeros((), dtype=torch.float64)]
    given = [value.clone().requires_grad_() for value in given]
    assert torch.autograd.gradcheck(features, given)


def test_changed_properties_keep_their_units():
    scene, window, positions, facts = scene_and_window(spacing=2.0)
    liquefied = torch.from_numpy(facts.properties[:, 0] == 0.0)
    changed = scene.with_strength(liquefied, cohesion_pa=5e3, tan_friction=0.1)
    weight = torch.from_numpy(facts.properties[:, 2] * 9.81 * 2.0).double()
    assert torch.allclose(changed.cohesion[liquefied], 5e3 / weight[liquefied])
    assert torch.equal(changed.cohesion[~liquefied], scene.cohesion[~liquefied])
    assert torch.all(changed.friction[liquefied] == 0.1)
    heavy = scene.with_density(liquefied, 2500.0)
    assert torch.allclose(
        heavy.cohesion[liquefied] * 2500.0 * 9.81 * 2.0,
        scene.cohesion[liquefied] * weight[liquefied],
    )
    raised = scene.with_water_raised(1.0)
    before, after = (body_force(window[-1], one)[:, 1] for one in (scene, raised))
    assert torch.all(after >= before) and torch.any(after > before)
    there = facts.__class__(**{**vars(facts), "phreatic_line": facts.phreatic_line + [0, 1.0]})
    assert np.allclose(after, there.body_force(positions)[:, 1])


def test_a_mirrored_scene_is_the_scene_in_the_mirror():
    scene, window, _, _ = scene_and_window()
    over = torch.tensor([-1.0, 1.0], dtype=torch.float64)
    options = {**OPTIONS, "velocity_mean": torch.tensor([0.0, -0.2], dtype=torch.float64)}
    one = point_features(window, scene, **options)
    two = point_features(window * over, scene.mirrored(), **options)
    sign = torch.ones(one.shape[1], dtype=torch.float64)
    sign[0:10:2] = -1.0
    sign[11] = -1.0
    expected = one * sign
    expected[:, [12, 13]] = expected[:, [13, 12]]
    assert torch.allclose(two, expected, atol=1e-12)
