"""Steps of eight points at once: what the scene schedule runs where `point_functions` does one.

A processor takes its time over a point not for the sums but for their order: a stress hangs on a
root, which hangs on a quotient, and so on for a hundred cycles, and a core looks ahead for little
more than one point. So points go in tiles. What hangs on other places in memory (home, nodes,
material) is fetched point by point into arrays of the tile; what is only sums is written as a loop
over the tile without branches, which the compiler turns into vector instructions; what is rare
(edges of the yield surface, tension, edges of the grid) is done again point by point.

Formulas are those of `transfer` and `mohr_coulomb`, which the point schedule calls as well. A slot
has room for whole tiles; what stands behind its last point is never read by a point.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace

import taichi as ti

from mpm_taichi.materials.mohr_coulomb import main_return, other_return
from mpm_taichi.solver.boundary import NEAR
from mpm_taichi.solver.layout import TILE, A, known, vec4
from mpm_taichi.solver.splines import EDGES, spline_weights
from mpm_taichi.solver.transfer import (
    cell_sums,
    gather_beside,
    gather_inside,
    gift,
    gradient_inside,
    move,
    pressure_relief,
    scatter_beside,
    scatter_inside,
    scatter_volume,
    scatter_weighted_volume,
    strain_increment,
    trial_stress,
)


@ti.func
def rows(width: ti.template()):
    """An array of the tile with `width` numbers for each of its points."""
    return ti.Matrix([[0.0 for _ in ti.static(range(width))] for _ in ti.static(range(TILE))])


@ti.func
def column(zero: ti.template()):
    """An array of the tile with one number of the kind of `zero` for each of its points."""
    return ti.Vector([zero for _ in ti.static(range(TILE))])


@ti.func
def row_of(array: ti.template(), lane):
    """The four numbers of a point of the tile."""
    return vec4(array[lane, 0], array[lane, 1], array[lane, 2], array[lane, 3])


@ti.func
def put(array: ti.template(), lane, values):
    """Set the four numbers of a point of the tile."""
    for k in ti.static(range(4)):
        array[lane, k] = values[k]


def tile_functions(
    *, affine: bool, averaged: bool, corrected: bool, effects: SimpleNamespace | None = None
) -> SimpleNamespace:
    """The functions of a tile for one choice of options, as `point_functions.point_functions`.

    In each, `first` is the first point of the tile and `last` the one behind the scene's last.
    """
    acted = effects is not None

    @ti.func
    def strain_tile(
        first, last, dt, share, volume, home: A, gradient: A, stress: A, history: A, row: A,
        elastic: A, strength: A, edges: A, swelling: A, slot, on, time, columns, first_node,
        integers: A, numbers: A, motion: A, facts: A, present: A, effect_numbers: A, means: A,
        moduli: A, limits: A, trials: A, news: A, pasts: A, sheared: A, elsewhere: A,
    ):  # fmt: skip
        """Stress and history of the points after a step."""
        start = known(first)
        end = ti.min(first + TILE, last)
        for point in range(first, end):
            p = known(point)
            lane = point - first
            r = known(row[p])
            put(means, lane, swelling[known(home[p])])
            put(moduli, lane, elastic[r])
            if ti.static(acted):
                put(limits, lane, present[p])
            else:
                put(limits, lane, strength[r])
        for lane in range(TILE):
            p = start + lane
            rate, old, past = gradient[p], stress[p], history[p]
            mean, modulus, limit = row_of(means, lane), row_of(moduli, lane), row_of(limits, lane)
            volumetric = strain_increment(rate, past[1], mean, dt, averaged)
            relief = pressure_relief(old, past[1], mean, share, averaged)
            trial, strain, opened = trial_stress(
                old, rate, past[1], volumetric, relief, dt, modulus, corrected
            )
            new, shear, work, off = main_return(trial, modulus, limit)
            spent = work * volume * (1.0 + past[0])
            put(trials, lane, trial)
            put(news, lane, new)
            put(pasts, lane, vec4(past[0] + strain, opened, past[2] + shear, past[3] + spent))
            elsewhere[lane] = off
            sheared[lane] = shear
        for point in range(first, end):
            p = known(point)
            lane = point - first
            new, past = row_of(news, lane), row_of(pasts, lane)
            shear = sheared[lane]
            if elsewhere[lane] > 0.0:
                r = known(row[p])
                own_edges = edges[r]
                if ti.static(acted):
                    own_edges = vec4(present[p][3], present[p][4], present[p][5], 0.0)
                old = history[p]
                new, shear, opening, work = other_return(
                    row_of(trials, lane), row_of(moduli, lane), row_of(limits, lane), own_edges
                )
                past[2] = old[2] + shear
                past[3] = old[3] + work * volume * (1.0 + old[0])
                if ti.static(corrected):
                    past[0] -= opening
                    past[1] += opening
            stress[p] = new
            history[p] = past
            if ti.static(acted):
                if shear > 0.0 and on & ti.static(effects.dilation_mask):
                    change, work = effects.dilate(
                        p, slot, on, time, columns, first_node, shear, row_of(moduli, lane),
                        integers, numbers, motion, home, gradient, stress, history, facts,
                        effect_numbers,
                    )  # fmt: skip
                    stress[p] = new + vec4(change, change, change, 0.0)
                    past[3] += work * volume * (1.0 + past[0])
                    history[p] = past

    @ti.func
    def scatter_tile(
        first, last, cell, per_cell, volume, columns, motion: A, home: A, gradient: A, stress: A,
        history: A, row: A, strength: A, edges: A, load: A, kind: A, present: A, bases: A,
        acrosses: A, upwards: A, weights_x: A, weights_y: A, masses: A,
    ):  # fmt: skip
        """Add momentum, internal force and mass of the points to their nodes."""
        start = known(first)
        end = ti.min(first + TILE, last)
        for point in range(first, end):
            masses[point - first] = edges[known(row[known(point)])][3]
        for lane in range(TILE):
            p = start + lane
            base, across, upward = gift(
                motion[p], gradient[p], stress[p], history[p][0], masses[lane], volume, cell,
                per_cell, affine,
            )  # fmt: skip
            put(bases, lane, base)
            put(acrosses, lane, across)
            put(upwards, lane, upward)
            x, y = spline_weights(motion[p][0]), spline_weights(motion[p][1])
            for k in ti.static(range(3)):
                weights_x[lane, k] = x[k]
                weights_y[lane, k] = y[k]
        for point in range(first, end):
            p = known(point)
            lane = point - first
            node = known(home[p])
            place = kind[node]
            own_strength = strength[known(row[p])]
            if ti.static(acted):
                own_strength = vec4(present[p][0], present[p][1], 0.0, 0.0)
            if place & EDGES:
                scatter_beside(
                    load, node, columns, place, motion[p], gradient[p], stress[p], history[p][0],
                    masses[lane], volume, cell, affine, False,
                )  # fmt: skip
                if place & NEAR:
                    scatter_volume(
                        load, node, columns, place, motion[p], volume, own_strength, False
                    )
            else:
                x = ti.Vector([weights_x[lane, k] for k in ti.static(range(3))])
                y = ti.Vector([weights_y[lane, k] for k in ti.static(range(3))])
                scatter_inside(
                    load, node, columns, row_of(bases, lane), row_of(acrosses, lane),
                    row_of(upwards, lane), masses[lane], x, y, False,
                )  # fmt: skip
                if place & NEAR:
                    scatter_weighted_volume(load, node, columns, x, y, volume, own_strength, False)

    @ti.func
    def gather_tile(
        first, last, dt, cell, per_cell, blend, columns, motion: A, home: A, gradient: A,
        stress: A, history: A, flow: A, swelling: A, kind: A, means: A, acrosses: A, upwards: A,
        rates: A, news: A, sums: A, weights_x: A, weights_y: A, shifts: A, beside: A, alarms: A,
    ):  # fmt: skip
        """Velocity and its gradient at the points, and their motion; 1 if one raises the alarm."""
        start = known(first)
        end = ti.min(first + TILE, last)
        alarm = 0
        for lane in range(TILE):
            p = start + lane
            x, y = spline_weights(motion[p][0]), spline_weights(motion[p][1])
            for k in ti.static(range(3)):
                weights_x[lane, k] = x[k]
                weights_y[lane, k] = y[k]
        for point in range(first, end):
            p = known(point)
            lane = point - first
            node = known(home[p])
            place = kind[node]
            if place & EDGES:
                mean, rate = gather_beside(flow, node, columns, place, motion[p], cell)
                put(means, lane, mean)
                put(acrosses, lane, rate)
                beside[lane] = 1
            else:
                mean, across, upward = gather_inside(
                    flow, node, columns,
                    ti.Vector([weights_x[lane, k] for k in ti.static(range(3))]),
                    ti.Vector([weights_y[lane, k] for k in ti.static(range(3))]),
                )  # fmt: skip
                put(means, lane, mean)
                put(acrosses, lane, across)
                put(upwards, lane, upward)
                beside[lane] = 0
        for lane in range(TILE):
            p = start + lane
            mean, across = row_of(means, lane), row_of(acrosses, lane)
            rate = gradient_inside(motion[p], mean, across, row_of(upwards, lane), per_cell)
            for k in ti.static(range(4)):
                rate[k] = ti.select(beside[lane] != 0, across[k], rate[k])
            new, shift, far = move(motion[p], columns, mean, blend, dt, per_cell)
            put(rates, lane, rate)
            put(news, lane, new)
            shifts[lane] = shift
            alarms[lane] = far
            if ti.static(averaged):
                put(sums, lane, cell_sums(rate, stress[p], history[p][1], dt))
        for point in range(first, end):
            p = known(point)
            lane = point - first
            node = known(home[p] + shifts[lane])
            alarm |= alarms[lane]
            gradient[p] = row_of(rates, lane)
            motion[p] = row_of(news, lane)
            home[p] = node
            if ti.static(averaged):
                swelling[node] = swelling[node] + row_of(sums, lane)
        return alarm

    return SimpleNamespace(
        strain_tile=strain_tile, scatter_tile=scatter_tile, gather_tile=gather_tile
    )
