"""The update of the nodes: new velocities from their loads, and the same in settling.

Nodes are independent of each other but for those of a column on which the ground acts together
(`boundary`): the lowest of them takes them all through the step.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from collections.abc import Callable
from types import SimpleNamespace

import taichi as ti

from mpm_taichi.layout import (
    AREA,
    COEFFICIENT,
    FORCE_X,
    FORCE_Y,
    MOMENTUM_X,
    MOMENTUM_Y,
    NODE_ADHESION,
    NODE_FRICTION,
    NODE_MASS,
    NODE_VOLUME,
    NORMAL_X,
    NORMAL_Y,
    PER_COVER,
    ROWS,
    SETTLE_DAMPING,
    WATER_X,
    WATER_Y,
    A,
    vec2,
    vec4,
    vec8,
)
from mpm_taichi.solver.boundary import (
    BARRING,
    COLUMN,
    LOWEST,
    RESISTING,
    STICK,
    TOP,
    WALLS,
    contact,
)

LEAST_SOIL = 0.03
"""Soil around a node of a column [cells] below which it moves as the node above. More would bond
the soil next to the ground to it: at 0.1 a level base braked by a tenth where a node is that
light. With less, a slab on a slope of phi 20 creeps: it failed 11 % early at 0, 1.5 % at 0.02."""

GROUP_X, GROUP_Y, GROUP_AREA, GROUP_MASS = range(4)
"""Columns of `NodeState.velocity` while the ground acts on a column: velocity [m/s], area
[m2 per m] and mass [kg/m] of the group of nodes whose highest this is; the mass of others is 0."""


@ti.func
def ground_share(n, nodes: A):
    """Area [m2 per m] by which a node of a column meets the ground, 0 without soil around it.

    A node with little soil meets it by less: with its whole area, its small mass could take all of
    the impulse that the ground has for the column.
    """
    load, surroundings = nodes.load[n], nodes.surroundings[n]
    return surroundings[AREA] * ti.min(load[NODE_VOLUME] * surroundings[PER_COVER], 1.0)


@ti.func
def settle_forces(n, step: A, nodes: A):
    """Force on a node while the stress settles, before the ground acts [N/m]."""
    load, surroundings = nodes.load[n], nodes.surroundings[n]
    force = vec2(load[FORCE_X], load[FORCE_Y])
    force += load[NODE_VOLUME] * vec2(surroundings[WATER_X], surroundings[WATER_Y])
    force[1] -= step.gravity * load[NODE_MASS]
    return force


@ti.func
def damped(push, old):
    """Force, or change of velocity, less Cundall's damping of it against a velocity."""
    left = push
    for k in ti.static(range(2)):
        left[k] = push[k] - SETTLE_DAMPING * ti.abs(push[k]) * ti.math.sign(old[k])
    return left


@ti.func
def leave_settled(n, new, nodes: A):
    """Store the velocity of a node in settling and clear its sums."""
    nodes.velocity[n] = vec4(new[0], new[1], 0.0, 0.0)
    nodes.load[n] = vec8(0.0)
    nodes.cell_mean[n] = vec4(0.0)


@ti.func
def join_column(lowest, rows, step: A, nodes: A, slots: A, velocity_of: A):
    """Join the light nodes of a column to the next node above, and sum the column up.

    A node that holds little soil could move against its neighbours with hardly a point between
    them to resist, and the soil next to the ground would be weaker than it is. So it moves as the
    node above. Each group is left in `NodeState.velocity`, columns GROUP_X to GROUP_MASS.

    Args:
        lowest: node of the column.
        rows: number of its nodes.
        step: numbers of the step.
        nodes: their state.
        slots: of the scenes.
        velocity_of: velocity of a node before the ground acts [m/s], of (n, step, nodes, slots).

    Returns:
        flow: sum of area x velocity [m2/s per m]; give: of area^2 / mass; area.
    """
    flow, give, total = vec2(0.0, 0.0), 0.0, 0.0
    mass, area, volume, momentum = 0.0, 0.0, 0.0, vec2(0.0, 0.0)
    enough = ti.static(LEAST_SOIL) * step.cell * step.cell
    for n in range(lowest, lowest + rows):
        own = nodes.load[n][NODE_MASS]
        if nodes.kind[n] & COLUMN and own > 0.0:
            momentum += own * velocity_of(n, step, nodes, slots)
            mass += own
            area += ground_share(n, nodes)
            volume += nodes.load[n][NODE_VOLUME]
            above = n + 1 < lowest + rows and nodes.load[n + 1][NODE_MASS] > 0.0
            group = vec4(0.0)
            if volume >= enough or not above:
                velocity = momentum / mass
                flow += area * velocity
                give += area * area / mass
                total += area
                group = vec4(velocity[0], velocity[1], area, mass)
                mass, area, volume, momentum = 0.0, 0.0, 0.0, vec2(0.0, 0.0)
            nodes.velocity[n] = group
    return flow, ti.max(give, 1.0e-30), total


@ti.func
def velocity_kept(n, step: A, nodes: A, slots: A):
    """Velocity that `settle_column` has put in the place of the momentum [m/s]."""
    return vec2(nodes.load[n][MOMENTUM_X], nodes.load[n][MOMENTUM_Y])


@ti.func
def hold_column(lowest, rows, step: A, nodes: A):
    """Have the ground hold a column in settling: its nodes' velocities, kept as momentum [m/s]."""
    flow, give, _ = join_column(lowest, rows, step, nodes, nodes, velocity_kept)
    new = vec2(0.0, 0.0)
    for k in range(rows):
        n = lowest + rows - 1 - k
        if nodes.kind[n] & COLUMN and nodes.load[n][NODE_MASS] > 0.0:
            group = nodes.velocity[n]
            if group[GROUP_MASS] > 0.0:
                new = vec2(group[GROUP_X], group[GROUP_Y])
                new -= (group[GROUP_AREA] / (group[GROUP_MASS] * give)) * flow
                if nodes.kind[n] & WALLS:
                    new[0] = 0.0
            for a in ti.static(range(2)):
                nodes.load[n][MOMENTUM_X + a] = new[a]


@ti.func
def settle_column(lowest, step: A, nodes: A):
    """Dynamic relaxation of the nodes of a column; the ground holds the soil along it.

    The force that is damped is what the ground leaves of it: a force that the ground balances would
    be damped, by its whole size, against whatever small velocity there is, and never come to rest.

    Returns:
        their unbalanced forces and their weight [N/m].
    """
    rows = ti.cast(nodes.surroundings[lowest][ROWS], ti.i32)
    for n in range(lowest, lowest + rows):  # groups take the place of the velocities
        mass = nodes.load[n][NODE_MASS]
        if nodes.kind[n] & COLUMN and mass > 0.0:
            force = settle_forces(n, step, nodes)
            for k in ti.static(range(2)):
                old = nodes.velocity[n][k]
                nodes.load[n][MOMENTUM_X + k] = old + step.dt * force[k] / mass
                nodes.load[n][FORCE_X + k] = old
    hold_column(lowest, rows, step, nodes)
    unbalanced, weight = 0.0, 0.0
    for n in range(lowest, lowest + rows):
        load = nodes.load[n]
        if nodes.kind[n] & COLUMN and load[NODE_MASS] > 0.0:
            old = vec2(load[FORCE_X], load[FORCE_Y])
            change = vec2(load[MOMENTUM_X], load[MOMENTUM_Y]) - old
            unbalanced += (ti.abs(change[0]) + ti.abs(change[1])) * load[NODE_MASS] / step.dt
            weight += step.gravity * load[NODE_MASS]
            new = old + damped(change, old)
            for k in ti.static(range(2)):
                nodes.load[n][MOMENTUM_X + k] = new[k]
    hold_column(lowest, rows, step, nodes)
    for n in range(lowest, lowest + rows):
        if nodes.kind[n] & COLUMN and nodes.load[n][NODE_MASS] > 0.0:
            leave_settled(n, velocity_kept(n, step, nodes, nodes), nodes)
    return unbalanced, weight


@ti.func
def settle_node(n, step: A, nodes: A):
    """Dynamic relaxation of a node, or of its column; the ground holds, so do smooth walls.

    Returns:
        unbalanced force and weight [N/m] of what it took through the step.
    """
    kind = nodes.kind[n]
    unbalanced, weight = 0.0, 0.0
    if kind & LOWEST:
        unbalanced, weight = settle_column(n, step, nodes)
    if nodes.load[n][NODE_MASS] > 0.0 and not kind & COLUMN:
        force = settle_forces(n, step, nodes)
        if kind & (STICK | BARRING):
            force = vec2(0.0, 0.0)
        if kind & WALLS:
            force[0] = 0.0
        unbalanced += ti.abs(force[0]) + ti.abs(force[1])
        weight += step.gravity * nodes.load[n][NODE_MASS]
        old = vec2(nodes.velocity[n][0], nodes.velocity[n][1])
        new = old + (step.dt / nodes.load[n][NODE_MASS]) * damped(force, old)
        leave_settled(n, new, nodes)
    return unbalanced, weight


def node_update(effects: SimpleNamespace | None = None) -> Callable:
    """The function `update_node`, with the hooks of `effects` where there are any.

    `effects` is what `effects.hooks.effect_functions` makes, None for a scene without any.
    """
    acted = effects is not None

    @ti.func
    def drive(n, step: A, nodes: A, slots: A):
        """Velocity of a node before ground and walls act.

        Resistance only slows: it takes away at most the velocity that the node would have before
        ground and walls act, and its work counts as lost to the surroundings.

        Returns:
            old: velocity before the step; free: without resistance; slowed: with it [m/s].
            water: force of the water [N/m]; pushed: acceleration by effects [m/s2].
        """
        load, surroundings = nodes.load[n], nodes.surroundings[n]
        inverse = 1.0 / load[NODE_MASS]
        old = vec2(load[MOMENTUM_X], load[MOMENTUM_Y]) * inverse
        water = vec2(surroundings[WATER_X], surroundings[WATER_Y]) * load[NODE_VOLUME]
        force = vec2(load[FORCE_X], load[FORCE_Y]) + water
        force[1] -= step.gravity * load[NODE_MASS]
        if step.damping > 0.0:  # Cundall's local damping: a share of the force, against the motion
            for k in ti.static(range(2)):
                force[k] -= step.damping * ti.abs(force[k]) * ti.math.sign(old[k])
        free = old + step.dt * inverse * force
        pushed = vec2(0.0, 0.0)
        slowed = free
        if ti.static(acted):
            pushed = effects.acceleration_at(n, step, slots)
            free += step.dt * pushed
            speed = free.norm()
            left = ti.max(speed - nodes.resistance[n] * step.dt * inverse, 0.0)
            slowed = free * (left / ti.max(speed, 1.0e-12))
        return old, free, slowed, water, pushed

    @ti.func
    def base_at(n, step: A, nodes: A, slots: A):
        """Friction coefficient of the ground at a node, and the force of its adhesion [N/m]."""
        load, surroundings = nodes.load[n], nodes.surroundings[n]
        friction = surroundings[COEFFICIENT]
        adhesion = 0.0
        if nodes.kind[n] & RESISTING:  # the soil's in simple shear, `law.ground_strength`
            share = 1.0 / load[NODE_VOLUME]
            friction = load[NODE_FRICTION] * share
            covered = ti.min(load[NODE_VOLUME] * surroundings[PER_COVER], 1.0)
            traction = load[NODE_ADHESION] * share
            if ti.static(acted):
                friction, traction = effects.ground_at(n, step, slots, friction, traction)
            adhesion = traction * surroundings[AREA] * covered
        elif ti.static(acted):
            friction, _ = effects.ground_at(n, step, slots, friction, 0.0)
        return friction, adhesion

    @ti.func
    def leave(n, old, free, new, water, pushed, step: A, nodes: A):
        """Store the new velocity of a node and clear its sums.

        Returns:
            (3,) work [J/m]: done against ground, walls and resistance (impulse x mean velocity);
            by the water; with effects, by their accelerations.
        """
        mass = nodes.load[n][NODE_MASS]
        mean = old + new
        lost = 0.5 * mass * (free - new).dot(mean)
        water_work = 0.5 * step.dt * water.dot(mean)
        change = new - old
        effect_work = 0.5 * step.dt * mass * pushed.dot(mean)
        nodes.velocity[n] = vec4(new[0], new[1], change[0], change[1])
        nodes.load[n] = vec8(0.0)
        nodes.cell_mean[n] = vec4(0.0)
        if ti.static(acted):
            nodes.resistance[n] = 0.0
        return ti.Vector([lost, water_work, effect_work])

    @ti.func
    def slowed_velocity(n, step: A, nodes: A, slots: A):
        """Velocity of a node before ground and walls act [m/s]."""
        _, _, slowed, _, _ = drive(n, step, nodes, slots)
        return slowed

    @ti.func
    def column_impulse(lowest, rows, step: A, nodes: A, slots: A):
        """Impulse of the ground on a column of nodes, per area of the ground [N s/m2 per m].

        It keeps the mean velocity of the soil along the ground out of the ground, and slows it by
        friction and adhesion; bonded ground stops it.
        """
        flow, give, area = join_column(lowest, rows, step, nodes, slots, slowed_velocity)
        friction, adhesion = 0.0, 0.0
        for n in range(lowest, lowest + rows):
            if nodes.kind[n] & COLUMN and nodes.load[n][NODE_MASS] > 0.0:
                coefficient, hold = base_at(n, step, nodes, slots)
                friction += ground_share(n, nodes) * coefficient
                adhesion += hold
        impulse = vec2(0.0, 0.0)
        if area > 0.0:
            surroundings = nodes.surroundings[lowest]
            normal = vec2(surroundings[NORMAL_X], surroundings[NORMAL_Y])
            along = vec2(-normal[1], normal[0])
            if nodes.kind[lowest] & STICK:
                impulse = -flow / give
            else:
                push = ti.max(-flow.dot(normal), 0.0) / give
                limit = (friction * push + adhesion * step.dt) / area
                stop = -flow.dot(along) / give
                impulse = push * normal + ti.max(ti.min(stop, limit), -limit) * along
        return impulse

    @ti.func
    def update_column(lowest, step: A, nodes: A, slots: A):
        """New velocities of the nodes of a column; returns as `update_node`."""
        rows = ti.cast(nodes.surroundings[lowest][ROWS], ti.i32)
        impulse = column_impulse(lowest, rows, step, nodes, slots)
        work = ti.Vector([0.0, 0.0, 0.0])
        new = vec2(0.0, 0.0)
        for k in range(rows):
            n = lowest + rows - 1 - k
            if nodes.kind[n] & COLUMN and nodes.load[n][NODE_MASS] > 0.0:
                group = nodes.velocity[n]
                if group[GROUP_MASS] > 0.0:
                    new = vec2(group[GROUP_X], group[GROUP_Y])
                    new += (group[GROUP_AREA] / group[GROUP_MASS]) * impulse
                    kind = nodes.kind[n] & (WALLS | TOP)
                    new = contact(new, kind, nodes.surroundings[n], 0.0, 0.0)
                old, free, _, water, pushed = drive(n, step, nodes, slots)
                work += leave(n, old, free, new, water, pushed, step, nodes)
        return work

    @ti.func
    def update_node(n, step: A, nodes: A, slots: A):
        """New velocity of a node, or of its column, from its load, which is cleared.

        Returns:
            (3,) work [J/m], see `leave`.
        """
        kind = nodes.kind[n]
        work = ti.Vector([0.0, 0.0, 0.0])
        if kind & LOWEST:
            work = update_column(n, step, nodes, slots)
        if nodes.load[n][NODE_MASS] > 0.0 and not kind & COLUMN:
            old, free, slowed, water, pushed = drive(n, step, nodes, slots)
            friction, adhesion = base_at(n, step, nodes, slots)
            brake = adhesion * step.dt * (1.0 / nodes.load[n][NODE_MASS])
            new = contact(slowed, kind, nodes.surroundings[n], friction, brake)
            work += leave(n, old, free, new, water, pushed, step, nodes)
        return work

    return update_node
