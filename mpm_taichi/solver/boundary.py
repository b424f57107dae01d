"""Surroundings of the soil as the grid nodes see them: ground, walls, fixed bodies, water.

`node_tables` works out, once per scene, a type, a contact normal and a water force for every node;
`contact` is the velocity condition the kernels apply at the nodes of each type.

The floor acts on the velocity of a node before the points take it over, so that its impulse
reaches the points (zeroing the acceleration alone would leave them their speed).

Ground on a line of nodes acts at its own nodes. Where it crosses the cells, no node lies on it: if
those below it alone kept the soil out, the soil would sink to them, up to a cell below the ground,
and run farther the deeper it sinks. There the nodes of a column whose splines touch the ground act
together: the ground acts on the mean velocity of the soil along it, sum(a v) with the nodes' shares
a of its area, and its impulse reaches each node in proportion to a (a Lagrange multiplier per
column, lumped).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import taichi as ti

from geometry.scenes.scene import Ground
from geometry.sides import SIDES
from mpm_taichi.layout import (
    AREA,
    COEFFICIENT,
    NORMAL_X,
    NORMAL_Y,
    PER_COVER,
    ROWS,
    WATER_X,
    WATER_Y,
    vec2,
)
from mpm_taichi.solver.splines import BASE_EDGE, EDGES, LEFT_EDGE, RIGHT_EDGE, weights_of_points
from mpm_taichi.solver.water import head_places, level_and_fall, water_force

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene

STICK, SLIDE, LEFT, RIGHT, TOP, ROUGH, TRACTION, NEAR = 1, 2, 4, 8, 16, 32, 64, 128
"""Bits of a node's type: bonded ground or fixed body; Coulomb ground; walls; lid; rough ground;
share of the traction of rough ground; rough ground or water within reach of points at this node.
The bits of `splines` follow: boundaries at which the splines end."""

WALLS = LEFT | RIGHT
RESISTING = ROUGH | TRACTION
"""Ground whose traction is the strength of the soil next to it."""
BARRING = SLIDE | ROUGH
"""Ground that soil cannot enter."""

COLUMN, LOWEST = 2048, 4096
"""Bits of a node's type, next to those of `splines`: one of the nodes of a column on which the
ground acts together, and the lowest of them."""
STEEPEST = 1.0
"""Slope of the ground up to which the nodes of a column act together; at a steeper face they act
one by one."""

CONTACT = {"no_slip": STICK, "coulomb": SLIDE, "rough": ROUGH}
"""Bit of each contact of the ground."""

FULL_CONTACT = 0.5
"""Share of soil around a node of the base at which the base counts as fully covered."""

MARGIN = 3
"""Rows of nodes beyond the domain on every side, all of them wall: no point can pass three."""


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
    """The grid of a scene: lines of nodes at the height it counts from and on the left wall."""
    cell = scene.cell_size
    below = np.ceil(round((scene.lattice_y - scene.ground.lowest) / cell, 6))
    low = scene.lattice_y - max(below, 0.0) * cell
    across = int(np.ceil(round(scene.domain.width / cell, 6)))
    upward = int(np.ceil(round((scene.domain.y_max - low) / cell, 6)))
    return Grid(
        origin=(scene.domain.x_min - MARGIN * cell, low - MARGIN * cell),
        cell=cell,
        shape=(across + 2 * MARGIN + 1, upward + 2 * MARGIN + 1),
    )


def node_tables(
    scene: Scene, grid: Grid, *, wall_contact: str, water: str, water_face: str, gravity: float
) -> tuple[np.ndarray, np.ndarray]:
    """Types and contact data of all nodes of a scene.

    Args:
        scene: the scene.
        grid: its grid.
        wall_contact: "smooth" or "no_slip" side walls; a far boundary is smooth.
        water: "buoyant" (weight reduced below the phreatic line) or "pore_pressure" (its slope
            pushes as well: - grad u with u hydrostatic below the line).
        water_face: "fixed", or "moving": water may come to wherever the pool's level reaches.
        gravity: [m/s2].

    Returns:
        kind: (nodes,) int32, the bits above.
        surroundings: (nodes, 8) float32, `layout.NodeState.surroundings`.
    """
    x, y = grid.coordinates()
    kind = np.zeros(grid.shape, np.int32)
    surroundings = np.zeros((*grid.shape, 8), np.float32)
    tolerance = 1e-6 * grid.cell

    below = y <= scene.ground.height(x) + tolerance
    kind[below] |= CONTACT[scene.ground.contact]
    normal = ground_normal(scene, x)
    surroundings[..., NORMAL_X], surroundings[..., NORMAL_Y] = normal[..., 0], normal[..., 1]
    surroundings[..., COEFFICIENT] = scene.ground.friction_coefficient or 0.0
    edges = edge_bits(scene.ground, grid)
    kind |= edges
    area, volume = ground_shares(scene.ground, grid)
    rows = rows_of_columns(scene, grid, area, edges)
    together = column_nodes(rows)
    kind[together] = CONTACT[scene.ground.contact] | COLUMN | edges[together]
    kind[rows > 0] |= LOWEST
    surroundings[..., ROWS] = rows
    if scene.ground.contact == "rough":
        kind[area > 0] |= TRACTION
    touched = (kind & (TRACTION | COLUMN)) > 0
    surroundings[..., AREA] = np.where(touched, area, 0.0)
    surroundings[..., PER_COVER] = np.where(
        touched, 1.0 / np.maximum(FULL_CONTACT * volume, tolerance), 0
    )

    # An open domain is enlarged before anything comes near, so its grid has the same three rows.
    last_x, last_y = grid.shape[0] - 1 - MARGIN, grid.shape[1] - 1 - MARGIN
    if wall_contact == "no_slip":
        for side, wall in zip(SIDES, (kind[: MARGIN + 1], kind[last_x:]), strict=True):
            if not scene.domain.goes_on(side):
                wall &= ~COLUMN
                wall |= STICK
    kind[: MARGIN + 1] |= LEFT
    kind[last_x:] |= RIGHT
    kind[:, last_y:] |= TOP

    wet = np.zeros(grid.shape, bool)
    if scene.has_water:
        head = scene.phreatic_level(head_places(x[:, 0], grid.cell))
        level, fall = level_and_fall(head, grid.cell)
        surroundings[..., WATER_X], surroundings[..., WATER_Y] = water_force(
            level, fall if water == "pore_pressure" else 0.0, y, grid.cell, gravity
        )
        highest = level if water_face == "fixed" else np.maximum(level, scene.water_level)
        wet = y < highest + 0.5 * grid.cell
    kind[beside((kind & (TRACTION | ROUGH | COLUMN) > 0) | wet)] |= NEAR
    return kind.ravel(), surroundings.reshape(-1, 8)


def edge_bits(ground: Ground, grid: Grid) -> np.ndarray:
    """Bits of the nodes on level ground that lies on a line of nodes, and on the side walls.

    Ground is level at a node where it is over 1.5 cells to both sides, the reach of its points.

    Returns:
        (grid.shape) int32.
    """
    x, y = grid.coordinates()
    height = ground.height(x)
    near = [ground.height(x + k * grid.cell) for k in (-1.5, -1.0, 1.0, 1.5)]
    level = np.max([np.abs(other - height) for other in near], axis=0) < 1e-6 * grid.cell
    bits = np.where(level & (np.abs(y - height) < 1e-4 * grid.cell), BASE_EDGE, 0)
    bits[MARGIN] |= LEFT_EDGE
    bits[grid.shape[0] - 1 - MARGIN] |= RIGHT_EDGE
    return bits.astype(np.int32)


def ground_shares(ground: Ground, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Area of the ground and volume above it that belong to each node, both of `grid.shape`.

    The integrals of the splines over the ground line [m2 per m] and over the space above it [m2],
    from wall to wall: a traction t on the ground loads a node with t x area, wherever the line lies
    in the cell. Read only.
    """
    return _shares(tuple(ground.points), grid)


@lru_cache(maxsize=32)  # a back-analysis lays the same grid on the same ground a hundred times
def _shares(line: tuple[tuple[float, float], ...], grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    ground = Ground(points=list(line))
    fine = grid.cell / 8
    left = grid.origin[0] + MARGIN * grid.cell
    right = grid.origin[0] + (grid.shape[0] - 1 - MARGIN) * grid.cell
    x = np.arange(left + 0.5 * fine, right, fine)
    ends = ground.height(np.stack([x - 0.5 * fine, x + 0.5 * fine]))
    length = np.hypot(fine, ends[1] - ends[0])
    base = ends.mean(axis=0)
    edges = edge_bits(ground, grid)
    area = node_weight(grid, np.stack([x, base], axis=1), length, edges)
    heights = fine * (np.arange(0.5, 8 * 3))
    space = np.stack([np.repeat(x, len(heights)), (base[:, None] + heights[None]).ravel()], axis=1)
    volume = node_weight(grid, space, np.full(len(space), fine**2), edges)
    area[area < 1e-6 * grid.cell] = 0.0
    area.flags.writeable = volume.flags.writeable = False
    return area, volume


def rows_of_columns(scene: Scene, grid: Grid, area: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Number of nodes on which the ground acts together, at the lowest of each column, else 0.

    A column has none where the ground lies on its own nodes or is steeper than `STEEPEST`.

    Args:
        scene: the scene.
        grid: its grid.
        area: `ground_shares`.
        edges: `edge_bits`.

    Returns:
        (grid.shape) int32.
    """
    x, _ = grid.coordinates()
    reach = 1.5 * grid.cell
    heights = scene.ground.height(x[:, 0] + np.linspace(-reach, reach, 13)[:, None])
    gentle = np.abs(np.diff(heights, axis=0)).max(axis=0) <= STEEPEST * reach / 6
    crossed = gentle & ~((edges & BASE_EDGE) > 0).any(axis=1)
    touched = (area > 0) & crossed[:, None]
    rows = np.zeros(grid.shape, np.int32)
    some = touched.any(axis=1)
    rows[some, touched.argmax(axis=1)[some]] = touched.sum(axis=1)[some]
    return rows


def column_nodes(rows: np.ndarray) -> np.ndarray:
    """Nodes of the columns that `rows_of_columns` counts, same shape, bool."""
    lowest = np.maximum.accumulate(np.where(rows > 0, np.arange(rows.shape[1]), -1), axis=1)
    return (lowest >= 0) & (np.arange(rows.shape[1]) < lowest + rows.max(axis=1, keepdims=True))


def beside(chosen: np.ndarray) -> np.ndarray:
    """Nodes that are chosen or have a chosen node among their eight neighbours, same shape."""
    padded = np.pad(chosen, 1)
    across, upward = chosen.shape
    return np.logical_or.reduce(
        [padded[i : i + across, j : j + upward] for i in range(3) for j in range(3)]
    )


def ground_normal(scene: Scene, x: np.ndarray) -> np.ndarray:
    """Unit normal of the ground below `x`, pointing up, shape (*x.shape, 2)."""
    line = np.asarray(scene.ground.points, dtype=float)
    slopes = np.diff(line[:, 1]) / np.diff(line[:, 0])
    padded = np.concatenate([[0.0], slopes, [0.0]])
    slope = padded[np.searchsorted(line[:, 0], x, side="right")]
    length = np.sqrt(1.0 + slope**2)
    return np.stack([-slope / length, 1.0 / length], axis=-1)


def fixed_by_bodies(
    grid: Grid, soil: np.ndarray, fixed: np.ndarray, kind: np.ndarray
) -> np.ndarray:
    """Nodes held by kinematic points: those with more B-spline weight of fixed than of soil points.

    Args:
        grid: the grid.
        soil: (N, 2) positions of moving points [m].
        fixed: (K, 2) positions of kinematic points [m].
        kind: (nodes,) types of the nodes.

    Returns:
        (nodes,) bool.
    """
    if len(fixed) == 0:
        return np.zeros(grid.nodes, bool)
    edges = kind.reshape(grid.shape) & EDGES
    held = node_weight(grid, fixed, np.ones(len(fixed)), edges)
    return (held > node_weight(grid, soil, np.ones(len(soil)), edges)).ravel()


def node_weight(
    grid: Grid, points: np.ndarray, amount: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Sum of `amount` (N,) x spline of `points` (N, 2) [m] at each node, shape `grid.shape`.

    `edges` are the nodes' `edge_bits`.
    """
    total = np.zeros(grid.shape)
    scaled = (points - np.asarray(grid.origin)) / grid.cell
    scaled = np.clip(scaled, 1.0, np.asarray(grid.shape) - 2.0)
    centre = np.floor(scaled + 0.5).astype(int)
    offset = scaled - centre
    home = edges[centre[:, 0], centre[:, 1]]
    left, right, base = (home & bit > 0 for bit in (LEFT_EDGE, RIGHT_EDGE, BASE_EDGE))
    across = weights_of_points(offset[:, 0], left, right)
    upward = weights_of_points(offset[:, 1], base, np.zeros(len(home), bool))
    for i in range(3):
        for j in range(3):
            share = amount * across[i] * upward[j]
            np.add.at(total, (centre[:, 0] + i - 1, centre[:, 1] + j - 1), share)
    return total


@ti.func
def contact(velocity, kind, surroundings, friction, adhesion):
    """Velocity of a node after ground and walls have acted on it [m/s].

    Args:
        velocity: without contact [m/s].
        kind: the bits of the node.
        surroundings: the row of the node.
        friction: Coulomb coefficient of the ground, of rough ground sin(phi) of the soil.
        adhesion: most the traction of rough ground changes the velocity in this step [m/s].

    Contact is unilateral: soil may leave a ground or a wall, never enter it; only bonded ground
    ("no_slip") holds it. The tangential impulse is at most friction x the normal one + adhesion.
    """
    v = velocity
    if kind & STICK:
        v = vec2(0.0, 0.0)
    elif kind & (BARRING | RESISTING):
        normal_x, normal_y = surroundings[NORMAL_X], surroundings[NORMAL_Y]
        out = v[0] * normal_x + v[1] * normal_y
        along = v[1] * normal_x - v[0] * normal_y
        limit = adhesion
        if kind & BARRING:
            limit -= friction * ti.min(out, 0.0)
            out = ti.max(out, 0.0)
        slowed = ti.max(ti.abs(along) - limit, 0.0)
        along = ti.select(along > 0.0, slowed, -slowed)
        v = vec2(out * normal_x - along * normal_y, out * normal_y + along * normal_x)
    if kind & LEFT:
        v[0] = ti.max(v[0], 0.0)
    if kind & RIGHT:
        v[0] = ti.min(v[0], 0.0)
    if kind & TOP:
        v[1] = ti.min(v[1], 0.0)
    return v
