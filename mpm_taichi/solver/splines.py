"""Weights of the nodes around a point: quadratic B-splines, open at level ground and at side walls.

Inside, the three nodes nearest to a point along an axis share it by a quadratic B-spline. Next to a
boundary that lies on a line of nodes, the spline of the first node inside would not vanish on the
boundary: soil would act through it on nodes behind, and a velocity that is linear from the ground
up could not be represented, so that the stress of the two lowest cells would be off by a tenth at
any cell size. There the spline ends as an open knot vector lets it end: in the half cell next to
the boundary the weights are linear, 1 - xi at the boundary's node and xi at the next, which joins
the quadratic ones with equal slope at xi = 1/2 (Steffen, Wallstedt, Guilkey, Kirby and Berzins
2008).
All contact then happens at the boundary's own nodes.

Points give mass and take velocity by the same weights: with any others (equal shares of mass, say)
momentum is lost on the way, and a thin sheet of soil brakes by an eighth too much.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import numpy as np
import taichi as ti

BASE_EDGE, LEFT_EDGE, RIGHT_EDGE = 256, 512, 1024
"""Bits of a node's type: it lies on level ground, on the left wall, on the right wall."""

EDGES = BASE_EDGE | LEFT_EDGE | RIGHT_EDGE

LEAST_SHARE = 0.05
"""Least share of a point's mass at the second node from a boundary: a node with the force of a
point, and none of its mass, would ask for a time step of nothing."""


@ti.func
def spline_weights(offset):
    """Quadratic B-spline weights of the three nodes around a point at `offset` [cells]."""
    below = 0.5 - offset
    above = 0.5 + offset
    return ti.Vector([0.5 * below * below, 0.75 - offset * offset, 0.5 * above * above])


@ti.func
def spline_slopes(offset):
    """Slopes [1 / cell] that go with `spline_weights`: their moments (MLS-MPM, Hu et al. 2018)."""
    weights = spline_weights(offset)
    return 4.0 * ti.Vector(
        [-weights[0] * (1.0 + offset), -weights[1] * offset, weights[2] * (1.0 - offset)]
    )


@ti.func
def edge_weights(offset, low, high):
    """Weights along one axis of a point whose home may lie on a boundary, below (`low`) or above.

    A point behind the boundary counts as on it.
    """
    weights = spline_weights(offset)
    if low != 0:
        xi = ti.max(offset, 0.0)
        weights = ti.Vector([0.0, 1.0 - xi, xi])
    elif high != 0:
        xi = ti.max(-offset, 0.0)
        weights = ti.Vector([xi, 1.0 - xi, 0.0])
    return weights


@ti.func
def edge_slopes(offset, low, high):
    """Slopes [1 / cell] that go with `edge_weights`."""
    slopes = spline_slopes(offset)
    if low != 0:
        slopes = ti.Vector([0.0, -1.0, 1.0])
    elif high != 0:
        slopes = ti.Vector([-1.0, 1.0, 0.0])
    return slopes


@ti.func
def mass_offset(offset, low, high):
    """Offset [cells] at which the mass of a point counts: `LEAST_SHARE` or more inside."""
    result = offset
    if low != 0:
        result = ti.max(offset, LEAST_SHARE)
    elif high != 0:
        result = ti.min(offset, -LEAST_SHARE)
    return result


def weights_of_points(
    offset: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`edge_weights` in numpy: of the nodes below, at and above each home, each (N,).

    Args:
        offset: (N,) [cells].
        low: (N,) bool, home on a boundary below.
        high: (N,) bool, home on a boundary above.
    """
    xi = np.maximum(np.where(high, -offset, offset), 0.0)
    edge = low | high
    return (
        np.where(edge, np.where(high, xi, 0.0), 0.5 * (0.5 - offset) ** 2),
        np.where(edge, 1.0 - xi, 0.75 - offset**2),
        np.where(edge, np.where(low, xi, 0.0), 0.5 * (0.5 + offset) ** 2),
    )
