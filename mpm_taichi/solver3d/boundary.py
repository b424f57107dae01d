"""Ground, walls, flanks and water as the nodes of a three-dimensional grid see them.

As in `solver.boundary`: level ground on a plane of nodes acts at its own nodes; where the ground
crosses the cells, the nodes of a column whose splines touch it act together; a face steeper than 45
degrees acts node by node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import taichi as ti

from mpm_taichi.solver.boundary import (
    BARRING,
    COLUMN,
    FULL_CONTACT,
    LEFT,
    LOWEST,
    MARGIN,
    NEAR,
    RESISTING,
    RIGHT,
    ROUGH,
    SLIDE,
    STEEPEST,
    STICK,
    TOP,
    TRACTION,
)
from mpm_taichi.solver.splines import BASE_EDGE, LEFT_EDGE, RIGHT_EDGE, weights_of_points
from mpm_taichi.solver.water import water_force
from mpm_taichi.solver3d.layout import (
    AREA,
    COEFFICIENT,
    FLANK_AREA,
    NORMAL,
    PER_COVER,
    ROWS,
    vec2,
    vec3,
)
from mpm_taichi.solver3d.problem import Problem3d
from mpm_taichi.solver3d.transfer import FAR_EDGE, NEAR_EDGE

ROUGH_FLANK, STICK_FLANK = 1 << 15, 1 << 16
"""Bits of a node's type: flank with the soil's own strength, bonded flank."""

NEAR_FLANK, FAR_FLANK = 1 << 17, 1 << 18
"""Bits of a node's type: on or behind the flank at y_min, at y_max."""

CONTACT = {"no_slip": STICK, "coulomb": SLIDE, "slip": SLIDE, "rough": ROUGH}

SAMPLES = 4
"""Places along the edge of a cell at which the area of the ground is summed."""

EDGE_VOLUME = 13.0 / 24.0
"""Volume [cells] of the node at which splines end."""


@dataclass(frozen=True)
class Grid3d:
    """Node (i, j, k) lies at origin + (i, j, k) cell; numbered with z fastest."""

    origin: tuple[float, float, float]  # m
    cell: float  # m
    shape: tuple[int, int, int]

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return int(np.prod(self.shape))

    def axis(self, number: int) -> np.ndarray:
        """Coordinates [m] of the nodes along an axis."""
        return self.origin[number] + self.cell * np.arange(self.shape[number])

    def plan(self) -> tuple[np.ndarray, np.ndarray]:
        """X and y [m] of the columns of nodes, each (nx, ny)."""
        return np.meshgrid(self.axis(0), self.axis(1), indexing="ij")


def make_grid(problem: Problem3d) -> Grid3d:
    """The grid of a problem: planes of nodes on its lowest ground, at x_min and at y_min."""
    cell = problem.cells_per_spacing * problem.spacing
    x_min, x_max, y_min, y_max, z_max = problem.domain
    x, y = np.meshgrid(
        np.arange(x_min, x_max + cell, cell), np.arange(y_min, y_max + cell, cell), indexing="ij"
    )
    inside = problem.base.at(np.clip(x, x_min, x_max), np.clip(y, y_min, y_max))
    low = float(np.min(inside))
    counts = [
        int(np.ceil(round(width / cell, 6))) + 2 * MARGIN + 1
        for width in (x_max - x_min, y_max - y_min, z_max - low)
    ]
    return Grid3d(
        (x_min - MARGIN * cell, y_min - MARGIN * cell, low - MARGIN * cell), cell, tuple(counts)
    )


def node_tables(
    problem: Problem3d, grid: Grid3d, gravity: float, *, seepage: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Types (nodes,) int32, surroundings (nodes, 8) and water (nodes, 4) of all nodes.

    Args:
        problem: the problem.
        grid: its grid.
        gravity: [m/s2].
        seepage: the slope of the water level pushes, too.
    """
    x, y = grid.plan()
    z = grid.axis(2)
    height = problem.base.at(x, y)
    kind = np.zeros(grid.shape, np.int32)
    surroundings = np.zeros((*grid.shape, 8), np.float32)
    tolerance = 1e-6 * grid.cell
    bit = CONTACT[problem.contact]
    kind[z <= height[..., None] + tolerance] |= bit
    surroundings[..., NORMAL : NORMAL + 3] = ground_normal(problem, grid)[:, :, None]
    surroundings[..., COEFFICIENT] = problem.friction_coefficient
    edges, gentle = edge_bits(problem, grid)
    kind |= edges
    area, volume = ground_shares(problem, grid, edges)
    crossed = gentle & ~((edges & BASE_EDGE) > 0).any(axis=2)
    together = (area > 0) & crossed[..., None]
    kind[together] = bit | COLUMN | edges[together]
    columns = together.any(axis=2)
    lowest = together.argmax(axis=2)
    i, j = np.nonzero(columns)
    kind[i, j, lowest[i, j]] |= LOWEST
    highest = together.shape[2] - together[:, :, ::-1].argmax(axis=2)
    surroundings[i, j, lowest[i, j], ROWS] = (highest - lowest)[i, j]
    if problem.contact == "rough":
        kind[area > 0] |= TRACTION
    touched = (kind & (TRACTION | COLUMN)) > 0
    surroundings[..., AREA] = np.where(touched, area, 0.0)
    surroundings[..., PER_COVER] = np.where(
        touched, 1.0 / np.maximum(FULL_CONTACT * volume, tolerance), 0.0
    )
    _lay_walls(problem, grid, kind, surroundings)
    water = np.zeros((*grid.shape, 4), np.float32)
    if problem.water is not None:
        level = problem.water.at(x, y)[..., None]
        _, upward = water_force(level, 0.0, z, grid.cell, gravity)
        water[..., 2] = upward
        if seepage:
            half = 0.5 * grid.cell
            for axis, (dx, dy) in enumerate(((half, 0.0), (0.0, half))):
                fall = problem.water.at(x - dx, y - dy) - problem.water.at(x + dx, y + dy)
                water[..., axis] = upward * (fall / grid.cell)[..., None]
    chosen = kind & (TRACTION | ROUGH | COLUMN | ROUGH_FLANK) > 0
    kind[beside(chosen)] |= NEAR
    return kind.ravel(), surroundings.reshape(-1, 8), water.reshape(-1, 4)


def _lay_walls(
    problem: Problem3d, grid: Grid3d, kind: np.ndarray, surroundings: np.ndarray
) -> None:
    """Walls across the section, flanks along it, the lid."""
    last = [count - 1 - MARGIN for count in grid.shape]
    kind[: MARGIN + 1] |= LEFT
    kind[last[0] :] |= RIGHT
    kind[:, :, last[2] :] |= TOP
    flank = {"smooth": 0, "rough": ROUGH_FLANK, "no_slip": STICK_FLANK}[problem.flanks]
    kind[:, : MARGIN + 1] |= NEAR_FLANK | flank
    kind[:, last[1] :] |= FAR_FLANK | flank
    for row in (MARGIN, last[1]):
        surroundings[:, row, :, FLANK_AREA] = grid.cell**2


def edge_bits(problem: Problem3d, grid: Grid3d) -> tuple[np.ndarray, np.ndarray]:
    """Bits of the nodes at which splines end (grid.shape), and columns of gentle ground (nx, ny).

    Ground is level at a node where it is over 1.5 cells to all sides, the reach of its points.
    """
    x, y = grid.plan()
    reach = 1.5 * grid.cell
    steps = np.linspace(-reach, reach, 7)
    around = np.array([[problem.base.at(x + dx, y + dy) for dy in steps] for dx in steps])
    height = around[3, 3]
    level = np.abs(around - height).max(axis=(0, 1)) < 1e-6 * grid.cell
    rise = STEEPEST * reach / 3 * (1.0 + 1e-9)
    gentle = np.abs(np.diff(around, axis=0)).max(axis=(0, 1)) <= rise
    gentle &= np.abs(np.diff(around, axis=1)).max(axis=(0, 1)) <= rise
    on = np.abs(grid.axis(2) - height[..., None]) < 1e-4 * grid.cell
    bits = np.where(level[..., None] & on, BASE_EDGE, 0)
    bits[MARGIN] |= LEFT_EDGE
    bits[grid.shape[0] - 1 - MARGIN] |= RIGHT_EDGE
    bits[:, MARGIN] |= NEAR_EDGE
    bits[:, grid.shape[1] - 1 - MARGIN] |= FAR_EDGE
    return bits.astype(np.int32), gentle


def ground_shares(
    problem: Problem3d, grid: Grid3d, edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Area of the ground [m2] and volume above it [m3] of each node, both (grid.shape).

    Integrals of the splines over the ground, and over the space above it, from wall to wall.
    """
    fine = grid.cell / SAMPLES
    places = [
        grid.origin[axis]
        + grid.cell * MARGIN
        + fine * (np.arange(SAMPLES * (grid.shape[axis] - 1 - 2 * MARGIN)) + 0.5)
        for axis in (0, 1)
    ]
    x, y = (part.ravel() for part in np.meshgrid(*places, indexing="ij"))
    base, half = problem.base, 0.5 * fine
    slope_x = (base.at(x + half, y) - base.at(x - half, y)) / fine
    slope_y = (base.at(x, y + half) - base.at(x, y - half)) / fine
    z = base.at(x, y)
    area = node_weight(
        grid, np.stack([x, y, z], 1), fine**2 * np.sqrt(1 + slope_x**2 + slope_y**2), edges
    )
    area[area < 1e-6 * grid.cell**2] = 0.0
    volume = np.zeros(grid.shape)
    for up in fine * (np.arange(3 * SAMPLES) + 0.5):
        volume += node_weight(grid, np.stack([x, y, z + up], 1), np.full(len(x), fine**3), edges)
    return area, volume


def node_weight(
    grid: Grid3d, points: np.ndarray, amount: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Sum of `amount` (N,) x spline of `points` (N, 3) [m] at each node, shape `grid.shape`."""
    scaled = (points - np.asarray(grid.origin)) / grid.cell
    scaled = np.clip(scaled, 1.0, np.asarray(grid.shape) - 2.0)
    centre = np.floor(scaled + 0.5).astype(np.int64)
    offset = scaled - centre
    home = edges[centre[:, 0], centre[:, 1], centre[:, 2]]
    no = np.zeros(len(home), bool)
    bits = [(LEFT_EDGE, RIGHT_EDGE), (NEAR_EDGE, FAR_EDGE)]
    sides = [(home & low > 0, home & high > 0) for low, high in bits] + [(home & BASE_EDGE > 0, no)]
    weights = [weights_of_points(offset[:, a], *sides[a]) for a in range(3)]
    _, ny, nz = grid.shape
    first = (centre[:, 0] * ny + centre[:, 1]) * nz + centre[:, 2]
    total = np.zeros(grid.nodes)
    for i in range(3):
        for j in range(3):
            share = amount * weights[0][i] * weights[1][j]
            for k in range(3):
                node = first + ((i - 1) * ny + (j - 1)) * nz + (k - 1)
                total += np.bincount(node, weights=share * weights[2][k], minlength=grid.nodes)
    return total.reshape(grid.shape)


def ground_normal(problem: Problem3d, grid: Grid3d) -> np.ndarray:
    """Unit normal of the ground below the columns, pointing up, (nx, ny, 3)."""
    x, y = grid.plan()
    half = 0.5 * grid.cell
    base = problem.base
    slope_x = (base.at(x + half, y) - base.at(x - half, y)) / grid.cell
    slope_y = (base.at(x, y + half) - base.at(x, y - half)) / grid.cell
    normal = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def beside(chosen: np.ndarray) -> np.ndarray:
    """Nodes that are chosen or have a chosen node among their 26 neighbours, same shape."""
    for axis in range(3):
        ends = np.zeros_like(chosen.take([0], axis))
        before = np.concatenate([ends, np.delete(chosen, -1, axis)], axis)
        after = np.concatenate([np.delete(chosen, 0, axis), ends], axis)
        chosen = chosen | before | after
    return chosen


@ti.func
def slowed_along(velocity, normal, limit, barring):
    """Velocity after a plane has acted: kept out of it where it bars, slowed along it [m/s].

    `limit` is the most that friction and adhesion take away: (coefficient, adhesion in m/s).
    """
    out = velocity.dot(normal)
    along = velocity - out * normal
    most = limit[1]
    if barring != 0:
        most -= limit[0] * ti.min(out, 0.0)
        out = ti.max(out, 0.0)
    speed = along.norm()
    left = ti.max(speed - most, 0.0) / ti.max(speed, 1.0e-12)
    return left * along + out * normal


@ti.func
def contact(velocity, kind, surroundings, friction, adhesion, flank):
    """Velocity of a node after ground, walls and flanks have acted on it [m/s].

    Args:
        velocity: without contact [m/s].
        kind: bits of the node.
        surroundings: its row.
        friction: coefficient of the ground.
        adhesion: of the ground: most it changes the velocity by [m/s].
        flank: the same two of a rough flank, (2,).
    """
    v = velocity
    if kind & STICK:
        v = vec3(0.0)
    elif kind & (BARRING | RESISTING):
        normal = vec3(surroundings[NORMAL], surroundings[NORMAL + 1], surroundings[NORMAL + 2])
        v = slowed_along(v, normal, vec2(friction, adhesion), kind & BARRING)
    if kind & (NEAR_FLANK | FAR_FLANK):
        side = ti.select(kind & NEAR_FLANK, 1.0, -1.0)
        if kind & STICK_FLANK:
            v = vec3(0.0)
        elif kind & ROUGH_FLANK:
            v = slowed_along(v, vec3(0.0, side, 0.0), flank, 1)
        elif v[1] * side < 0.0:
            v[1] = 0.0
    if kind & LEFT:
        v[0] = ti.max(v[0], 0.0)
    if kind & RIGHT:
        v[0] = ti.min(v[0], 0.0)
    if kind & TOP:
        v[2] = ti.min(v[2], 0.0)
    return v
