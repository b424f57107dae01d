"""A three-dimensional problem made ready: points on the grid, tables, stress before settling."""

from __future__ import annotations

import numpy as np

from geometry.scenes.scene import Material
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB, material_constants
from mpm_taichi.solver.runtime import aligned
from mpm_taichi.solver.water import WATER_DENSITY
from mpm_taichi.solver3d import layout
from mpm_taichi.solver3d.boundary import Grid3d, make_grid, node_tables
from mpm_taichi.solver3d.kernels import BLOCK
from mpm_taichi.solver3d.problem import Problem3d
from pipeline.config import SimulationSettings


class Arrays3d:
    """The arrays of `layout.ARRAYS` of one problem, as attributes, and the blocks of its points."""

    def __init__(self, problem: Problem3d, settings: SimulationSettings) -> None:
        self.problem, self.settings = problem, settings
        self.grid: Grid3d = make_grid(problem)
        count, nodes = len(problem.position), self.grid.nodes
        nx, ny, _ = self.grid.shape
        blocks = 2 * -(-nx // (2 * BLOCK))  # a pair of even and odd ones
        rows = {layout.Points: count, layout.Nodes: nodes, layout.Tables: 1}
        for group, number in rows.items():
            for name, kind in group.__annotations__.items():
                width = getattr(kind.dtype, "n", 1)
                dtype = np.int32 if kind is layout.INDEX else np.float32
                shape = (number,) if width == 1 else (number, width)
                setattr(self, name, aligned(shape, dtype))
        self.column_sums = np.zeros((nx * ny, 2))
        self.block_sums = np.zeros((blocks, 4))
        self.block_reach = np.zeros(blocks, np.float32)
        self.first = np.zeros(blocks + 1, np.int32)
        gravity = settings.gravity_m_per_s2
        tables = node_tables(problem, self.grid, gravity, seepage=settings.water == "pore_pressure")
        self.kind[:], self.surroundings[:], self.water[:] = tables
        self._lay_materials()
        self._lay_points(gravity)
        self.label = np.arange(count)  # place in the problem of each point
        self.form_blocks()

    def _lay_materials(self) -> None:
        """Material rows; one more for a material that is saturated below the water level."""
        problem = self.problem
        rows: list[Material] = list(problem.materials)
        densities = [one.density for one in rows]
        row = problem.material.astype(np.int32).copy()
        wet = self._water_level() > problem.position[:, 2]
        for number, material in enumerate(problem.materials):
            soaked = wet & (problem.material == number)
            if material.saturated_density is not None and soaked.any():
                row[soaked] = len(rows)
                rows.append(material)
                densities.append(material.saturated_density)
        self.row[:] = self.laid_row = row
        self.materials = rows
        self.density = np.asarray(densities, np.float32)
        self.elastic = np.array(
            [
                elastic_constants(
                    youngs_modulus=one.youngs_modulus_pa, poisson_ratio=one.poisson_ratio
                )
                for one in rows
            ]
        )
        self.strength = np.array([MOHR_COULOMB.constants(one) for one in rows], np.float32)
        self.settle_strength = np.array(
            [MOHR_COULOMB.settling_constants(one) for one in rows], np.float32
        )
        poisson = np.array([one.poisson_ratio for one in rows])
        self.k0 = self.settings.k0 or poisson / (1.0 - poisson)
        stiffness = np.array([one.youngs_modulus_pa for one in rows]) * (1.0 - poisson)
        stiffness /= (1.0 + poisson) * (1.0 - 2.0 * poisson)
        self.wave_speed = float(np.sqrt(np.max(stiffness / np.asarray(densities))))

    def _water_level(self) -> np.ndarray:
        """Level of the water at the points [m], (N,); minus infinity without any."""
        problem = self.problem
        if problem.water is None:
            return np.full(len(problem.position), -np.inf)
        return problem.water.at(problem.position[:, 0], problem.position[:, 1])

    def _lay_points(self, gravity: float) -> None:
        problem, grid = self.problem, self.grid
        scaled = (problem.position - np.asarray(grid.origin)) / grid.cell
        centre = np.floor(scaled + 0.5).astype(np.int64)
        self.motion[:, :3] = scaled - centre
        _, ny, nz = grid.shape
        self.home[:] = (centre[:, 0] * ny + centre[:, 1]) * nz + centre[:, 2]
        self.volume[:] = problem.volume
        thrown = problem.velocity is not None
        if thrown:
            self.motion[:, 3:6] = problem.velocity
        self.settled = self.settings.initial_stress == "settled" and not thrown
        if self.settings.initial_stress != "gravity_on" and not thrown:
            vertical = self.k0_stress(gravity)
            lateral = np.broadcast_to(self.k0, self.density.shape)[self.row] * vertical
            self.stress[:, 0] = self.stress[:, 1] = lateral
            self.stress[:, 2] = vertical

    def k0_stress(self, gravity: float) -> np.ndarray:
        """Vertical effective stress (N,) [Pa] from the weight, less buoyancy, of the column above.

        Columns are half a cell wide.
        """
        problem = self.problem
        wet = self._water_level() > problem.position[:, 2]
        weight = gravity * problem.volume * (self.density[self.row] - WATER_DENSITY * wet)
        width = 0.5 * self.grid.cell
        place = np.floor((problem.position[:, :2] - np.asarray(self.grid.origin[:2])) / width)
        column = place[:, 0].astype(np.int64) * (2 * self.grid.shape[1] + 2)
        column += place[:, 1].astype(np.int64)
        order = np.lexsort((-problem.position[:, 2], column))
        below = np.cumsum(weight[order])
        ends = np.flatnonzero(np.diff(column[order], prepend=-1))
        lengths = np.diff(np.append(ends, len(order)))
        before = np.repeat(below[ends] - weight[order][ends], lengths)
        result = np.empty(len(order))
        result[order] = -(below - before - 0.5 * weight[order]) / width**2
        return result

    @property
    def ratios(self) -> np.ndarray:
        """Strength ratio of each material row, (R,); 0 without one."""
        return np.array([one.strength_ratio or 0.0 for one in self.materials])

    def lay_strength_ratios(self, vertical: np.ndarray) -> None:
        """Give every point of a soil with a strength ratio a row of its own, at its own strength.

        Args:
            vertical: effective stress before failure (N,) [Pa], compression positive, in the order
                of the problem.
        """
        ratios = self.ratios
        own = np.flatnonzero(ratios[self.laid_row] > 0.0)
        if not len(own):
            return
        like = self.laid_row[own]
        at_depth = ratios[like] * np.maximum(vertical[own], 0.0)
        strength = [
            material_constants(
                friction_angle=soil.friction_rad,
                cohesion=max(soil.cohesion_pa, float(cohesion)),
                tension_cap=soil.tension_cap_pa,
            )
            for soil, cohesion in zip((self.materials[n] for n in like), at_depth, strict=True)
        ]
        self.strength = np.concatenate([self.strength, strength])
        for name in ("elastic", "settle_strength", "density"):
            table = getattr(self, name)
            setattr(self, name, np.concatenate([table, table[like]]))
        row = self.laid_row.copy()
        row[own] = len(self.materials) + np.arange(len(own), dtype=np.int32)
        self.row[:] = row[self.label]

    def form_blocks(self) -> None:
        """Put the points in the order of their blocks, and of their cells in them."""
        block = self.home // (self.grid.shape[1] * self.grid.shape[2] * BLOCK)
        order = np.argsort(self.home, kind="stable")  # nodes are numbered along x last
        for name in layout.Points._fields:
            values = getattr(self, name)
            values[:] = values[order]
        self.label = self.label[order]
        count = np.bincount(block, minlength=len(self.first) - 1)
        self.first[1:] = np.cumsum(count)

    def arrays(self) -> list[np.ndarray]:
        """All arrays in the order in which kernels take them."""
        return [getattr(self, name) for name in layout.ARRAYS]

    def in_given_order(self, values: np.ndarray) -> np.ndarray:
        """Values of the points, in the order of the problem."""
        out = np.empty_like(values)
        out[self.label] = values
        return out

    def positions(self) -> np.ndarray:
        """Positions (N, 3) float32 [m] in the order of the problem."""
        _, ny, nz = self.grid.shape
        node = np.stack([self.home // (ny * nz), self.home // nz % ny, self.home % nz], axis=1)
        place = np.asarray(self.grid.origin) + self.grid.cell * (node + self.motion[:, :3])
        return self.in_given_order(place.astype(np.float32))
