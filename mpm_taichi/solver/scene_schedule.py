"""Scene-parallel schedule (CPU): one thread takes one scene through all its steps.

Plain loads and stores, no atomics: a scene's result depends on nothing but the scene, not on the
number of threads and not on its neighbours.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from collections.abc import Callable
from types import SimpleNamespace

import taichi as ti

from mpm_taichi.effects.framework.table import LIQUEFIED, OVERBURDEN
from mpm_taichi.layout import (
    ALARM,
    CELL,
    COLUMNS,
    CONTACT_LOSS,
    DAMPING,
    EFFECT_WORK,
    EFFECTS_ON,
    FIRST_NODE,
    FIRST_POINT,
    FRAME_COUNT,
    FRAME_TIME,
    FRAMES_DONE,
    GRAVITY,
    IDLE,
    LAST_NODE,
    LAST_POINT,
    LAST_SETTLED,
    MEAN_OVERBURDEN,
    MOVING,
    PHASE,
    PIC_RATE,
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

# Taichi hands a CPU thread at least 512 turns of a loop; a scene takes one turn in 512.
_TURNS = 512


def scene_schedule(
    point: SimpleNamespace, tile: SimpleNamespace, effects: SimpleNamespace | None = None
) -> Callable:
    """The kernel `run_scenes`: settling where a scene is new, then a chunk of frames.

    Args:
        point: `point_functions.point_functions`.
        tile: `tiles.tile_functions`.
        effects: `effects.hooks.effect_functions`, or None.

    Returns:
        the kernel, of the number of slots and the arrays of `layout.ARRAYS`.
    """
    strain_tile, scatter_tile, gather_tile = tile.strain_tile, tile.scatter_tile, tile.gather_tile
    settle_gather, settle_scatter = point.settle_gather, point.settle_scatter
    new_scratch = tile.scratch
    update_node = node_update(effects)
    acted = effects is not None

    @ti.func
    def settle(slot, state: A):
        """Elastic rest under weight, by dynamic relaxation on points that stay where they are.

        Geometry and masses are those of t = 0 throughout, so that the stress found is in balance
        with the points exactly where the scene has them.
        """
        integers, numbers, nodes = ti.static(
            (state.slots.integers, state.slots.numbers, state.nodes)
        )
        first, last = integers[slot, FIRST_POINT], integers[slot, LAST_SETTLED]
        first_node, last_node = integers[slot, FIRST_NODE], integers[slot, LAST_NODE]
        columns = integers[slot, COLUMNS]
        cell = numbers[slot, CELL]
        per_cell, gravity = 1.0 / cell, numbers[slot, GRAVITY]
        dt = SETTLE_COURANT * cell / numbers[slot, WAVE_SPEED]
        on = 0
        if ti.static(acted):
            on = integers[slot, EFFECTS_ON]
        relaxation = ti.static(
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
        step = 0
        ratio = 1.0
        while step < SETTLE_LIMIT and ratio > SETTLE_TOLERANCE and last > first:
            for p in range(first, last):
                settle_gather(p, relaxation, state, False)
            if ti.static(acted):
                if on & ti.static(effects.width_mask):
                    for p in range(first, last):
                        effects.settle_wider(p, relaxation, state, False)
            for n in range(first_node, last_node):
                average_cell(n, nodes.cell_mean)
            for p in range(first, last):
                settle_scatter(p, relaxation, state, False)
            if ti.static(acted):
                if on & ti.static(effects.width_mask):
                    for p in range(first, last):
                        effects.push_outward(p, relaxation, state, False)
            unbalanced = ti.cast(0.0, ti.f64)
            weight = ti.cast(0.0, ti.f64)
            for n in range(first_node, last_node):
                force, own = settle_node(n, relaxation, nodes)
                unbalanced += ti.cast(force, ti.f64)
                weight += ti.cast(own, ti.f64)
            if step > 20:
                ratio = ti.cast(unbalanced / weight, ti.f32)
            step += 1
        integers[slot, SETTLE_STEPS] = step
        numbers[slot, UNBALANCED] = ratio

    @ti.func
    def start_moving(slot, first, last, state: A):
        """The settled stress becomes that of t = 0, and everything else is forgotten."""
        points = ti.static(state.points)
        for p in range(first, last):
            points.initial_stress[p] = points.stress[p]
            points.gradient[p] = vec4(0.0, 0.0, 0.0, 0.0)
            points.history[p] = vec4(0.0, 0.0, 0.0, 0.0)
        if ti.static(acted):
            note_overburden(slot, first, last, state)
        state.slots.integers[slot, PHASE] = MOVING

    @ti.func
    def note_overburden(slot, first, last, state: A):
        """Vertical effective stress before failure, and its mean over the liquefied points.

        Soil with a strength ratio has its strength from here on.
        """
        facts = ti.static(state.points.facts)
        total = ti.cast(0.0, ti.f64)
        points = 0
        for p in range(first, last):
            overburden = ti.max(-state.points.stress[p][YY], 0.0)
            facts[p, OVERBURDEN] = overburden
            effects.start_strength(p, state)
            if facts[p, LIQUEFIED] > 0.5:
                total += ti.cast(overburden, ti.f64)
                points += 1
        mean = ti.cast(total / ti.max(points, 1), ti.f32)
        state.slots.numbers[slot, MEAN_OVERBURDEN] = mean

    @ti.func
    def frame_sums(slot, frame, first, last, state: A):
        """Energies of all points of a scene at the end of a frame."""
        numbers, sums = ti.static((state.slots.numbers, state.frames.sums))
        total = ti.Vector([0.0, 0.0, 0.0], ti.f64)
        top = 0.0
        for p in range(first, last):
            e = point_energy(p, state.points, state.materials)
            for k in ti.static(range(3)):
                total[k] += ti.cast(e[k], ti.f64)
            top = ti.max(top, e[3])
        for k in ti.static(range(3)):
            sums[slot, frame, k] = total[k]
        numbers[slot, SPEED] = ti.sqrt(top)
        sums[slot, frame, TOP_SPEED] = ti.sqrt(top)

    @ti.func
    def run_scenes(slots: A, state: A):
        integers, numbers = ti.static((state.slots.integers, state.slots.numbers))
        points, nodes, sums = ti.static((state.points, state.nodes, state.frames.sums))
        for turn in range(slots * _TURNS):
            slot = turn // _TURNS
            if turn % _TURNS == 0 and integers[slot, PHASE] != IDLE:
                first, last = integers[slot, FIRST_POINT], integers[slot, LAST_POINT]
                first_node, last_node = integers[slot, FIRST_NODE], integers[slot, LAST_NODE]
                columns = integers[slot, COLUMNS]
                tiles = (last - first + TILE - 1) // TILE
                cell = numbers[slot, CELL]
                per_cell = 1.0 / cell
                gravity, damping = numbers[slot, GRAVITY], numbers[slot, DAMPING]
                smoothing = numbers[slot, SMOOTHING]
                if integers[slot, PHASE] == SETTLING:
                    settle(slot, state)
                    start_moving(slot, first, last, state)
                alarm = 0
                scratch = ti.static(new_scratch())
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
                    step = ti.static(
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
                    done = 0
                    while done < count and alarm == 0:
                        if ti.static(acted):
                            time = integers[slot, FRAMES_DONE] * numbers[slot, FRAME_TIME]
                            time += done * dt
                            if on & ti.static(effects.strength_mask):
                                for p in range(first, last):
                                    effects.renew_strength(p, step, state)
                            if on & ti.static(effects.width_mask):
                                for p in range(first, last):
                                    effects.strain_across(p, step, state)
                        for tile in range(tiles):
                            strain_tile(first + tile * TILE, last, step, state, scratch)
                        for tile in range(tiles):
                            scatter_tile(first + tile * TILE, last, step, state, scratch)
                        if ti.static(acted):
                            if on & ti.static(effects.resistance_mask):
                                for p in range(first, last):
                                    effects.resist(p, step, state, False)
                            if on & ti.static(effects.width_mask):
                                for p in range(first, last):
                                    effects.push_outward(p, step, state, False)
                        for n in range(first_node, last_node):
                            work = update_node(n, step, nodes, state.slots)
                            contact_loss += ti.cast(work[0], ti.f64)
                            water_work += ti.cast(work[1], ti.f64)
                            if ti.static(acted):
                                effect_work += ti.cast(work[2], ti.f64)
                        for tile in range(tiles):
                            alarm |= gather_tile(first + tile * TILE, last, step, state, scratch)
                        if ti.static(acted):
                            if on & ti.static(effects.width_mask):
                                for p in range(first, last):
                                    effects.widen(p, step, state, False)
                        for n in range(first_node, last_node):
                            average_cell(n, nodes.cell_mean)
                        for n in range(first_node, last_node):
                            smooth_cell(n, columns, smoothing, nodes.cell_mean)
                        done += 1
                    integers[slot, STEPS] += done
                    if alarm != 0 and integers[slot, ALARM] == 0:
                        integers[slot, ALARM] = frame + 1
                    frame_sums(slot, frame, first, last, state)
                    sums[slot, frame, CONTACT_LOSS] = contact_loss
                    sums[slot, frame, WATER_WORK] = water_work
                    if ti.static(acted):
                        sums[slot, frame, EFFECT_WORK] = effect_work
                        integers[slot, FRAMES_DONE] += 1
                    for p in range(first, last):
                        state.frames.positions[slot, frame, p - first] = position(
                            p, first_node, columns, cell, points
                        )

    return state_kernel(run_scenes, slots=ti.i32)
