"""Pore water that moves: closed forms of consolidation, liquefied columns, its limits in a run."""

import numpy as np
import pytest
from scipy.linalg import expm

from mpm_taichi.effects.framework.between import PointsNow
from mpm_taichi.effects.framework.free_water import SUCTION
from mpm_taichi.solver.pore_water import (
    WATER_DENSITY,
    PoreWater,
    PorousSoil,
    lay_cells,
)

GRAVITY = 9.81
WEIGHT = WATER_DENSITY * GRAVITY
STORAGE = 1.0 / 40e6


class Block:
    """A rectangle of wet soil on a closed base, four points to a cell; `k` of (x, y), (P,).

    Its top is `below` the water level [m].
    """

    def __init__(
        self, width, height, cell, k, *, shut=None, ratio=1.0, loose=0.0, stress=None, below=0.0
    ):
        half = 0.5 * cell
        x = half * (np.arange(round(width / half)) + 0.5)
        y = half * (np.arange(round(height / half)) + 0.5)
        self.position = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        x, y = self.position.T
        full = np.ones(len(x))
        liquefies = loose(x, y) > 0.0 if callable(loose) else loose * full > 0.0
        self.soil = PorousSoil(
            volume=half**2 * full,
            storage=STORAGE * full,
            permeability=k(x, y) if callable(k) else k * full,
            wet=full > 0.0,
            contraction=loose * full if np.isscalar(loose) else loose(x, y),
            per_shear=0.1 * np.sign(loose(x, y) if callable(loose) else loose * full),
            loose=liquefies,
            ratio=ratio * liquefies,
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

        def still(position):
            return WEIGHT * (below + height - position[:, 1])

        self.water = PoreWater(self.soil, self.stress, lay, still)

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
    fine = [terzaghi_error(40, steps) for steps in (10, 20, 40)]
    assert np.log2(np.divide(fine[:-1], fine[1:])) == pytest.approx([1.0, 1.0], abs=0.15)
    coarse = [terzaghi_error(cells, 600) for cells in (5, 10)]
    assert np.log2(coarse[0] / coarse[1]) == pytest.approx(1.9, abs=0.15)


def test_a_strip_that_drains_on_three_sides_is_the_product_of_two_columns():
    k, width, height, h = 1e-4, 20.0, 10.0, 0.5
    block = Block(width, height, h, k, shut=lambda x, y: y < 0.0)
    time = 0.15 * height**2 / spread(k)
    found = block.pass_time(time, 200, excess=np.full(len(block.position), 50e3)) / 50e3
    x, y = (np.floor(block.position / h) + 0.5).T * h
    to_side = 0.5 * width - np.abs(x - 0.5 * width)
    across = terzaghi(to_side, 0.5 * width, time, spread(k))
    expected = across * terzaghi(height - y, height, time, spread(k))
    assert np.abs(found - expected).max() < 0.005


def fine_column(permeability, height, excess, time, cells=400):
    """Excess pressure of a column that drains at its top, by cells of its own: (y, u)."""
    h = height / cells
    y = h * (np.arange(cells) + 0.5)
    k = permeability(y)
    between = 2.0 * k[1:] * k[:-1] / (k[1:] + k[:-1])
    flow = np.diag(np.append(between, 2.0 * k[-1])) + np.diag(np.insert(between, 0, 0.0))
    flow -= np.diag(between, 1) + np.diag(between, -1)
    return y, expm(-time * flow / (WEIGHT * STORAGE * h**2)) @ excess(y)


@pytest.mark.parametrize("time", [100.0, 1000.0])
def test_water_gathers_under_a_seal_as_in_a_fine_column(time):
    def k(y):
        return np.where((y > 6.0) & (y < 7.0), 1e-6, 1e-4)

    def excess(y):
        return np.where(y < 3.0, 60e3, 0.0)

    h = 0.25
    block = Block(h, 10.0, h, lambda x, y: k(y))
    found = block.pass_time(time, 200, excess=excess(block.position[:, 1]))
    found = cell_means(block, found).mean(axis=1)
    y, u = fine_column(k, 10.0, excess, time)
    expected = u.reshape(len(found), -1).mean(axis=1)
    print(np.abs(found - expected).max() / 60e3)
    assert np.abs(found - expected).max() < 0.02 * 60e3
    # What the layer under the seal, which held none, has taken up [m3/m2].
    gained, fine = (STORAGE * (one[12:24] * h).sum() for one in (found, expected))
    assert gained == pytest.approx(fine, rel=0.02)
    assert gained > 1e-3


def test_no_water_is_lost():
    rng = np.random.default_rng(3)
    block = Block(8.0, 8.0, 1.0, lambda x, y: 10.0 ** rng.uniform(-7, -3, len(x)),
                  loose=lambda x, y: np.where(y < 4.0, 0.02, 0.0))  # fmt: skip
    water, stress, shear = block.water, block.stress, np.zeros(len(block.stress))
    before = water.content
    for _ in range(20):
        stress = stress * rng.uniform(0.9, 1.1, (len(stress), 1))
        shear = shear + rng.uniform(0.0, 0.01, len(stress))
        loads = block.soil.storage * block.soil.volume
        water.renew(PointsNow(block.position, stress, shear, 0.5, 0.5))
    change = water.content - before
    sources = water.contracted + water.cavitated - water.expelled
    assert change == pytest.approx(sources, abs=1e-13 * loads.sum() * 1e5)
    assert water.contracted > 1e-3


def test_liquefied_soil_settles_behind_a_front_that_rises():
    """Grains hang in water above the front: what flows up has the gradient of their weight."""
    k, height, h, weight, loose = 1e-4, 8.0, 0.25, 9e3, 0.05
    block = Block(h, height, h, k, loose=loose, stress=lambda x, y: weight * (height - y))
    speed = k * weight / WEIGHT
    for reached in (2.0, 4.0, 6.0):
        # Water left: owed below the front, and what its effective stress has squeezed out.
        time = reached * (loose - STORAGE * weight * (height - reached)) / speed
        fresh = Block(h, height, h, k, loose=loose, stress=lambda x, y: weight * (height - y))
        fresh.pass_time(time, 300)
        assert fresh.water.expelled / h == pytest.approx(speed * time, rel=0.01)
        solid = cell_means(fresh, fresh.water.effective).mean(axis=1) > 0.0
        assert h * solid.sum() == pytest.approx(reached, abs=1.5 * h)
    # All has settled by the strain that was owed.
    block.pass_time(3.0 * height * loose / speed, 600)
    assert block.water.expelled / h == pytest.approx(loose * height, rel=0.01)
    assert not block.water.fluid.any()


def test_shear_of_loose_soil_raises_the_pressure_until_it_has_liquefied():
    block = Block(2.0, 2.0, 1.0, 1e-12, ratio=0.3, loose=0.02)
    water = block.water
    for shear, ratio in ((0.0, 0.3), (0.01, 0.3 + 0.1 * 0.01 / STORAGE / 100e3), (0.5, 1.0)):
        now = PointsNow(block.position, block.stress, np.full(16, shear), 0.1, 0.1)
        rows = water.renew(now)
        assert water.excess == pytest.approx(ratio * 100e3, rel=1e-6)
        assert rows[:, 1] - rows[:, 2] * shear == pytest.approx((1 - ratio) * 100e3, abs=20.0)


def test_shear_of_dense_soil_lowers_the_pressure_until_it_is_critical_or_its_water_cavitates():
    gain = 0.1 * 0.01 / STORAGE  # 40 kPa a percent of shear
    y = Block(2.0, 2.0, 1.0, 1e-12).position[:, 1]
    for total, below in ((0.002, 0.0), (0.02, 0.0), (0.02, 10.0)):
        block = Block(2.0, 2.0, 1.0, 1e-12, loose=-total, below=below)
        lowest = np.maximum(-total / STORAGE, -SUCTION - WEIGHT * (below + 2.0 - y))
        for shear, excess in ((0.01, -gain), (0.02, -2.0 * gain), (0.5, lowest)):
            now = PointsNow(block.position, block.stress, np.full(16, shear), 0.1, 0.1)
            rows = block.water.renew(now)
            assert block.water.excess == pytest.approx(excess, rel=1e-6)
            assert rows[:, 1] - rows[:, 2] * shear == pytest.approx(100e3 - excess, abs=20.0)
            assert rows[:, 4] == pytest.approx(SUCTION + WEIGHT * (below + 2.0 - y), rel=1e-6)
        flows = PointsNow(block.position, block.stress, np.full(16, 0.5), 1e13, 1e13)
        block.water.renew(flows)
        assert block.water.excess == pytest.approx(0.0, abs=100.0)  # the water comes in
