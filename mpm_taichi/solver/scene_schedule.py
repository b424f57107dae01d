"""Scene-parallel schedule (CPU): one thread takes one scene through all its steps.

Plain loads and stores, no atomics: a scene's result depends on nothing but the scene, not on the
number of threads and not on its neighbours.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from collections.abc import Callable
from types import SimpleNamespace

import taichi as ti

from mpm_taichi.effects.framework.table import LIQUEFIED, OVERBURDEN
from mpm_taichi.solver.layout import (
    ALARM,
    CELL,
    COLUMNS,
    CONTACT_LOSS,
    DAMPING,
    EFFECT_WORK,
    EFFECTS_ON,
    F32,
    F64,
    FIRST_NODE,
    FIRST_POINT,
    FRAME_COUNT,
    FRAME_TIME,
    FRAMES,
    FRAMES_DONE,
    GRAVITY,
    I32,
    IDLE,
    INDEX,
    LAST_NODE,
    LAST_POINT,
    LAST_SETTLED,
    MEAN_OVERBURDEN,
    MOVING,
    PHASE,
    PIC_RATE,
    REAL,
    RELIEF,
    SETTLE_COURANT,
    SETTLE_LIMIT,
    SETTLE_STEPS,
    SETTLE_TOLERANCE,
    SETTLING,
    SMOOTHING,
    SPEED,
    STEPS,
    TILE,
    TOP_SPEED,
    UNBALANCED,
    VEC4,
    VEC8,
    VOLUME,
    WATER_WORK,
    WAVE_SPEED,
    A,
    vec4,
    vec8,
)
from mpm_taichi.solver.point_functions import settle_node, steps_of_frame
from mpm_taichi.solver.tiles import column, rows
from mpm_taichi.solver.transfer import cell_means, node_update

# Taichi hands a CPU thread at least 512 turns of a loop; a scene takes one turn in 512.
_TURNS = 512


def scene_schedule(
    point: SimpleNamespace, tiled: SimpleNamespace, effects: SimpleNamespace | None = None
) -> Callable:
    """The kernel `run_scenes`: settling where a scene is new, then a chunk of frames."""
    strain_tile, scatter_tile = tiled.strain_tile, tiled.scatter_tile
    gather_tile = tiled.gather_tile
    settle_gather, settle_scatter = point.settle_gather, point.settle_scatter
    point_energy, place = point.point_energy, point.place
    smooth_cell = point.smooth_cell
    update_node = node_update(effects)
    acted = effects is not None

    @ti.func
    def average_cells(first_node, last_node, swelling: A):
        for n in range(first_node, last_node):
            if swelling[n][3] > 0.0:
                swelling[n] = cell_means(swelling[n])

    @ti.func
    def settle(
        slot, integers: A, numbers: A, motion: A, home: A, gradient: A, stress: A, row: A,
        elastic: A, strength: A, edges: A, load: A, flow: A, swelling: A, kind: A, table: A,
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
                settle_gather(p, cell, columns, motion, home, gradient, flow, swelling, kind, False)
            average_cells(first_node, last_node, swelling)
            for p in range(first, last):
                settle_scatter(
                    p, dt, cell, volume, columns, motion, home, gradient, stress, row, elastic,
                    strength, edges, load, swelling, kind, False,
                )  # fmt: skip
            unbalanced = ti.cast(0.0, ti.f64)
            weight = ti.cast(0.0, ti.f64)
            for n in range(first_node, last_node):
                if load[n][4] > 0.0:
                    new, force, own = settle_node(
                        load[n], flow[n], table[n], kind[n], dt, numbers[slot, GRAVITY]
                    )
                    flow[n] = new
                    load[n] = vec8(0.0)
                    swelling[n] = vec4(0.0)
                    unbalanced += ti.cast(force, ti.f64)
                    weight += ti.cast(own, ti.f64)
            if step > 20:
                ratio = ti.cast(unbalanced / weight, ti.f32)
            step += 1
        integers[slot, SETTLE_STEPS] = step
        numbers[slot, UNBALANCED] = ratio

    @ti.func
    def frame_sums(
        slot, frame, integers: A, numbers: A, motion: A, stress: A, history: A, row: A, elastic: A,
        edges: A, sums: A,
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

    @ti.func
    def note_overburden(slot, first, last, numbers: A, stress: A, facts: A):
        """Vertical effective stress before failure, and its mean over the liquefied points."""
        total = ti.cast(0.0, ti.f64)
        points = 0
        for p in range(first, last):
            overburden = ti.max(-stress[p][1], 0.0)
            facts[p, OVERBURDEN] = overburden
            if facts[p, LIQUEFIED] > 0.5:
                total += ti.cast(overburden, ti.f64)
                points += 1
        numbers[slot, MEAN_OVERBURDEN] = ti.cast(total / ti.max(points, 1), ti.f32)

    @ti.kernel
    def run_scenes(
        slots: ti.i32, integers: I32, numbers: F32, motion: VEC4, home: INDEX, gradient: VEC4,
        stress: VEC4, history: VEC4, row: INDEX, elastic: VEC4, strength: VEC4, edges: VEC4,
        settle_strength: VEC4, settle_edges: VEC4, initial_stress: VEC4, load: VEC8, flow: VEC4,
        swelling: VEC4, kind: INDEX, table: VEC8, places: FRAMES, sums: F64, facts: F32,
        present: VEC8, resisted: REAL, effect_numbers: F32,
    ):  # fmt: skip
        for turn in range(slots * _TURNS):
            slot = turn // _TURNS
            if turn % _TURNS == 0 and integers[slot, PHASE] != IDLE:
                first, last = integers[slot, FIRST_POINT], integers[slot, LAST_POINT]
                first_node, last_node = integers[slot, FIRST_NODE], integers[slot, LAST_NODE]
                columns = integers[slot, COLUMNS]
                tiles = (last - first + TILE - 1) // TILE
                cell, volume = numbers[slot, CELL], numbers[slot, VOLUME]
                per_cell = 1.0 / cell
                gravity, damping = numbers[slot, GRAVITY], numbers[slot, DAMPING]
                smoothing = numbers[slot, SMOOTHING]
                if integers[slot, PHASE] == SETTLING:
                    settle(
                        slot, integers, numbers, motion, home, gradient, stress, row, elastic,
                        settle_strength, settle_edges, load, flow, swelling, kind, table,
                    )  # fmt: skip
                    for p in range(first, last):
                        initial_stress[p] = stress[p]
                        gradient[p] = vec4(0.0, 0.0, 0.0, 0.0)
                        history[p] = vec4(0.0, 0.0, 0.0, 0.0)
                    if ti.static(acted):
                        note_overburden(slot, first, last, numbers, stress, facts)
                    integers[slot, PHASE] = MOVING
                alarm = 0
                # Arrays of a tile, which the three passes use for one thing after the other.
                a, b, c, d, e, f = rows(4), rows(4), rows(4), rows(4), rows(4), rows(4)
                weights_x, weights_y = rows(3), rows(3)
                real, other = column(0.0), column(0.0)
                shifts, beside, alarms = column(0), column(0), column(0)
                for frame in range(integers[slot, FRAME_COUNT]):
                    count = steps_of_frame(numbers, slot)
                    dt = numbers[slot, FRAME_TIME] / count
                    blend = ti.min(numbers[slot, PIC_RATE] * dt, 1.0)
                    share = ti.min(numbers[slot, RELIEF] * dt, 1.0)
                    contact_loss = ti.cast(0.0, ti.f64)
                    water_work = ti.cast(0.0, ti.f64)
                    effect_work = ti.cast(0.0, ti.f64)
                    on = 0
                    time = 0.0
                    if ti.static(acted):
                        on = integers[slot, EFFECTS_ON]
                    step = 0
                    while step < count and alarm == 0:
                        if ti.static(acted):
                            time = integers[slot, FRAMES_DONE] * numbers[slot, FRAME_TIME]
                            time += step * dt
                            if on & ti.static(effects.strength_mask):
                                for p in range(first, last):
                                    effects.renew_strength(
                                        p, slot, on, time, columns, first_node, integers, numbers,
                                        motion, home, gradient, stress, history, facts, present,
                                        effect_numbers,
                                    )  # fmt: skip
                        for tile in range(tiles):
                            strain_tile(
                                first + tile * TILE, last, dt, share, volume, home, gradient,
                                stress, history, row, elastic, strength, edges, swelling, slot, on,
                                time, columns, first_node, integers, numbers, motion, facts,
                                present, effect_numbers, a, b, c, d, e, f, real, other,
                            )  # fmt: skip
                        for tile in range(tiles):
                            scatter_tile(
                                first + tile * TILE, last, cell, per_cell, volume, columns, motion,
                                home, gradient, stress, history, row, strength, edges, load, kind,
                                present, a, b, c, weights_x, weights_y, real,
                            )  # fmt: skip
                        if ti.static(acted):
                            if on & ti.static(effects.resistance_mask):
                                for p in range(first, last):
                                    effects.resist(
                                        p, slot, on, time, columns, first_node, integers, numbers,
                                        motion, home, gradient, stress, history, facts,
                                        effect_numbers, volume, kind, resisted, False,
                                    )  # fmt: skip
                        for n in range(first_node, last_node):
                            if load[n][4] > 0.0:
                                new = vec4(0.0)
                                lost = 0.0
                                work = 0.0
                                if ti.static(acted):
                                    node = effects.node_of(
                                        n, slot, time, columns, first_node, integers, numbers
                                    )
                                    new, lost, work, given = update_node(
                                        load[n], table[n], kind[n], dt, gravity, damping,
                                        resisted[n], slot, on, node, effect_numbers,
                                    )  # fmt: skip
                                    resisted[n] = 0.0
                                    effect_work += ti.cast(given, ti.f64)
                                else:
                                    new, lost, work, _ = update_node(
                                        load[n], table[n], kind[n], dt, gravity, damping
                                    )
                                flow[n] = new
                                load[n] = vec8(0.0)
                                swelling[n] = vec4(0.0)
                                contact_loss += ti.cast(lost, ti.f64)
                                water_work += ti.cast(work, ti.f64)
                        for tile in range(tiles):
                            alarm |= gather_tile(
                                first + tile * TILE, last, dt, cell, per_cell, blend, columns,
                                motion, home, gradient, stress, history, flow, swelling, kind, a,
                                b, c, d, e, f, weights_x, weights_y, shifts, beside, alarms,
                            )  # fmt: skip
                        average_cells(first_node, last_node, swelling)
                        for n in range(first_node, last_node):
                            smooth_cell(n, columns, smoothing, swelling)
                        step += 1
                    integers[slot, STEPS] += step
                    if alarm != 0 and integers[slot, ALARM] == 0:
                        integers[slot, ALARM] = frame + 1
                    frame_sums(
                        slot, frame, integers, numbers, motion, stress, history, row, elastic,
                        edges, sums,
                    )  # fmt: skip
                    sums[slot, frame, CONTACT_LOSS] = contact_loss
                    sums[slot, frame, WATER_WORK] = water_work
                    if ti.static(acted):
                        sums[slot, frame, EFFECT_WORK] = effect_work
                        integers[slot, FRAMES_DONE] += 1
                    for p in range(first, last):
                        places[slot, frame, p - first] = place(
                            p, first_node, columns, cell, motion, home
                        )

    return run_scenes
