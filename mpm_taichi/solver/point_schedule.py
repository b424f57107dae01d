"""Point-parallel schedule (GPU): all points, then all nodes, of all scenes together.

Points add to nodes with atomics, so sums come in any order and results agree with the scene
schedule to rounding only. Scenes with fewer steps in a frame wait for the others.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from collections.abc import Callable
from types import SimpleNamespace

import taichi as ti

from mpm_taichi.effects.framework.table import LIQUEFIED, OVERBURDEN
from mpm_taichi.layout import (
    ALARM,
    BLEND,
    CELL,
    COLUMNS,
    CONTACT_LOSS,
    DAMPING,
    EFFECT_WORK,
    EFFECTS_ON,
    FIRST_NODE,
    FIRST_POINT,
    FRAME_COUNT,
    FRAME_START,
    FRAME_TIME,
    FRAMES_DONE,
    GRAVITY,
    LAST_NODE,
    LAST_POINT,
    LAST_SETTLED,
    MEAN_OVERBURDEN,
    MOVING,
    PHASE,
    PIC_RATE,
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
    WATER_WORK,
    WAVE_SPEED,
    YY,
    A,
    StepNumbers,
    vec4,
)
from mpm_taichi.solver.kernel_arguments import state_kernel
from mpm_taichi.solver.nodes import node_update, settle_node
from mpm_taichi.solver.point_functions import (
    average_cell,
    point_energy,
    position,
    smooth_cell,
    steps_of_frame,
)


def point_schedule(
    point: SimpleNamespace, effects: SimpleNamespace | None = None
) -> SimpleNamespace:
    """The kernels `settle_step`, `start_moving`, `begin_frame`, `step`, `end_frame`.

    Each takes integers and then the arrays of `layout.ARRAYS`, and runs over `slots` slots of
    `points` points and `nodes` nodes. `point` and `effects` as in `scene_schedule.scene_schedule`.
    """
    strain_point, scatter_point = point.strain_point, point.scatter_point
    gather_and_move = point.gather_and_move
    settle_gather, settle_scatter = point.settle_gather, point.settle_scatter
    update_node = node_update(effects)
    acted = effects is not None

    @ti.func
    def step_of(slot, turn, slots: A):
        """The numbers of step `turn` of a frame."""
        integers, numbers = ti.static((slots.integers, slots.numbers))
        first_node, columns = integers[slot, FIRST_NODE], integers[slot, COLUMNS]
        cell = numbers[slot, CELL]
        dt, blend, share = numbers[slot, TIME_STEP], numbers[slot, BLEND], numbers[slot, SHARE]
        gravity, damping = numbers[slot, GRAVITY], numbers[slot, DAMPING]
        per_cell = 1.0 / cell
        time = 0.0
        on = 0
        if ti.static(acted):
            time = numbers[slot, FRAME_START] + turn * dt
            on = integers[slot, EFFECTS_ON]
        return ti.static(
            StepNumbers(
                slot=slot,
                first_node=first_node,
                columns=columns,
                cell=cell,
                per_cell=per_cell,
                dt=dt,
                blend=blend,
                share=share,
                gravity=gravity,
                damping=damping,
                time=time,
                on=on,
            )
        )

    @ti.func
    def relaxation_of(slot, slots: A):
        """The numbers of a step of settling."""
        integers, numbers = ti.static((slots.integers, slots.numbers))
        first_node, columns = integers[slot, FIRST_NODE], integers[slot, COLUMNS]
        cell = numbers[slot, CELL]
        per_cell, gravity = 1.0 / cell, numbers[slot, GRAVITY]
        dt = SETTLE_COURANT * cell / numbers[slot, WAVE_SPEED]
        on = 0
        if ti.static(acted):
            on = integers[slot, EFFECTS_ON]
        return ti.static(
            StepNumbers(
                slot=slot,
                first_node=first_node,
                columns=columns,
                cell=cell,
                per_cell=per_cell,
                dt=dt,
                gravity=gravity,
                on=on,
            )
        )

    @ti.func
    def settle_step(slots: A, points: A, nodes: A, state: A):
        integers, sums = ti.static((state.slots.integers, state.frames.sums))
        for slot in range(slots):
            sums[slot, 0, 0] = 0.0
            sums[slot, 0, 1] = 0.0
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == SETTLING and p < integers[slot, LAST_SETTLED]:
                step = ti.static(relaxation_of(slot, state.slots))
                settle_gather(p, step, state, True)
                if ti.static(acted):
                    if step.on & ti.static(effects.width_mask):
                        effects.settle_wider(p, step, state, True)
        for n in range(slots * nodes):
            slot = n // nodes
            if integers[slot, PHASE] == SETTLING and n < integers[slot, LAST_NODE]:
                average_cell(n, state.nodes.cell_mean)
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == SETTLING and p < integers[slot, LAST_SETTLED]:
                step = ti.static(relaxation_of(slot, state.slots))
                settle_scatter(p, step, state, True)
                if ti.static(acted):
                    if step.on & ti.static(effects.width_mask):
                        effects.push_outward(p, step, state, True)
        for n in range(slots * nodes):
            slot = n // nodes
            if integers[slot, PHASE] == SETTLING and n < integers[slot, LAST_NODE]:
                step = ti.static(relaxation_of(slot, state.slots))
                force, own = settle_node(n, step, state.nodes)
                if own != 0.0:
                    ti.atomic_add(sums[slot, 0, 0], ti.cast(force, ti.f64))
                    ti.atomic_add(sums[slot, 0, 1], ti.cast(own, ti.f64))

    @ti.func
    def start_moving(slots: A, points: A, state: A):
        integers, sums = ti.static((state.slots.integers, state.frames.sums))
        mine = ti.static(state.points)
        for slot in range(slots):
            sums[slot, 0, 0] = 0.0
            sums[slot, 0, 1] = 0.0
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == SETTLING and p < integers[slot, LAST_POINT]:
                mine.initial_stress[p] = mine.stress[p]
                mine.gradient[p] = vec4(0.0)
                mine.history[p] = vec4(0.0)
                if ti.static(acted):
                    overburden = ti.max(-mine.stress[p][YY], 0.0)
                    mine.facts[p, OVERBURDEN] = overburden
                    effects.start_strength(p, state)
                    if mine.facts[p, LIQUEFIED] > 0.5:
                        ti.atomic_add(sums[slot, 0, 0], ti.cast(overburden, ti.f64))
                        ti.atomic_add(sums[slot, 0, 1], ti.cast(1.0, ti.f64))
        for slot in range(slots):
            if integers[slot, PHASE] == SETTLING:
                integers[slot, PHASE] = MOVING
                if ti.static(acted):
                    mean = sums[slot, 0, 0] / ti.max(sums[slot, 0, 1], 1.0)
                    state.slots.numbers[slot, MEAN_OVERBURDEN] = ti.cast(mean, ti.f32)

    @ti.func
    def begin_frame(slots: A, frame: A, state: A):
        integers, numbers = ti.static((state.slots.integers, state.slots.numbers))
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
                state.frames.sums[slot, frame, k] = 0.0

    @ti.func
    def step(turn: A, frame: A, slots: A, points: A, nodes: A, state: A):
        integers, numbers = ti.static((state.slots.integers, state.slots.numbers))
        sums, cell_mean = ti.static((state.frames.sums, state.nodes.cell_mean))
        for p in range(slots * points):
            slot = p // points
            if turn < integers[slot, SUBSTEPS] and p < integers[slot, LAST_POINT]:
                now = ti.static(step_of(slot, turn, state.slots))
                if ti.static(acted):
                    if now.on & ti.static(effects.strength_mask):
                        effects.renew_strength(p, now, state)
                    if now.on & ti.static(effects.width_mask):
                        effects.strain_across(p, now, state)
                strain_point(p, now, state)
                scatter_point(p, now, state, True)
                if ti.static(acted):
                    if now.on & ti.static(effects.resistance_mask):
                        effects.resist(p, now, state, True)
                    if now.on & ti.static(effects.width_mask):
                        effects.push_outward(p, now, state, True)
        for n in range(slots * nodes):
            slot = n // nodes
            if turn < integers[slot, SUBSTEPS] and n < integers[slot, LAST_NODE]:
                now = ti.static(step_of(slot, turn, state.slots))
                work = update_node(n, now, state.nodes, state.slots)
                if ti.static(acted):
                    if work[2] != 0.0:
                        ti.atomic_add(sums[slot, frame, EFFECT_WORK], ti.cast(work[2], ti.f64))
                if work[0] != 0.0:
                    ti.atomic_add(sums[slot, frame, CONTACT_LOSS], ti.cast(work[0], ti.f64))
                if work[1] != 0.0:
                    ti.atomic_add(sums[slot, frame, WATER_WORK], ti.cast(work[1], ti.f64))
        for p in range(slots * points):
            slot = p // points
            if turn < integers[slot, SUBSTEPS] and p < integers[slot, LAST_POINT]:
                now = ti.static(step_of(slot, turn, state.slots))
                alarm = gather_and_move(p, now, state, True)
                if alarm != 0:
                    integers[slot, ALARM] = frame + 1
                if ti.static(acted):
                    if now.on & ti.static(effects.width_mask):
                        effects.widen(p, now, state, True)
        for n in range(slots * nodes):
            slot = n // nodes
            if turn < integers[slot, SUBSTEPS] and n < integers[slot, LAST_NODE]:
                average_cell(n, cell_mean)
        for n in range(slots * nodes):
            slot = n // nodes
            if turn < integers[slot, SUBSTEPS] and n < integers[slot, LAST_NODE]:
                smooth_cell(n, integers[slot, COLUMNS], numbers[slot, SMOOTHING], cell_mean)

    @ti.func
    def end_frame(frame: A, slots: A, points: A, state: A):
        integers, numbers = ti.static((state.slots.integers, state.slots.numbers))
        sums = ti.static(state.frames.sums)
        for p in range(slots * points):
            slot = p // points
            if integers[slot, PHASE] == MOVING and p < integers[slot, LAST_POINT]:
                energy = point_energy(p, state.points, state.materials)
                for k in ti.static(range(3)):
                    ti.atomic_add(sums[slot, frame, k], ti.cast(energy[k], ti.f64))
                ti.atomic_max(sums[slot, frame, TOP_SPEED], ti.cast(ti.sqrt(energy[3]), ti.f64))
                state.frames.positions[slot, frame, p - integers[slot, FIRST_POINT]] = position(
                    p,
                    integers[slot, FIRST_NODE],
                    integers[slot, COLUMNS],
                    numbers[slot, CELL],
                    state.points,
                )
        for slot in range(slots):
            numbers[slot, SPEED] = ti.cast(sums[slot, frame, TOP_SPEED], ti.f32)

    def kernel(body: Callable, *integers: str) -> Callable:
        return state_kernel(body, **dict.fromkeys(integers, ti.i32))

    return SimpleNamespace(
        settle_step=kernel(settle_step, "slots", "points", "nodes"),
        start_moving=kernel(start_moving, "slots", "points"),
        begin_frame=kernel(begin_frame, "slots", "frame"),
        step=kernel(step, "turn", "frame", "slots", "points", "nodes"),
        end_frame=kernel(end_frame, "frame", "slots", "points"),
    )
