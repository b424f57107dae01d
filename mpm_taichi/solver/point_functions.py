"""What one point, one node, one frame does; both schedules are made of these.

A step: stress of the points; scatter; nodes; gather and motion; means of the cells. The stress
comes first because F-bar needs the divergence of all points of a cell, which the gather before has
summed. On the CPU the same is done for eight points side by side: `tiles`.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace

import taichi as ti

from mpm_taichi.solver.boundary import BARRING, NEAR, STICK, WALLS
from mpm_taichi.solver.layout import (
    CELL,
    COURANT,
    FIXED_STEP,
    FRAME_TIME,
    SETTLE_DAMPING,
    SPEED,
    WAVE_SPEED,
    A,
    vec2,
    vec4,
)
from mpm_taichi.solver.transfer import (
    cell_sums,
    gather,
    move,
    pressure_relief,
    scatter,
    scatter_volume,
    smooth_pressure,
    strain_increment,
    stress_step,
)


@ti.func
def steps_of_frame(numbers: A, slot):
    """Number of steps in the coming frame: CFL with the present top speed, or the fixed step."""
    longest = numbers[slot, FIXED_STEP]
    if longest <= 0.0:
        speed = numbers[slot, WAVE_SPEED] + numbers[slot, SPEED]
        longest = numbers[slot, COURANT] * numbers[slot, CELL] / speed
    return ti.max(ti.cast(ti.ceil(numbers[slot, FRAME_TIME] / longest - 1.0e-4), ti.i32), 1)


@ti.func
def settle_node(load, flow, table, kind, dt, gravity):
    """Velocity of a node in dynamic relaxation (Cundall's damping), its unbalanced force, weight.

    The ground holds; walls are smooth and hold as well.
    """
    weight = gravity * load[4]
    force = vec2(load[2], load[3]) + load[5] * vec2(table[4], table[5])
    force[1] -= weight
    if kind & (STICK | BARRING):
        force = vec2(0.0, 0.0)
    if kind & WALLS:
        force[0] = 0.0
    unbalanced = ti.abs(force[0]) + ti.abs(force[1])
    new = vec2(0.0, 0.0)
    for k in ti.static(range(2)):
        damped = force[k] - SETTLE_DAMPING * ti.abs(force[k]) * ti.math.sign(flow[k])
        new[k] = flow[k] + (dt / load[4]) * damped
    return vec4(new[0], new[1], 0.0, 0.0), unbalanced, weight


def point_functions(
    *, affine: bool, averaged: bool, corrected: bool, effects: SimpleNamespace | None = None
) -> SimpleNamespace:
    """The functions of a point for one choice of transfer and material options.

    `effects` is what `effects.hooks.effect_functions` makes: then a point has a strength of its own
    (`present`), which its effects renew in every step.

    In each, `p` is the number of a point and `atomic` says that other threads add to its nodes.
    """
    acted = effects is not None

    @ti.func
    def strain_point(
        p, dt, share, volume, home: A, gradient: A, stress: A, history: A, row: A, elastic: A,
        strength: A, edges: A, swelling: A, slot, on, time, columns, first_node, integers: A,
        numbers: A, motion: A, facts: A, present: A, effect_numbers: A,
    ):  # fmt: skip
        r = row[p]
        own_strength = strength[r]
        own_edges = edges[r]
        if ti.static(acted):
            now = present[p]
            own_strength = vec4(now[0], now[1], now[2], 0.0)
            own_edges = vec4(now[3], now[4], now[5], 0.0)
        means = swelling[home[p]]
        velocity_gradient = gradient[p]
        old = history[p]
        volumetric = strain_increment(velocity_gradient, old[1], means, dt, averaged)
        relief = pressure_relief(stress[p], old[1], means, share, averaged)
        new_stress, new, shear = stress_step(
            stress[p], velocity_gradient, old, volumetric, relief, dt, volume, elastic[r],
            own_strength, own_edges, corrected,
        )  # fmt: skip
        stress[p] = new_stress
        history[p] = new
        if ti.static(acted):
            if shear > 0.0 and on & ti.static(effects.dilation_mask):
                change, work = effects.dilate(
                    p, slot, on, time, columns, first_node, shear, elastic[r], integers, numbers,
                    motion, home, gradient, stress, history, facts, effect_numbers,
                )  # fmt: skip
                stress[p] = new_stress + vec4(change, change, change, 0.0)
                new[3] += work * volume * (1.0 + new[0])
                history[p] = new

    @ti.func
    def scatter_point(
        p, cell, volume, columns, motion: A, home: A, gradient: A, stress: A, history: A, row: A,
        strength: A, edges: A, load: A, kind: A, present: A, atomic: ti.template(),
    ):  # fmt: skip
        r = row[p]
        node = home[p]
        place = kind[node]
        own_strength = strength[r]
        if ti.static(acted):
            own_strength = vec4(present[p][0], present[p][1], 0.0, 0.0)
        scatter(
            load, node, columns, place, motion[p], gradient[p], stress[p], history[p][0],
            edges[r][3], volume, cell, affine, atomic,
        )  # fmt: skip
        if place & NEAR:
            scatter_volume(load, node, columns, place, motion[p], volume, own_strength, atomic)

    @ti.func
    def gather_and_move(
        p, dt, cell, blend, columns, motion: A, home: A, gradient: A, stress: A, history: A,
        flow: A, swelling: A, kind: A, atomic: ti.template(),
    ):  # fmt: skip
        node = home[p]
        mean, velocity_gradient = gather(flow, node, columns, kind[node], motion[p], cell)
        new, shift, alarm = move(motion[p], columns, mean, blend, dt, 1.0 / cell)
        node += shift
        gradient[p] = velocity_gradient
        motion[p] = new
        home[p] = node
        if ti.static(averaged):
            sums = cell_sums(velocity_gradient, stress[p], history[p][1], dt)
            if ti.static(atomic):
                for k in ti.static(range(4)):
                    ti.atomic_add(swelling[node][k], sums[k])
            else:
                swelling[node] = swelling[node] + sums
        return alarm

    @ti.func
    def smooth_cell(n, columns, smoothing, swelling: A):
        own = swelling[n]
        if own[3] > 0.0:
            own[1] = smooth_pressure(
                own, swelling[n - 1], swelling[n + 1], swelling[n - columns],
                swelling[n + columns], smoothing,
            )  # fmt: skip
            swelling[n] = own

    @ti.func
    def settle_gather(
        p, cell, columns, motion: A, home: A, gradient: A, flow: A, swelling: A, kind: A,
        atomic: ti.template(),
    ):  # fmt: skip
        node = home[p]
        _, velocity_gradient = gather(flow, node, columns, kind[node], motion[p], cell)
        gradient[p] = velocity_gradient
        if ti.static(averaged):
            sums = vec4(velocity_gradient[0] + velocity_gradient[3], 0.0, 0.0, 1.0)
            if ti.static(atomic):
                for k in ti.static(range(4)):
                    ti.atomic_add(swelling[node][k], sums[k])
            else:
                swelling[node] = swelling[node] + sums

    @ti.func
    def settle_scatter(
        p, dt, cell, volume, columns, motion: A, home: A, gradient: A, stress: A, row: A,
        elastic: A, strength: A, edges: A, load: A, swelling: A, kind: A, atomic: ti.template(),
    ):  # fmt: skip
        r = row[p]
        node = home[p]
        volumetric = strain_increment(gradient[p], 0.0, swelling[node], dt, averaged)
        zero = vec4(0.0, 0.0, 0.0, 0.0)
        new_stress, _, _ = stress_step(
            stress[p], gradient[p], zero, volumetric, 0.0, dt, volume, elastic[r], strength[r],
            edges[r], False,
        )  # fmt: skip
        stress[p] = new_stress
        still = vec4(motion[p][0], motion[p][1], 0.0, 0.0)
        place = kind[node]
        scatter(
            load, node, columns, place, still, zero, new_stress, 0.0, edges[r][3], volume, cell,
            False, atomic,
        )  # fmt: skip
        if place & NEAR:
            scatter_volume(load, node, columns, place, still, volume, strength[r], atomic)

    @ti.func
    def point_energy(p, volume, motion: A, stress: A, history: A, row: A, elastic: A, edges: A):
        """Kinetic, elastic, dissipated energy [J/m] and squared speed of a point."""
        m = motion[p]
        s = stress[p]
        moduli = elastic[row[p]]
        squared = m[2] * m[2] + m[3] * m[3]
        pressure = (s[0] + s[1] + s[2]) * (1.0 / 3.0)
        shear = (
            (s[0] - pressure) ** 2 + (s[1] - pressure) ** 2 + (s[2] - pressure) ** 2
        ) + 2.0 * s[3] * s[3]  # fmt: skip
        strained = volume * (1.0 + history[p][0])
        stored = strained * 0.5 * (pressure * pressure * moduli[3] + shear * moduli[2])
        return vec4(0.5 * edges[row[p]][3] * squared, stored, history[p][3], squared)

    @ti.func
    def place(p, first_node, columns, cell, motion: A, home: A):
        """Position of a point relative to its grid's first node [m]."""
        node = home[p] - first_node
        i = node // columns
        j = node - i * columns
        return vec2(
            (ti.cast(i, ti.f32) + motion[p][0]) * cell, (ti.cast(j, ti.f32) + motion[p][1]) * cell
        )

    return SimpleNamespace(
        strain_point=strain_point,
        scatter_point=scatter_point,
        gather_and_move=gather_and_move,
        smooth_cell=smooth_cell,
        settle_gather=settle_gather,
        settle_scatter=settle_scatter,
        point_energy=point_energy,
        place=place,
    )
