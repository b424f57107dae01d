"""Quadratic B-splines between points and the nodes of a grid."""

from __future__ import annotations

import torch
from torch import Tensor


def spline_weights(places: Tensor) -> tuple[Tensor, Tensor, tuple[int, int]]:
    """Quadratic B-splines of a grid of nodes at whole numbers, as of the material point method.

    Args:
        places: (N, 2) [cells].

    Returns:
        nodes (N, 9), counted row by row over a box that holds them all; their weights (N, 9), which
        add up to 1; columns and rows of the box.
    """
    nearest = torch.floor(places.detach() + 0.5)
    offset = places - nearest
    one = torch.stack(
        [0.5 * (0.5 - offset).square(), 0.75 - offset.square(), 0.5 * (0.5 + offset).square()], 1
    )
    weights = (one[:, :, None, 1] * one[:, None, :, 0]).flatten(1)
    low = nearest.amin(0) - 1.0
    corner = (nearest - 1.0 - low).long()
    columns, rows = (int(size) for size in (nearest.amax(0) - low + 2.0))
    steps = torch.arange(3, device=places.device)
    row, column = corner[:, 1, None] + steps, corner[:, 0, None] + steps
    return (row[:, :, None] * columns + column[:, None, :]).flatten(1), weights, (columns, rows)
