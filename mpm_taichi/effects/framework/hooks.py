"""The hooks of effects compiled for the kernels: what they see, and when they are asked.

One set of kernels knows all effects of the library (and those user effects that a scene has on); a
slot's mask of bits says which of them its scene has on, and the others cost one test of a bit. So
scenes with any effects share a batch, and a scene's numbers hang on nothing but the scene.

A hook sees of a point (`here`): its place x, y and its place at the start x0, y0 [m]; velocity vx,
vy and speed [m/s]; time since the start [s]; strain, the plastic shear strain so far [-];
strain_rate, the rate of shear in the plane (largest minus smallest principal rate) [1/s]; opening,
the volumetric strain by which it is open under the tension cap [-]; pressure, mean effective stress
and vertical, the vertical one; overburden, vertical effective stress before failure, and
mean_overburden, its mean over the liquefied points (all four in Pa, compression positive);
liquefied, 1 or 0; friction (tan phi) and cohesion [Pa] of its material; cell [m]; memory and field,
the effect's own numbers. Of a node (`node`): place x, y [m]; time [s]; cell [m].
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace

import taichi as ti

from mpm_taichi.effects.framework.base import Effect
from mpm_taichi.effects.framework.table import (
    CAP,
    COHESION,
    LIQUEFIED,
    OVERBURDEN,
    START_X,
    START_Y,
    TANGENT,
    EffectTable,
)
from mpm_taichi.materials.mohr_coulomb import NO_CAP
from mpm_taichi.solver.layout import CELL, GROWN, MEAN_OVERBURDEN, ORIGIN_X, ORIGIN_Y, A, vec2, vec8
from mpm_taichi.solver.splines import BASE_EDGE, LEFT_EDGE, RIGHT_EDGE, edge_weights, mass_offset

_F32 = ti.f32
Here = ti.types.struct(
    x=_F32, y=_F32, x0=_F32, y0=_F32, vx=_F32, vy=_F32, speed=_F32, time=_F32, strain=_F32,
    strain_rate=_F32, opening=_F32, pressure=_F32, overburden=_F32, mean_overburden=_F32,
    liquefied=_F32, friction=_F32, cohesion=_F32, vertical=_F32, cell=_F32, memory=_F32, field=_F32,
)  # fmt: skip
Node = ti.types.struct(x=_F32, y=_F32, time=_F32, cell=_F32)
Soil = ti.types.struct(friction=_F32, cohesion=_F32, cap=_F32)
Base = ti.types.struct(friction=_F32, adhesion=_F32)


@ti.func
def grid_place(n, slot, columns, first_node, integers: A, numbers: A):
    """Column and row of a node, in cells from the origin of the grid that the run began with."""
    number = n - first_node
    i = number // columns
    j = number - i * columns
    return vec2(ti.cast(i - integers[slot, GROWN], ti.f32), ti.cast(j, ti.f32))


@ti.func
def here_of(
    p, slot, time, columns, first_node, integers: A, numbers: A, motion: A, home: A, gradient: A,
    stress: A, history: A, facts: A,
):  # fmt: skip
    """What hooks see of a point; see the head of this file."""
    cell = numbers[slot, CELL]
    m, g, s, h = motion[p], gradient[p], stress[p], history[p]
    place = grid_place(home[p], slot, columns, first_node, integers, numbers)
    stretch = g[0] - g[3]
    shear = g[1] + g[2]
    return Here(
        x=numbers[slot, ORIGIN_X] + (place[0] + m[0]) * cell,
        y=numbers[slot, ORIGIN_Y] + (place[1] + m[1]) * cell,
        x0=facts[p, START_X],
        y0=facts[p, START_Y],
        vx=m[2],
        vy=m[3],
        speed=ti.sqrt(m[2] * m[2] + m[3] * m[3]),
        time=time,
        strain=h[2],
        strain_rate=ti.sqrt(stretch * stretch + shear * shear),
        opening=h[1],
        pressure=-(s[0] + s[1] + s[2]) * (1.0 / 3.0),
        overburden=facts[p, OVERBURDEN],
        mean_overburden=numbers[slot, MEAN_OVERBURDEN],
        liquefied=facts[p, LIQUEFIED],
        friction=facts[p, TANGENT],
        cohesion=facts[p, COHESION],
        vertical=-s[1],
        cell=cell,
        memory=0.0,
        field=0.0,
    )


@ti.func
def strength_constants(soil):
    """As `mohr_coulomb.material_constants`: (sin phi, k, T, 1/(3 - sin), 1/(3 + sin), corner)."""
    tangent = ti.max(soil.friction, 0.0)
    cohesion = ti.max(soil.cohesion, 0.0)
    cosine = 1.0 / ti.sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    k = 2.0 * cohesion * cosine
    apex = NO_CAP
    if tangent > 0.0:
        apex = cohesion / tangent
    cap = ti.min(apex, soil.cap)
    corner = cap
    if cap < apex:
        corner = (cap * (1.0 + sine) - k) / (1.0 - sine)
    return vec8(sine, k, cap, 1.0 / (3.0 - sine), 1.0 / (3.0 + sine), corner, 0.0, 0.0)


@ti.func
def scatter_resistance(resisted: A, home, columns, kind, motion, amount, atomic: ti.template()):
    """Add a point's resistance [N/m] to its nine nodes, by the weights of its mass."""
    weight_x = edge_weights(
        mass_offset(motion[0], kind & LEFT_EDGE, kind & RIGHT_EDGE),
        kind & LEFT_EDGE,
        kind & RIGHT_EDGE,
    )
    weight_y = edge_weights(mass_offset(motion[1], kind & BASE_EDGE, 0), kind & BASE_EDGE, 0)
    for i in ti.static(range(3)):
        for j in ti.static(range(3)):
            n = home + (i - 1) * columns + (j - 1)
            value = weight_x[i] * weight_y[j] * amount
            if ti.static(atomic):
                ti.atomic_add(resisted[n], value)
            else:
                resisted[n] = resisted[n] + value


def effect_functions(effects: tuple[Effect, ...]) -> SimpleNamespace:
    """What the schedules ask of effects, compiled for these.

    Returns:
        `table` (`EffectTable`); masks of the slots whose points need a pass, `strength_mask` and
        `resistance_mask` and `dilation_mask`; and the functions below.
    """
    table = EffectTable(effects)
    calls = {hook: _calls(table, hook) for hook in Effect.DEVICE_HOOKS}
    strengths, memories = table.places("strength"), table.places("memory")
    strength, memory = calls["strength"], calls["memory"]
    fields, remembered = table.field, table.memory
    resistances, resistance = table.places("resistance"), calls["resistance"]
    dilations, dilation = table.places("dilation"), calls["dilation"]
    accelerations, acceleration = table.places("acceleration"), calls["acceleration"]
    grounds, ground = table.places("ground"), calls["ground"]

    @ti.func
    def seen_by(here, p, facts: A, place: ti.template()):
        """`here` with the effect's own memory and field."""
        own = here
        if ti.static(place in fields):
            own.field = facts[p, fields[place]]
        if ti.static(place in remembered):
            own.memory = facts[p, remembered[place]]
        return own

    @ti.func
    def renew_strength(
        p, slot, on, time, columns, first_node, integers: A, numbers: A, motion: A, home: A,
        gradient: A, stress: A, history: A, facts: A, present: A, effect_numbers: A,
    ):  # fmt: skip
        """Memory, then present strength of a point."""
        here = here_of(
            p, slot, time, columns, first_node, integers, numbers, motion, home, gradient, stress,
            history, facts,
        )  # fmt: skip
        for k in ti.static(memories):
            if on & ti.static(1 << k):
                own = seen_by(here, p, facts, k)
                facts[p, remembered[k]] = memory[k](effect_numbers, slot, own)
        soil = Soil(friction=facts[p, TANGENT], cohesion=facts[p, COHESION], cap=facts[p, CAP])
        for k in ti.static(strengths):
            if on & ti.static(1 << k):
                own = seen_by(here, p, facts, k)
                soil = strength[k](effect_numbers, slot, soil, own)
        present[p] = strength_constants(soil)

    @ti.func
    def resist(
        p, slot, on, time, columns, first_node, integers: A, numbers: A, motion: A, home: A,
        gradient: A, stress: A, history: A, facts: A, effect_numbers: A, volume, kind: A,
        resisted: A, atomic: ti.template(),
    ):  # fmt: skip
        """Resistance of a point to its nodes."""
        here = here_of(
            p, slot, time, columns, first_node, integers, numbers, motion, home, gradient, stress,
            history, facts,
        )  # fmt: skip
        total = 0.0
        for k in ti.static(resistances):
            if on & ti.static(1 << k):
                own = seen_by(here, p, facts, k)
                total += ti.max(resistance[k](effect_numbers, slot, own), 0.0)
        if total > 0.0:
            amount = total * volume * (1.0 + history[p][0])
            node = home[p]
            scatter_resistance(resisted, node, columns, kind[node], motion[p], amount, atomic)

    @ti.func
    def dilate(
        p, slot, on, time, columns, first_node, shear, moduli, integers: A, numbers: A, motion: A,
        home: A, gradient: A, stress: A, history: A, facts: A, effect_numbers: A,
    ):  # fmt: skip
        """Change of mean stress [Pa] of plastic shear `shear`, and of the dissipation [J/m3]."""
        here = here_of(
            p, slot, time, columns, first_node, integers, numbers, motion, home, gradient, stress,
            history, facts,
        )  # fmt: skip
        sine = 0.0
        for k in ti.static(dilations):
            if on & ti.static(1 << k):
                own = seen_by(here, p, facts, k)
                sine += dilation[k](effect_numbers, slot, own)
        change = -moduli[1] * sine * shear
        # Plastic volume sine x shear against the mean stress, halfway through its change.
        return change, (0.5 * change - here.pressure) * sine * shear

    @ti.func
    def node_of(n, slot, time, columns, first_node, integers: A, numbers: A):
        """What hooks see of a node."""
        cell = numbers[slot, CELL]
        place = grid_place(n, slot, columns, first_node, integers, numbers)
        return Node(
            x=numbers[slot, ORIGIN_X] + place[0] * cell,
            y=numbers[slot, ORIGIN_Y] + place[1] * cell,
            time=time,
            cell=cell,
        )

    @ti.func
    def push(slot, on, node, effect_numbers: A):
        """Acceleration of all mass at a node [m/s2]."""
        total = vec2(0.0, 0.0)
        for k in ti.static(accelerations):
            if on & ti.static(1 << k):
                total += acceleration[k](effect_numbers, slot, node)
        return total

    @ti.func
    def hold(slot, on, node, friction, adhesion, effect_numbers: A):
        """Friction coefficient and adhesion [Pa] of the ground at a node, as effects leave them."""
        base = Base(friction=friction, adhesion=adhesion)
        for k in ti.static(grounds):
            if on & ti.static(1 << k):
                base = ground[k](effect_numbers, slot, base, node)
        return ti.max(base.friction, 0.0), ti.max(base.adhesion, 0.0)

    return SimpleNamespace(
        table=table,
        strength_mask=table.mask("strength", "memory"),
        resistance_mask=table.mask("resistance"),
        dilation_mask=table.mask("dilation"),
        renew_strength=renew_strength,
        resist=resist,
        dilate=dilate,
        node_of=node_of,
        push=push,
        hold=hold,
    )


_compiled: dict[object, object] = {}


def _calls(table: EffectTable, hook: str) -> dict[int, object]:
    """Place of an effect -> its hook as a Taichi function (effect_numbers, slot, ...)."""
    return {
        place: _call(getattr(table.effects[place], hook), table, place)
        for place in table.places(hook)
    }


def _call(hook: object, table: EffectTable, place: int) -> object:
    """The hook, given its effect's numbers by name."""
    if hook not in _compiled:
        _compiled[hook] = ti.func(hook)
    function = _compiled[hook]
    names, first = table.effects[place].columns, table.first[place]
    kind = ti.types.struct(**dict.fromkeys(names, _F32))

    @ti.func
    def numbers_of(effect_numbers: A, slot):
        effect = kind()
        for k in ti.static(range(len(names))):
            effect[names[k]] = effect_numbers[slot, first + k]
        return effect

    @ti.func
    def with_one(effect_numbers: A, slot, one):
        return function(numbers_of(effect_numbers, slot), one)

    @ti.func
    def with_two(effect_numbers: A, slot, one, two):
        return function(numbers_of(effect_numbers, slot), one, two)

    return with_one if hook.__code__.co_argcount == 2 else with_two
