"""The coarse grid: smooth in the positions, blind to where it ends, felt far away."""

from __future__ import annotations

import pytest
import torch

from gns.data.scene_facts import first_window
from gns.network.graph import joined, radius_graph
from gns.network.grid_level import GridLevel
from gns.network.network import Network
from gns.network.splines import spline_weights
from gns.network.tangents import Moving, network_with_tangents
from gns.rollout.differentiate import gradient
from gns.rollout.traced_rollout import trace
from tests.gns.scenes import simulator, start

WIDTH = 6


def level(seed: int = 0, cell: float = 4.0, rounds: int = 2) -> GridLevel:
    torch.manual_seed(seed)
    return GridLevel(WIDTH, cell, rounds).double()


def points(count: int, size: float, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    latents = torch.randn(count, WIDTH, generator=generator, dtype=torch.float64)
    places = size * torch.rand(count, 2, generator=generator, dtype=torch.float64)
    return latents, places


def test_splines_add_up_to_one_and_keep_the_place():
    places = points(200, 30.0)[1] - 15.0
    nodes, weights, (columns, rows) = spline_weights(places)
    assert nodes.min() >= 0 and nodes.max() < columns * rows
    torch.testing.assert_close(weights.sum(1), torch.ones(200, dtype=torch.float64))
    corner = torch.floor(places + 0.5).amin(0) - 1.0
    there = torch.stack([nodes % columns, nodes // columns], 2) + corner
    torch.testing.assert_close((weights[:, :, None] * there).sum(1), places)


def test_derivatives_are_those_of_finite_differences_across_cells():
    grid, (latents, places) = level(), points(40, 20.0)
    places[0] = torch.tensor([6.0, 10.0])  # where a point changes its nearest node
    places.requires_grad_()
    (slope,) = torch.autograd.grad(grid(latents, places).square().sum(), places)
    for step in (1e-5, 1e-6):
        found = torch.zeros_like(places)
        for index in range(len(places)):
            for axis in range(2):
                values = []
                for sign in (1.0, -1.0):
                    moved = places.detach().clone()
                    moved[index, axis] += sign * step
                    values.append(grid(latents, moved).square().sum())
                found[index, axis] = (values[0] - values[1]) / (2 * step)
        torch.testing.assert_close(slope, found, rtol=1e-4, atol=1e-4 * float(slope.abs().max()))


def test_soil_far_away_changes_nothing_but_soil_near_does():
    grid, (latents, places) = level(), points(60, 20.0)
    alone = grid(latents, places)
    for shift, same in ((400.0, True), (12.0, False)):
        more = torch.cat([places, places[:5] + shift])
        beside = grid(torch.cat([latents, latents[:5]]), more)[:60]
        assert torch.allclose(beside, alone, rtol=1e-12, atol=1e-12) == same


def test_the_grid_carries_farther_than_the_messages():
    torch.manual_seed(0)
    line = torch.stack([torch.arange(40.0), torch.zeros(40)], 1).double()
    graph, far = radius_graph(line, 1.5), 39
    edges = torch.ones(graph.edges, 3, dtype=torch.float64)
    reached = []
    for cell in (0.0, 4.0):
        network = Network(
            point_features=2, width=WIDTH, message_passing_steps=4, grid_cell=cell
        ).double()
        features = torch.randn(40, 2, dtype=torch.float64, requires_grad=True)
        out = network(features, edges, graph, places=[line])
        (slope,) = torch.autograd.grad(out[0].sum(), features)
        reached.append(int(slope.abs().sum(1).nonzero().max()))
    assert reached[0] == 4
    assert reached[1] > 20 and reached[1] <= far


def test_scenes_side_by_side_do_not_hear_each_other():
    torch.manual_seed(1)
    network = Network(point_features=2, width=WIDTH, message_passing_steps=2, grid_cell=3.0)
    places = [torch.rand(30, 2) * 10.0, torch.rand(20, 2) * 10.0]
    graphs = [radius_graph(one, 2.0) for one in places]
    features = [torch.randn(len(one), 2) for one in places]
    edges = [torch.randn(graph.edges, 3) for graph in graphs]
    both = network(torch.cat(features), torch.cat(edges), joined(graphs), places=places)
    for own, scene in enumerate(both.split([30, 20])):
        alone = network(features[own], edges[own], graphs[own], places=[places[own]])
        torch.testing.assert_close(scene, alone, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("everywhere", [False, True])
def test_tangents_are_those_of_torch(everywhere):
    torch.manual_seed(2)
    network = Network(
        point_features=3,
        width=WIDTH,
        message_passing_steps=3,
        grid_cell=3.0,
        grid_everywhere=everywhere,
    )
    network = network.double()
    places = torch.rand(25, 2, dtype=torch.float64) * 9.0
    graph = radius_graph(places, 2.5)
    values = (torch.randn(25, 3).double(), torch.randn(graph.edges, 3).double(), places)
    changes = tuple(torch.randn(2, *one.shape).double() for one in values)
    moving = [Moving(one, change) for one, change in zip(values, changes, strict=True)]
    found = network_with_tangents(network, moving[0], moving[1], graph, None, moving[2])

    def whole(features, edges, there):
        return network(features, edges, graph, places=[there])

    torch.testing.assert_close(found.value, whole(*values))
    step = 1e-6
    for direction in range(2):
        own = [change[direction] for change in changes]
        ends = [
            whole(*[one + sign * step * c for one, c in zip(values, own, strict=True)])
            for sign in (1.0, -1.0)
        ]
        slope = (ends[0] - ends[1]) / (2 * step)
        torch.testing.assert_close(found.change[direction], slope, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize("mode", ["reverse", "forward"])
def test_gradient_of_a_rollout_is_that_of_finite_differences(mode, symmetric):
    facts, positions = start()
    model = simulator(
        torch.float64,
        seed=3,
        width=8,
        acceleration_std=(0.4, 0.4),
        grid_cell=4.0,
        grid_everywhere=True,
        symmetric=symmetric,
        overburden=True,
        cutoff="smooth",
    )
    base = model.scaled(facts)
    liquefied = torch.from_numpy((facts.properties[:, 0] == 0) & (facts.type == 0))
    window = first_window(positions, facts, model.config.history)

    def scene_of(theta):
        return base.with_strength(liquefied, cohesion_pa=1e3 * theta[0])

    def loss(frames):
        return float(frames[-1].sum()), {5: torch.ones(frames[-1].shape).numpy()}

    value, slope, _ = gradient(model, scene_of, [18.7], window, 6, loss, mode=mode)
    ends = []
    for sign in (1.0, -1.0):
        theta = torch.tensor([18.7 + sign * 1e-4], dtype=torch.float64)
        ends.append(trace(model, scene_of(theta), window, 6).frames[-1].sum())
    assert slope[0] == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5)
    assert abs(slope[0]) > 1e-6 and value != 0.0
