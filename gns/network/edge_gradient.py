"""The edge part of the network and its gradient (reverse mode).

`encode_edges` and `edge_update` are what `network` calls. Their backward pass goes through the
chunks of `edge_chunks` once more: of each it recomputes the layers and at once all gradients.
Where the layers of a small graph take little memory they are kept instead. Gradients that nobody
asks for (of frozen weights) are not computed.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from gns.network.edge_chunks import (
    NORM_EPSILON,
    Chunk,
    EdgeWeights,
    Hidden,
    chunks_of,
    forward,
    layers,
    sum_by_receiver,
    sum_by_sender,
)
from gns.network.graph import Graph

KEEP_BYTES = 2**25
"""Where the layers of all edges take no more than this in a step, they are kept for the backward
pass: a third fewer operations there."""


def encode_edges(features: Tensor, weights: EdgeWeights, graph: Graph) -> Tensor:
    """The edges' first latent: perceptron and LayerNorm of their features.

    Args:
        features: (E, F).
        weights: of the encoder, with its first bias.
        graph: the E edges.

    Returns:
        (E, C).
    """
    if _differentiates(features, *weights):
        return _EdgePerceptron.apply(graph, True, features, None, None, *weights)[0]
    out = features.new_empty(graph.edges, weights.width)
    forward(graph, features, None, None, weights, edges_out=out, sums_out=None)
    return out


def edge_update(
    edges: Tensor,
    shares: Tensor,
    weights: EdgeWeights,
    graph: Graph,
    *,
    fading: Tensor | None = None,
    last: bool = False,
) -> tuple[Tensor | None, Tensor]:
    """Messages of a step: m = LayerNorm(perceptron(e, x_s, x_r)); e + m, and the sum of m by point.

    Args:
        edges: (E, C) latent e. Overwritten where no gradient is asked for.
        shares: (N, 2, C), what each point brings to the first layer as sender and as receiver, the
            first bias included.
        weights: of the perceptron, without first bias.
        graph: the E edges between the N points.
        fading: (E, 1) factors of the messages in the sum (a smooth cut-off); None: all 1.
        last: the new latent of the edges is not needed.

    Returns:
        (E, C) e + m, or None; (N, C) sums of the messages to each point.
    """
    shares = shares.reshape(-1, shares.shape[-1])
    if _differentiates(edges, shares, fading, *weights):
        return _EdgePerceptron.apply(graph, not last, edges, shares, fading, *weights)
    sums = edges.new_empty(graph.points, weights.width)
    out = None if last else edges
    forward(graph, edges, shares, fading, weights, edges_out=out, sums_out=sums)
    return out, sums


def _differentiates(*tensors: Tensor | None) -> bool:
    return torch.is_grad_enabled() and any(t is not None and t.requires_grad for t in tensors)


class _EdgePerceptron(torch.autograd.Function):
    """`encode_edges` (no shares) or `edge_update` (with shares) with its gradient."""

    @staticmethod
    def forward(ctx, graph, wants_edges, edges, shares, fading, *parameters):
        weights = EdgeWeights(*parameters)
        out = edges.new_empty(graph.edges, weights.width) if wants_edges else None
        sums = None if shares is None else edges.new_empty(graph.points, weights.width)
        size = 3 * graph.edges * weights.width * edges.element_size()
        keep = size <= KEEP_BYTES
        hidden = forward(
            graph, edges, shares, fading, weights, edges_out=out, sums_out=sums, keep=keep
        )
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(edges, shares, fading, *parameters)
        ctx.graph, ctx.hidden = graph, hidden
        return out, sums

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, edges_gradient, sums_gradient):
        if edges_gradient is None and sums_gradient is None:
            return (None,) * len(ctx.needs_input_grad)
        edges, shares, fading, *parameters = ctx.saved_tensors
        weights, graph = EdgeWeights(*parameters), ctx.graph
        _, _, to_edges, to_shares, to_fading, *wanted = ctx.needs_input_grad
        pass_back = _Backward(
            graph=graph,
            edges=edges,
            shares=shares,
            fading=fading,
            weights=weights,
            edges_gradient=edges_gradient,
            sums_gradient=sums_gradient,
            wanted=wanted,
            to_edges=torch.empty_like(edges) if to_edges else None,
            to_shares=torch.zeros_like(shares) if to_shares else None,
            to_fading=torch.zeros_like(fading) if to_fading else None,
        )
        totals = [
            total if total is None else total.to(parameter.dtype)
            for total, parameter in zip(pass_back.run(ctx.hidden), parameters, strict=True)
        ]
        return None, None, pass_back.to_edges, pass_back.to_shares, pass_back.to_fading, *totals


class _Backward:
    """The backward pass: what it is given, what it fills (`to_...`), and its work on a chunk."""

    def __init__(
        self,
        *,
        graph: Graph,
        edges: Tensor,
        shares: Tensor | None,
        fading: Tensor | None,
        weights: EdgeWeights,
        edges_gradient: Tensor | None,
        sums_gradient: Tensor | None,
        wanted: list[bool],
        to_edges: Tensor | None,
        to_shares: Tensor | None,
        to_fading: Tensor | None,
    ) -> None:
        self.graph, self.edges, self.shares, self.fading = graph, edges, shares, fading
        self.weights, self.laid_out = weights, weights.laid_out()
        self.first_matrix, self.wanted = weights.first.contiguous(), wanted
        self.edges_gradient, self.sums_gradient = edges_gradient, sums_gradient
        self.to_edges, self.to_shares, self.to_fading = to_edges, to_shares, to_fading

    def run(self, hidden: list[Hidden | None]) -> list[Tensor | None]:
        """Go through all chunks; return the gradients of the parameters."""
        chunks = chunks_of(self.graph, self.weights.width, self.edges.element_size())
        totals: list[Tensor | None] = [None] * len(self.wanted)
        for chunk, kept in zip(chunks, hidden, strict=True):
            to_senders, gradients = self._chunk(chunk, kept)
            if self.to_shares is not None:
                self.to_shares[0::2][chunk.senders] += to_senders
            for place, value in enumerate(gradients):
                if value is not None and totals[place] is None:
                    totals[place] = value.float() if value.dtype == torch.bfloat16 else value
                elif value is not None:
                    totals[place].add_(value)
        return totals

    def _chunk(
        self, chunk: Chunk, hidden: Hidden | None
    ) -> tuple[Tensor | None, list[Tensor | None]]:
        """Fill a chunk's part; return what goes to its senders and to the parameters."""
        weights, inputs = self.weights, self.edges[chunk.edges]
        if hidden is None:
            hidden = layers(chunk, self.edges, self.shares, self.laid_out)[0]
        gradient = self._of_messages(chunk, hidden)
        third, scale, shift = torch.ops.aten.native_layer_norm_backward(
            gradient,
            hidden.third,
            [weights.width],
            hidden.mean,
            hidden.spread,
            weights.scale,
            weights.shift,
            [True, self.wanted[6], self.wanted[7]],
        )
        second = torch.ops.aten.threshold_backward(third @ weights.third, hidden.second, 0)
        first = torch.ops.aten.threshold_backward(second @ weights.second, hidden.first, 0)
        if self.to_edges is not None:
            out = self.to_edges[chunk.edges]
            if self.shares is None or self.edges_gradient is None:
                torch.mm(first, self.first_matrix, out=out)
            else:
                torch.addmm(self.edges_gradient[chunk.edges], first, self.first_matrix, out=out)
        to_senders = None
        if self.to_shares is not None:
            self.to_shares[1::2][chunk.receivers] = sum_by_receiver(chunk, first)
            to_senders = sum_by_sender(chunk, first)
        of_parameters = (
            lambda: (inputs.t() @ first).t(),
            lambda: first.sum(0),
            lambda: (hidden.first.t() @ second).t(),
            lambda: second.sum(0),
            lambda: (hidden.second.t() @ third).t(),
            lambda: third.sum(0),
            lambda: scale,
            lambda: shift,
        )
        wanted = zip(self.wanted, of_parameters, strict=True)
        return to_senders, [work() if needed else None for needed, work in wanted]

    def _of_messages(self, chunk: Chunk, hidden: Hidden) -> Tensor:
        """Gradient with respect to the messages of a chunk, (K, C)."""
        if self.sums_gradient is None:
            return self.edges_gradient[chunk.edges]
        gradient = self.sums_gradient.index_select(0, self.graph.receivers[chunk.edges])
        if self.to_fading is not None:
            messages = functional.layer_norm(
                hidden.third,
                [self.weights.width],
                self.weights.scale,
                self.weights.shift,
                NORM_EPSILON,
            )
            self.to_fading[chunk.edges] = (gradient * messages).sum(1, keepdim=True)
        if self.fading is not None:
            gradient.mul_(self.fading[chunk.edges])
        if self.edges_gradient is not None:
            gradient.add_(self.edges_gradient[chunk.edges])
        return gradient
