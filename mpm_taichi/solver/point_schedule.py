"""Point-parallel schedule (GPU): all points, then all nodes, of all scenes side by side.

Points add to nodes with atomics, so sums come in any order and results agree with the scene
schedule to rounding only. Scenes with fewer steps in a frame wait for the others.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace

import taichi as ti

from mpm_taichi.effects.framework.table import LIQUEFIED, OVERBURDEN
from mpm_taichi.solver.layout import (
    ALARM,
    BLEND,
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
    FRAME_START,
    FRAME_TIME,
    FRAMES,
    FRAMES_DONE,
    GRAVITY,
    I32,
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
    SETTLING,
    SHARE,
    SMOOTHING,
    SPEED,
    STEPS,
    SUBSTEPS,
    SUMS,
    TIME_STEP,
    TOP_SPEED,
    VEC4,
    VEC8,
    VOLUME,
    WATER_WORK,
    WAVE_SPEED,
    vec4,
    vec8,
)
from mpm_taichi.solver.point_functions import settle_node, steps_of_frame
from mpm_taichi.solver.transfer import cell_means, node_update


def point_schedule(
    point: SimpleNamespace, effects: SimpleNamespace | None = None
) -> SimpleNamespace:
    """The kernels `settle_step`, `start_moving`, `begin_frame`, `step`, `end_frame`.

    Each runs over `slots` slots of `points` points and `nodes` nodes.
    """
    strain_point, scatter_point = point.strain_point, point.scatter_point
    gather_and_move = point.gather_and_move
    settle_gather, settle_scatter = point.settle_gather, point.settle_scatter
    point_energy, place = point.point_energy, point.place
    smooth_cell = point.smooth_cell
    update_node = node_update(effects)
    acted = effects is not None

    @ti.kernel
    def settle_step(
        slots: ti.i32, points: ti.i32, nodes: ti.i32, integers: I32, numbers: F32, motion: VEC4,
        home: INDEX, gradient: VEC4, stress: VEC4, row: INDEX, elastic: VEC4, strength: VEC4,
        edges: VEC4, load: VEC8, flow: VEC4, swelling: VEC4, kind: INDEX, table: VEC8, sums: F64,
    ):  # fmt: skip
        for slot in range(slots):
            sums[slot, 0, 0] = 0.0
            sums[slot, 0, 1] = 0.0
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == SETTLING and p < integers[slot, LAST_SETTLED]:
                settle_gather(
                    p, numbers[slot, CELL], integers[slot, COLUMNS], motion, home, gradient, flow,
                    swelling, kind, True,
                )  # fmt: skip
        for n in range(slots * nodes):
            slot = n // nodes
            if integers[slot, PHASE] == SETTLING and n < integers[slot, LAST_NODE]:
                if swelling[n][3] > 0.0:
                    swelling[n] = cell_means(swelling[n])
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == SETTLING and p < integers[slot, LAST_SETTLED]:
                dt = SETTLE_COURANT * numbers[slot, CELL] / numbers[slot, WAVE_SPEED]
                settle_scatter(
                    p, dt, numbers[slot, CELL], numbers[slot, VOLUME], integers[slot, COLUMNS],
                    motion, home, gradient, stress, row, elastic, strength, edges, load, swelling,
                    kind, True,
                )  # fmt: skip
        for n in range(slots * nodes):
            slot = n // nodes
            if integers[slot, PHASE] == SETTLING and n < integers[slot, LAST_NODE]:
                if load[n][4] > 0.0:
                    dt = SETTLE_COURANT * numbers[slot, CELL] / numbers[slot, WAVE_SPEED]
                    new, force, own = settle_node(
                        load[n], flow[n], table[n], kind[n], dt, numbers[slot, GRAVITY]
                    )
                    flow[n] = new
                    load[n] = vec8(0.0)
                    swelling[n] = vec4(0.0)
                    ti.atomic_add(sums[slot, 0, 0], ti.cast(force, ti.f64))
                    ti.atomic_add(sums[slot, 0, 1], ti.cast(own, ti.f64))

    @ti.kernel
    def start_moving(
        slots: ti.i32, points: ti.i32, integers: I32, gradient: VEC4, stress: VEC4, history: VEC4,
        initial_stress: VEC4, numbers: F32, facts: F32, sums: F64,
    ):  # fmt: skip
        for slot in range(slots):
            sums[slot, 0, 0] = 0.0
            sums[slot, 0, 1] = 0.0
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == SETTLING and p < integers[slot, LAST_POINT]:
                initial_stress[p] = stress[p]
                gradient[p] = vec4(0.0)
                history[p] = vec4(0.0)
                if ti.static(acted):
                    overburden = ti.max(-stress[p][1], 0.0)
                    facts[p, OVERBURDEN] = overburden
                    if facts[p, LIQUEFIED] > 0.5:
                        ti.atomic_add(sums[slot, 0, 0], ti.cast(overburden, ti.f64))
                        ti.atomic_add(sums[slot, 0, 1], ti.cast(1.0, ti.f64))
        for slot in range(slots):
            if integers[slot, PHASE] == SETTLING:
                integers[slot, PHASE] = MOVING
                if ti.static(acted):
                    mean = sums[slot, 0, 0] / ti.max(sums[slot, 0, 1], 1.0)
                    numbers[slot, MEAN_OVERBURDEN] = ti.cast(mean, ti.f32)

    @ti.kernel
    def begin_frame(slots: ti.i32, frame: ti.i32, integers: I32, numbers: F32, sums: F64):
        for slot in range(slots):
            count = 0
            wanted = frame < integers[slot, FRAME_COUNT]
            if wanted and integers[slot, PHASE] == MOVING and integers[slot, ALARM] == 0:
                count = steps_of_frame(numbers, slot)
                dt = numbers[slot, FRAME_TIME] / count
                numbers[slot, TIME_STEP] = dt
                numbers[slot, BLEND] = ti.min(numbers[slot, PIC_RATE] * dt, 1.0)
                numbers[slot, SHARE] = ti.min(numbers[slot, RELIEF] * dt, 1.0)
                integers[slot, STEPS] += count
                if ti.static(acted):
                    start = integers[slot, FRAMES_DONE] * numbers[slot, FRAME_TIME]
                    numbers[slot, FRAME_START] = start
                    integers[slot, FRAMES_DONE] += 1
            integers[slot, SUBSTEPS] = count
            for k in range(SUMS):
                sums[slot, frame, k] = 0.0

    @ti.kernel
    def step(
        turn: ti.i32, frame: ti.i32, slots: ti.i32, points: ti.i32, nodes: ti.i32, integers: I32,
        numbers: F32, motion: VEC4, home: INDEX, gradient: VEC4, stress: VEC4, history: VEC4,
        row: INDEX, elastic: VEC4, strength: VEC4, edges: VEC4, load: VEC8, flow: VEC4,
        swelling: VEC4, kind: INDEX, table: VEC8, sums: F64, facts: F32, present: VEC8,
        resisted: REAL, effect_numbers: F32,
    ):  # fmt: skip
        for p in range(slots * points):
            slot = p // points
            if turn < integers[slot, SUBSTEPS] and p < integers[slot, LAST_POINT]:
                on = 0
                time = 0.0
                columns, first_node = integers[slot, COLUMNS], integers[slot, FIRST_NODE]
                if ti.static(acted):
                    on = integers[slot, EFFECTS_ON]
                    time = numbers[slot, FRAME_START] + turn * numbers[slot, TIME_STEP]
                    if on & ti.static(effects.strength_mask):
                        effects.renew_strength(
                            p, slot, on, time, columns, first_node, integers, numbers, motion, home,
                            gradient, stress, history, facts, present, effect_numbers,
                        )  # fmt: skip
                strain_point(
                    p, numbers[slot, TIME_STEP], numbers[slot, SHARE], numbers[slot, VOLUME], home,
                    gradient, stress, history, row, elastic, strength, edges, swelling, slot, on,
                    time, columns, first_node, integers, numbers, motion, facts, present,
                    effect_numbers,
                )  # fmt: skip
                scatter_point(
                    p, numbers[slot, CELL], numbers[slot, VOLUME], integers[slot, COLUMNS], motion,
                    home, gradient, stress, history, row, strength, edges, load, kind, present,
                    True,
                )  # fmt: skip
                if ti.static(acted):
                    if on & ti.static(effects.resistance_mask):
                        effects.resist(
                            p, slot, on, time, columns, first_node, integers, numbers, motion, home,
                            gradient, stress, history, facts, effect_numbers, numbers[slot, VOLUME],
                            kind, resisted, True,
                        )  # fmt: skip
        for n in range(slots * nodes):
            slot = n // nodes
            if turn < integers[slot, SUBSTEPS] and n < integers[slot, LAST_NODE]:
                if load[n][4] > 0.0:
                    new = vec4(0.0)
                    lost = 0.0
                    work = 0.0
                    if ti.static(acted):
                        time = numbers[slot, FRAME_START] + turn * numbers[slot, TIME_STEP]
                        node = effects.node_of(
                            n, slot, time, integers[slot, COLUMNS], integers[slot, FIRST_NODE],
                            integers, numbers,
                        )  # fmt: skip
                        new, lost, work, given = update_node(
                            load[n], table[n], kind[n], numbers[slot, TIME_STEP],
                            numbers[slot, GRAVITY], numbers[slot, DAMPING], resisted[n], slot,
                            integers[slot, EFFECTS_ON], node, effect_numbers,
                        )  # fmt: skip
                        resisted[n] = 0.0
                        if given != 0.0:
                            ti.atomic_add(sums[slot, frame, EFFECT_WORK], ti.cast(given, ti.f64))
                    else:
                        new, lost, work, _ = update_node(
                            load[n], table[n], kind[n], numbers[slot, TIME_STEP],
                            numbers[slot, GRAVITY], numbers[slot, DAMPING],
                        )  # fmt: skip
                    flow[n] = new
                    load[n] = vec8(0.0)
                    swelling[n] = vec4(0.0)
                    if lost != 0.0:
                        ti.atomic_add(sums[slot, frame, CONTACT_LOSS], ti.cast(lost, ti.f64))
                    if work != 0.0:
                        ti.atomic_add(sums[slot, frame, WATER_WORK], ti.cast(work, ti.f64))
        for p in range(slots * points):
            slot = p // points
            if turn < integers[slot, SUBSTEPS] and p < integers[slot, LAST_POINT]:
                alarm = gather_and_move(
                    p, numbers[slot, TIME_STEP], numbers[slot, CELL], numbers[slot, BLEND],
                    integers[slot, COLUMNS], motion, home, gradient, stress, history, flow,
                    swelling, kind, True,
                )  # fmt: skip
                if alarm != 0:
                    integers[slot, ALARM] = frame + 1
        for n in range(slots * nodes):
            slot = n // nodes
            if turn < integers[slot, SUBSTEPS] and n < integers[slot, LAST_NODE]:
                if swelling[n][3] > 0.0:
                    swelling[n] = cell_means(swelling[n])
        for n in range(slots * nodes):
            slot = n // nodes
            if turn < integers[slot, SUBSTEPS] and n < integers[slot, LAST_NODE]:
                smooth_cell(n, integers[slot, COLUMNS], numbers[slot, SMOOTHING], swelling)

    @ti.kernel
    def end_frame(
        frame: ti.i32, slots: ti.i32, points: ti.i32, integers: I32, numbers: F32, motion: VEC4,
        home: INDEX, stress: VEC4, history: VEC4, row: INDEX, elastic: VEC4, edges: VEC4,
        places: FRAMES, sums: F64,
    ):  # fmt: skip
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == MOVING and p < integers[slot, LAST_POINT]:
                energy = point_energy(
                    p, numbers[slot, VOLUME], motion, stress, history, row, elastic, edges
                )
                for k in ti.static(range(3)):
                    ti.atomic_add(sums[slot, frame, k], ti.cast(energy[k], ti.f64))
                ti.atomic_max(sums[slot, frame, TOP_SPEED], ti.cast(ti.sqrt(energy[3]), ti.f64))
                places[slot, frame, p - integers[slot, FIRST_POINT]] = place(
                    p, integers[slot, FIRST_NODE], integers[slot, COLUMNS], numbers[slot, CELL],
                    motion, home,
                )  # fmt: skip
        for slot in range(slots):
            numbers[slot, SPEED] = ti.cast(sums[slot, frame, TOP_SPEED], ti.f32)

    return SimpleNamespace(
        settle_step=settle_step,
        start_moving=start_moving,
        begin_frame=begin_frame,
        step=step,
        end_frame=end_frame,
    )
