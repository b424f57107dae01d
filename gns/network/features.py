"""Input features of points and edges (paper, its section on the GNS; plain numbers only).

A point: its last velocities, normalised; how near ground and walls are, up to the connectivity
radius; how the ground slopes there; whether it is kinematic; its strength; its body force,
which carries the water and follows the point into and out of it: the vertical part and, if wanted,
the horizontal one; if wanted, how much soil lies above it and how this changes sideways, which
drives a slope. An edge: where the sender is
from the receiver, in radii, and how far. Every feature is differentiable with respect to positions,
material properties and water level.
"""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor

from gns.network.graph import Graph
from gns.network.splines import spline_weights
from gns.network.units import ScaledScene

StrengthFeature = Literal["log", "linear"]

EDGE_FEATURES = 3
STRENGTH_FLOOR = 0.05
"""Cohesion [rho g d] from which on the feature `log` grows with the logarithm: those of interest
span 0.02 to 7, and a runout goes with the ratio of strengths rather than with their difference."""
OVERBURDEN_CELL = 2.0
"""Of the grid on which the overburden is summed [spacings]."""
OVERBURDEN_FEATURES = 4
FAR = 2000.0
"""How far the ground goes on level beyond its ends, in spacings."""
TINY = 1e-12
"""Keeps the slope of a square root finite."""


DENSITY, DENSITY_SPREAD = 1.8, 0.2
"""What the feature `density` is counted from and divided by [density of water]."""
STIFFNESS = 1000.0
"""The feature `stiffness` is the logarithm of Young's modulus over this [rho g d]."""


def point_feature_names(
    history: int,
    *,
    overburden: bool = False,
    thrust: bool = False,
    density: bool = False,
    stiffness: bool = False,
) -> list[str]:
    """Features of a point for windows of `history` frames, in the order of `point_features`."""
    names = [f"velocity {step} {axis}" for step in range(history - 1) for axis in "xy"]
    names += ["above", "slope", "left", "right", "kinematic", "friction", "cohesion", "factor"]
    names += ["thrust"] * thrust + ["density"] * density + ["stiffness"] * stiffness
    if overburden:
        names += [f"overburden {number}" for number in range(OVERBURDEN_FEATURES)]
    return names


def point_features(
    window: Tensor,
    scene: ScaledScene,
    *,
    radius: float,
    velocity_mean: Tensor,
    velocity_std: Tensor,
    strength: StrengthFeature = "log",
    overburden: bool = False,
    thrust: bool = False,
    density: bool = False,
    stiffness: bool = False,
) -> Tensor:
    """Features of the points.

    Args:
        window: (history, N, 2) positions [spacings], the last is now.
        scene: the scene.
        radius: connectivity radius [spacings], up to which distances are given.
        velocity_mean: (2,) of moving points [sqrt(g d)].
        velocity_std: (2,) likewise.
        strength: how cohesion is given: c itself, or log(1 + c / STRENGTH_FLOOR).
        overburden: include features of the soil above (`overburden_features`).
        thrust: include the horizontal force of the water.
        density: include the density.
        stiffness: include Young's modulus.

    Returns:
        (N, features), `point_feature_names`.
    """
    now = window[-1]
    velocities = window.diff(dim=0) / scene.frame_interval
    velocities = ((velocities - velocity_mean) / velocity_std).transpose(0, 1).flatten(1)
    distance, slope = ground_distance(now, scene.ground)
    above = (distance / radius).clamp(-1.0, 1.0)
    closeness = 1.0 - above.abs()
    left = ((now[:, 0] - scene.low[0]) / radius).clamp(-1.0, 1.0)
    right = ((scene.high[0] - now[:, 0]) / radius).clamp(-1.0, 1.0)
    cohesion = scene.cohesion
    if strength == "log":
        cohesion = torch.log1p(cohesion / STRENGTH_FLOOR)
    push, weight = body_force(now, scene).unbind(1)
    factor = -weight
    others = [
        above,
        closeness * slope,
        left,
        right,
        scene.kinematic.to(now.dtype),
        scene.friction,
        cohesion,
        factor,
    ]
    if thrust:
        others.append(push)
    if density:
        others.append((scene.density - DENSITY) / DENSITY_SPREAD)
    if stiffness:
        others.append(torch.full_like(push, math.log(scene.stiffness / STIFFNESS)))
    features = [velocities, torch.stack(others, dim=1)]
    if overburden:
        features.append(overburden_features(now, scene.density, factor))
    return torch.cat(features, dim=1)


def overburden_features(positions: Tensor, density: Tensor, factor: Tensor) -> Tensor:
    """Soil above a point, from sums over a grid; smooth in the positions.

    With V the weight of the soil above the point (under water: what the water leaves of it) and H
    that of its whole column, in units of a spacing of the point's own soil: log(1 + V), log(1 + H),
    and their slopes dV/dx and dH/dx, drawn into -1 to 1.

    Args:
        positions: (N, 2) [spacings].
        density: (N,) in any unit.
        factor: weight under water over weight in air, (N,).

    Returns:
        (N, OVERBURDEN_FEATURES).
    """
    nodes, weights, (columns, rows) = spline_weights(positions / OVERBURDEN_CELL)
    load = weights * (density * factor)[:, None]
    field = load.new_zeros(columns * rows).index_add(0, nodes.flatten(), load.flatten())
    field = field.reshape(rows, columns) / OVERBURDEN_CELL
    whole = field.sum(0)
    above = whole - field.cumsum(0) + 0.5 * field
    levels = torch.stack([above, whole.expand_as(above)])
    padded = torch.nn.functional.pad(levels, (1, 1))
    slopes = (padded[..., 2:] - padded[..., :-2]) / (2.0 * OVERBURDEN_CELL)
    at_nodes = torch.cat([levels, slopes]).flatten(1).t()
    values = (at_nodes[nodes] * weights[:, :, None]).sum(1) / density[:, None]
    level, slope = values[:, :2], values[:, 2:]
    return torch.cat([torch.log1p(level), slope / (1.0 + slope.square()).sqrt()], dim=1)


def edge_features(positions: Tensor, graph: Graph, radius: float) -> Tensor:
    """(E, 3): (sender - receiver) / radius, and its length.

    Args:
        positions: (N, 2) [spacings].
        graph: the edges.
        radius: connectivity radius [spacings].
    """
    apart = (positions[graph.senders] - positions[graph.receivers]) / radius
    length = (apart.square().sum(1, keepdim=True) + TINY).sqrt()
    return torch.cat([apart, length], dim=1)


def fading_of(features: Tensor) -> Tensor:
    """Smooth cut-off: 1 up to three quarters of the radius, from there to 0 at the radius, (E, 1).

    Args:
        features: of the edges, (E, 3).
    """
    beyond = (4.0 * features[:, 2:] - 3.0).clamp(0.0, 1.0)
    return 1.0 - beyond.square() * (3.0 - 2.0 * beyond)


def body_force(positions: Tensor, scene: ScaledScene) -> Tensor:
    """Weight and force of the water per mass, over g, (N, 2), as `SceneFacts.body_force`."""
    none = torch.zeros_like(scene.density)
    if len(scene.phreatic_line) == 0:
        return torch.stack([none, none - 1.0], dim=1)
    x = positions[:, 0]

    def head(x: Tensor) -> Tensor:
        level = height_on_line(x, scene.phreatic_line)
        change = scene.head_change
        return level if change is None else level + height_on_line(x, change)

    submerged = ((head(x) - positions[:, 1]) / scene.cell + 0.5).clamp(0.0, 1.0)
    lift, push = submerged / scene.density, none
    if scene.thrust:
        half = 0.5 * scene.cell
        push = lift * (head(x - half) - head(x + half)) / scene.cell
    return torch.stack([push, lift - 1.0], dim=1)


def height_on_line(x: Tensor, line: Tensor) -> Tensor:
    """Height (N,) of a polyline (P, 2), x ascending and level beyond its ends, at x (N,)."""
    if len(line) == 1:
        return line[0, 1].expand_as(x)
    ends = line.detach()[:, 0].contiguous()
    part = torch.searchsorted(ends, x.detach().contiguous()).clamp(1, len(line) - 1)
    first, second = line[part - 1], line[part]
    share = ((x - first[:, 0]) / (second[:, 0] - first[:, 0])).clamp(0.0, 1.0)
    return first[:, 1] + share * (second[:, 1] - first[:, 1])


def ground_distance(positions: Tensor, ground: Tensor) -> tuple[Tensor, Tensor]:
    """Distance from the ground, negative below it, and how the ground slopes at the nearest place.

    Args:
        positions: (N, 2) [spacings].
        ground: (P, 2) vertices.

    Returns:
        (N,) [spacings]; (N,) horizontal part of the ground's unit normal, positive where the ground
        falls to the right.
    """
    start, end, normal = _segments(ground)
    with torch.no_grad():
        squares = (positions[:, None] - _foot(positions[:, None], start, end)).square().sum(-1)
        nearest = squares.argmin(dim=1)
    apart = positions - _foot(positions, start[nearest], end[nearest])
    length = (apart.square().sum(1) + TINY).sqrt()
    below = positions.detach()[:, 1] < height_on_line(positions.detach()[:, 0], ground)
    return torch.where(below, -length, length), normal[nearest]


def _segments(ground: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Starts, ends (S, 2) and horizontal parts of the normals (S,), with level ends."""
    beyond = ground.new_tensor([[FAR, 0.0]])
    line = torch.cat([ground[:1] - beyond, ground, ground[-1:] + beyond])
    along = line.diff(dim=0)
    return line[:-1], line[1:], -along[:, 1] / along.norm(dim=1)


def _foot(positions: Tensor, start: Tensor, end: Tensor) -> Tensor:
    """The place on each segment that is nearest to each position, (..., 2)."""
    along = end - start
    share = ((positions - start) * along).sum(-1) / along.square().sum(-1)
    return start + share.clamp(0.0, 1.0)[..., None] * along
