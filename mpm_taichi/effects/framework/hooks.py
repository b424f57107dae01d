"""The hooks of effects compiled for the kernels: what they see, and when they are asked.

One set of kernels knows all effects of the library (and those user effects that a scene has on); a
slot's mask of bits says which of them its scene has on, and the others cost one test of a bit. So
scenes with any effects share a batch, and a scene's numbers depend only on the scene.

A hook sees of a point (`here`): its place x, y and its place at the start x0, y0 [m]; velocity vx,
vy and speed [m/s]; time since the start [s]; strain, the plastic shear strain so far [-];
strain_rate, the rate of shear in the plane (largest minus smallest principal rate) [1/s]; opening,
the volumetric strain by which it is open under the tension cap [-]; pressure, mean effective
stress, plane_pressure, that of the two in the plane, and vertical, the vertical one; overburden,
vertical effective stress before failure, and mean_overburden, its mean over the liquefied points
(all five in Pa, compression positive); liquefied, 1 or 0; friction (tan phi) and cohesion [Pa] of
its material, with a strength ratio that of the point; cell [m]; memory and field, the effect's own
numbers; renewed, the five that its hook `between` renews. Of a node (`node`): place x, y [m]; time
[s]; cell [m].
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace

import taichi as ti

from mpm_taichi.effects.framework.base import Effect
from mpm_taichi.effects.framework.between import RENEWED
from mpm_taichi.effects.framework.table import (
    CAP,
    COHESION,
    LIQUEFIED,
    OVERBURDEN,
    RATIO,
    START_X,
    START_Y,
    TANGENT,
    EffectTable,
)
from mpm_taichi.layout import (
    BULK_MODULUS,
    CLOSED_POINTS,
    DIVERGENCE,
    DVX_DX,
    DVX_DY,
    DVY_DX,
    DVY_DY,
    FORCE_X,
    GROWN,
    MEAN_OVERBURDEN,
    OFFSET_X,
    OFFSET_Y,
    OPENING,
    ORIGIN_X,
    ORIGIN_Y,
    SHEAR,
    SHEAR_MODULUS,
    VELOCITY_X,
    VELOCITY_Y,
    VOLUMETRIC,
    VX,
    XX,
    YY,
    ZZ,
    A,
    vec2,
    vec4,
)
from mpm_taichi.materials.law import MaterialLaw
from mpm_taichi.solver.transfer import mass_weights, velocity_weights

_F32 = ti.f32
Renewed = ti.types.vector(RENEWED, ti.f32)
PointView = ti.types.struct(
    x=_F32,
    y=_F32,
    x0=_F32,
    y0=_F32,
    vx=_F32,
    vy=_F32,
    speed=_F32,
    time=_F32,
    strain=_F32,
    strain_rate=_F32,
    opening=_F32,
    pressure=_F32,
    overburden=_F32,
    mean_overburden=_F32,
    liquefied=_F32,
    friction=_F32,
    cohesion=_F32,
    vertical=_F32,
    plane_pressure=_F32,
    cell=_F32,
    memory=_F32,
    field=_F32,
    renewed=Renewed,
)
NodeView = ti.types.struct(x=_F32, y=_F32, time=_F32, cell=_F32)
Soil = ti.types.struct(friction=_F32, cohesion=_F32, cap=_F32)
Base = ti.types.struct(friction=_F32, adhesion=_F32)


@ti.func
def column_and_row(n, step: A, slots: A):
    """Column and row of a node, in cells from the origin of the grid that the run began with."""
    number = n - step.first_node
    i = number // step.columns
    j = number - i * step.columns
    return vec2(ti.cast(i - slots.integers[step.slot, GROWN], ti.f32), ti.cast(j, ti.f32))


@ti.func
def point_view(p, step: A, state: A):
    """A point as hooks see it; see the head of this file."""
    points, numbers = ti.static((state.points, state.slots.numbers))
    m, g, s, h = points.motion[p], points.gradient[p], points.stress[p], points.history[p]
    home = column_and_row(points.home[p], step, state.slots)
    stretch = g[DVX_DX] - g[DVY_DY]
    shear = g[DVY_DX] + g[DVX_DY]
    return PointView(
        x=numbers[step.slot, ORIGIN_X] + (home[0] + m[OFFSET_X]) * step.cell,
        y=numbers[step.slot, ORIGIN_Y] + (home[1] + m[OFFSET_Y]) * step.cell,
        x0=points.facts[p, START_X],
        y0=points.facts[p, START_Y],
        vx=m[VELOCITY_X],
        vy=m[VELOCITY_Y],
        speed=ti.sqrt(m[VELOCITY_X] * m[VELOCITY_X] + m[VELOCITY_Y] * m[VELOCITY_Y]),
        time=step.time,
        strain=h[SHEAR],
        strain_rate=ti.sqrt(stretch * stretch + shear * shear),
        opening=h[OPENING],
        pressure=-(s[XX] + s[YY] + s[ZZ]) * (1.0 / 3.0),
        overburden=points.facts[p, OVERBURDEN],
        mean_overburden=numbers[step.slot, MEAN_OVERBURDEN],
        liquefied=points.facts[p, LIQUEFIED],
        friction=points.facts[p, TANGENT],
        cohesion=points.facts[p, COHESION],
        vertical=-s[YY],
        plane_pressure=-(s[XX] + s[YY]) * 0.5,
        cell=step.cell,
        memory=0.0,
        field=0.0,
        renewed=Renewed(0.0),
    )


@ti.func
def node_view(n, step: A, slots: A):
    """A node as hooks see it."""
    place = column_and_row(n, step, slots)
    return NodeView(
        x=slots.numbers[step.slot, ORIGIN_X] + place[0] * step.cell,
        y=slots.numbers[step.slot, ORIGIN_Y] + place[1] * step.cell,
        time=step.time,
        cell=step.cell,
    )


@ti.func
def place_of(p, step: A, state: A):
    """A point's place, as a node has one."""
    home, offset = column_and_row(state.points.home[p], step, state.slots), state.points.motion[p]
    numbers = ti.static(state.slots.numbers)
    return NodeView(
        x=numbers[step.slot, ORIGIN_X] + (home[0] + offset[OFFSET_X]) * step.cell,
        y=numbers[step.slot, ORIGIN_Y] + (home[1] + offset[OFFSET_Y]) * step.cell,
        time=step.time,
        cell=step.cell,
    )


@ti.func
def stretched_across(stress, strain, volumetric, elastic):
    """Stress after an elastic strain across the section, of which soil resists `volumetric`."""
    mean = elastic[BULK_MODULUS] * volumetric
    third = (2.0 / 3.0) * elastic[SHEAR_MODULUS] * strain
    return stress + vec4(mean - third, mean - third, mean + 2.0 * third, 0.0)


@ti.func
def scatter_resistance(p, step: A, points: A, nodes: A, amount, atomic: A):
    """Add a point's resistance [N/m] to its nine nodes, by the weights of its mass."""
    home = points.home[p]
    weight_x, weight_y = mass_weights(points.motion[p], nodes.kind[home])
    for i in ti.static(range(3)):
        for j in ti.static(range(3)):
            n = home + (i - 1) * step.columns + (j - 1)
            value = weight_x[i] * weight_y[j] * amount
            if ti.static(atomic):
                ti.atomic_add(nodes.resistance[n], value)
            else:
                nodes.resistance[n] = nodes.resistance[n] + value


def effect_functions(
    effects: tuple[Effect, ...], law: MaterialLaw, *, averaged: bool
) -> SimpleNamespace:
    """Calls of the schedules to effects, compiled for these and a material law.

    `averaged`: volumetric strain is averaged over a cell (F-bar).

    Returns:
        `table` (`EffectTable`); masks of the slots whose points need a pass, `strength_mask` and
        `resistance_mask`, `dilation_mask` and `width_mask`; and the functions below.
    """
    table = EffectTable(effects)
    calls = {hook: _calls(table, hook) for hook in Effect.DEVICE_HOOKS}
    strengths, memories = table.places("strength"), table.places("memory")
    strength, memory = calls["strength"], calls["memory"]
    fields, remembered, renewed = table.field, table.memory, table.renewed
    resistances, resistance = table.places("resistance"), calls["resistance"]
    dilations, dilation = table.places("dilation"), calls["dilation"]
    accelerations, acceleration = table.places("acceleration"), calls["acceleration"]
    grounds, ground = table.places("ground"), calls["ground"]
    widths, width, stretches = table.places("width"), calls["width"], table.stretch
    strength_constants = law.strength_constants
    changes_strength = strength_constants is not None

    @ti.func
    def seen_by(view, p, facts: A, place: A):
        """`view` of a point with the effect's own numbers."""
        own = view
        if ti.static(place in fields):
            own.field = facts[p, fields[place]]
        if ti.static(place in remembered):
            own.memory = facts[p, remembered[place]]
        if ti.static(place in renewed):
            for k in ti.static(range(RENEWED)):
                own.renewed[k] = facts[p, renewed[place] + k]
        return own

    @ti.func
    def renew_strength(p, step: A, state: A):
        """Memory, then present strength of a point."""
        facts, numbers = ti.static((state.points.facts, state.slots.effect_numbers))
        view = point_view(p, step, state)
        for k in ti.static(memories):
            if step.on & ti.static(1 << k):
                own = seen_by(view, p, facts, k)
                facts[p, remembered[k]] = memory[k](numbers, step.slot, own)
        if ti.static(changes_strength):
            soil = Soil(friction=facts[p, TANGENT], cohesion=facts[p, COHESION], cap=facts[p, CAP])
            for k in ti.static(strengths):
                if step.on & ti.static(1 << k):
                    own = seen_by(view, p, facts, k)
                    soil = strength[k](numbers, step.slot, soil, own)
            state.points.own_strength[p] = strength_constants(soil)

    @ti.func
    def start_strength(p, state: A):
        """Strength by the ratio of a point whose overburden has just been noted.

        From here on it is the strength of its material, which effects then change.
        """
        facts = ti.static(state.points.facts)
        if facts[p, RATIO] > 0.0:
            at_depth = facts[p, RATIO] * facts[p, OVERBURDEN]
            facts[p, COHESION] = ti.max(facts[p, COHESION], at_depth)
            if ti.static(changes_strength):
                state.points.own_strength[p] = strength_constants(
                    Soil(friction=facts[p, TANGENT], cohesion=facts[p, COHESION], cap=facts[p, CAP])
                )

    @ti.func
    def resist(p, step: A, state: A, atomic: A):
        """Resistance of a point to its nodes."""
        points, numbers = ti.static((state.points, state.slots.effect_numbers))
        view = point_view(p, step, state)
        total = 0.0
        for k in ti.static(resistances):
            if step.on & ti.static(1 << k):
                own = seen_by(view, p, points.facts, k)
                total += ti.max(resistance[k](numbers, step.slot, own), 0.0)
        if total > 0.0:
            amount = total * points.volume[p] * (1.0 + points.history[p][VOLUMETRIC])
            scatter_resistance(p, step, points, state.nodes, amount, atomic)

    @ti.func
    def widening(place, step: A, state: A):
        """Slope of ln w at a place [1/m]."""
        slope = 0.0
        for k in ti.static(widths):
            if step.on & ti.static(1 << k):
                now = width[k](state.slots.effect_numbers, step.slot, place)
                slope += now[1] / now[0]
        return slope

    @ti.func
    def share_growth(home, rate, state: A, atomic: A):
        """Add a rate of strain across [1/s] of a closed point to the growth of its cell."""
        if ti.static(averaged):
            if ti.static(atomic):
                ti.atomic_add(state.nodes.cell_mean[home][DIVERGENCE], rate)
            else:
                state.nodes.cell_mean[home][DIVERGENCE] += rate

    @ti.func
    def widen(p, step: A, state: A, atomic: A):
        """Strain of a point across the section in its motion, noted for the coming step.

        In all it is ln(w / w_0) of where the point is, whatever way it came. Closed points share
        it with their cell, as they do the growth of their area (`stress.cell_sums`).
        """
        points, facts = ti.static((state.points, state.points.facts))
        place, home = place_of(p, step, state), points.home[p]
        for k in ti.static(widths):
            if step.on & ti.static(1 << k):
                now = width[k](state.slots.effect_numbers, step.slot, place)
                whole = ti.log(now[0] / facts[p, fields[k]])
                strain = whole - facts[p, stretches[k]]
                facts[p, stretches[k]] = whole
                facts[p, stretches[k] + 1] = strain
                if points.history[p][OPENING] <= 0.0:
                    share_growth(home, strain / step.dt, state, atomic)

    @ti.func
    def strain_across(p, step: A, state: A):
        """Stress and history of a point after the strain that was noted, before that in the plane.

        As in the plane (`stress.trial`) what has opened closes before it resists, and of a closed
        point the change of volume comes with the mean of its cell.
        """
        points, facts = ti.static((state.points, state.points.facts))
        history, closed = points.history[p], 0.0
        if ti.static(averaged):
            closed = state.nodes.cell_mean[points.home[p]][CLOSED_POINTS]
        for k in ti.static(widths):
            if step.on & ti.static(1 << k):
                strain = facts[p, stretches[k] + 1]
                closing = ti.max(ti.min(history[OPENING], -strain), 0.0)
                volumetric = strain + closing
                if history[OPENING] <= 0.0 and closed > 0.0:
                    volumetric = 0.0
                elastic = state.materials.elastic[points.row[p]]
                points.stress[p] = stretched_across(points.stress[p], strain, volumetric, elastic)
                history[VOLUMETRIC] += volumetric
                history[OPENING] -= closing
        points.history[p] = history

    @ti.func
    def settle_wider(p, step: A, state: A, atomic: A):
        """Both while the stress settles and points stay: by the velocity of the nodes."""
        points, nodes = ti.static((state.points, state.nodes))
        weight_x, weight_y = velocity_weights(points.motion[p], nodes.kind[points.home[p]])
        speed = 0.0
        # Unrolled, these loops would make all kernels with effects a third longer to compile.
        for i in range(3):
            for j in range(3):
                n = points.home[p] + (i - 1) * step.columns + (j - 1)
                speed += weight_x[i] * weight_y[j] * nodes.velocity[n][VX]
        rate = speed * widening(place_of(p, step, state), step, state)
        share_growth(points.home[p], rate, state, atomic)
        strain = step.dt * rate
        volumetric = 0.0 if ti.static(averaged) else strain
        elastic = state.materials.elastic[points.row[p]]
        points.stress[p] = stretched_across(points.stress[p], strain, volumetric, elastic)

    @ti.func
    def push_outward(p, step: A, state: A, atomic: A):
        """Force of the stress across the section on the nodes of a point, where the slide widens.

        It does on the nodes' velocities the work that the strain across takes up.
        """
        points, nodes = ti.static((state.points, state.nodes))
        slope = widening(place_of(p, step, state), step, state)
        strained = points.volume[p] * (1.0 + points.history[p][VOLUMETRIC])
        force = -slope * strained * points.stress[p][ZZ]
        weight_x, weight_y = velocity_weights(points.motion[p], nodes.kind[points.home[p]])
        for i in range(3):
            for j in range(3):
                n = points.home[p] + (i - 1) * step.columns + (j - 1)
                share = weight_x[i] * weight_y[j] * force
                if ti.static(atomic):
                    ti.atomic_add(nodes.load[n][FORCE_X], share)
                else:
                    nodes.load[n][FORCE_X] += share

    @ti.func
    def dilate(p, step: A, state: A, shear, bulk_modulus):
        """Change of mean stress [Pa] of plastic shear `shear`, and of the dissipation [J/m3]."""
        view = point_view(p, step, state)
        sine = 0.0
        for k in ti.static(dilations):
            if step.on & ti.static(1 << k):
                own = seen_by(view, p, state.points.facts, k)
                sine += dilation[k](state.slots.effect_numbers, step.slot, own)
        change = -bulk_modulus * sine * shear
        # Plastic volume sine x shear against the mean stress, halfway through its change.
        return change, (0.5 * change - view.pressure) * sine * shear

    @ti.func
    def acceleration_at(n, step: A, slots: A):
        """Acceleration of all mass at a node [m/s2]."""
        view = node_view(n, step, slots)
        total = vec2(0.0, 0.0)
        for k in ti.static(accelerations):
            if step.on & ti.static(1 << k):
                total += acceleration[k](slots.effect_numbers, step.slot, view)
        return total

    @ti.func
    def ground_at(n, step: A, slots: A, friction, adhesion):
        """Friction coefficient and adhesion [Pa] of the ground at a node, as effects leave them."""
        view = node_view(n, step, slots)
        base = Base(friction=friction, adhesion=adhesion)
        for k in ti.static(grounds):
            if step.on & ti.static(1 << k):
                base = ground[k](slots.effect_numbers, step.slot, base, view)
        return ti.max(base.friction, 0.0), ti.max(base.adhesion, 0.0)

    return SimpleNamespace(
        table=table,
        strength_mask=table.mask("strength", "memory"),
        resistance_mask=table.mask("resistance"),
        dilation_mask=table.mask("dilation"),
        width_mask=table.mask("width"),
        renew_strength=renew_strength,
        start_strength=start_strength,
        resist=resist,
        widen=widen,
        strain_across=strain_across,
        settle_wider=settle_wider,
        push_outward=push_outward,
        dilate=dilate,
        acceleration_at=acceleration_at,
        ground_at=ground_at,
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
