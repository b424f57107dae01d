"""The graph network as textbooks write it: the oracle of the tests, the baseline of the timings.

Every layer is one operation on all edges, gradients are torch's own, and the parameters are those
of `gns.network.network.Network`, name by name. Kept free of every trick on purpose.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from gns.network.graph import Graph
from gns.network.network import Network


def perceptron(inputs: int, width: int, outputs: int, *, norm: bool = True) -> nn.Sequential:
    """Two hidden layers of ReLU, and LayerNorm."""
    layers = [
        nn.Linear(inputs, width),
        nn.ReLU(),
        nn.Linear(width, width),
        nn.ReLU(),
        nn.Linear(width, outputs),
    ]
    return nn.Sequential(*layers, nn.LayerNorm(outputs)) if norm else nn.Sequential(*layers)


class TextbookNetwork(nn.Module):
    """Encode, process, decode (Sanchez-Gonzalez 2020)."""

    def __init__(
        self, point_features: int, edge_features: int, outputs: int, width: int, steps: int
    ):
        super().__init__()
        self.point_encoder = perceptron(point_features, width, width)
        self.edge_encoder = perceptron(edge_features, width, width)
        self.edge_updates = nn.ModuleList(perceptron(3 * width, width, width) for _ in range(steps))
        self.point_updates = nn.ModuleList(
            perceptron(2 * width, width, width) for _ in range(steps)
        )
        self.decoder = perceptron(width, width, outputs, norm=False)

    def forward(
        self,
        point_features: Tensor,
        edge_features: Tensor,
        graph: Graph,
        *,
        fading: Tensor | None = None,
    ) -> Tensor:
        """As `Network.forward`."""
        points = self.point_encoder(point_features)
        edges = self.edge_encoder(edge_features)
        for edge_update, point_update in zip(self.edge_updates, self.point_updates, strict=True):
            gathered = torch.cat([edges, points[graph.senders], points[graph.receivers]], dim=-1)
            messages = edge_update(gathered)
            weighed = messages if fading is None else fading * messages
            sums = torch.zeros_like(points).index_add(0, graph.receivers, weighed)
            points = points + point_update(torch.cat([points, sums], dim=-1))
            edges = edges + messages
        return self.decoder(points)


def textbook_of(network: Network) -> TextbookNetwork:
    """The textbook's network with (a copy of) the parameters of ours."""
    own = network.state_dict()
    steps = len(network.steps)
    width = network.decoder.first.in_features
    textbook = TextbookNetwork(
        network.point_encoder.first.in_features,
        network.edge_encoder.first.in_features,
        network.decoder.third.out_features,
        width,
        steps,
    ).to(next(network.parameters()))
    places = {"first": 0, "second": 2, "third": 4, "norm": 5}
    parts = {"point_encoder": "point_encoder", "edge_encoder": "edge_encoder", "decoder": "decoder"}
    for step in range(steps):
        parts[f"steps.{step}.edge"] = f"edge_updates.{step}"
        parts[f"steps.{step}.point"] = f"point_updates.{step}"
    renamed = {}
    for name, value in own.items():
        part, layer, kind = name.rsplit(".", 2)
        renamed[f"{parts[part]}.{places[layer]}.{kind}"] = value.clone()
    textbook.load_state_dict(renamed)
    return textbook
