"""The work on edges in pieces that fit the processor's cache.

The paper's network applies a perceptron to [edge, sender, receiver], E x 3C numbers. Here, exactly:

1. The first layer is split, W1 [e, x_s, x_r] = We e + (Ws x)_s + (Wr x)_r: the last two are worked
   out once per point, not once per edge (a point has 28 edges), and gathered.
2. Edges are sorted by receiver and taken in chunks of whole receivers. All layers of a chunk follow
   each other while it is in the cache, and its messages are summed at once.
3. The backward pass recomputes each chunk (`edge_gradient`), so that of the E x C numbers of a
   step only the edges' latent is kept.

Each operation on a chunk uses all of torch's threads. (A pool of threads with a chunk each had to
wait for torch's own, which spin between the operations on points: twice the time on small graphs,
none saved on large ones.) E edges, N points, K edges of a chunk, width C.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from gns.network.graph import Graph

CHUNK_BYTES = 2**22
"""Size of one latent of a chunk: a few of them fit the caches of the cores that share it."""
NORM_EPSILON = 1e-5
"""Added to the variance in LayerNorm."""


class EdgeWeights(NamedTuple):
    """Parameters of a perceptron with two hidden layers and LayerNorm; matrices are (out, in)."""

    first: Tensor  # the part of the first layer that multiplies the edges
    first_bias: Tensor | None  # None where it is part of what points bring along
    second: Tensor
    second_bias: Tensor
    third: Tensor
    third_bias: Tensor
    scale: Tensor  # of LayerNorm
    shift: Tensor

    @property
    def width(self) -> int:
        """Width of the messages C."""
        return self.third.shape[0]

    def cast(self, dtype: torch.dtype) -> EdgeWeights:
        """The same in another type of number."""
        return EdgeWeights(*[None if one is None else one.to(dtype) for one in self])

    def laid_out(self) -> EdgeWeights:
        """The same, each matrix transposed in memory.

        A product with its transpose is then a third faster on a CPU; the copy costs next to
        nothing.
        """
        return self._replace(
            first=self.first.t().contiguous().t(),
            second=self.second.t().contiguous().t(),
            third=self.third.t().contiguous().t(),
        )


class Hidden(NamedTuple):
    """Outputs of a chunk's layers."""

    first: Tensor  # (K, C) after ReLU
    second: Tensor  # (K, C) after ReLU
    third: Tensor  # (K, C) before LayerNorm
    mean: Tensor  # (K, 1) of the third
    spread: Tensor  # (K, 1) 1 / standard deviation of the third


@dataclass(frozen=True)
class Chunk:
    """Some receivers and all their edges.

    Attributes:
        edges: which edges.
        receivers: which points.
        starts: (receivers,) first edge of each receiver, counted from the chunk's first.
        every: (K,) 0, 1, 2, ...
        pairs: (2 K,) rows of the points' (2 N, C) shares: sender's and receiver's of each edge.
        pair_starts: (K,) 0, 2, 4, ...
        senders: stretch of the points that holds all senders.
        sender_order: (K,) the chunk's edges sorted by sender.
        sender_starts: (senders,) first edge of each sender in that order.
    """

    edges: slice
    receivers: slice
    starts: Tensor
    every: Tensor
    pairs: Tensor
    pair_starts: Tensor
    senders: slice
    sender_order: Tensor
    sender_starts: Tensor


def chunks_of(graph: Graph, width: int, itemsize: int = 4) -> list[Chunk]:
    """The chunks of a graph for latents of a width; worked out once and kept with the graph.

    A GPU has no use for small pieces: there the whole graph is one chunk.
    """
    size = max(CHUNK_BYTES // (width * itemsize), 1)
    if graph.senders.is_cuda:
        size = max(graph.edges, 1)
    name = f"chunks of {size}"
    if name not in graph.kept:
        graph.kept[name] = _cut(graph, size)
    return graph.kept[name]


def _cut(graph: Graph, size: int) -> list[Chunk]:
    """Cut at receivers, each chunk as near to `size` edges as whole receivers allow."""
    device = graph.senders.device
    starts = graph.starts.cpu().numpy()
    senders = graph.senders.cpu().numpy()
    pieces = max(-(-graph.edges // size), 1)
    aims = np.linspace(0, graph.edges, pieces + 1)[1:-1]
    cuts = np.unique(np.concatenate([[0], np.searchsorted(starts, aims), [graph.points]]))
    pairs = torch.stack([2 * graph.senders, 2 * graph.receivers + 1], dim=1).ravel()
    every = torch.arange(graph.edges, device=device)
    chunks = []
    for low, high in zip(cuts[:-1], cuts[1:], strict=True):
        begin, end = int(starts[low]), int(starts[high])
        sent = senders[begin:end]
        lowest, highest = (int(sent.min()), int(sent.max()) + 1) if len(sent) else (0, 0)
        # Numbers of 16 bits are sorted by counting, several times as fast.
        small = sent - lowest if highest - lowest > 2**16 else (sent - lowest).astype(np.uint16)
        counts = np.bincount(small, minlength=highest - lowest)
        chunks.append(
            Chunk(
                edges=slice(begin, end),
                receivers=slice(int(low), int(high)),
                starts=graph.starts[low:high] - begin,
                every=every[: end - begin],
                pairs=pairs[2 * begin : 2 * end],
                pair_starts=2 * every[: end - begin],
                senders=slice(lowest, highest),
                sender_order=torch.from_numpy(np.argsort(small, kind="stable")).to(device),
                sender_starts=torch.from_numpy(np.cumsum(counts) - counts).to(device),
            )
        )
    return chunks


def layers(
    chunk: Chunk, edges: Tensor, shares: Tensor | None, weights: EdgeWeights
) -> tuple[Hidden, Tensor]:
    """All layers of a chunk: what they gave, and the messages (K, C).

    Args:
        chunk: which edges.
        edges: (E, C) latents, or (E, features) for the encoder.
        shares: (2 N, C) what points bring to the first layer as sender and as receiver, in turns;
            None for the encoder.
        weights: of the perceptron, `laid_out`.
    """
    inputs = edges[chunk.edges]
    if shares is None:
        first = torch.addmm(weights.first_bias, inputs, weights.first.t())
    else:
        # Both gathers and their sum in one pass over memory.
        first = functional.embedding_bag(chunk.pairs, shares, chunk.pair_starts, mode="sum")
        first.addmm_(inputs, weights.first.t())
    first.relu_()
    second = torch.addmm(weights.second_bias, first, weights.second.t()).relu_()
    third = torch.addmm(weights.third_bias, second, weights.third.t())
    message, mean, spread = torch.native_layer_norm(
        third, [weights.width], weights.scale, weights.shift, NORM_EPSILON
    )
    return Hidden(first, second, third, mean, spread), message


def sum_by_receiver(chunk: Chunk, values: Tensor) -> Tensor:
    """(receivers, C) sums of (K, C) values; zero for a point without edges."""
    return functional.embedding_bag(chunk.every, values, chunk.starts, mode="sum")


def sum_by_sender(chunk: Chunk, values: Tensor) -> Tensor:
    """(senders, C) sums of (K, C) values."""
    return functional.embedding_bag(chunk.sender_order, values, chunk.sender_starts, mode="sum")


def forward(
    graph: Graph,
    edges: Tensor,
    shares: Tensor | None,
    fading: Tensor | None,
    weights: EdgeWeights,
    *,
    edges_out: Tensor | None,
    sums_out: Tensor | None,
    keep: bool = False,
) -> list[Hidden | None]:
    """Work through all chunks and write the results.

    Args:
        graph: the E edges between N points.
        edges: (E, C) latents, or (E, features) for the encoder.
        shares: (2 N, C), or None for the encoder; see `layers`.
        fading: (E, 1) factors of the messages in their sums; None: all 1.
        weights: of the perceptron.
        edges_out: (E, C): the messages (encoder), or latent + message; may be `edges` itself.
        sums_out: (N, C): sums of the messages to each point.
        keep: return what the layers of each chunk gave, else None of each.
    """
    weights = weights.laid_out()

    kept: list[Hidden | None] = []
    for chunk in chunks_of(graph, weights.width, edges.element_size()):
        hidden, message = layers(chunk, edges, shares, weights)
        if edges_out is not None and shares is None:
            edges_out[chunk.edges] = message
        elif edges_out is not None:
            torch.add(edges[chunk.edges], message, out=edges_out[chunk.edges])
        if sums_out is not None:
            if fading is not None:
                message.mul_(fading[chunk.edges])
            sums_out[chunk.receivers] = sum_by_receiver(chunk, message)
        kept.append(hidden if keep else None)
    return kept
