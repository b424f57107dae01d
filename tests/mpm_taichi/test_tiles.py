"""Eight points at once against one point at a time, in every region of the yield surface."""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from functools import cache

import numpy as np
import pytest
import taichi as ti

from mpm_taichi.layout import ALARM, TILE, A, StepNumbers
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.materials.mohr_coulomb import MOHR_COULOMB, material_constants
from mpm_taichi.solver.kernel_arguments import state_kernel
from mpm_taichi.solver.point_functions import point_functions
from mpm_taichi.solver.runtime import aligned, start
from mpm_taichi.solver.splines import BASE_EDGE, LEFT_EDGE
from mpm_taichi.solver.tiles import tile_functions
from tests.mpm_taichi.arrays import arrays

CELL, COLUMNS, NODES = 2.0, 12, 144
STEP, SHARE, BLEND = 2e-3, 0.3, 0.01


@ti.func
def step_of(dt: A, state: A):
    """The numbers of a step; `dt` keeps them from being constants of the compiler."""
    cell = CELL * dt / STEP
    per_cell, share, blend = 1.0 / cell, SHARE * dt / STEP, BLEND * dt / STEP
    return ti.static(
        StepNumbers(
            slot=0, first_node=0, columns=COLUMNS, cell=cell, per_cell=per_cell,
            dt=dt, share=share, blend=blend,
        )
    )  # fmt: skip


@cache
def passes(program: object, averaged: bool, corrected: bool):
    """Kernels of the three passes by tiles and by points; `program`: Taichi as it runs now."""
    options = {"affine": True, "averaged": averaged, "corrected": corrected}
    point = point_functions(MOHR_COULOMB, **options)
    tile = tile_functions(MOHR_COULOMB, point, **options)

    @ti.func
    def by_tiles(first: A, last: A, dt: A, state: A):
        for _ in range(1):
            scratch = ti.static(tile.scratch())
            step = ti.static(step_of(dt, state))
            tiles = (last - first + TILE - 1) // TILE
            for t in range(tiles):
                tile.strain_tile(first + t * TILE, last, step, state, scratch)
            for t in range(tiles):
                tile.scatter_tile(first + t * TILE, last, step, state, scratch)
            for t in range(tiles):
                alarm = tile.gather_tile(first + t * TILE, last, step, state, scratch)
                state.slots.integers[0, ALARM] |= alarm

    @ti.func
    def by_points(first: A, last: A, dt: A, state: A):
        for _ in range(1):
            step = ti.static(step_of(dt, state))
            for p in range(first, last):
                point.strain_point(p, step, state)
            for p in range(first, last):
                point.scatter_point(p, step, state, False)
            for p in range(first, last):
                state.slots.integers[0, ALARM] |= point.gather_and_move(p, step, state, False)

    kinds = {"first": ti.i32, "last": ti.i32, "dt": ti.f32}
    return state_kernel(by_tiles, **kinds), state_kernel(by_points, **kinds)


def state(count: int, seed: int) -> dict[str, np.ndarray]:
    """Random points of soils of every kind, about the yield surface, next to edges and inside."""
    random = np.random.default_rng(seed)
    room = -(-count // TILE) * TILE + TILE
    soils = [(0.0, 30e3, None), (0.0, 20e3, 5e3), (35.0, 0.0, None), (25.0, 10e3, None),
             (30.0, 8e3, 1e3)]  # fmt: skip
    strength = [
        material_constants(
            friction_angle=np.radians(angle), cohesion=cohesion, tension_cap=cap
        )
        for angle, cohesion, cap in soils
    ]  # fmt: skip
    elastic = elastic_constants(youngs_modulus=30e6, poisson_ratio=0.3)

    def array(values: np.ndarray, kind: type = np.float32) -> np.ndarray:
        result = aligned((room if len(values) == count else len(values), *values.shape[1:]), kind)
        result[: len(values)] = values
        return result

    motion = np.concatenate(
        [random.uniform(-0.5, 0.5, (count, 2)), random.normal(0, 3.0, (count, 2))], axis=1
    )
    stress = random.normal(0, 12e3, (count, 4)) - [30e3, 30e3, 30e3, 0.0]
    history = random.uniform(0, 0.02, (count, 4)) * [1, random.integers(0, 2), 50, 1e6]
    history[:, 1] *= random.integers(0, 2, count)
    inner = [n for n in range(NODES) if 2 <= n // COLUMNS < 10 and 2 <= n % COLUMNS < 10]
    swelling = random.normal(0, 1.0, (NODES, 4)) * [1, 20e3, 20e3, 0] - [0, 30e3, 30e3, 0]
    swelling[:, 3] = random.integers(0, 3, NODES)
    kind = random.choice([0, 0, 0, BASE_EDGE, LEFT_EDGE, BASE_EDGE | LEFT_EDGE], NODES)
    given = {
        "motion": array(motion), "home": array(random.choice(inner, count), np.int32),
        "gradient": array(random.normal(0, 0.5, (count, 4))), "stress": array(stress),
        "history": array(history), "row": array(random.integers(0, len(soils), count), np.int32),
        "elastic": np.tile(elastic, (len(soils), 1)), "strength": strength,
        "volume": array(random.uniform(0.1, 2.0, count)),
        "density": random.uniform(1500.0, 2200.0, len(soils)),
        "velocity": random.normal(0, 2.0, (NODES, 4)), "cell_mean": swelling, "kind": kind,
    }  # fmt: skip
    return arrays(room, NODES, len(soils), **given)


def go(kernel, before: dict[str, np.ndarray], first: int, last: int) -> dict[str, np.ndarray]:
    """What a pass over the points from `first` to `last` leaves."""
    now = {}
    for name, value in before.items():
        now[name] = aligned(value.shape, value.dtype)
        now[name][...] = value
    kernel(first, last, STEP, *now.values())
    return now


def kernels(averaged: bool, corrected: bool):
    start("cpu", 1)
    return passes(ti.lang.impl.get_runtime().prog, averaged, corrected)


@pytest.mark.parametrize("averaged", [True, False])
@pytest.mark.parametrize("corrected", [True, False])
@pytest.mark.slow
def test_tiles_do_what_points_do(averaged: bool, corrected: bool):
    by_tiles, by_points = kernels(averaged, corrected)
    before = state(4003, seed=7)
    tiles, points = (go(kernel, before, 0, 4003) for kernel in (by_tiles, by_points))
    for name in ("motion", "gradient", "stress", "history", "load", "cell_mean"):
        scale = np.abs(points[name]).max(axis=0)
        scale[scale == 0.0] = 1.0
        error = np.abs(tiles[name] - points[name]) / scale
        assert error.max() < 3e-6, name
    assert np.array_equal(tiles["home"], points["home"])
    assert not tiles["integers"][0, ALARM]
    plastic = points["history"][:4003] - before["history"][:4003]
    assert (plastic[:, 2] > 0).mean() > 0.2
    assert (plastic[:, 2] == 0).mean() > 0.1
    if corrected:
        assert (plastic[:, 1] > 0).sum() > 50
        assert (plastic[:, 1] < 0).sum() > 5


@pytest.mark.slow
def test_bits_of_a_point_hang_on_its_place_in_no_tile():
    by_tiles, _ = kernels(True, True)
    before = state(64, seed=11)
    whole = go(by_tiles, before, 0, 64)
    for first, last in ((3, 4), (5, 12), (13, 30), (40, 64), (63, 64)):
        part = go(by_tiles, before, first, last)
        where = slice(first, last)
        for name in ("stress", "history", "home"):
            assert np.array_equal(part[name][where], whole[name][where]), (name, first)
        for name in ("motion", "gradient", "stress", "history", "home"):  # the others stay
            assert np.array_equal(part[name][:first], before[name][:first])
            assert np.array_equal(part[name][last:], before[name][last:])


@pytest.mark.parametrize("speed", [1e4, np.nan, np.inf])
def test_one_point_that_goes_too_far_raises_the_alarm_and_stays(speed: float):
    by_tiles, by_points = kernels(True, True)
    before = state(13, seed=3)
    before["kind"][:] = 0
    before["velocity"][before["home"][12]] = speed
    for kernel in (by_tiles, by_points):
        after = go(kernel, before, 0, 13)
        assert after["integers"][0, ALARM] == 1
        assert after["home"][12] == before["home"][12]
        assert np.array_equal(after["motion"][12, :2], before["motion"][12, :2])
        calm = go(kernel, before | {"velocity": np.zeros_like(before["velocity"])}, 0, 13)
        assert calm["integers"][0, ALARM] == 0
