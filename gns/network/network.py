"""The graph network of the paper: encoder, processor, decoder (its section on the GNS).

In: features of N points and of the E edges between them. Out: what the decoder makes of each point,
the normalised acceleration. Perceptrons have two hidden layers; LayerNorm follows all but the
decoder's; messages are summed; points and edges are updated by residuals (Sanchez-Gonzalez 2020).

The edges are worked through as `edge_chunks` says, which gives the numbers of the textbook's form
(`benchmarks.performance.gns_textbook`, equal in a test) in a half to a quarter of its time.
Parameters have the textbook's shapes: the first layer of a message is one matrix over [edge,
sender, receiver].
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from gns.network.edge_chunks import NORM_EPSILON, EdgeWeights
from gns.network.edge_gradient import edge_update, encode_edges
from gns.network.graph import Graph
from gns.network.grid_level import GridLevel


class Perceptron(nn.Module):
    """Two hidden layers of ReLU; LayerNorm at the end unless stated otherwise."""

    def __init__(self, inputs: int, width: int, outputs: int, *, norm: bool = True) -> None:
        super().__init__()
        self.first = nn.Linear(inputs, width)
        self.second = nn.Linear(width, width)
        self.third = nn.Linear(width, outputs)
        self.norm = nn.LayerNorm(outputs, eps=NORM_EPSILON) if norm else None

    def forward(self, inputs: Tensor) -> Tensor:
        """(..., inputs) -> (..., outputs)."""
        return self.after_first(self.first(inputs))

    def after_first(self, before_activation: Tensor) -> Tensor:
        """The rest, from what the first layer gives before its ReLU, (..., width)."""
        hidden = functional.relu(before_activation, inplace=before_activation.requires_grad)
        hidden = functional.relu(self.second(hidden), inplace=True)
        outputs = self.third(hidden)
        return outputs if self.norm is None else self.norm(outputs)

    def edge_weights(self, columns: int | None = None) -> EdgeWeights:
        """The parameters as `edge_chunks` takes them.

        Args:
            columns: first columns of the first layer that multiply the edges, and no first bias;
                None: all, with the bias.
        """
        return EdgeWeights(
            first=self.first.weight if columns is None else self.first.weight[:, :columns],
            first_bias=self.first.bias if columns is None else None,
            second=self.second.weight,
            second_bias=self.second.bias,
            third=self.third.weight,
            third_bias=self.third.bias,
            scale=self.norm.weight,
            shift=self.norm.bias,
        )


class MessagePassing(nn.Module):
    """One step: messages along the edges, their sums into the points."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.width = width
        self.edge = Perceptron(3 * width, width, width)
        self.point = Perceptron(2 * width, width, width)

    def share_weights(self) -> tuple[Tensor, Tensor]:
        """Matrix (2 C, C), bias (2 C,) of what a point brings to messages: as sender, receiver."""
        width, first = self.width, self.edge.first
        matrix = torch.cat([first.weight[:, width : 2 * width], first.weight[:, 2 * width :]])
        return matrix, torch.cat([torch.zeros_like(first.bias), first.bias])

    def forward(
        self, points: Tensor, edges: Tensor, graph: Graph, *, fading: Tensor | None, last: bool
    ) -> tuple[Tensor, Tensor | None]:
        """Latents of points (N, C) and edges (E, C) after the step; edges: None after the last.

        The work on edges is done in the type of their numbers, that on points in theirs.
        """
        width = self.width
        matrix, bias = self.share_weights()
        shares = functional.linear(points, matrix, bias).reshape(len(points), 2, width)
        weights = self.edge.edge_weights(width)
        if edges.dtype != points.dtype:
            weights, shares = weights.cast(edges.dtype), shares.to(edges.dtype)
            fading = None if fading is None else fading.to(edges.dtype)
        edges, sums = edge_update(edges, shares, weights, graph, fading=fading, last=last)
        sums = sums.to(points.dtype)
        own = self.point.first
        change = functional.linear(points, own.weight[:, :width], own.bias)
        change = change + functional.linear(sums, own.weight[:, width:])
        return points + self.point.after_first(change), edges


class Network(nn.Module):
    """Encode, process, decode.

    Args:
        point_features: numbers a point brings.
        edge_features: numbers an edge brings.
        outputs: numbers decoded for each point.
        width: of all latents and hidden layers; 128 in the paper.
        message_passing_steps: 10 in the paper.
        grid_cell: cell of a coarse grid halfway through them [spacings]; 0: no grid (paper).
        grid_rounds: of convolutions on it.
        grid_everywhere: between all steps, not halfway alone; each grid has its own weights.

    Attributes:
        edge_precision: type of the numbers of the work on edges; None: that of the points. With
            bfloat16 it is mixed precision: weights, points and sums over chunks stay as they are.
    """

    def __init__(
        self,
        *,
        point_features: int,
        edge_features: int = 3,
        outputs: int = 2,
        width: int = 128,
        message_passing_steps: int = 10,
        grid_cell: float = 0.0,
        grid_rounds: int = 3,
        grid_everywhere: bool = False,
    ) -> None:
        super().__init__()
        self.edge_precision: torch.dtype | None = None
        self.point_encoder = Perceptron(point_features, width, width)
        self.edge_encoder = Perceptron(edge_features, width, width)
        self.steps = nn.ModuleList(MessagePassing(width) for _ in range(message_passing_steps))
        self.grid = GridLevel(width, grid_cell, grid_rounds) if grid_cell > 0 else None
        others = set(range(2, len(self.steps) + 1)) - {self.halfway + 1} if grid_everywhere else ()
        self.more_grids = nn.ModuleDict(
            {str(number): GridLevel(width, grid_cell, grid_rounds) for number in sorted(others)}
        )
        self.decoder = Perceptron(width, width, outputs, norm=False)

    @property
    def halfway(self) -> int:
        """Message-passing steps before the grid."""
        return len(self.steps) // 2

    def grid_before(self, number: int) -> GridLevel | None:
        """The grid before a message-passing step, counted from 1."""
        if number == self.halfway + 1:
            return self.grid
        return self.more_grids[str(number)] if str(number) in self.more_grids else None

    def forward(
        self,
        point_features: Tensor,
        edge_features: Tensor,
        graph: Graph,
        *,
        fading: Tensor | None = None,
        places: Sequence[Tensor] = (),
    ) -> Tensor:
        """Outputs of the points.

        Args:
            point_features: (N, features).
            edge_features: (E, features), in the order of the graph's edges.
            graph: the edges.
            fading: (E, 1) factor of each message, which a smooth cut-off gives; None: all 1.
            places: positions of the points of each scene [spacings], which the grid needs.

        Returns:
            (N, outputs).
        """
        points = self.point_encoder(point_features)
        weights = self.edge_encoder.edge_weights()
        if self.edge_precision is not None:
            weights = weights.cast(self.edge_precision)
            edge_features = edge_features.to(self.edge_precision)
        edges = encode_edges(edge_features, weights, graph)
        for number, step in enumerate(self.steps, start=1):
            grid = self.grid_before(number)
            if grid is not None:
                scenes = zip(points.split([len(one) for one in places]), places, strict=True)
                points = torch.cat([grid(own, place) for own, place in scenes])
            last = number == len(self.steps)
            points, edges = step(points, edges, graph, fading=fading, last=last)
        return self.decoder(points)
