"""The production network against the textbook's: outputs and all gradients."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import gns.network.edge_chunks
import gns.network.edge_gradient
from benchmarks.performance.gns_textbook import TextbookNetwork, textbook_of
from gns.network.graph import Graph, radius_graph
from gns.network.network import Network
from tests.budget import examples

POINT_FEATURES, EDGE_FEATURES = 7, 3
NAMES = ("points", "edges", "fading")


def network_of(width: int, steps: int, dtype: torch.dtype, seed: int) -> Network:
    torch.manual_seed(seed)
    network = Network(point_features=POINT_FEATURES, width=width, message_passing_steps=steps).to(
        dtype
    )
    for parameter in network.parameters():  # LayerNorm starts as the identity, biases small
        parameter.data += 0.1 * torch.randn_like(parameter)
    return network


def inputs_of(graph: Graph, dtype: torch.dtype, faded: bool, seed: int) -> list[torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)

    def draw(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, dtype=dtype, generator=generator).requires_grad_()

    inputs = [draw(graph.points, POINT_FEATURES), draw(graph.edges, EDGE_FEATURES)]
    return [*inputs, draw(graph.edges, 1)] if faded else inputs


def apply(network: torch.nn.Module, graph: Graph, inputs: list[torch.Tensor]) -> torch.Tensor:
    points, edges, *fading = inputs
    return network(points, edges, graph, fading=fading[0] if fading else None)


def difference(one: torch.Tensor, other: torch.Tensor) -> float:
    """Relative to the largest value."""
    if one.numel() == 0:
        return 0.0
    one, other = one.detach(), other.detach()
    return float((one - other).abs().max() / other.abs().max().clamp_min(1e-30))


def gradients(network: torch.nn.Module, graph: Graph, inputs: list[torch.Tensor]) -> list:
    """Of a fixed combination of the outputs, in the order inputs, parameters."""
    output = apply(network, graph, inputs)
    weights = torch.linspace(-1.0, 2.0, output.numel(), dtype=output.dtype).reshape(output.shape)
    return list(torch.autograd.grad(output, [*inputs, *network.parameters()], weights))


def near_a_kink(textbook: TextbookNetwork, graph: Graph, inputs: list[torch.Tensor]) -> bool:
    """True where rounding may decide on which side of zero the input of a ReLU lies."""
    least: list[float] = []
    hooks = [
        module.register_forward_pre_hook(
            lambda _, given: least.append(float(given[0].detach().abs().min()))
        )
        for module in textbook.modules()
        if isinstance(module, torch.nn.ReLU)
    ]
    apply(textbook, graph, inputs)
    for hook in hooks:
        hook.remove()
    return min(least) < 1e-5


def ordered(network: Network, textbook: TextbookNetwork, values: list, inputs: int) -> list:
    """Gradients of the textbook's parameters in the order of ours."""
    own = [name for name, _ in network.named_parameters()]
    by_shape = dict(zip(own, (name for name, _ in textbook_names(textbook, own)), strict=True))
    other = dict(zip((n for n, _ in textbook.named_parameters()), values[inputs:], strict=True))
    return values[:inputs] + [other[by_shape[name]] for name in own]


def textbook_names(textbook: TextbookNetwork, own: list[str]) -> list[tuple[str, str]]:
    places = {"first": "0", "second": "2", "third": "4", "norm": "5"}
    names = []
    for name in own:
        part, layer, kind = name.rsplit(".", 2)
        if part.startswith("steps."):
            _, step, kind_of_update = part.split(".")
            part = f"{kind_of_update}_updates.{step}"
        names.append((f"{part}.{places[layer]}.{kind}", name))
    return names


@settings(deadline=None, max_examples=examples(30))
@given(
    seed=st.integers(0, 2**31 - 1),
    count=st.integers(1, 40),
    size=st.sampled_from([0.5, 6.0, 14.0, 90.0]),
    faded=st.booleans(),
    steps=st.integers(1, 3),
    kept=st.booleans(),
)
@pytest.mark.slow
def test_equals_the_textbook_in_double_precision(seed, count, size, faded, steps, kept):
    with pytest.MonkeyPatch.context() as patch:
        # Chunks of about 13 edges, so that even tiny graphs are cut.
        patch.setattr(gns.network.edge_chunks, "CHUNK_BYTES", 13 * 8 * 8)
        patch.setattr(gns.network.edge_gradient, "KEEP_BYTES", 2**30 if kept else 0)
        torch.manual_seed(seed)
        graph = radius_graph(torch.rand(count, 2) * size, 3.0)  # with isolated points
        network = network_of(8, steps, torch.float64, seed)
        textbook = textbook_of(network)
        inputs = inputs_of(graph, torch.float64, faded, seed)
        assert difference(apply(network, graph, inputs), apply(textbook, graph, inputs)) < 1e-12
        with torch.no_grad():
            assert difference(apply(network, graph, inputs), apply(textbook, graph, inputs)) < 1e-12
        own = gradients(network, graph, inputs)
        other = ordered(network, textbook, gradients(textbook, graph, inputs), len(inputs))
        for one, two in zip(own, other, strict=True):
            assert difference(one, two) < 1e-12 or (one - two).abs().max() < 1e-13


@pytest.mark.parametrize("faded", [False, True])
@pytest.mark.parametrize("kept", [False, True])
@pytest.mark.slow
def test_equals_the_textbook_in_single_precision(faded, kept, monkeypatch):
    monkeypatch.setattr(gns.network.edge_chunks, "CHUNK_BYTES", 4 * 16 * 50)
    monkeypatch.setattr(gns.network.edge_gradient, "KEEP_BYTES", 2**30 if kept else 0)
    compared = 0
    for seed in range(30):
        torch.manual_seed(seed)
        graph = radius_graph(torch.rand(30, 2) * 9, 3.0)
        network = network_of(16, 2, torch.float32, seed)
        textbook = textbook_of(network)
        inputs = inputs_of(graph, torch.float32, faded, seed)
        if near_a_kink(textbook, graph, inputs):
            continue
        compared += 1
        assert difference(apply(network, graph, inputs), apply(textbook, graph, inputs)) < 1e-5
        own = gradients(network, graph, inputs)
        other = ordered(network, textbook, gradients(textbook, graph, inputs), len(inputs))
        for one, two in zip(own, other, strict=True):
            assert difference(one, two) < 1e-5
    assert compared >= 5


@pytest.mark.parametrize("steps", [1, 3])
def test_frozen_weights_leave_the_gradient_of_the_inputs(steps):
    torch.manual_seed(0)
    graph = radius_graph(torch.rand(25, 2) * 8, 3.0)
    network = network_of(8, steps, torch.float64, 0)
    inputs = inputs_of(graph, torch.float64, True, 0)
    expected = gradients(network, graph, inputs)[:3]
    network.requires_grad_(False)
    output = apply(network, graph, inputs)
    weights = torch.linspace(-1.0, 2.0, output.numel(), dtype=output.dtype).reshape(output.shape)
    for one, two in zip(torch.autograd.grad(output, inputs, weights), expected, strict=True):
        assert torch.allclose(one, two, rtol=1e-13, atol=1e-14)


def test_threads_change_the_work_on_edges_by_rounding_alone(monkeypatch):
    monkeypatch.setattr(gns.network.edge_chunks, "CHUNK_BYTES", 4 * 16 * 4000)
    monkeypatch.setattr(gns.network.edge_gradient, "KEEP_BYTES", 0)
    torch.manual_seed(0)
    points = 800
    graph = radius_graph(torch.rand(points, 2) * 36, 3.0)
    edge = network_of(16, 1, torch.float32, 0).steps[0].edge
    edges = torch.randn(graph.edges, 16, requires_grad=True)
    shares = torch.randn(points, 2, 16, requires_grad=True)
    threads = torch.get_num_threads()
    found = []
    try:
        for number in (1, 2, 3):
            torch.set_num_threads(number)
            out = gns.network.edge_gradient.edge_update(edges, shares, edge.edge_weights(16), graph)
            sought = [edges, shares, edge.first.weight, *list(edge.parameters())[2:]]
            found.append([*out, *torch.autograd.grad(out, sought, [edges, shares[:, 0]])])
    finally:
        torch.set_num_threads(threads)
    for other in found[1:]:
        for one, two in zip(found[0], other, strict=True):
            assert difference(one, two) < 1e-5


def test_a_message_reaches_as_far_as_the_steps():
    """On a chain of points, an input is felt by exactly as many neighbours as there are steps."""
    chain = torch.stack([torch.arange(9.0), torch.zeros(9)], dim=1)
    graph = radius_graph(chain, 1.0)
    network = network_of(8, 3, torch.float64, 3)
    points, edges = inputs_of(graph, torch.float64, False, 3)
    output = network(points, edges, graph)
    (to_points,) = torch.autograd.grad(output[0].sum(), points)
    felt = to_points.abs().sum(1) > 0
    assert felt.tolist() == [True] * 4 + [False] * 5


@pytest.mark.slow
def test_gradients_reach_positions_through_the_edges():
    torch.manual_seed(2)
    graph = radius_graph(torch.rand(6, 2) * 4, 3.0)
    network = network_of(4, 2, torch.float64, 2).requires_grad_(False)
    inputs = inputs_of(graph, torch.float64, True, 2)
    assert torch.autograd.gradcheck(lambda *given: apply(network, graph, list(given)), inputs)


def test_mixed_precision_is_the_same_to_its_own_rounding():
    """Edges in bfloat16 (8 bits): outputs and gradients to a few per cent of their size."""
    torch.manual_seed(0)
    graph = radius_graph(torch.rand(40, 2) * 9, 3.0)
    network = network_of(16, 2, torch.float32, 0)
    inputs = inputs_of(graph, torch.float32, True, 0)
    exact, expected = apply(network, graph, inputs), gradients(network, graph, inputs)
    network.edge_precision = torch.bfloat16
    output, found = apply(network, graph, inputs), gradients(network, graph, inputs)
    assert output.dtype == torch.float32 and all(one.dtype == torch.float32 for one in found)
    assert 1e-5 < difference(output, exact) < 0.03
    one, two = (torch.cat([part.ravel() for part in parts[3:]]) for parts in (found, expected))
    assert (one - two).norm() < 0.1 * two.norm()  # of all weights; the sides of some ReLUs change
