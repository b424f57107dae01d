"""What the grid nodes know of the world around the soil: ground, walls, fixed bodies, water.

`node_tables` works out, once per scene, a type, a contact normal and a water force for every node;
`contact` is the velocity condition the kernels apply at the nodes of each type.

The floor acts on the velocity of a node before the points take it over, so that its impulse
reaches the points (zeroing the acceleration alone would leave them their speed).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import taichi as ti

if TYPE_CHECKING:
    from geometry.scene import Scene

vec2 = ti.types.vector(2, ti.f32)

STICK, SLIDE, LEFT, RIGHT, TOP = 1, 2, 4, 8, 16
"""Bits of a node's type: no-slip ground or fixed body; Coulomb ground; walls; lid."""

MARGIN = 3
"""Rows of nodes beyond the domain on every side, all of them wall: no point can pass three."""

WATER_DENSITY = 1000.0
"""Density of fresh water [kg/m3]."""


@dataclass(frozen=True)
class Grid:
    """A regular grid. Node (i, j) lies at origin + (i, j) cell; j runs fastest in memory."""

    origin: tuple[float, float]  # m
    cell: float  # m
    shape: tuple[int, int]  # nodes along x, along y

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return self.shape[0] * self.shape[1]

    def coordinates(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates [m] of all nodes, each of shape `self.shape`."""
        x = self.origin[0] + self.cell * np.arange(self.shape[0])
        y = self.origin[1] + self.cell * np.arange(self.shape[1])
        return np.meshgrid(x, y, indexing="ij")


def make_grid(scene: Scene) -> Grid:
    """The grid of a scene: a line of nodes on the lowest ground and on the left wall."""
    cell = scene.cell_size
    low = scene.ground.lowest
    across = int(np.ceil(round(scene.domain.width / cell, 6)))
    upward = int(np.ceil(round((scene.domain.y_max - low) / cell, 6)))
    return Grid(
        origin=(scene.domain.x_min - MARGIN * cell, low - MARGIN * cell),
        cell=cell,
        shape=(across + 2 * MARGIN + 1, upward + 2 * MARGIN + 1),
    )


def node_tables(
    scene: Scene, grid: Grid, *, wall_contact: str, water: str, gravity: float
) -> tuple[np.ndarray, np.ndarray]:
    """Types and contact data of all nodes of a scene.

    Args:
        scene: the scene.
        grid: its grid.
        wall_contact: "smooth" or "no_slip" side walls.
        water: "buoyant" (weight reduced below the phreatic line) or "pore_pressure" (its slope
            pushes as well: - grad u with u hydrostatic below the line).
        gravity: [m/s2].

    Returns:
        kind: (nodes,) int32, the bits above.
        contact: (nodes, 8) float32: normal x, y (out of the ground), Coulomb coefficient, 0;
            water force per volume x, y [N/m3], 0, 0.
    """
    x, y = grid.coordinates()
    kind = np.zeros(grid.shape, np.int32)
    table = np.zeros((*grid.shape, 8), np.float32)
    tolerance = 1e-6 * grid.cell

    below = y <= scene.ground.height(x) + tolerance
    kind[below] |= STICK if scene.ground.contact == "no_slip" else SLIDE
    normal = ground_normal(scene, x)
    table[..., 0], table[..., 1] = normal[..., 0], normal[..., 1]
    table[..., 2] = scene.ground.friction_coefficient or 0.0

    # An open domain is enlarged before anything comes near, so its grid has the same three rows.
    last_x, last_y = grid.shape[0] - 1 - MARGIN, grid.shape[1] - 1 - MARGIN
    if wall_contact == "no_slip":
        kind[: MARGIN + 1] |= STICK
        kind[last_x:] |= STICK
    kind[: MARGIN + 1] |= LEFT
    kind[last_x:] |= RIGHT
    kind[:, last_y:] |= TOP

    table[..., 4], table[..., 5] = water_force(scene, x, y, grid.cell, water, gravity)
    return kind.ravel(), table.reshape(-1, 8)


def ground_normal(scene: Scene, x: np.ndarray) -> np.ndarray:
    """Unit normal of the ground below `x`, pointing up, shape (*x.shape, 2)."""
    line = np.asarray(scene.ground.points, dtype=float)
    slopes = np.diff(line[:, 1]) / np.diff(line[:, 0])
    padded = np.concatenate([[0.0], slopes, [0.0]])
    slope = padded[np.searchsorted(line[:, 0], x, side="right")]
    length = np.sqrt(1.0 + slope**2)
    return np.stack([-slope / length, 1.0 / length], axis=-1)


def water_force(
    scene: Scene, x: np.ndarray, y: np.ndarray, cell: float, water: str, gravity: float
) -> tuple[np.ndarray, np.ndarray]:
    """Force of still water on soil per unit volume [N/m3], x and y, at nodes (x, y).

    Below the phreatic line h(x) the pore pressure is u = rho_w g (h - y). Its gradient carries the
    submerged weight (both forms) and, where the line falls, the thrust of the pool (pore_pressure
    only). The force sets in over one cell, so that it depends smoothly on the level.
    """
    if not scene.has_water:
        return np.zeros_like(x), np.zeros_like(x)
    level = scene.phreatic_level(x)
    submerged = np.clip((level - y) / cell + 0.5, 0.0, 1.0)
    unit = WATER_DENSITY * gravity * submerged
    if water == "buoyant":
        return np.zeros_like(x), unit
    fall = (scene.phreatic_level(x - 0.5 * cell) - scene.phreatic_level(x + 0.5 * cell)) / cell
    return unit * fall, unit


def fixed_by_bodies(grid: Grid, soil: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Nodes held by kinematic points: those with more B-spline weight of fixed than of soil points.

    Args:
        grid: the grid.
        soil: (N, 2) positions of moving points [m].
        fixed: (K, 2) positions of kinematic points [m].

    Returns:
        (nodes,) bool.
    """
    if len(fixed) == 0:
        return np.zeros(grid.nodes, bool)
    return (node_weight(grid, fixed) > node_weight(grid, soil)).ravel()


def node_weight(grid: Grid, points: np.ndarray) -> np.ndarray:
    """Sum of the quadratic B-spline weights of `points` (N, 2) [m] at each node, `grid.shape`."""
    total = np.zeros(grid.shape)
    scaled = (points - np.asarray(grid.origin)) / grid.cell
    centre = np.floor(scaled + 0.5).astype(int)
    offset = scaled - centre
    weights = [0.5 * (0.5 - offset) ** 2, 0.75 - offset**2, 0.5 * (0.5 + offset) ** 2]
    for i in range(3):
        for j in range(3):
            share = weights[i][:, 0] * weights[j][:, 1]
            np.add.at(total, (centre[:, 0] + i - 1, centre[:, 1] + j - 1), share)
    return total


@ti.func
def contact(velocity, kind, normal_x, normal_y, friction):
    """Velocity of a node after ground and walls have acted on it [m/s].

    Contact is unilateral: soil may leave a Coulomb ground or a wall, never enter it.
    """
    v = velocity
    if kind & 1:
        v = vec2(0.0, 0.0)
    else:
        if kind & 2:
            into = v[0] * normal_x + v[1] * normal_y
            if into < 0.0:
                along = v[1] * normal_x - v[0] * normal_y
                # Coulomb: the tangential impulse is at most friction x the normal one.
                slowed = ti.max(ti.abs(along) + friction * into, 0.0)
                along = ti.select(along > 0.0, slowed, -slowed)
                v = vec2(-normal_y * along, normal_x * along)
        if kind & 4:
            v[0] = ti.max(v[0], 0.0)
        if kind & 8:
            v[0] = ti.min(v[0], 0.0)
        if kind & 16:
            v[1] = ti.min(v[1], 0.0)
    return v
