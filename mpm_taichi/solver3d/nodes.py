"""The update of the nodes of a three-dimensional grid, one column after the other.

The scheme is that of `solver.nodes`: nodes of a column on which the ground acts together are taken
through the step by the lowest of them.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import taichi as ti

from mpm_taichi.layout import SETTLE_DAMPING, A, vec4, vec8
from mpm_taichi.solver.boundary import (
    BARRING,
    COLUMN,
    FULL_CONTACT,
    LOWEST,
    RESISTING,
    STICK,
    TOP,
    WALLS,
)
from mpm_taichi.solver.nodes import LEAST_SOIL
from mpm_taichi.solver3d.boundary import (
    EDGE_VOLUME,
    FAR_FLANK,
    NEAR_FLANK,
    ROUGH_FLANK,
    STICK_FLANK,
    contact,
)
from mpm_taichi.solver3d.layout import (
    ADHESION,
    AREA,
    COEFFICIENT,
    FLANK_AREA,
    FORCE,
    FRICTION,
    NODE_MASS,
    NODE_VOLUME,
    NORMAL,
    PER_COVER,
    ROWS,
    vec2,
    vec3,
)

FLANKS = NEAR_FLANK | FAR_FLANK
GROUP_AREA, GROUP_MASS = 3, 4
"""Columns of `Nodes.velocity`, after its three of velocity, while the ground acts on a column."""


@ti.func
def three(row, first: ti.template()):
    """Three numbers of a packed row."""
    return vec3(row[first], row[first + 1], row[first + 2])


@ti.func
def ground_share(n, nodes: A):
    """Area [m2] by which a node meets the ground, less where little soil is around it."""
    surroundings = nodes.surroundings[n]
    return surroundings[AREA] * ti.min(nodes.load[n][NODE_VOLUME] * surroundings[PER_COVER], 1.0)


@ti.func
def acting_force(n, step: A, nodes: A):
    """Internal force, weight and water on a node, and the water's part [N]."""
    load = nodes.load[n]
    water = load[NODE_VOLUME] * three(nodes.water[n], 0)
    force = three(load, FORCE) + water
    force[2] -= step.gravity * load[NODE_MASS]
    return force, water


@ti.func
def free_velocity(n, step: A, nodes: A, settling: ti.template()):
    """Velocity of a node before ground and walls act [m/s]; in settling it is kept as momentum."""
    new = three(nodes.load[n], 0)
    if ti.static(not settling):
        force, _ = acting_force(n, step, nodes)
        new = (new + step.dt * force) / nodes.load[n][NODE_MASS]
    return new


@ti.func
def base_at(n, step: A, nodes: A):
    """Friction coefficient of the ground at a node, and the force of its adhesion [N]."""
    friction = nodes.surroundings[n][COEFFICIENT]
    adhesion = 0.0
    if nodes.kind[n] & RESISTING:
        share = 1.0 / nodes.load[n][NODE_VOLUME]
        friction = nodes.soil[n][FRICTION] * share
        adhesion = nodes.soil[n][ADHESION] * share * ground_share(n, nodes)
    return friction, adhesion


@ti.func
def flank_at(n, step: A, nodes: A):
    """Friction coefficient of a rough flank and the change of velocity of its adhesion [m/s]."""
    result = vec2(0.0, 0.0)
    if nodes.kind[n] & ROUGH_FLANK:
        load = nodes.load[n]
        full = FULL_CONTACT * EDGE_VOLUME * step.cell * step.cell * step.cell
        area = nodes.surroundings[n][FLANK_AREA] * ti.min(load[NODE_VOLUME] / full, 1.0)
        traction = nodes.soil[n][ADHESION] / load[NODE_VOLUME]
        result = vec2(
            nodes.soil[n][FRICTION] / load[NODE_VOLUME],
            traction * area * step.dt / load[NODE_MASS],
        )
    return result


@ti.func
def leave(n, new, change, nodes: A):
    """Store the velocity of a node and its change, and clear its sums."""
    nodes.velocity[n] = vec8(new[0], new[1], new[2], change[0], change[1], change[2], 0.0, 0.0)
    nodes.load[n] = vec8(0.0)
    nodes.soil[n] = vec2(0.0)
    nodes.cell_sum[n] = vec4(0.0)


@ti.func
def join_column(lowest, rows, step: A, nodes: A, settling: ti.template()):
    """Join light nodes of a column to the next one above, and sum the column up.

    Returns:
        sum of area x velocity [m3/s], of area^2 / mass, of area.
    """
    flow, give, total = vec3(0.0), 0.0, 0.0
    mass, area, volume, momentum = 0.0, 0.0, 0.0, vec3(0.0)
    enough = LEAST_SOIL * step.cell * step.cell * step.cell
    for n in range(lowest, lowest + rows):
        own = nodes.load[n][NODE_MASS]
        if nodes.kind[n] & COLUMN and own > 0.0:
            momentum += own * free_velocity(n, step, nodes, settling)
            mass += own
            area += ground_share(n, nodes)
            volume += nodes.load[n][NODE_VOLUME]
            above = n + 1 < lowest + rows and nodes.load[n + 1][NODE_MASS] > 0.0
            group = vec8(0.0)
            if volume >= enough or not above:
                velocity = momentum / mass
                flow += area * velocity
                give += area * area / mass
                total += area
                group = vec8(velocity[0], velocity[1], velocity[2], area, mass, 0.0, 0.0, 0.0)
                mass, area, volume, momentum = 0.0, 0.0, 0.0, vec3(0.0)
            nodes.velocity[n] = group
    return flow, ti.max(give, 1.0e-30), total


@ti.func
def column_impulse(lowest, rows, step: A, nodes: A):
    """Impulse of the ground on a column of nodes, per area of the ground [N s/m2 per m2]."""
    flow, give, area = join_column(lowest, rows, step, nodes, False)
    friction, adhesion = 0.0, 0.0
    for n in range(lowest, lowest + rows):
        if nodes.kind[n] & COLUMN and nodes.load[n][NODE_MASS] > 0.0:
            coefficient, hold = base_at(n, step, nodes)
            friction += ground_share(n, nodes) * coefficient
            adhesion += hold
    impulse = vec3(0.0)
    if area > 0.0:
        if nodes.kind[lowest] & STICK:
            impulse = -flow / give
        else:
            normal = three(nodes.surroundings[lowest], NORMAL)
            out = flow.dot(normal)
            along = flow - out * normal
            push = ti.max(-out, 0.0) / give
            limit = (friction * push + adhesion * step.dt) / area
            length = along.norm()
            stop = ti.min(length / give, limit) / ti.max(length, 1.0e-30)
            impulse = push * normal - stop * along
    return impulse


@ti.func
def finish_node(n, free, new, step: A, nodes: A):
    """Store a node's new velocity; its work (2,) [J]: against ground and walls, by the water."""
    mass = nodes.load[n][NODE_MASS]
    old = three(nodes.load[n], 0) / mass
    _, water = acting_force(n, step, nodes)
    mean = old + new
    work = vec2(0.5 * mass * (free - new).dot(mean), 0.5 * step.dt * water.dot(mean))
    leave(n, new, new - old, nodes)
    return work


@ti.func
def update_node(n, step: A, nodes: A):
    """New velocity of a node, or of those of its column; its work (2,) [J]."""
    kind = nodes.kind[n]
    work = vec2(0.0)
    if kind & LOWEST:
        rows = ti.cast(nodes.surroundings[n][ROWS], ti.i32)
        impulse = column_impulse(n, rows, step, nodes)
        new = vec3(0.0)
        for k in range(rows):
            m = n + rows - 1 - k
            if nodes.kind[m] & COLUMN and nodes.load[m][NODE_MASS] > 0.0:
                group = nodes.velocity[m]
                if group[GROUP_MASS] > 0.0:
                    new = three(group, 0) + (group[GROUP_AREA] / group[GROUP_MASS]) * impulse
                bits = nodes.kind[m] & (WALLS | TOP | FLANKS | ROUGH_FLANK | STICK_FLANK)
                flank = flank_at(m, step, nodes)
                new = contact(new, bits, nodes.surroundings[m], 0.0, 0.0, flank)
                work += finish_node(m, free_velocity(m, step, nodes, False), new, step, nodes)
    if nodes.load[n][NODE_MASS] > 0.0 and not kind & COLUMN:
        free = free_velocity(n, step, nodes, False)
        new = free
        if kind & (STICK | BARRING | RESISTING | WALLS | TOP | FLANKS):
            friction, adhesion = base_at(n, step, nodes)
            brake = adhesion * step.dt / nodes.load[n][NODE_MASS]
            flank = flank_at(n, step, nodes)
            new = contact(free, kind, nodes.surroundings[n], friction, brake, flank)
        work += finish_node(n, free, new, step, nodes)
    return work


@ti.func
def held_by_walls(kind, vector):
    """A force or velocity without what walls and flanks take from it in settling."""
    result = vector
    if kind & WALLS:
        result[0] = 0.0
    if kind & FLANKS:
        result[1] = 0.0
        if kind & (ROUGH_FLANK | STICK_FLANK):
            result = vec3(0.0)
    return result


@ti.func
def hold_column(lowest, rows, step: A, nodes: A):
    """Have the ground hold a column in settling: its nodes' velocities, kept as momentum [m/s]."""
    flow, give, _ = join_column(lowest, rows, step, nodes, True)
    new = vec3(0.0)
    for k in range(rows):
        m = lowest + rows - 1 - k
        if nodes.kind[m] & COLUMN and nodes.load[m][NODE_MASS] > 0.0:
            group = nodes.velocity[m]
            if group[GROUP_MASS] > 0.0:
                new = three(group, 0)
                new -= (group[GROUP_AREA] / (group[GROUP_MASS] * give)) * flow
                new = held_by_walls(nodes.kind[m], new)
            for a in ti.static(range(3)):
                nodes.load[m][a] = new[a]


@ti.func
def settle_column(lowest, step: A, nodes: A):
    """Dynamic relaxation of a column: unbalanced force and weight [N], (2,).

    The force that is damped is what the ground leaves of it: a force that the ground balances would
    be damped, by its whole size, against whatever small velocity there is, and never come to rest.
    """
    rows = ti.cast(nodes.surroundings[lowest][ROWS], ti.i32)
    sums = vec2(0.0)
    for m in range(lowest, lowest + rows):
        mass = nodes.load[m][NODE_MASS]
        if nodes.kind[m] & COLUMN and mass > 0.0:
            force, _ = acting_force(m, step, nodes)
            for a in ti.static(range(3)):
                nodes.load[m][a] = nodes.velocity[m][a] + step.dt * force[a] / mass
                nodes.load[m][FORCE + a] = nodes.velocity[m][a]
    hold_column(lowest, rows, step, nodes)
    for m in range(lowest, lowest + rows):
        load = nodes.load[m]
        if nodes.kind[m] & COLUMN and load[NODE_MASS] > 0.0:
            old = three(load, FORCE)
            change = three(load, 0) - old
            sums += vec2(
                ti.abs(change).sum() * load[NODE_MASS] / step.dt, step.gravity * load[NODE_MASS]
            )
            change -= SETTLE_DAMPING * ti.abs(change) * ti.math.sign(old)
            for a in ti.static(range(3)):
                nodes.load[m][a] = old[a] + change[a]
    hold_column(lowest, rows, step, nodes)
    for m in range(lowest, lowest + rows):
        if nodes.kind[m] & COLUMN and nodes.load[m][NODE_MASS] > 0.0:
            leave(m, three(nodes.load[m], 0), vec3(0.0), nodes)
    return sums


@ti.func
def settle_node(n, step: A, nodes: A):
    """Dynamic relaxation of a node or of its column: unbalanced force and weight [N], (2,)."""
    kind = nodes.kind[n]
    sums = vec2(0.0)
    if kind & LOWEST:
        sums = settle_column(n, step, nodes)
    if nodes.load[n][NODE_MASS] > 0.0 and not kind & COLUMN:
        force, _ = acting_force(n, step, nodes)
        if kind & (STICK | BARRING):
            force = vec3(0.0)
        force = held_by_walls(kind, force)
        sums += vec2(ti.abs(force).sum(), step.gravity * nodes.load[n][NODE_MASS])
        old = three(nodes.velocity[n], 0)
        damped = force - SETTLE_DAMPING * ti.abs(force) * ti.math.sign(old)
        new = old + (step.dt / nodes.load[n][NODE_MASS]) * damped
        leave(n, new, vec3(0.0), nodes)
    return sums
