"""Eight points at once against one point at a time, in every region of the yield surface."""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from functools import cache

import numpy as np
import pytest
import taichi as ti

from mpm_taichi.materials.mohr_coulomb import material_constants
from mpm_taichi.solver import layout
from mpm_taichi.solver.layout import F32, I32, INDEX, TILE, VEC4, VEC8
from mpm_taichi.solver.point_functions import point_functions
from mpm_taichi.solver.runtime import aligned, start
from mpm_taichi.solver.splines import BASE_EDGE, LEFT_EDGE
from mpm_taichi.solver.tiles import column, rows, tile_functions

CELL, COLUMNS, NODES = 2.0, 12, 144
VOLUME, MASS, STEP, SHARE, BLEND = 0.9, 1700.0, 2e-3, 0.3, 0.01

POINTS = [
    "motion", "gradient", "stress", "history", "home", "row",
]  # fmt: skip


@cache
def passes(program: object, averaged: bool, corrected: bool):
    """Kernels of the three passes by tiles and by points; `program`: Taichi as it runs now."""
    options = {"affine": True, "averaged": averaged, "corrected": corrected}
    tile, point = tile_functions(**options), point_functions(**options)

    @ti.kernel
    def by_tiles(
        first: ti.i32, last: ti.i32, motion: VEC4, home: INDEX, gradient: VEC4, stress: VEC4,
        history: VEC4, row: INDEX, elastic: VEC4, strength: VEC4, edges: VEC4, load: VEC8,
        flow: VEC4, swelling: VEC4, kind: INDEX, facts: F32, present: VEC8, integers: I32,
        numbers: F32, alarm: INDEX,
    ):  # fmt: skip
        for _ in range(1):
            a, b, c, d, e, f = rows(4), rows(4), rows(4), rows(4), rows(4), rows(4)
            x, y, r, s = rows(3), rows(3), column(0.0), column(0.0)
            i, j, k = column(0), column(0), column(0)
            tiles = (last - first + TILE - 1) // TILE
            for t in range(tiles):
                tile.strain_tile(
                    first + t * TILE, last, STEP, SHARE, VOLUME, home, gradient, stress, history,
                    row, elastic, strength, edges, swelling, 0, 0, 0.0, COLUMNS, 0, integers,
                    numbers, motion, facts, present, numbers, a, b, c, d, e, f, r, s,
                )  # fmt: skip
            for t in range(tiles):
                tile.scatter_tile(
                    first + t * TILE, last, CELL, 1.0 / CELL, VOLUME, COLUMNS, motion, home,
                    gradient, stress, history, row, strength, edges, load, kind, present, a, b, c,
                    x, y, r,
                )  # fmt: skip
            for t in range(tiles):
                alarm[0] |= tile.gather_tile(
                    first + t * TILE, last, STEP, CELL, 1.0 / CELL, BLEND, COLUMNS, motion, home,
                    gradient, stress, history, flow, swelling, kind, a, b, c, d, e, f, x, y, i, j,
                    k,
                )  # fmt: skip

    @ti.kernel
    def by_points(
        first: ti.i32, last: ti.i32, motion: VEC4, home: INDEX, gradient: VEC4, stress: VEC4,
        history: VEC4, row: INDEX, elastic: VEC4, strength: VEC4, edges: VEC4, load: VEC8,
        flow: VEC4, swelling: VEC4, kind: INDEX, facts: F32, present: VEC8, integers: I32,
        numbers: F32, alarm: INDEX,
    ):  # fmt: skip
        for _ in range(1):
            for p in range(first, last):
                point.strain_point(
                    p, STEP, SHARE, VOLUME, home, gradient, stress, history, row, elastic, strength,
                    edges, swelling, 0, 0, 0.0, COLUMNS, 0, integers, numbers, motion, facts,
                    present, numbers,
                )  # fmt: skip
            for p in range(first, last):
                point.scatter_point(
                    p, CELL, VOLUME, COLUMNS, motion, home, gradient, stress, history, row,
                    strength, edges, load, kind, present, False,
                )  # fmt: skip
            for p in range(first, last):
                alarm[0] |= point.gather_and_move(
                    p, STEP, CELL, BLEND, COLUMNS, motion, home, gradient, stress, history, flow,
                    swelling, kind, False,
                )  # fmt: skip

    return by_tiles, by_points


def state(count: int, seed: int) -> dict[str, np.ndarray]:
    """Random points of soils of every kind, about the yield surface, beside edges and inside."""
    random = np.random.default_rng(seed)
    room = -(-count // TILE) * TILE + TILE
    soils = [(0.0, 30e3, None), (0.0, 20e3, 5e3), (35.0, 0.0, None), (25.0, 10e3, None),
             (30.0, 8e3, 1e3)]  # fmt: skip
    tables = [
        material_constants(
            friction_angle=np.radians(angle), cohesion=cohesion, youngs_modulus=30e6,
            poisson_ratio=0.3, tension_cap=cap,
        )
        for angle, cohesion, cap in soils
    ]  # fmt: skip
    elastic, strength, edges = (np.stack(part) for part in zip(*tables, strict=True))
    edges[:, 3] = MASS

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
    return {
        "motion": array(motion), "home": array(random.choice(inner, count), np.int32),
        "gradient": array(random.normal(0, 0.5, (count, 4))), "stress": array(stress),
        "history": array(history), "row": array(random.integers(0, len(soils), count), np.int32),
        "elastic": elastic, "strength": strength, "edges": edges,
        "load": aligned((NODES, 8), np.float32),
        "flow": random.normal(0, 2.0, (NODES, 4)).astype(np.float32),
        "swelling": swelling.astype(np.float32), "kind": kind.astype(np.int32),
        "facts": np.zeros((1, 1), np.float32), "present": np.zeros((1, 8), np.float32),
        "integers": np.zeros((1, layout.INTEGERS), np.int32),
        "numbers": np.zeros((1, layout.NUMBERS), np.float32), "alarm": np.zeros(1, np.int32),
    }  # fmt: skip


def go(kernel, before: dict[str, np.ndarray], first: int, last: int) -> dict[str, np.ndarray]:
    """What a pass over the points from `first` to `last` leaves."""
    now = {}
    for name, value in before.items():
        now[name] = aligned(value.shape, value.dtype)
        now[name][...] = value
    kernel(first, last, *now.values())
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
    for name in ("motion", "gradient", "stress", "history", "load", "swelling"):
        scale = np.abs(points[name]).max(axis=0)
        scale[scale == 0.0] = 1.0
        error = np.abs(tiles[name] - points[name]) / scale
        assert error.max() < 3e-6, name
    assert np.array_equal(tiles["home"], points["home"])
    assert not tiles["alarm"][0]
    plastic = points["history"][:4003] - before["history"][:4003]
    assert (plastic[:, 2] > 0).mean() > 0.2
    assert (plastic[:, 2] == 0).mean() > 0.1
    if corrected:
        assert (plastic[:, 1] > 0).sum() > 50
        assert (plastic[:, 1] < 0).sum() > 5


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
    before["flow"][before["home"][12]] = speed
    for kernel in (by_tiles, by_points):
        after = go(kernel, before, 0, 13)
        assert after["alarm"][0] == 1
        assert after["home"][12] == before["home"][12]
        assert np.array_equal(after["motion"][12, :2], before["motion"][12, :2])
        calm = go(kernel, before | {"flow": np.zeros_like(before["flow"])}, 0, 13)
        assert calm["alarm"][0] == 0
