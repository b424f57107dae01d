"""Pore water that moves: closed forms of consolidation, liquefied columns, its limits in a run."""

import numpy as np
import pytest

from mpm_taichi.effects.framework.between import PointsNow
from mpm_taichi.solver.pore_water import (
    WATER_DENSITY,
    PorousSoil,
    PoreWater,
    lay_cells,
)

GRAVITY = 9.81
WEIGHT = WATER_DENSITY * GRAVITY
STORAGE = 1.0 / 40e6


class Block:
    """A rectangle of wet soil on a closed base, four points to a cell; `k` of (x, y), (P,)."""

    def __init__(self, width, height, cell, k, *, shut=None, ratio=1.0, loose=0.0, stress=None):
        half = 0.5 * cell
        x = half * (np.arange(round(width / half)) + 0.5)
        y = half * (np.arange(round(height / half)) + 0.5)
        self.position = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        x, y = self.position.T
        full = np.ones(len(x))
        self.soil = PorousSoil(
            volume=half**2 * full,
            storage=STORAGE * full,
            permeability=k(x, y) if callable(k) else k * full,
            wet=full > 0.0,
            contraction=loose * full if np.isscalar(loose) else loose(x, y),
            loose=loose(x, y) > 0.0 if callable(loose) else loose * full > 0.0,
            sine=0.5 * full,
            least=0.0 * full,
        )
        mean = stress(x, y) if stress else 100e3 * full
        self.stress = np.stack([-mean, -mean, -mean, 0.0 * mean], axis=1)

        def lay(position):
            return lay_cells(
                self.soil, position, origin=(0.0, 0.0), cell=cell, gravity=GRAVITY,
                closed=shut or (lambda x, y: (y < 0.0) | (x < 0.0) | (x > width)),
            )  # fmt: skip

        self.water = PoreWater(self.soil, self.stress, lay, ratio=ratio, contractancy=0.1)

    def pass_time(self, seconds, steps, *, excess=None):
        """Steps of equal length under constant stress."""
        if excess is not None:
            self.water.excess = excess
        dt = seconds / steps
        for _ in range(steps):
            self.water.renew(
                PointsNow(self.position, self.stress, np.zeros(len(self.stress)), dt, dt)
            )
        return self.water.excess


def spread(k):
    """c_v [m2/s]."""
    return k / (WEIGHT * STORAGE)


def terzaghi(depth, height, time, coefficient):
    """u / u_0 at a depth below the drained top of a layer on a closed base."""
    m = (np.arange(400) + 0.5) * np.pi
    fade = np.exp(-np.multiply.outer(m**2, coefficient * time / height**2))
    return 2.0 * (np.sin(np.multiply.outer(depth / height, m)) / m) @ fade


def column_error(cells, steps, factor=0.2):
    k, height = 1e-4, 10.0
    block = Block(height / cells, height, height / cells, k)
    time = factor * height**2 / spread(k)
    start = np.full(len(block.position), 50e3)
    found = block.pass_time(time, steps, excess=start) / 50e3
    expected = terzaghi(height - block.water_y(), height, time, spread(k))
    return found, expected


def cell_means(block, values):
    """Means of the cells of a column, from below."""
    y = block.position[:, 1]
    return np.array([values[np.isclose(y, one)].mean() for one in np.unique(y)]).reshape(-1, 2)


def terzaghi_error(cells, steps):
    k, height = 1e-4, 10.0
    h = height / cells
    block = Block(h, height, h, k)
    time = 0.2 * height**2 / spread(k)
    found = block.pass_time(time, steps, excess=np.full(len(block.position), 50e3)) / 50e3
    found = cell_means(block, found).mean(axis=1)
    depth = height - h * (np.arange(cells) + 0.5)
    return np.abs(found - terzaghi(depth, height, time, spread(k))).max()


def test_a_column_consolidates_as_terzaghi_says():
    assert terzaghi_error(20, 100) < 0.005


def test_the_step_converges_with_time_and_the_cells_with_their_square():
    fine = [terzaghi_error(80, steps) for steps in (10, 20, 40)]
    assert 0.85 < np.log2(fine[0] / fine[1]) < 1.15
    assert 0.85 < np.log2(fine[1] / fine[2]) < 1.2
    coarse = [terzaghi_error(cells, 4000) for cells in (5, 10, 20)]
    assert np.log2(coarse[0] / coarse[1]) > 1.7
