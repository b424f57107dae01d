"""Work on one point, one cell, one frame; both schedules are made of these.

A step: stress of the points; scatter; nodes; gather and motion; means of the cells. The stress
comes first because F-bar needs the divergence of all points of a cell, which the gather before has
summed. On the CPU the same is done for eight points together: `tiles`.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace

import taichi as ti

from mpm_taichi.layout import (
    BULK_COMPLIANCE,
    BULK_MODULUS,
    CELL,
    CLOSED_POINTS,
    COURANT,
    DISSIPATED,
    DVX_DX,
    DVY_DY,
    FIXED_STEP,
    FRAME_TIME,
    OFFSET_X,
    OFFSET_Y,
    OPENING,
    SHEAR_COMPLIANCE,
    SMOOTHED,
    SPEED,
    VELOCITY_X,
    VELOCITY_Y,
    VOLUMETRIC,
    WAVE_SPEED,
    XX,
    XY,
    YY,
    ZZ,
    A,
    vec2,
    vec4,
)
from mpm_taichi.materials.law import MaterialLaw
from mpm_taichi.solver.boundary import NEAR
from mpm_taichi.solver.stress import cell_means, cell_sums, smooth_pressure, stress_functions
from mpm_taichi.solver.transfer import gather, mass_weights, move, scatter, scatter_volume


@ti.func
def steps_of_frame(numbers: A, slot):
    """Number of steps in the coming frame: CFL with the present top speed, or the fixed step."""
    longest = numbers[slot, FIXED_STEP]
    if longest <= 0.0:
        speed = numbers[slot, WAVE_SPEED] + numbers[slot, SPEED]
        longest = numbers[slot, COURANT] * numbers[slot, CELL] / speed
    return ti.max(ti.cast(ti.ceil(numbers[slot, FRAME_TIME] / longest - 1.0e-4), ti.i32), 1)


@ti.func
def average_cell(n, cell_mean: A):
    """The means of a cell from its sums."""
    if cell_mean[n][CLOSED_POINTS] > 0.0:
        cell_mean[n] = cell_means(cell_mean[n])


@ti.func
def smooth_cell(n, columns, smoothing, cell_mean: A):
    """The smoothed mean stress of a cell from the means of its neighbours."""
    own = cell_mean[n]
    if own[CLOSED_POINTS] > 0.0:
        own[SMOOTHED] = smooth_pressure(
            own,
            cell_mean[n - 1],
            cell_mean[n + 1],
            cell_mean[n - columns],
            cell_mean[n + columns],
            smoothing,
        )
        cell_mean[n] = own


@ti.func
def point_mass(p, points: A, materials: A):
    """Mass of a point [kg/m]."""
    return materials.density[points.row[p]] * points.volume[p]


@ti.func
def point_energy(p, points: A, materials: A):
    """Kinetic, elastic, dissipated energy [J/m] and squared speed of a point."""
    m = points.motion[p]
    s = points.stress[p]
    moduli = materials.elastic[points.row[p]]
    squared = m[VELOCITY_X] * m[VELOCITY_X] + m[VELOCITY_Y] * m[VELOCITY_Y]
    mean = (s[XX] + s[YY] + s[ZZ]) * (1.0 / 3.0)
    shear = ((s[XX] - mean) ** 2 + (s[YY] - mean) ** 2 + (s[ZZ] - mean) ** 2) + 2.0 * s[XY] * s[XY]
    strained = points.volume[p] * (1.0 + points.history[p][VOLUMETRIC])
    stored = (
        strained * 0.5 * (mean * mean * moduli[BULK_COMPLIANCE] + shear * moduli[SHEAR_COMPLIANCE])
    )
    kinetic = 0.5 * point_mass(p, points, materials) * squared
    return vec4(kinetic, stored, points.history[p][DISSIPATED], squared)


@ti.func
def position(p, first_node, columns, cell, points: A):
    """Position of a point relative to its grid's first node [m]."""
    node = points.home[p] - first_node
    i = node // columns
    j = node - i * columns
    offset = points.motion[p]
    return vec2(
        (ti.cast(i, ti.f32) + offset[OFFSET_X]) * cell,
        (ti.cast(j, ti.f32) + offset[OFFSET_Y]) * cell,
    )


@ti.func
def add_to_cell(node, sums, cell_mean: A, atomic: A):
    """Add a point's sums to those of its cell."""
    if ti.static(atomic):
        for k in ti.static(range(4)):
            ti.atomic_add(cell_mean[node][k], sums[k])
    else:
        cell_mean[node] = cell_mean[node] + sums


def point_functions(
    law: MaterialLaw,
    *,
    affine: bool,
    averaged: bool,
    corrected: bool,
    effects: SimpleNamespace | None = None,
) -> SimpleNamespace:
    """The functions of a point for one material law and one choice of options.

    `effects` is what `effects.hooks.effect_functions` makes: then a point has a strength of its own
    (`PointState.own_strength`), which its effects renew in every step.

    In each, `p` is the number of a point and `atomic` says that other threads add to its nodes.
    """
    acted = effects is not None
    stress = stress_functions(law, averaged=averaged, corrected=corrected)
    # Settling is elastic and starts from no history: nothing opens, nothing is evened out.
    settling = stress_functions(law, averaged=averaged, relieved=False)
    remembers = law.variables > 0

    @ti.func
    def strength_of(p, points: A, materials: A):
        """Constants of the law at a point, (8,)."""
        row = materials.strength[points.row[p]]
        if ti.static(acted):
            row = points.own_strength[p]
        return row

    @ti.func
    def variables_of(p, points: A):
        """History variables of the law at a point; a number that nobody reads if it has none."""
        if ti.static(not remembers):
            return 0.0
        return ti.Vector([points.variables[p, k] for k in ti.static(range(law.variables))])

    @ti.func
    def strain_point(p, step: A, state: A):
        """Stress and history of a point after a step."""
        points, materials = ti.static((state.points, state.materials))
        elastic = materials.elastic[points.row[p]]
        variables = variables_of(p, points)
        new_stress, new, shear = stress.advance(
            p,
            step,
            points,
            state.nodes.cell_mean[points.home[p]],
            elastic,
            strength_of(p, points, materials),
            variables,
        )
        points.stress[p] = new_stress
        points.history[p] = new
        if ti.static(remembers):
            for k in ti.static(range(law.variables)):
                points.variables[p, k] = variables[k]
        if ti.static(acted):
            if shear > 0.0 and step.on & ti.static(effects.dilation_mask):
                change, work = effects.dilate(p, step, state, shear, elastic[BULK_MODULUS])
                points.stress[p] = new_stress + vec4(change, change, change, 0.0)
                new[DISSIPATED] += work * points.volume[p] * (1.0 + new[VOLUMETRIC])
                points.history[p] = new

    @ti.func
    def scatter_strength(p, step: A, points: A, load: A, kind, strength, atomic: A):
        """Volume and strength of a point near water or rough ground."""
        weight_x, weight_y = mass_weights(points.motion[p], kind)
        friction, adhesion = law.ground_strength(strength)
        scatter_volume(
            load,
            points.home[p],
            step.columns,
            weight_x,
            weight_y,
            points.volume[p],
            friction,
            adhesion,
            atomic,
        )

    @ti.func
    def scatter_point(p, step: A, state: A, atomic: A):
        """Momentum, internal force, mass, and where asked for strength, to the nodes."""
        points, nodes, materials = ti.static((state.points, state.nodes, state.materials))
        kind = nodes.kind[points.home[p]]
        scatter(p, step, points, nodes.load, kind, point_mass(p, points, materials), affine, atomic)
        if kind & NEAR:
            strength = strength_of(p, points, materials)
            scatter_strength(p, step, points, nodes.load, kind, strength, atomic)

    @ti.func
    def gather_and_move(p, step: A, state: A, atomic: A):
        """Velocity and its gradient at a point, and its motion; 1 if it raises the alarm."""
        points, nodes = ti.static((state.points, state.nodes))
        node = points.home[p]
        mean, gradient = gather(
            nodes.velocity, node, step.columns, nodes.kind[node], points.motion[p], step.cell
        )
        new, shift, alarm = move(
            points.motion[p], step.columns, mean, step.blend, step.dt, 1.0 / step.cell
        )
        node += shift
        points.gradient[p] = gradient
        points.motion[p] = new
        points.home[p] = node
        if ti.static(averaged):
            sums = cell_sums(gradient, points.stress[p], points.history[p][OPENING], step.dt)
            add_to_cell(node, sums, nodes.cell_mean, atomic)
        return alarm

    @ti.func
    def settle_gather(p, step: A, state: A, atomic: A):
        """Velocity gradient at a point that stays where it is."""
        points, nodes = ti.static((state.points, state.nodes))
        node = points.home[p]
        _, gradient = gather(
            nodes.velocity, node, step.columns, nodes.kind[node], points.motion[p], step.cell
        )
        points.gradient[p] = gradient
        if ti.static(averaged):
            divergence = gradient[DVX_DX] + gradient[DVY_DY]
            add_to_cell(node, vec4(divergence, 0.0, 0.0, 1.0), nodes.cell_mean, atomic)

    @ti.func
    def settle_scatter(p, step: A, state: A, atomic: A):
        """Stress of a point in settling, and its internal force and mass to the nodes."""
        points, nodes, materials = ti.static((state.points, state.nodes, state.materials))
        r, node = points.row[p], points.home[p]
        strength = materials.settle_strength[r]
        variables = variables_of(p, points)
        new_stress, _, _ = settling.advance(
            p, step, points, nodes.cell_mean[node], materials.elastic[r], strength, variables
        )
        points.stress[p] = new_stress
        kind = nodes.kind[node]
        mass = point_mass(p, points, materials)
        scatter(p, step, points, nodes.load, kind, mass, False, atomic)
        if kind & NEAR:
            scatter_strength(p, step, points, nodes.load, kind, strength, atomic)

    return SimpleNamespace(
        stress=stress,
        variables_of=variables_of,
        strength_of=strength_of,
        scatter_strength=scatter_strength,
        strain_point=strain_point,
        scatter_point=scatter_point,
        gather_and_move=gather_and_move,
        settle_gather=settle_gather,
        settle_scatter=settle_scatter,
    )
