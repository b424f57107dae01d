"""Steps of eight points at once: what the scene schedule runs where `point_functions` does one.

The stress update is latency-bound: each stress waits for a chain of a square root and divisions
about 100 cycles long, and a core looks ahead for little more than one point. So points go in tiles.
What depends on other places in memory (home, nodes, material) is fetched point by point into arrays
of the tile; pure arithmetic is a loop over the tile without branches, which the compiler turns into
vector instructions; what is rare (edges of the yield surface, tension, edges of the grid) is done
again point by point.

Formulas are those of `stress`, `transfer` and the material law, which the point schedule calls as
well. A slot has room for whole tiles; what lies behind its last point is never read by a point.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace
from typing import Any, NamedTuple

import taichi as ti

from mpm_taichi.layout import (
    BULK_MODULUS,
    DISSIPATED,
    OFFSET_X,
    OFFSET_Y,
    OPENING,
    SHEAR,
    TILE,
    VOLUMETRIC,
    A,
    bounded,
    vec4,
)
from mpm_taichi.materials.law import MaterialLaw
from mpm_taichi.solver.boundary import NEAR
from mpm_taichi.solver.splines import EDGES, spline_weights
from mpm_taichi.solver.stress import cell_sums
from mpm_taichi.solver.transfer import (
    contribution,
    gather_at_edge,
    gather_inside,
    gradient_inside,
    move,
    scatter_at_edge,
    scatter_inside,
    scatter_volume,
)


class Scratch(NamedTuple):
    """Arrays of a tile, which its three passes use one after the other for different things."""

    fours: Any  # six arrays of four numbers a point; the third also holds constants of the law
    variables: Any  # the history variables of the law
    weights: Any  # two of three: spline weights along x and y
    reals: Any  # two of one real number
    integers: Any  # three of one integer


@ti.func
def rows(width: A):
    """An array of the tile with `width` numbers for each of its points."""
    return ti.Matrix([[0.0 for _ in ti.static(range(width))] for _ in ti.static(range(TILE))])


@ti.func
def column(zero: A):
    """An array of the tile with one number of the kind of `zero` for each of its points."""
    return ti.Vector([zero for _ in ti.static(range(TILE))])


@ti.func
def new_scratch(constants: A, variables: A):
    """A `Scratch` with room for this many constants and history variables of the law."""
    a, b, c, d, e, f = rows(4), rows(4), rows(constants), rows(4), rows(4), rows(4)
    law_variables = rows(variables)
    x, y, real, other = rows(3), rows(3), column(0.0), column(0.0)
    i, j, k = column(0), column(0), column(0)
    return ti.static(
        Scratch(
            fours=(a, b, c, d, e, f),
            variables=law_variables,
            weights=(x, y),
            reals=(real, other),
            integers=(i, j, k),
        )
    )


@ti.func
def row_of(array: A, lane):
    """The four numbers of a point of the tile."""
    return vec4(array[lane, 0], array[lane, 1], array[lane, 2], array[lane, 3])


@ti.func
def vector_of(array: A, lane, width: A):
    """The numbers of a point of the tile."""
    return ti.Vector([array[lane, k] for k in ti.static(range(width))])


@ti.func
def put(array: A, lane, values, width: A):
    """Set the numbers of a point of the tile."""
    for k in ti.static(range(width)):
        array[lane, k] = values[k]


@ti.func
def put_weights(motion, lane, weights_x: A, weights_y: A):
    """Set the spline weights of a point of the tile."""
    put(weights_x, lane, spline_weights(motion[OFFSET_X]), 3)
    put(weights_y, lane, spline_weights(motion[OFFSET_Y]), 3)


def tile_functions(
    law: MaterialLaw,
    point: SimpleNamespace,
    *,
    affine: bool,
    averaged: bool,
    corrected: bool,
    effects: SimpleNamespace | None = None,
) -> SimpleNamespace:
    """The functions of a tile, from those of a `point` (`point_functions`) with the same options.

    In each, `first` is the first point of the tile and `last` the one behind the scene's last.
    """
    acted = effects is not None
    stress, variables_of, strength_of = point.stress, point.variables_of, point.strength_of
    scatter_strength, ground_strength = point.scatter_strength, law.ground_strength
    branches, constants = law.rare_return is not None, max(law.usual_constants, 4)
    variables, width = law.variables, max(law.variables, 1)

    @ti.func
    def strain_tile(first, last, step: A, state: A, scratch: A):
        """Stress and history of the points after a step."""
        points, cell_mean = ti.static((state.points, state.nodes.cell_mean))
        means, moduli, limits, trials, news, pasts = ti.static(scratch.fours)
        sheared, elsewhere = ti.static(scratch.reals)
        start = bounded(first)
        end = ti.min(first + TILE, last)
        for index in range(first, end):
            p = bounded(index)
            lane = index - first
            put(means, lane, cell_mean[bounded(points.home[p])], 4)
            put(moduli, lane, state.materials.elastic[bounded(points.row[p])], 4)
            put(limits, lane, strength_of(p, points, state.materials), constants)
            if ti.static(variables > 0):
                put(scratch.variables, lane, variables_of(p, points), variables)
        for lane in range(TILE):
            p = start + lane
            past = points.history[p]
            modulus = row_of(moduli, lane)
            trial, strain, opened = stress.trial(
                points.stress[p],
                points.gradient[p],
                past[OPENING],
                row_of(means, lane),
                step,
                modulus,
            )
            strength = vector_of(limits, lane, constants)
            own = vector_of(scratch.variables, lane, width)
            new, shear, work, off = stress.usual_return(trial, modulus, strength, own)
            spent = work * points.volume[p] * (1.0 + past[VOLUMETRIC])
            put(trials, lane, trial, 4)
            put(news, lane, new, 4)
            after = vec4(
                past[VOLUMETRIC] + strain, opened, past[SHEAR] + shear, past[DISSIPATED] + spent
            )
            put(pasts, lane, after, 4)
            if ti.static(variables > 0):
                put(scratch.variables, lane, own, variables)
            elsewhere[lane] = off
            sheared[lane] = shear
        for index in range(first, end):
            p = bounded(index)
            lane = index - first
            new, past = row_of(news, lane), row_of(pasts, lane)
            shear = sheared[lane]
            if ti.static(branches):
                if elsewhere[lane] > 0.0:
                    old = points.history[p]
                    own = variables_of(p, points)
                    new, shear, opening, work = stress.rare_return(
                        row_of(trials, lane),
                        row_of(moduli, lane),
                        strength_of(p, points, state.materials),
                        own,
                    )
                    past[SHEAR] = old[SHEAR] + shear
                    spent = work * points.volume[p] * (1.0 + old[VOLUMETRIC])
                    past[DISSIPATED] = old[DISSIPATED] + spent
                    if ti.static(corrected):
                        past[VOLUMETRIC] -= opening
                        past[OPENING] += opening
                    if ti.static(variables > 0):
                        put(scratch.variables, lane, own, variables)
            if ti.static(variables > 0):
                for k in ti.static(range(variables)):
                    points.variables[p, k] = scratch.variables[lane, k]
            points.stress[p] = new
            points.history[p] = past
            if ti.static(acted):
                if shear > 0.0 and step.on & ti.static(effects.dilation_mask):
                    change, work = effects.dilate(
                        p, step, state, shear, row_of(moduli, lane)[BULK_MODULUS]
                    )
                    points.stress[p] = new + vec4(change, change, change, 0.0)
                    past[DISSIPATED] += work * points.volume[p] * (1.0 + past[VOLUMETRIC])
                    points.history[p] = past

    @ti.func
    def scatter_tile(first, last, step: A, state: A, scratch: A):
        """Add momentum, internal force and mass of the points to their nodes."""
        points, nodes, materials = ti.static((state.points, state.nodes, state.materials))
        bases, acrosses, upwards = ti.static(scratch.fours[:3])
        weights_x, weights_y = ti.static(scratch.weights)
        masses, _ = ti.static(scratch.reals)
        start = bounded(first)
        end = ti.min(first + TILE, last)
        for index in range(first, end):
            masses[index - first] = materials.density[bounded(points.row[bounded(index)])]
        for lane in range(TILE):
            p = start + lane
            masses[lane] *= points.volume[p]
            base, across, upward = contribution(p, step, points, masses[lane], affine)
            put(bases, lane, base, 4)
            put(acrosses, lane, across, 4)
            put(upwards, lane, upward, 4)
            put_weights(points.motion[p], lane, weights_x, weights_y)
        for index in range(first, end):
            p = bounded(index)
            lane = index - first
            node = bounded(points.home[p])
            kind = nodes.kind[node]
            if kind & EDGES:
                scatter_at_edge(p, step, points, nodes.load, kind, masses[lane], affine, False)
                if kind & NEAR:
                    strength = strength_of(p, points, materials)
                    scatter_strength(p, step, points, nodes.load, kind, strength, False)
            else:
                x, y = vector_of(weights_x, lane, 3), vector_of(weights_y, lane, 3)
                scatter_inside(
                    nodes.load,
                    node,
                    step.columns,
                    row_of(bases, lane),
                    row_of(acrosses, lane),
                    row_of(upwards, lane),
                    masses[lane],
                    x,
                    y,
                    False,
                )
                if kind & NEAR:
                    friction, adhesion = ground_strength(strength_of(p, points, materials))
                    scatter_volume(
                        nodes.load,
                        node,
                        step.columns,
                        x,
                        y,
                        points.volume[p],
                        friction,
                        adhesion,
                        False,
                    )

    @ti.func
    def gather_tile(first, last, step: A, state: A, scratch: A):
        """Velocity and its gradient at the points, and their motion; 1 if one raises the alarm."""
        points, nodes = ti.static((state.points, state.nodes))
        means, acrosses, upwards, rates, news, sums = ti.static(scratch.fours)
        weights_x, weights_y = ti.static(scratch.weights)
        shifts, at_edge, alarms = ti.static(scratch.integers)
        start = bounded(first)
        end = ti.min(first + TILE, last)
        alarm = 0
        for lane in range(TILE):
            put_weights(points.motion[start + lane], lane, weights_x, weights_y)
        for index in range(first, end):
            p = bounded(index)
            lane = index - first
            node = bounded(points.home[p])
            kind = nodes.kind[node]
            if kind & EDGES:
                mean, rate = gather_at_edge(
                    nodes.velocity, node, step.columns, kind, points.motion[p], step.cell
                )
                put(means, lane, mean, 4)
                put(acrosses, lane, rate, 4)
                at_edge[lane] = 1
            else:
                mean, across, upward = gather_inside(
                    nodes.velocity,
                    node,
                    step.columns,
                    vector_of(weights_x, lane, 3),
                    vector_of(weights_y, lane, 3),
                )
                put(means, lane, mean, 4)
                put(acrosses, lane, across, 4)
                put(upwards, lane, upward, 4)
                at_edge[lane] = 0
        for lane in range(TILE):
            p = start + lane
            mean, across = row_of(means, lane), row_of(acrosses, lane)
            motion = points.motion[p]
            rate = gradient_inside(motion, mean, across, row_of(upwards, lane), step.per_cell)
            for k in ti.static(range(4)):
                rate[k] = ti.select(at_edge[lane] != 0, across[k], rate[k])
            new, shift, far = move(motion, step.columns, mean, step.blend, step.dt, step.per_cell)
            put(rates, lane, rate, 4)
            put(news, lane, new, 4)
            shifts[lane] = shift
            alarms[lane] = far
            if ti.static(averaged):
                opened = points.history[p][OPENING]
                put(sums, lane, cell_sums(rate, points.stress[p], opened, step.dt), 4)
        for index in range(first, end):
            p = bounded(index)
            lane = index - first
            node = bounded(points.home[p] + shifts[lane])
            alarm |= alarms[lane]
            points.gradient[p] = row_of(rates, lane)
            points.motion[p] = row_of(news, lane)
            points.home[p] = node
            if ti.static(averaged):
                nodes.cell_mean[node] = nodes.cell_mean[node] + row_of(sums, lane)
        return alarm

    @ti.func
    def scratch():
        return ti.static(new_scratch(constants, width))

    return SimpleNamespace(
        strain_tile=strain_tile,
        scatter_tile=scatter_tile,
        gather_tile=gather_tile,
        scratch=scratch,
    )
