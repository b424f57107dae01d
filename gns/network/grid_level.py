"""A coarse grid under the points, over which they hear of what is far away.

Messages along edges go one connectivity radius a step; the pressure in a body of soil goes through
all of it within a frame. Halfway through the message passing, the points' latents are therefore
averaged onto the nodes of a coarse grid, pass through a few residual rounds of 3 x 3 convolutions,
and come back to the points. A node is a few hundred times rarer than an edge, so this costs a few
hundredths of a step. (Levels of different fineness: Fortunato et al. 2022, for meshes.)

The grid is smooth in the positions: latents go to it and come back by quadratic B-splines, and
every node counts as far as there is soil around it, so that it matters nowhere where the grid ends.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from gns.network.splines import spline_weights

HALF_PRESENT = 1.0
"""Points around a node (weighted) with which it counts half; a node within soil has cell^2."""


class GridLevel(nn.Module):
    """Points to grid, rounds on the grid, grid to points.

    Args:
        width: of the latents C.
        cell: edge of a cell [spacings].
        rounds: residual rounds of two convolutions; each reaches two cells farther.
    """

    def __init__(self, width: int, cell: float, rounds: int) -> None:
        super().__init__()
        self.cell = cell
        self.enter = nn.Conv2d(width + 1, width, 1)
        self.first = nn.ModuleList(nn.Conv2d(width, width, 3, padding=1) for _ in range(rounds))
        self.second = nn.ModuleList(nn.Conv2d(width, width, 3, padding=1) for _ in range(rounds))
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(rounds))
        self.back = nn.Linear(2 * width, width)
        self.out = nn.Linear(width, width)
        self.norm = nn.LayerNorm(width)

    def forward(self, points: Tensor, places: Tensor) -> Tensor:
        """Latents after the grid.

        Args:
            points: latents of the points of one scene, (N, C).
            places: their positions, (N, 2) [spacings].

        Returns:
            (N, C).
        """
        nodes, weights, (columns, rows) = spline_weights(places / self.cell)
        total = columns * rows
        here = torch.cat([points, torch.ones_like(points[:, :1])], dim=1)
        sums = here.new_zeros(total, here.shape[1]).index_add(
            0, nodes.flatten(), (weights[:, :, None] * here[:, None]).flatten(0, 1)
        )
        mass = sums[:, -1:]
        present = mass / (mass + HALF_PRESENT)
        mean = sums[:, :-1] / (mass + HALF_PRESENT)
        field = _as_image(torch.cat([mean, present], dim=1), columns, rows)
        there = _as_image(present, columns, rows)
        field = self.enter(field) * there
        for first, second, norm in zip(self.first, self.second, self.norms, strict=True):
            change = second(functional.relu(first(functional.relu(field)) * there))
            change = norm(change.movedim(1, 3)).movedim(3, 1)
            field = field + change * there
        flat = field[0].flatten(1).t()
        heard = (flat[nodes] * weights[:, :, None]).sum(1)
        change = functional.relu(self.back(torch.cat([points, heard], dim=1)))
        return points + self.norm(self.out(change))


def _as_image(values: Tensor, columns: int, rows: int) -> Tensor:
    """(nodes, C) -> (1, C, rows, columns)."""
    return values.t().reshape(1, -1, rows, columns)
