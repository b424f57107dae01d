"""The network and its directional derivatives in one pass (forward mode).

For p directions in which the features change, the change of the outputs: exact, with nothing kept
for later, at the cost of 1 + p passes. Weights are taken as fixed. The edges are worked through in
the chunks of `edge_chunks`; of each chunk the layers are worked out once for all directions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from gns.network.edge_chunks import (
    EdgeWeights,
    Hidden,
    chunks_of,
    layers,
    sum_by_receiver,
)
from gns.network.graph import Graph
from gns.network.network import MessagePassing, Network, Perceptron


class Moving(NamedTuple):
    """A value (...) and its derivatives in p directions (p, ...)."""

    value: Tensor
    change: Tensor


def network_with_tangents(
    network: Network,
    points: Moving,
    edges: Moving,
    graph: Graph,
    fading: Moving | None = None,
    places: Moving | None = None,
) -> Moving:
    """Outputs of the network (N, outputs) and their derivatives (p, N, outputs).

    Args:
        network: its weights stay as they are.
        points: features (N, F) and their changes.
        edges: features (E, F) and their changes.
        graph: the edges.
        fading: factors of the messages (E, 1) and their changes; None: all 1.
        places: positions (N, 2) [spacings] and their changes, which a grid needs.
    """
    with torch.no_grad():
        latent = _perceptron(network.point_encoder, points)
        edge_latent = _encode_edges(network.edge_encoder.edge_weights(), edges, graph)
        for number, step in enumerate(network.steps, start=1):
            grid = network.grid_before(number)
            if grid is not None:
                latent = along(grid, (latent.value, places.value), _both(latent, places))
            last = number == len(network.steps)
            latent = _step(step, latent, edge_latent, graph, fading, last=last)
        return _perceptron(network.decoder, latent)


def along(
    function: Callable[..., Tensor],
    values: tuple[Tensor, ...],
    changes: Sequence[tuple[Tensor, ...]],
) -> Moving:
    """A function's value and its derivatives in several directions."""
    results = [torch.func.jvp(function, values, change) for change in changes]
    if not results:
        value = function(*values)
        return Moving(value, value.new_zeros(0, *value.shape))
    return Moving(results[0][0], torch.stack([change for _, change in results]))


def _both(one: Moving, other: Moving) -> list[tuple[Tensor, Tensor]]:
    return list(zip(one.change, other.change, strict=True))


def _step(
    step: MessagePassing,
    points: Moving,
    edges: Moving,
    graph: Graph,
    fading: Moving | None,
    *,
    last: bool,
) -> Moving:
    """One message-passing step; `edges` is overwritten unless it is the last."""
    matrix, bias = step.share_weights()
    shares = Moving(
        functional.linear(points.value, matrix, bias).reshape(-1, step.width),
        functional.linear(points.change, matrix).reshape(len(points.change), -1, step.width),
    )
    sums = _edge_update(
        step.edge.edge_weights(step.width), edges, shares, graph, fading, keep=not last
    )
    own, width = step.point.first, step.width
    before = Moving(
        functional.linear(points.value, own.weight[:, :width], own.bias)
        + functional.linear(sums.value, own.weight[:, width:]),
        functional.linear(points.change, own.weight[:, :width])
        + functional.linear(sums.change, own.weight[:, width:]),
    )
    update = _after_first(step.point, before)
    return Moving(points.value + update.value, points.change + update.change)


def _perceptron(perceptron: Perceptron, inputs: Moving) -> Moving:
    first = perceptron.first
    before = Moving(first(inputs.value), functional.linear(inputs.change, first.weight))
    return _after_first(perceptron, before)


def _after_first(perceptron: Perceptron, before: Moving) -> Moving:
    """The rest of a perceptron, from what its first layer gives before its ReLU."""
    first = functional.relu(before.value)
    second = functional.relu(perceptron.second(first))
    third = perceptron.third(second)
    change = functional.linear(before.change * (first > 0), perceptron.second.weight)
    change = functional.linear(change.mul_(second > 0), perceptron.third.weight)
    if perceptron.norm is None:
        return Moving(third, change)
    norm = perceptron.norm
    value, mean, spread = torch.native_layer_norm(
        third, norm.normalized_shape, norm.weight, norm.bias, norm.eps
    )
    return Moving(value, _norm_change(change, third, mean, spread, norm.weight))


def _norm_change(
    change: Tensor, inputs: Tensor, mean: Tensor, spread: Tensor, scale: Tensor
) -> Tensor:
    """Change (..., K, C) of LayerNorm from that of its inputs (K, C); `change` is overwritten."""
    standard = (inputs - mean) * spread
    along = (change * standard).mean(-1, keepdim=True)
    change -= change.mean(-1, keepdim=True)
    return change.sub_(standard * along).mul_(spread * scale)


def _encode_edges(weights: EdgeWeights, features: Moving, graph: Graph) -> Moving:
    count, weights = len(features.change), weights.laid_out()
    value = features.value.new_empty(graph.edges, weights.width)
    change = features.value.new_empty(count, graph.edges, weights.width)

    for chunk in chunks_of(graph, weights.width, value.element_size()):
        hidden, value[chunk.edges] = layers(chunk, features.value, None, weights)
        for direction in range(count):
            before = features.change[direction, chunk.edges] @ weights.first.t()
            change[direction, chunk.edges] = _message_change(before, hidden, weights)

    return Moving(value, change)


def _edge_update(
    weights: EdgeWeights,
    edges: Moving,
    shares: Moving,
    graph: Graph,
    fading: Moving | None,
    *,
    keep: bool,
) -> Moving:
    """Sums of the messages to each point; the messages are added to `edges` if these are kept."""
    count, weights = len(edges.change), weights.laid_out()
    value = edges.value.new_empty(graph.points, weights.width)
    change = edges.value.new_empty(count, graph.points, weights.width)

    for chunk in chunks_of(graph, weights.width, value.element_size()):
        hidden, message = layers(chunk, edges.value, shares.value, weights)
        for direction in range(count):
            before = functional.embedding_bag(
                chunk.pairs, shares.change[direction], chunk.pair_starts, mode="sum"
            )
            latent = edges.change[direction, chunk.edges]
            moved = _message_change(before.addmm_(latent, weights.first.t()), hidden, weights)
            if keep:
                latent += moved
            if fading is not None:
                moved *= fading.value[chunk.edges]
                moved.addcmul_(message, fading.change[direction, chunk.edges])
            change[direction, chunk.receivers] = sum_by_receiver(chunk, moved)
        if keep:
            edges.value[chunk.edges] += message
        if fading is not None:
            message *= fading.value[chunk.edges]
        value[chunk.receivers] = sum_by_receiver(chunk, message)

    return Moving(value, change)


def _message_change(before: Tensor, hidden: Hidden, weights: EdgeWeights) -> Tensor:
    """Change of the messages (K, C) from that before the first ReLU, which is overwritten."""
    second = before.mul_(hidden.first > 0) @ weights.second.t()
    third = second.mul_(hidden.second > 0) @ weights.third.t()
    return _norm_change(third, hidden.third, hidden.mean, hidden.spread, weights.scale)
