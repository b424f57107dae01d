"""The update of one node: its new velocity from its load, and from the same in settling."""

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
    PER_COVER,
    SETTLE_DAMPING,
    WATER_X,
    WATER_Y,
    A,
    vec2,
    vec4,
    vec8,
)
from mpm_taichi.solver.boundary import BARRING, RESISTING, STICK, WALLS, contact


@ti.func
def settle_node(n, step: A, nodes: A):
    """Dynamic relaxation of a node (Cundall's damping); the ground holds, so do smooth walls.

    Returns:
        its unbalanced force and its weight [N/m].
    """
    load, old, surroundings, kind = (
        nodes.load[n], nodes.velocity[n], nodes.surroundings[n], nodes.kind[n],
    )  # fmt: skip
    weight = step.gravity * load[NODE_MASS]
    force = vec2(load[FORCE_X], load[FORCE_Y])
    force += load[NODE_VOLUME] * vec2(surroundings[WATER_X], surroundings[WATER_Y])
    force[1] -= weight
    if kind & (STICK | BARRING):
        force = vec2(0.0, 0.0)
    if kind & WALLS:
        force[0] = 0.0
    unbalanced = ti.abs(force[0]) + ti.abs(force[1])
    new = vec2(0.0, 0.0)
    for k in ti.static(range(2)):
        damped = force[k] - SETTLE_DAMPING * ti.abs(force[k]) * ti.math.sign(old[k])
        new[k] = old[k] + (step.dt / load[NODE_MASS]) * damped
    nodes.velocity[n] = vec4(new[0], new[1], 0.0, 0.0)
    nodes.load[n] = vec8(0.0)
    nodes.cell_mean[n] = vec4(0.0)
    return unbalanced, weight


def node_update(effects: SimpleNamespace | None = None) -> Callable:
    """The function `update_node`, with the hooks of `effects` where there are any.

    `effects` is what `effects.hooks.effect_functions` makes, None for a scene without any.
    """
    acted = effects is not None

    @ti.func
    def update_node(n, step: A, nodes: A, slots: A):
        """New velocity of a node from its load, which is cleared for the next step.

        Resistance only slows: it takes away at most the velocity that the node would have before
        ground and walls act, and its work counts as lost to the surroundings.

        Returns:
            lost: work done against ground and walls, impulse x mean velocity [J/m].
            water_work: work done by the water forces [J/m].
            effect_work: with effects, work done by accelerations [J/m].
        """
        load, surroundings, kind = nodes.load[n], nodes.surroundings[n], nodes.kind[n]
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
            nodes.resistance[n] = 0.0
        friction = surroundings[COEFFICIENT]
        adhesion = 0.0
        if kind & RESISTING:  # strength of the soil in simple shear, `law.ground_strength`
            share = 1.0 / load[NODE_VOLUME]
            friction = load[NODE_FRICTION] * share
            covered = ti.min(load[NODE_VOLUME] * surroundings[PER_COVER], 1.0)
            if ti.static(not acted):
                adhesion = (
                    load[NODE_ADHESION] * share * surroundings[AREA] * covered * step.dt * inverse
                )
            else:
                friction, traction = effects.ground_at(
                    n, step, slots, friction, load[NODE_ADHESION] * share
                )
                adhesion = traction * surroundings[AREA] * covered * step.dt * inverse
        elif ti.static(acted):
            friction, _ = effects.ground_at(n, step, slots, friction, 0.0)
        new = contact(slowed, kind, surroundings, friction, adhesion)
        lost = 0.5 * load[NODE_MASS] * (free - new).dot(old + new)
        water_work = 0.5 * step.dt * water.dot(old + new)
        change = new - old
        effect_work = 0.5 * step.dt * load[NODE_MASS] * pushed.dot(old + new)
        nodes.velocity[n] = vec4(new[0], new[1], change[0], change[1])
        nodes.load[n] = vec8(0.0)
        nodes.cell_mean[n] = vec4(0.0)
        return lost, water_work, effect_work

    return update_node
