"""The graph of a moment: an edge between every two points nearer than the connectivity radius.

In: positions (N, 2) in spacings. Out: a `Graph` whose edges are sorted by receiver, then by sender,
so that all messages to a point lie side by side. `radius_graph` finds the edges with a k-d tree on
the CPU and with a list of cells on a GPU; both give the same edges in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from scipy.sparse import coo_array
from scipy.spatial import cKDTree
from torch import Tensor

RADIUS_SLACK = 1e-4
"""Share of the radius by which it is enlarged: points of a lattice lie at exactly the radius (three
spacings), and rounding of their positions must not decide which of these edges there are."""


@dataclass(frozen=True)
class Graph:
    """Directed edges between N points; both directions of a pair, no point with itself.

    Attributes:
        senders: (E,) int64, where the message of an edge comes from.
        receivers: (E,) int64, where it goes to; ascending.
        starts: (N + 1,) int64; the edges to point i are starts[i] to starts[i + 1].
        kept: what others have worked out from the edges, by name (the chunks of `edge_chunks`).
    """

    senders: Tensor
    receivers: Tensor
    starts: Tensor
    kept: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def points(self) -> int:
        """Number of points N."""
        return len(self.starts) - 1

    @property
    def edges(self) -> int:
        """Number of directed edges E."""
        return len(self.senders)


def radius_graph(positions: Tensor, radius: float) -> Graph:
    """The edges between all points within the radius of each other.

    Args:
        positions: (N, 2), finite, in any unit of length; on a GPU the search happens there.
        radius: the connectivity radius in the same unit; `RADIUS_SLACK` is added.

    Raises:
        ValueError: a position is not finite.
    """
    if positions.is_cuda:
        return graph_by_cells(positions, radius)
    return graph_by_tree(positions, radius)


def graph_by_tree(positions: Tensor, radius: float) -> Graph:
    """`radius_graph` by a k-d tree on the CPU; (N, 2) positions on any device."""
    places = positions.detach().cpu().numpy().astype(np.float64)
    if not np.isfinite(places).all():
        raise ValueError("a position is not finite")
    count = len(places)
    if count == 0:
        nothing = np.zeros(0, np.int64)
        return _graph(nothing, np.zeros(1, np.int64), positions.device)
    # Neither balanced nor tightened, a tree is built in a tenth of the time and read as fast.
    tree = cKDTree(places, balanced_tree=False, compact_nodes=False)
    pairs = tree.query_pairs(radius * (1.0 + RADIUS_SLACK), output_type="ndarray")
    one, other = pairs[:, 0], pairs[:, 1]
    rows, columns = np.concatenate([one, other]), np.concatenate([other, one])
    # A sparse matrix sorts by counting, five times as fast as a sort of the pairs.
    matrix = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(count, count)).tocsr()
    matrix.sort_indices()
    return _graph(matrix.indices, matrix.indptr, positions.device)


def graph_by_cells(positions: Tensor, radius: float) -> Graph:
    """`radius_graph` by a list of cells, on the device of the positions (N, 2).

    Points are sorted by cell, row of cells by row. The points of three cells side by side are then
    one stretch, so that every point has three stretches of candidates.
    """
    places = positions.detach().double()
    count, device = len(places), positions.device
    if not bool(torch.isfinite(places).all()):
        raise ValueError("a position is not finite")
    if count == 0:
        nothing = torch.zeros(0, dtype=torch.int64, device=device)
        return Graph(nothing, nothing, torch.zeros(1, dtype=torch.int64, device=device))
    reach = radius * (1.0 + RADIUS_SLACK)
    corner = places.amin(0)
    # Points thrown far out must not make a grid that fills the memory.
    side = max(reach, float((places.amax(0) - corner).max()) / 2048)
    column, row = ((places - corner) / side).long().unbind(1)
    columns, rows = int(column.max()) + 3, int(row.max()) + 3
    cell = (row + 1) * columns + column + 1
    order = torch.argsort(cell, stable=True)
    cell = cell[order]
    first = torch.searchsorted(cell, torch.arange(columns * rows + 1, device=device))
    below = cell[:, None] + columns * torch.arange(-1, 2, device=device)
    begin, end = first[below - 1].ravel(), first[below + 2].ravel()
    length = end - begin
    stretch = torch.repeat_interleave(torch.arange(3 * count, device=device), length)
    offset = begin - (length.cumsum(0) - length)
    sender = torch.arange(len(stretch), device=device) + offset[stretch]
    receiver = stretch // 3
    ordered = places[order]
    apart = ordered[sender] - ordered[receiver]
    near = (apart.square().sum(1) <= reach**2) & (sender != receiver)
    key = order[receiver[near]] * count + order[sender[near]]
    key = key.sort().values
    receivers = key // count
    starts = torch.searchsorted(receivers, torch.arange(count + 1, device=device))
    return Graph(key % count, receivers, starts)


def joined(graphs: Sequence[Graph]) -> Graph:
    """Several graphs side by side as one, the points of each numbered after those before it."""
    if len(graphs) == 1:
        return graphs[0]
    points = np.cumsum([0] + [graph.points for graph in graphs])
    edges = np.cumsum([0] + [graph.edges for graph in graphs])
    starts = [graph.starts[:-1] + int(shift) for graph, shift in zip(graphs, edges, strict=False)]
    return Graph(
        senders=torch.cat([g.senders + int(n) for g, n in zip(graphs, points, strict=False)]),
        receivers=torch.cat([g.receivers + int(n) for g, n in zip(graphs, points, strict=False)]),
        starts=torch.cat([*starts, graphs[0].starts.new_tensor([int(edges[-1])])]),
    )


def _graph(senders: np.ndarray, starts: np.ndarray, device: torch.device) -> Graph:
    receivers = np.repeat(np.arange(len(starts) - 1, dtype=np.int64), np.diff(starts))
    return Graph(
        senders=torch.from_numpy(senders.astype(np.int64)).to(device),
        receivers=torch.from_numpy(receivers).to(device),
        starts=torch.from_numpy(starts.astype(np.int64)).to(device),
    )
