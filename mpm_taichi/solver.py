"""The time loop of the material point method, scheduled in two ways.

`scene` (CPU): one thread takes one scene through all its steps, with plain loads and stores. The
result of a scene then depends on nothing but the scene: not on threads, not on its neighbours.
`point` (GPU): all points of all scenes side by side, with atomic adds, so equal to rounding only.
Both call the functions of `transfer`; the physics is written once.

A step: stress of the points and scatter; nodes; gather and motion. The stress comes first because
F-bar needs the divergence of all points of a cell, which the gather before has summed.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from functools import cache
from types import SimpleNamespace

import taichi as ti

from mpm_taichi.boundary import NEAR
from mpm_taichi.mohr_coulomb import vec4
from mpm_taichi.transfer import (
    gather,
    move,
    pressure_relief,
    scatter,
    scatter_volume,
    strain_increment,
    update_node,
    update_stress,
    vec2,
    vec8,
)

A = ti.template()
"""How a function takes an array: as it is, not by value."""

F32 = ti.types.ndarray(dtype=ti.f32, ndim=2)
F64 = ti.types.ndarray(dtype=ti.f64, ndim=3)
I32 = ti.types.ndarray(dtype=ti.i32, ndim=2)
INDEX = ti.types.ndarray(dtype=ti.i32, ndim=1)
VEC4 = ti.types.ndarray(dtype=vec4, ndim=1)
VEC8 = ti.types.ndarray(dtype=vec8, ndim=1)
FRAMES = ti.types.ndarray(dtype=vec2, ndim=3)

# Columns of the integer table of a slot (a slot holds one scene).
FIRST_POINT, LAST_POINT, LAST_SETTLED, FIRST_NODE, LAST_NODE, COLUMNS, PHASE, FRAME_COUNT = range(8)
ALARM, SETTLE_STEPS, STEPS, SUBSTEPS = range(8, 12)
INTEGERS = 12
# Columns of the table of numbers of a slot.
CELL, VOLUME, FRAME_TIME, PIC_RATE, GRAVITY, COURANT, WAVE_SPEED, SPEED = range(8)
FIXED_STEP, DAMPING, UNBALANCED, RELIEF = range(8, 12)
NUMBERS = 12
# Columns of the sums of a frame [J/m; m/s].
KINETIC, ELASTIC, PLASTIC, CONTACT_LOSS, WATER_WORK, TOP_SPEED = range(6)
SUMS = 6

IDLE, SETTLING, MOVING = 0, 1, 2
"""Phases of a slot."""

SETTLE_LIMIT = 6000
"""Most steps of settling; reaching it is reported."""
SETTLE_TOLERANCE = 1e-4
"""Settled: unbalanced nodal forces below this share of the weight."""
SETTLE_DAMPING = 0.7
SETTLE_COURANT = 0.5

# Taichi hands a CPU thread at least 512 turns of a loop; a scene takes one turn in 512.
_TURNS = 512


@ti.func
def steps_of_frame(numbers: A, slot):
    """Number of steps in the coming frame: CFL with the present top speed, or the fixed step."""
    longest = numbers[slot, FIXED_STEP]
    if longest <= 0.0:
        speed = numbers[slot, WAVE_SPEED] + numbers[slot, SPEED]
        longest = numbers[slot, COURANT] * numbers[slot, CELL] / speed
    return ti.max(ti.cast(ti.ceil(numbers[slot, FRAME_TIME] / longest - 1.0e-4), ti.i32), 1)


@ti.func
def settle_contact(velocity, kind):
    """Contact while settling: the ground holds, walls are smooth and hold as well."""
    v = velocity
    if kind & 35:
        v = vec2(0.0, 0.0)
    if kind & 12:
        v[0] = 0.0
    return v


@cache
def build_kernels(*, affine: bool, averaged: bool, corrected: bool) -> SimpleNamespace:
    """Compile the kernels for one choice of transfer and material options.

    Args:
        affine: the affine part of a point's velocity travels to the grid (APIC, affine FLIP).
        averaged: volumetric strain increments averaged over a cell (F-bar).
        corrected: volume correction at the free surface.

    Returns:
        `run_scenes` (settling and frames, one thread per scene), and for the point schedule
        `begin_frame`, `point_step`, `end_frame`.
    """

    @ti.func
    def stress_and_scatter(
        p, dt, share, cell, volume, columns, motion: A, home: A, gradient: A, stress: A, history: A,
        row: A, elastic: A, strength: A, edges: A, load: A, swelling: A, kind: A,
        atomic: ti.template(),
    ):  # fmt: skip
        r = row[p]
        node = home[p]
        point_motion = motion[p]
        velocity_gradient = gradient[p]
        old = history[p]
        limits = edges[r]
        volumetric = strain_increment(velocity_gradient, swelling[node], dt, averaged)
        relief = pressure_relief(stress[p], old, swelling[node], share, averaged)
        new_stress, new = update_stress(
            stress[p], velocity_gradient, old, volumetric, relief, dt, volume, elastic[r], strength[r],
            limits, corrected,
        )  # fmt: skip
        stress[p] = new_stress
        history[p] = new
        scatter(
            load, node, columns, point_motion, velocity_gradient, new_stress, new[0], limits[3],
            volume, cell, affine, atomic,
        )  # fmt: skip
        if kind[node] & NEAR:
            scatter_volume(load, node, columns, point_motion, volume, strength[r], atomic)

    @ti.func
    def gather_and_move(
        p, dt, cell, blend, columns, motion: A, home: A, gradient: A, stress: A, history: A, flow: A,
        swelling: A,
        atomic: ti.template(),
    ):  # fmt: skip
        node = home[p]
        mean, velocity_gradient = gather(flow, node, columns, motion[p], cell)
        new, node, alarm = move(motion[p], node, columns, mean, blend, dt, cell)
        gradient[p] = velocity_gradient
        motion[p] = new
        home[p] = node
        if ti.static(averaged):
            divergence = velocity_gradient[0] + velocity_gradient[3]
            s = stress[p]
            closed = ti.select(history[p][1] <= 0.0, 1.0, 0.0)
            sums = vec4(divergence, 1.0, closed * (s[0] + s[1] + s[2]) * (1.0 / 3.0), closed)
            if ti.static(atomic):
                for k in ti.static(range(4)):
                    ti.atomic_add(swelling[node][k], sums[k])
            else:
                swelling[node] = swelling[node] + sums
        return alarm

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

    @ti.func
    def settle(
        slot, integers: A, numbers: A, motion: A, home: A, gradient: A, stress: A, history: A, row: A, elastic: A, strength: A,
        edges: A, load: A, flow: A, swelling: A, kind: A, table: A,
    ):  # fmt: skip
        """Elastic rest under weight, by dynamic relaxation on points that stay where they are.

        Node velocities live in `flow`; geometry and masses are those of t = 0 throughout, so
        that the stress found is in balance with the points exactly where the scene has them.
        """
        first, last = integers[slot, FIRST_POINT], integers[slot, LAST_SETTLED]
        first_node, last_node = integers[slot, FIRST_NODE], integers[slot, LAST_NODE]
        columns = integers[slot, COLUMNS]
        cell, volume = numbers[slot, CELL], numbers[slot, VOLUME]
        dt = SETTLE_COURANT * cell / numbers[slot, WAVE_SPEED]
        step = 0
        ratio = 1.0
        while step < SETTLE_LIMIT and ratio > SETTLE_TOLERANCE and last > first:
            for p in range(first, last):
                _, velocity_gradient = gather(flow, home[p], columns, motion[p], cell)
                gradient[p] = velocity_gradient
                if ti.static(averaged):
                    node = home[p]
                    divergence = velocity_gradient[0] + velocity_gradient[3]
                    swelling[node] = swelling[node] + vec4(divergence, 1.0, 0.0, 0.0)
            for p in range(first, last):
                r = row[p]
                node = home[p]
                volumetric = strain_increment(gradient[p], swelling[node], dt, averaged)
                zero = vec4(0.0, 0.0, 0.0, 0.0)
                new_stress, _ = update_stress(
                    stress[p], gradient[p], zero, volumetric, 0.0, dt, volume, elastic[r], strength[r],
                    edges[r], False,
                )  # fmt: skip
                stress[p] = new_stress
                still = vec4(motion[p][0], motion[p][1], 0.0, 0.0)
                scatter(
                    load, node, columns, still, zero, new_stress, 0.0, edges[r][3], volume, cell,
                    False, False,
                )  # fmt: skip
                if kind[node] & NEAR:
                    scatter_volume(load, node, columns, still, volume, strength[r], False)
            unbalanced = ti.cast(0.0, ti.f64)
            weight = ti.cast(0.0, ti.f64)
            for n in range(first_node, last_node):
                if load[n][4] > 0.0:
                    now = load[n]
                    old = vec2(flow[n][0], flow[n][1])
                    force = vec2(now[2], now[3]) + now[5] * vec2(table[n][4], table[n][5])
                    force[1] -= numbers[slot, GRAVITY] * now[4]
                    free = settle_contact(force, kind[n])
                    unbalanced += ti.abs(free[0]) + ti.abs(free[1])
                    weight += numbers[slot, GRAVITY] * now[4]
                    for k in ti.static(range(2)):
                        free[k] -= SETTLE_DAMPING * ti.abs(free[k]) * ti.math.sign(old[k])
                    new = old + (dt / now[4]) * free
                    flow[n] = vec4(new[0], new[1], 0.0, 0.0)
                    load[n] = vec8(0.0)
                    swelling[n] = vec4(0.0)
            if step > 20:
                ratio = ti.cast(unbalanced / weight, ti.f32)
            step += 1
        integers[slot, SETTLE_STEPS] = step
        numbers[slot, UNBALANCED] = ratio

    @ti.func
    def frame_sums(
        slot, frame, integers: A, numbers: A, motion: A, stress: A, history: A, row: A, elastic: A, edges: A, sums: A,
    ):  # fmt: skip
        """Energies of all points of a scene at the end of a frame."""
        total = ti.Vector([0.0, 0.0, 0.0], ti.f64)
        top = 0.0
        for p in range(integers[slot, FIRST_POINT], integers[slot, LAST_POINT]):
            e = point_energy(p, numbers[slot, VOLUME], motion, stress, history, row, elastic, edges)
            for k in ti.static(range(3)):
                total[k] += ti.cast(e[k], ti.f64)
            top = ti.max(top, e[3])
        for k in ti.static(range(3)):
            sums[slot, frame, k] = total[k]
        numbers[slot, SPEED] = ti.sqrt(top)
        sums[slot, frame, TOP_SPEED] = ti.sqrt(top)

    @ti.kernel
    def run_scenes(
        slots: ti.i32, integers: I32, numbers: F32, motion: VEC4, home: INDEX, gradient: VEC4,
        stress: VEC4, history: VEC4, row: INDEX, elastic: VEC4, strength: VEC4, edges: VEC4,
        settle_strength: VEC4, settle_edges: VEC4, initial_stress: VEC4, load: VEC8, flow: VEC4,
        swelling: VEC4, kind: INDEX, table: VEC8, places: FRAMES, sums: F64,
    ):  # fmt: skip
        for turn in range(slots * _TURNS):
            slot = turn // _TURNS
            if turn % _TURNS == 0 and integers[slot, PHASE] != IDLE:
                first, last = integers[slot, FIRST_POINT], integers[slot, LAST_POINT]
                first_node, last_node = integers[slot, FIRST_NODE], integers[slot, LAST_NODE]
                columns = integers[slot, COLUMNS]
                cell, volume = numbers[slot, CELL], numbers[slot, VOLUME]
                gravity, damping = numbers[slot, GRAVITY], numbers[slot, DAMPING]
                if integers[slot, PHASE] == SETTLING:
                    settle(
                        slot, integers, numbers, motion, home, gradient, stress, history, row,
                        elastic, settle_strength, settle_edges, load, flow, swelling, kind, table,
                    )  # fmt: skip
                    for p in range(first, last):
                        initial_stress[p] = stress[p]
                        gradient[p] = vec4(0.0, 0.0, 0.0, 0.0)
                        history[p] = vec4(0.0, 0.0, 0.0, 0.0)
                    integers[slot, PHASE] = MOVING
                alarm = 0
                for frame in range(integers[slot, FRAME_COUNT]):
                    count = steps_of_frame(numbers, slot)
                    dt = numbers[slot, FRAME_TIME] / count
                    blend = ti.min(numbers[slot, PIC_RATE] * dt, 1.0)
                    share = ti.min(numbers[slot, RELIEF] * dt, 1.0)
                    contact_loss = ti.cast(0.0, ti.f64)
                    water_work = ti.cast(0.0, ti.f64)
                    step = 0
                    while step < count and alarm == 0:
                        for p in range(first, last):
                            stress_and_scatter(
                                p, dt, share, cell, volume, columns, motion, home, gradient, stress,
                                history, row, elastic, strength, edges, load, swelling, kind, False,
                            )  # fmt: skip
                        for n in range(first_node, last_node):
                            if load[n][4] > 0.0:
                                new, lost, work = update_node(
                                    load[n], table[n], kind[n], dt, gravity, damping
                                )
                                flow[n] = new
                                load[n] = vec8(0.0)
                                swelling[n] = vec4(0.0)
                                contact_loss += ti.cast(lost, ti.f64)
                                water_work += ti.cast(work, ti.f64)
                        for p in range(first, last):
                            alarm |= gather_and_move(
                                p, dt, cell, blend, columns, motion, home, gradient, stress, history,
                                flow, swelling, False,
                            )  # fmt: skip
                        step += 1
                    integers[slot, STEPS] += step
                    frame_sums(
                        slot, frame, integers, numbers, motion, stress, history, row, elastic,
                        edges, sums,
                    )  # fmt: skip
                    sums[slot, frame, CONTACT_LOSS] = contact_loss
                    sums[slot, frame, WATER_WORK] = water_work
                    for p in range(first, last):
                        places[slot, frame, p - first] = place(
                            p, first_node, columns, cell, motion, home
                        )
                integers[slot, ALARM] |= alarm

    return SimpleNamespace(run_scenes=run_scenes)
