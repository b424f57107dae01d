"""Kernels of the three-dimensional solver: one step of motion or settling, the sums of a frame.

Points are grouped into blocks, slices across x that are `BLOCK` nodes thick. A block's points are
worked on by one thread in their order; even blocks share no nodes and go side by side, then the odd
ones. So every sum is formed in the same order for any number of threads, without atomics. Settling
and motion are one kernel, whose compilation is what a short run waits for.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from functools import cache
from types import SimpleNamespace

import taichi as ti

from mpm_taichi.layout import (
    BULK_COMPLIANCE,
    CLOSED_POINTS,
    DISSIPATED,
    DIVERGENCE,
    MEAN_STRESS,
    OPENING,
    SHEAR,
    SHEAR_COMPLIANCE,
    SMOOTHED,
    VOLUMETRIC,
    A,
    vec4,
)
from mpm_taichi.materials.elasticity import larger, smaller
from mpm_taichi.materials.mohr_coulomb import ground_strength
from mpm_taichi.solver.boundary import NEAR
from mpm_taichi.solver.kernel_arguments import state_kernel
from mpm_taichi.solver3d import layout
from mpm_taichi.solver3d.layout import SPEED, XX, YY, ZZ, StepNumbers, vec2
from mpm_taichi.solver3d.nodes import settle_node, update_node
from mpm_taichi.solver3d.stress import elastic_trial, mohr_coulomb, volume_rate
from mpm_taichi.solver3d.transfer import gather, move, scatter, scatter_strength

BLOCK = 6
"""Nodes along x in a block."""

DRIFT = 2
"""Cells that points may move before blocks are formed again: 2 DRIFT + 1 < BLOCK keeps the nodes
of blocks of one colour apart."""

TURNS = 512
"""Taichi hands a CPU thread at least 512 turns of a loop; a block takes one turn in 512."""

NUMBERS = ("cell", "dt", "blend", "share", "smoothing", "gravity")


@ti.func
def strain_and_scatter(p, step: A, state: A, settling, averaged: ti.template()):
    """Stress of a point after a step, and what it gives to its nodes."""
    points, nodes, tables = ti.static((state.points, state.nodes, state.tables))
    row, home = points.row[p], points.home[p]
    elastic, gradient, old = tables.elastic[row], points.gradient[p], points.history[p]
    strength = tables.strength[row]
    if settling != 0:
        strength = tables.settle_strength[row]
    strain = step.dt * volume_rate(gradient, step.dt)
    relief, opened = 0.0, old[OPENING]
    before = points.stress[p]
    if ti.static(averaged):
        means = nodes.cell_mean[home]
        if (opened <= 0.0) & (means[CLOSED_POINTS] > 0.0):
            strain = step.dt * means[DIVERGENCE]
            if settling == 0:
                pressure = (before[XX] + before[YY] + before[ZZ]) * (1.0 / 3.0)
                relief = step.share * (means[SMOOTHED] - pressure)
    closing = larger(smaller(opened, -strain), 0.0)
    opened -= closing
    strain += closing
    trial = elastic_trial(before, gradient, strain, step.dt, elastic)
    for a in ti.static((XX, YY, ZZ)):
        trial[a] += relief
    stress, shear, opening, work = mohr_coulomb(trial, elastic, strength)
    points.stress[p] = stress
    if settling != 0:
        points.history[p] = vec4(old[VOLUMETRIC] + strain, 0.0, 0.0, 0.0)
    else:
        points.history[p] = vec4(
            old[VOLUMETRIC] + (strain - opening),
            opened + opening,
            old[SHEAR] + shear,
            old[DISSIPATED] + work * points.volume[p] * (1.0 + old[VOLUMETRIC]),
        )
    kind = nodes.kind[home]
    mass = tables.density[row] * points.volume[p]
    scatter(p, step, points, nodes.load, kind, mass)
    if kind & NEAR:
        friction, adhesion = ground_strength(strength)
        scatter_strength(p, step, points, nodes.soil, kind, friction, adhesion)


@ti.func
def add_to_cell(p, home, gradient, step: A, points: A, cell_sum: A):
    """Add a closed point to the sums of its cell."""
    if points.history[p][OPENING] <= 0.0:
        s = points.stress[p]
        cell_sum[home] = cell_sum[home] + vec4(
            volume_rate(gradient, step.dt), 0.0, (s[XX] + s[YY] + s[ZZ]) * (1.0 / 3.0), 1.0
        )


@ti.func
def mean_stress(sums):
    """Mean stress of a cell from its sums [Pa]."""
    return sums[MEAN_STRESS] / ti.max(sums[CLOSED_POINTS], 1.0)


@ti.func
def bend(sum_a, own, sum_b):
    """A quarter of the second difference of mean stress, where both neighbours hold points."""
    result = 0.0
    if ti.min(sum_a[CLOSED_POINTS], sum_b[CLOSED_POINTS]) > 0.0:
        result = 0.25 * (2.0 * own - mean_stress(sum_a) - mean_stress(sum_b))
    return result


@ti.func
def average_cell(n, step: A, nodes: A):
    """Means of a cell, its pressure drawn weakly towards a line through its neighbours."""
    sums = nodes.cell_sum[n]
    if sums[CLOSED_POINTS] > 0.0:
        own = mean_stress(sums)
        layer = step.ny * step.nz
        total = bend(nodes.cell_sum[n - 1], own, nodes.cell_sum[n + 1])
        total += bend(nodes.cell_sum[n - step.nz], own, nodes.cell_sum[n + step.nz])
        total += bend(nodes.cell_sum[n - layer], own, nodes.cell_sum[n + layer])
        nodes.cell_mean[n] = vec4(
            sums[DIVERGENCE] / sums[CLOSED_POINTS],
            own - step.smoothing * total,
            own,
            sums[CLOSED_POINTS],
        )
    else:
        nodes.cell_mean[n] = vec4(0.0)


@ti.func
def gather_block(b, step: A, state: A, settling):
    """Velocities back to the points of a block, their motion, and their part of the cells."""
    points, nodes, first = ti.static((state.points, state.nodes, state.tables.first))
    top, alarms = 0.0, 0
    for p in range(first[b], first[b + 1]):
        home = points.home[p]
        mean, gradient = gather(home, step, nodes.velocity, nodes.kind[home], points.motion[p])
        points.gradient[p] = gradient
        if settling == 0:
            new, shift, alarm = move(points.motion[p], step, mean)
            points.motion[p] = new
            home += shift
            points.home[p] = home
            alarms += alarm
            top = ti.max(top, mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2])
        add_to_cell(p, home, gradient, step, points, nodes.cell_sum)
    state.tables.block_reach[b] = ti.select(alarms > 0, ti.math.inf, ti.sqrt(top))


@cache
def build_kernels(averaged: bool) -> SimpleNamespace:
    """The kernels, with or without F-bar.

    Returns:
        `step`, of the number of blocks, of columns of nodes, of nodes along y and z, whether the
        stress settles (0 or 1), `NUMBERS`, and all arrays; `sums`, of the number of blocks and all
        arrays.
    """

    @ti.func
    def run(
        blocks, columns, ny, nz, settling, cell, dt, blend, share, smoothing, gravity, state: A
    ):
        nodes, tables = ti.static((state.nodes, state.tables))
        step = ti.static(StepNumbers(cell, dt, blend, share, smoothing, gravity, ny, nz))
        for parity in ti.static(range(2)):
            for turn in range((blocks // 2) * TURNS):
                if turn % TURNS == 0:
                    b = 2 * (turn // TURNS) + parity
                    for p in range(tables.first[b], tables.first[b + 1]):
                        strain_and_scatter(p, step, state, settling, averaged)
        for column in range(columns):
            sums = ti.Vector([0.0, 0.0], ti.f64)
            for n in range(column * nz, (column + 1) * nz):
                work = vec2(0.0)
                if settling != 0:
                    work = settle_node(n, step, nodes)
                else:
                    work = update_node(n, step, nodes)
                sums += ti.cast(work, ti.f64)
            for a in ti.static(range(2)):
                before = tables.column_sums[column, a]
                tables.column_sums[column, a] = ti.select(settling != 0, 0.0, before) + sums[a]
        for parity in ti.static(range(2)):
            for turn in range((blocks // 2) * TURNS):
                if turn % TURNS == 0:
                    gather_block(2 * (turn // TURNS) + parity, step, state, settling)
        for column in range(columns):
            for n in range(column * nz + 1, (column + 1) * nz - 1):
                average_cell(n, step, nodes)

    @ti.func
    def sums(blocks, state: A):
        points, tables = ti.static((state.points, state.tables))
        for turn in range(blocks * TURNS):
            if turn % TURNS == 0:
                b = turn // TURNS
                total = ti.Vector([0.0, 0.0, 0.0, 0.0], ti.f64)
                for p in range(tables.first[b], tables.first[b + 1]):
                    m, s = points.motion[p], points.stress[p]
                    elastic, history = tables.elastic[points.row[p]], points.history[p]
                    squared = m[SPEED] ** 2 + m[SPEED + 1] ** 2 + m[SPEED + 2] ** 2
                    mean = (s[XX] + s[YY] + s[ZZ]) * (1.0 / 3.0)
                    shear = (s[XX] - mean) ** 2 + (s[YY] - mean) ** 2 + (s[ZZ] - mean) ** 2
                    shear += 2.0 * (s[3] ** 2 + s[4] ** 2 + s[5] ** 2)
                    density = mean**2 * elastic[BULK_COMPLIANCE] + shear * elastic[SHEAR_COMPLIANCE]
                    volume = points.volume[p]
                    mass = tables.density[points.row[p]] * volume
                    total[0] += ti.cast(0.5 * mass * squared, ti.f64)
                    total[1] += ti.cast(
                        0.5 * volume * (1.0 + history[VOLUMETRIC]) * density, ti.f64
                    )
                    total[2] += ti.cast(history[DISSIPATED], ti.f64)
                    total[3] = ti.max(total[3], ti.cast(squared, ti.f64))
                for a in ti.static(range(4)):
                    tables.block_sums[b, a] = total[a]

    integers = dict.fromkeys(("blocks", "columns", "ny", "nz", "settling"), ti.i32)
    numbers = dict.fromkeys(NUMBERS, ti.f32)
    return SimpleNamespace(
        step=state_kernel(run, table=layout, **integers, **numbers),
        sums=state_kernel(sums, table=layout, blocks=ti.i32),
    )
