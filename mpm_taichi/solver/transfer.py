"""Transfer between material points and grid, and the update of one node: the physics of a step.

Quadratic B-splines (`splines`) on a grid of cell size h. A point keeps the node nearest to it
(`home`) and its offset from that node in cells, -0.5 <= offset < 0.5: float32 then resolves a
motion as well at 400 m as at 0 m. Stress and velocity gradients use the moments of the B-splines
(MLS-MPM, Hu et al. 2018), so that force and affine momentum travel in one matrix.

Every function is written once; the flag `atomic` alone tells the two schedules of `solver` apart.
Arrays with a row per point: `motion` (offset x, y [cells], velocity x, y [m/s]); `home`, number
of the node; `gradient` of velocity [1/s]; `stress` [Pa]; `history` (volumetric strain, opening,
plastic shear strain, dissipated energy [J/m]); `row`, of the material. With a row per node: `load`
(momentum x, y; internal force x, y; mass; volume, volume x k/2, volume x sin phi where asked for);
`flow` (new velocity x, y; its change x, y); `swelling` (sum, then mean, of the divergence of
velocity; points, then smoothed mean stress; sum, then mean, of mean stress; closed points).
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import taichi as ti

from mpm_taichi.materials.mohr_coulomb import elastic_trial, larger, return_to_yield, smaller
from mpm_taichi.solver.boundary import RESISTING, contact
from mpm_taichi.solver.layout import A, known
from mpm_taichi.solver.splines import (
    BASE_EDGE,
    EDGES,
    LEFT_EDGE,
    RIGHT_EDGE,
    edge_slopes,
    edge_weights,
    mass_offset,
    spline_weights,
)

vec2 = ti.types.vector(2, ti.f32)
vec4 = ti.types.vector(4, ti.f32)
vec8 = ti.types.vector(8, ti.f32)


@ti.func
def cell_means(swelling):
    """Means over the closed points of a cell from their sums: (divergence, 0, pressure, points).

    The cell of F-bar is the knot span around a node, in which the velocity is one polynomial.
    """
    means = swelling
    means[0] /= swelling[3]
    means[2] /= swelling[3]
    return means


@ti.func
def smooth_pressure(own, below, above, left, right, smoothing):
    """Mean pressure of a cell, drawn towards a line through its neighbours above and beside it.

    Each argument but the last is a row of `cell_means`. Cells of quadratic splines can alternate in
    pressure without any force noticing; a linear pressure, as weight gives, is left as it is.
    A direction counts only where both neighbours hold closed points.
    """
    bend = 0.0
    if ti.min(below[3], above[3]) > 0.0:
        bend += 0.25 * (2.0 * own[2] - below[2] - above[2])
    if ti.min(left[3], right[3]) > 0.0:
        bend += 0.25 * (2.0 * own[2] - left[2] - right[2])
    return own[2] - smoothing * bend


@ti.func
def area_rate(gradient, dt):
    """Rate at which area grows in a step [1/s], to second order: (det(I + dt L) - 1) / dt.

    The first order alone lets a mass that turns grow by (dt spin)^2 a step.
    """
    return gradient[0] + gradient[3] + dt * (gradient[0] * gradient[3] - gradient[1] * gradient[2])


@ti.func
def strain_increment(gradient, opened, means, dt, averaged: ti.template()):
    """Volumetric strain increment of a point: its own, or the mean over its cell (F-bar).

    A point that has opened goes by its own: it moves freely, and its cell must not feel it.
    """
    divergence = area_rate(gradient, dt)
    if ti.static(averaged):
        divergence = ti.select((opened <= 0.0) & (means[3] > 0.0), means[0], divergence)
    return dt * divergence


@ti.func
def pressure_relief(stress, opened, means, share, averaged: ti.template()):
    """Change of mean stress [Pa] that brings a point nearer to its cell's smoothed mean.

    Without it, pressures that differ within a cell would drive its points apart for ever, since
    F-bar hides their own volume change from them. Opened points neither give nor take.
    """
    relief = 0.0
    if ti.static(averaged):
        lack = means[1] - (stress[0] + stress[1] + stress[2]) * (1.0 / 3.0)
        relief = ti.select((opened <= 0.0) & (means[3] > 0.0), share * lack, 0.0)
    return relief


@ti.func
def trial_stress(
    stress, gradient, opened, volumetric, relief, dt, elastic, corrected: ti.template()
):
    """Trial stress of `elastic_trial`, strain increment [-] and what is still open [-].

    With the volume correction, soil that opened (tension cap) must close again before it resists:
    otherwise each opening and closing at the free surface would leave volume behind.
    """
    strain = volumetric
    left = opened
    if ti.static(corrected):
        closing = larger(smaller(opened, -strain), 0.0)
        left -= closing
        strain += closing
    trial = elastic_trial(stress, gradient, strain, dt, elastic)
    trial[0] += relief
    trial[2] += relief
    return trial, strain, left


@ti.func
def stress_step(
    stress, gradient, history, volumetric, relief, dt, volume, elastic, strength, edges,
    corrected: ti.template(),
):  # fmt: skip
    """Stress and history of a point after a step, and its plastic shear strain in the step."""
    trial, strain, opened = trial_stress(
        stress, gradient, history[1], volumetric, relief, dt, elastic, corrected
    )
    new, shear, opening, work = return_to_yield(trial, elastic, strength, edges)
    if ti.static(corrected):
        opened += opening
        strain -= opening
    return (
        new,
        vec4(
            history[0] + strain,
            opened,
            history[2] + shear,
            history[3] + work * volume * (1.0 + history[0]),
        ),
        shear,
    )


@ti.func
def add(
    load: ti.template(), node, value, first: ti.template(), last: ti.template(),
    atomic: ti.template(),
):  # fmt: skip
    """Add `value` (8,) to a node; it is nil outside the lanes `first` to `last` - 1."""
    if ti.static(atomic):
        for k in ti.static(range(first, last)):
            ti.atomic_add(load[node][k], value[k])
    else:
        load[node] = load[node] + value


@ti.func
def scatter(
    load: ti.template(), home, columns, kind, motion, gradient, stress, strain, mass, volume, cell,
    affine: ti.template(), atomic: ti.template(),
):  # fmt: skip
    """Add a point's momentum, internal force and mass to its nine nodes.

    `kind` is the type of its home.
    """
    if kind & EDGES:
        scatter_beside(
            load, home, columns, kind, motion, gradient, stress, strain, mass, volume, cell,
            affine, atomic,
        )  # fmt: skip
    else:
        base, across, upward = gift(
            motion, gradient, stress, strain, mass, volume, cell, 1.0 / cell, affine
        )
        scatter_inside(
            load, home, columns, base, across, upward, mass, spline_weights(motion[0]),
            spline_weights(motion[1]), atomic,
        )  # fmt: skip


@ti.func
def scatter_beside(
    load: ti.template(), home, columns, kind, motion, gradient, stress, strain, mass, volume, cell,
    affine: ti.template(), atomic: ti.template(),
):  # fmt: skip
    """`scatter` of a point beside level ground or a wall."""
    x = mass_offset(motion[0], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    y = mass_offset(motion[1], kind & BASE_EDGE, 0)
    mass_x = edge_weights(x, kind & LEFT_EDGE, kind & RIGHT_EDGE)
    mass_y = edge_weights(y, kind & BASE_EDGE, 0)
    weight_x = edge_weights(motion[0], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    weight_y = edge_weights(motion[1], kind & BASE_EDGE, 0)
    slope_x = edge_slopes(motion[0], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    slope_y = edge_slopes(motion[1], kind & BASE_EDGE, 0)
    pull = -volume * (1.0 + strain) / cell
    spread = cell if ti.static(affine) else 0.0
    for i in ti.static(range(3)):
        for j in ti.static(range(3)):
            across = spread * ((i - 1) - x)
            upward = spread * ((j - 1) - y)
            weight = mass_x[i] * mass_y[j] * mass
            force_x = pull * slope_x[i] * weight_y[j]
            force_y = pull * weight_x[i] * slope_y[j]
            value = vec8(
                weight * (motion[2] + gradient[0] * across + gradient[2] * upward),
                weight * (motion[3] + gradient[1] * across + gradient[3] * upward),
                force_x * stress[0] + force_y * stress[3],
                force_x * stress[3] + force_y * stress[1],
                weight, 0.0, 0.0, 0.0,
            )  # fmt: skip
            add(load, home + (i - 1) * columns + (j - 1), value, 0, 5, atomic)


@ti.func
def gift(motion, gradient, stress, strain, mass, volume, cell, per_cell, affine: ti.template()):
    """What a point inside gives to its nodes, but for their weights: linear in their distance.

    To the node i columns and j rows from its home it gives base + i across + j upward, each
    (momentum x, y; internal force x, y). `per_cell` is 1 / cell.
    """
    pull = (-4.0 * per_cell) * volume * (1.0 + strain)
    spread = mass * cell if ti.static(affine) else 0.0
    across = vec4(spread * gradient[0], spread * gradient[1], pull * stress[0], pull * stress[3])
    upward = vec4(spread * gradient[2], spread * gradient[3], pull * stress[3], pull * stress[1])
    here = vec4(mass * motion[2], mass * motion[3], 0.0, 0.0)
    return here - motion[0] * across - motion[1] * upward, across, upward


@ti.func
def scatter_inside(
    load: ti.template(), home, columns, base, across, upward, mass, weight_x, weight_y,
    atomic: ti.template(),
):  # fmt: skip
    """`scatter` of a point that is not beside an edge, from its `gift`."""
    first = known(home - columns - 1)
    for i in ti.static(range(3)):
        line = weight_x[i] * (base + (i - 1) * across)
        rise = weight_x[i] * upward
        share = weight_x[i] * mass
        node = known(first + i * columns)
        for j in ti.static(range(3)):
            value = weight_y[j] * (line + (j - 1) * rise)
            whole = vec8(value[0], value[1], value[2], value[3], weight_y[j] * share, 0.0, 0.0, 0.0)
            add(load, node + j, whole, 0, 5, atomic)


@ti.func
def scatter_volume(
    load: ti.template(), home, columns, kind, motion, volume, strength, atomic: ti.template()
):
    """Add a point's volume, and volume x strength in simple shear, to its nine nodes.

    Water acts on the volume. Soil that shears along a plane at constant volume resists
    sigma sin(phi) + c cos(phi) (psi = 0; Davis 1968), and rough ground resists as much. Points far
    from water and from rough ground need not call this.
    """
    weight_x = edge_weights(
        mass_offset(motion[0], kind & LEFT_EDGE, kind & RIGHT_EDGE),
        kind & LEFT_EDGE,
        kind & RIGHT_EDGE,
    )
    weight_y = edge_weights(mass_offset(motion[1], kind & BASE_EDGE, 0), kind & BASE_EDGE, 0)
    scatter_weighted_volume(load, home, columns, weight_x, weight_y, volume, strength, atomic)


@ti.func
def scatter_weighted_volume(
    load: ti.template(), home, columns, weight_x, weight_y, volume, strength, atomic: ti.template()
):
    """`scatter_volume` with the weights of the nodes at hand."""
    value = vec8(
        0.0, 0.0, 0.0, 0.0, 0.0, volume, 0.5 * volume * strength[1], volume * strength[0]
    )  # fmt: skip
    first = known(home - columns - 1)
    for i in ti.static(range(3)):
        node = known(first + i * columns)
        for j in ti.static(range(3)):
            add(load, node + j, weight_x[i] * weight_y[j] * value, 5, 8, atomic)


def node_update(effects=None):  # noqa: ANN001, ANN201
    """The function `update_node`, with the hooks of `effects` where there are any.

    `effects` is what `effects.hooks.effect_functions` makes, None for a scene without any.
    """
    acted = effects is not None

    @ti.func
    def update_node(
        load, table, kind, dt, gravity, damping, resisted=0.0, slot=0, on=0, node=0,
        effect_numbers: A = 0,
    ):  # fmt: skip
        """New velocity of a node from its load.

        What resists (`resisted` [N/m]) only slows: it takes away at most the velocity that the node
        would have before ground and walls act, and its work counts as lost to the surroundings.

        Returns:
            flow: velocity x, y and its change over the step x, y [m/s].
            lost: work done against ground and walls, impulse x mean velocity [J/m].
            water_work: work done by the water forces [J/m].
            effect_work: with effects only, work done by accelerations [J/m].
        """
        inverse = 1.0 / load[4]
        old = vec2(load[0], load[1]) * inverse
        water = vec2(table[4], table[5]) * load[5]
        force = vec2(load[2], load[3]) + water
        force[1] -= gravity * load[4]
        if damping > 0.0:  # Cundall's local damping: a share of the force, against the motion
            for k in ti.static(range(2)):
                force[k] -= damping * ti.abs(force[k]) * ti.math.sign(old[k])
        free = old + dt * inverse * force
        pushed = vec2(0.0, 0.0)
        slowed = free
        if ti.static(acted):
            pushed = effects.push(slot, on, node, effect_numbers)
            free += dt * pushed
            speed = free.norm()
            left = ti.max(speed - resisted * dt * inverse, 0.0)
            slowed = free * (left / ti.max(speed, 1.0e-12))
        friction = table[2]
        adhesion = 0.0
        if kind & RESISTING:  # strength of the soil in simple shear, sigma sin(phi) + k/2
            share = 1.0 / load[5]
            friction = load[7] * share
            covered = ti.min(load[5] * table[6], 1.0)
            if ti.static(not acted):
                adhesion = load[6] * share * table[3] * covered * dt * inverse
            else:
                friction, traction = effects.hold(
                    slot, on, node, friction, load[6] * share, effect_numbers
                )
                adhesion = traction * table[3] * covered * dt * inverse
        elif ti.static(acted):
            friction, _ = effects.hold(slot, on, node, friction, 0.0, effect_numbers)
        new = contact(slowed, kind, table, friction, adhesion)
        lost = 0.5 * load[4] * (free - new).dot(old + new)
        water_work = 0.5 * dt * water.dot(old + new)
        change = new - old
        flow = vec4(new[0], new[1], change[0], change[1])
        effect_work = 0.5 * dt * load[4] * pushed.dot(old + new)
        return flow, lost, water_work, effect_work

    return update_node


@ti.func
def gather(flow: ti.template(), home, columns, kind, motion, cell):
    """Velocity, its change, and velocity gradient at a point, from its nine nodes.

    `kind` is the type of its home.

    Returns:
        mean: (velocity x, y, change x, y) [m/s].
        gradient: (dvx/dx, dvy/dx, dvx/dy, dvy/dy) [1/s].
    """
    mean = vec4(0.0, 0.0, 0.0, 0.0)
    gradient = vec4(0.0, 0.0, 0.0, 0.0)
    if kind & EDGES:
        mean, gradient = gather_beside(flow, home, columns, kind, motion, cell)
    else:
        mean, across, upward = gather_inside(
            flow, home, columns, spline_weights(motion[0]), spline_weights(motion[1])
        )
        gradient = gradient_inside(motion, mean, across, upward, 1.0 / cell)
    return mean, gradient


@ti.func
def gather_beside(flow: ti.template(), home, columns, kind, motion, cell):
    """`gather` of a point beside level ground or a wall."""
    weight_x = edge_weights(motion[0], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    weight_y = edge_weights(motion[1], kind & BASE_EDGE, 0)
    slope_x = edge_slopes(motion[0], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    slope_y = edge_slopes(motion[1], kind & BASE_EDGE, 0)
    mean = vec4(0.0, 0.0, 0.0, 0.0)
    across = vec4(0.0, 0.0, 0.0, 0.0)
    upward = vec4(0.0, 0.0, 0.0, 0.0)
    for i in ti.static(range(3)):
        for j in ti.static(range(3)):
            value = flow[home + (i - 1) * columns + (j - 1)]
            mean += weight_x[i] * weight_y[j] * value
            across += slope_x[i] * weight_y[j] * value
            upward += weight_x[i] * slope_y[j] * value
    return mean, vec4(across[0], across[1], upward[0], upward[1]) / cell


@ti.func
def gather_inside(flow: ti.template(), home, columns, weight_x, weight_y):
    """Sums over the nodes of a point that is not beside an edge.

    Returns:
        mean: of velocity and its change [m/s]; across, upward: of the same times the number of
        columns and of rows between node and home.
    """
    first = known(home - columns - 1)
    mean = vec4(0.0, 0.0, 0.0, 0.0)
    across = vec4(0.0, 0.0, 0.0, 0.0)
    upward = vec4(0.0, 0.0, 0.0, 0.0)
    for i in ti.static(range(3)):
        node = known(first + i * columns)
        low = weight_y[0] * flow[node]
        high = weight_y[2] * flow[node + 2]
        line = (low + weight_y[1] * flow[node + 1] + high) * weight_x[i]
        mean += line
        across += (i - 1) * line
        upward += weight_x[i] * (high - low)
    return mean, across, upward


@ti.func
def gradient_inside(offset, mean, across, upward, per_cell):
    """Velocity gradient from the sums of `gather_inside`; `offset` [cells] begins a motion."""
    return (4.0 * per_cell) * vec4(
        across[0] - offset[0] * mean[0],
        across[1] - offset[0] * mean[1],
        upward[0] - offset[1] * mean[0],
        upward[1] - offset[1] * mean[1],
    )


@ti.func
def move(motion, columns, mean, blend, dt, per_cell):
    """New motion of a point; `blend` is the share of PIC in this step, `per_cell` 1 / cell.

    A point that would move more than two cells in one step, or whose position is no number, stays
    where it is and raises the alarm.

    Returns:
        motion: (4,); shift: how many nodes its home lies further on; alarm: 1 or 0.
    """
    x = motion[0] + (dt * per_cell) * mean[0]
    y = motion[1] + (dt * per_cell) * mean[1]
    across, along = ti.floor(x + 0.5), ti.floor(y + 0.5)
    near = (across >= -1.0) & (across <= 2.0) & (along >= -1.0) & (along <= 2.0)
    right = ti.select(near, ti.cast(across, ti.i32), 0)
    up = ti.select(near, ti.cast(along, ti.i32), 0)
    x, y = ti.select(near, x, motion[0]), ti.select(near, y, motion[1])
    flip = 1.0 - blend
    new = vec4(
        x - ti.cast(right, ti.f32),
        y - ti.cast(up, ti.f32),
        flip * (motion[2] + mean[2]) + blend * mean[0],
        flip * (motion[3] + mean[3]) + blend * mean[1],
    )
    return new, right * columns + up, ti.select(near, 0, 1)


@ti.func
def cell_sums(gradient, stress, opened, dt):
    """What a point adds to the sums of its cell: (divergence, 0, pressure, 1), if it is closed."""
    closed = ti.select(opened <= 0.0, 1.0, 0.0)
    pressure = (stress[0] + stress[1] + stress[2]) * (1.0 / 3.0)
    return closed * vec4(area_rate(gradient, dt), 0.0, pressure, 1.0)
