"""Transfer between material points and grid: scatter, gather, motion.

Quadratic B-splines (`splines`) on a grid of cell size h. A point keeps the node nearest to it
(`home`) and its offset from that node in cells, -0.5 <= offset < 0.5: float32 then resolves a
motion as well at 400 m as at 0 m. Stress and velocity gradients use the moments of the B-splines
(MLS-MPM, Hu et al. 2018), so that force and affine momentum travel in one matrix.

Every function is written once; the two schedules of `solver` differ only in the flag `atomic`.
Arrays and columns: `layout`.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import taichi as ti

from mpm_taichi.layout import (
    CHANGE_X,
    CHANGE_Y,
    DVX_DX,
    DVX_DY,
    DVY_DX,
    DVY_DY,
    NODE_VOLUME,
    OFFSET_X,
    OFFSET_Y,
    VELOCITY_X,
    VELOCITY_Y,
    VOLUMETRIC,
    VX,
    VY,
    XX,
    XY,
    YY,
    A,
    bounded,
    vec4,
    vec8,
)
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


@ti.func
def add(load: A, node, value, first: A, last: A, atomic: A):
    """Add `value` (8,) to a node; it is zero outside the columns `first` to `last` - 1."""
    if ti.static(atomic):
        for k in ti.static(range(first, last)):
            ti.atomic_add(load[node][k], value[k])
    else:
        load[node] = load[node] + value


@ti.func
def scatter(p, step: A, points: A, load: A, kind, mass, affine: A, atomic: A):
    """Add a point's momentum, internal force and mass to its nine nodes.

    Args:
        p: the point.
        step: numbers of the step.
        points: their state.
        load: of the nodes.
        kind: type of the point's home.
        mass: of the point [kg/m].
        affine: whether the affine part of its velocity goes with it.
        atomic: whether other threads add to the same nodes.
    """
    if kind & EDGES:
        scatter_at_edge(p, step, points, load, kind, mass, affine, atomic)
    else:
        base, across, upward = contribution(p, step, points, mass, affine)
        scatter_inside(
            load,
            points.home[p],
            step.columns,
            base,
            across,
            upward,
            mass,
            spline_weights(points.motion[p][OFFSET_X]),
            spline_weights(points.motion[p][OFFSET_Y]),
            atomic,
        )


@ti.func
def scatter_at_edge(p, step: A, points: A, load: A, kind, mass, affine: A, atomic: A):
    """`scatter` of a point next to level ground or a wall."""
    home, motion = points.home[p], points.motion[p]
    gradient, stress = points.gradient[p], points.stress[p]
    x = mass_offset(motion[OFFSET_X], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    y = mass_offset(motion[OFFSET_Y], kind & BASE_EDGE, 0)
    mass_x = edge_weights(x, kind & LEFT_EDGE, kind & RIGHT_EDGE)
    mass_y = edge_weights(y, kind & BASE_EDGE, 0)
    weight_x = edge_weights(motion[OFFSET_X], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    weight_y = edge_weights(motion[OFFSET_Y], kind & BASE_EDGE, 0)
    slope_x = edge_slopes(motion[OFFSET_X], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    slope_y = edge_slopes(motion[OFFSET_Y], kind & BASE_EDGE, 0)
    pull = -points.volume[p] * (1.0 + points.history[p][VOLUMETRIC]) / step.cell
    spread = step.cell if ti.static(affine) else 0.0
    for i in ti.static(range(3)):
        for j in ti.static(range(3)):
            across = spread * ((i - 1) - x)
            upward = spread * ((j - 1) - y)
            weight = mass_x[i] * mass_y[j] * mass
            force_x = pull * slope_x[i] * weight_y[j]
            force_y = pull * weight_x[i] * slope_y[j]
            vx = motion[VELOCITY_X] + gradient[DVX_DX] * across + gradient[DVX_DY] * upward
            vy = motion[VELOCITY_Y] + gradient[DVY_DX] * across + gradient[DVY_DY] * upward
            value = vec8(
                weight * vx,
                weight * vy,
                force_x * stress[XX] + force_y * stress[XY],
                force_x * stress[XY] + force_y * stress[YY],
                weight,
                0.0,
                0.0,
                0.0,
            )
            add(load, home + (i - 1) * step.columns + (j - 1), value, 0, NODE_VOLUME, atomic)


@ti.func
def contribution(p, step: A, points: A, mass, affine: A):
    """Contribution of a point inside to its nodes, without their weights: linear in their distance.

    To the node i columns and j rows from its home it adds base + i across + j upward, each
    (momentum x, y; internal force x, y).
    """
    motion, gradient, stress = points.motion[p], points.gradient[p], points.stress[p]
    pull = (-4.0 * step.per_cell) * points.volume[p] * (1.0 + points.history[p][VOLUMETRIC])
    spread = mass * step.cell if ti.static(affine) else 0.0
    across = vec4(
        spread * gradient[DVX_DX], spread * gradient[DVY_DX], pull * stress[XX], pull * stress[XY]
    )
    upward = vec4(
        spread * gradient[DVX_DY], spread * gradient[DVY_DY], pull * stress[XY], pull * stress[YY]
    )
    centre = vec4(mass * motion[VELOCITY_X], mass * motion[VELOCITY_Y], 0.0, 0.0)
    return centre - motion[OFFSET_X] * across - motion[OFFSET_Y] * upward, across, upward


@ti.func
def scatter_inside(
    load: A, home, columns, base, across, upward, mass, weight_x, weight_y, atomic: A
):
    """`scatter` of a point away from the edges, from its `contribution`."""
    first = bounded(home - columns - 1)
    for i in ti.static(range(3)):
        line = weight_x[i] * (base + (i - 1) * across)
        rise = weight_x[i] * upward
        share = weight_x[i] * mass
        node = bounded(first + i * columns)
        for j in ti.static(range(3)):
            value = weight_y[j] * (line + (j - 1) * rise)
            whole = vec8(value[0], value[1], value[2], value[3], weight_y[j] * share, 0.0, 0.0, 0.0)
            add(load, node + j, whole, 0, NODE_VOLUME, atomic)


@ti.func
def mass_weights(motion, kind):
    """Weights along x and y by which a point gives its mass to its nodes, each (3,)."""
    left, right, base = kind & LEFT_EDGE, kind & RIGHT_EDGE, kind & BASE_EDGE
    weight_x = edge_weights(mass_offset(motion[OFFSET_X], left, right), left, right)
    weight_y = edge_weights(mass_offset(motion[OFFSET_Y], base, 0), base, 0)
    return weight_x, weight_y


@ti.func
def velocity_weights(motion, kind):
    """Weights along x and y by which a point has its velocity from its nodes, each (3,)."""
    weight_x = edge_weights(motion[OFFSET_X], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    weight_y = edge_weights(motion[OFFSET_Y], kind & BASE_EDGE, 0)
    return weight_x, weight_y


@ti.func
def scatter_volume(
    load: A, home, columns, weight_x, weight_y, volume, friction, adhesion, atomic: A
):
    """Add a point's volume, and volume x strength in simple shear, to its nine nodes.

    Water acts on the volume, and rough ground resists by `friction` [-] and `adhesion` [Pa]
    (`MaterialLaw.ground_strength`). Points far from both need not call this. The weights are those
    of the mass, `mass_weights`.
    """
    value = vec8(0.0, 0.0, 0.0, 0.0, 0.0, volume, volume * adhesion, volume * friction)
    first = bounded(home - columns - 1)
    for i in ti.static(range(3)):
        node = bounded(first + i * columns)
        for j in ti.static(range(3)):
            add(load, node + j, weight_x[i] * weight_y[j] * value, NODE_VOLUME, 8, atomic)


@ti.func
def gather(velocity: A, home, columns, kind, motion, cell):
    """Velocity, its change, and velocity gradient at a point, from its nine nodes.

    `kind` is the type of its home.

    Returns:
        mean: (velocity x, y, change x, y) [m/s].
        gradient: (DVX_DX, DVY_DX, DVX_DY, DVY_DY) [1/s].
    """
    mean = vec4(0.0, 0.0, 0.0, 0.0)
    gradient = vec4(0.0, 0.0, 0.0, 0.0)
    if kind & EDGES:
        mean, gradient = gather_at_edge(velocity, home, columns, kind, motion, cell)
    else:
        mean, across, upward = gather_inside(
            velocity,
            home,
            columns,
            spline_weights(motion[OFFSET_X]),
            spline_weights(motion[OFFSET_Y]),
        )
        gradient = gradient_inside(motion, mean, across, upward, 1.0 / cell)
    return mean, gradient


@ti.func
def gather_at_edge(velocity: A, home, columns, kind, motion, cell):
    """`gather` of a point next to level ground or a wall."""
    weight_x, weight_y = velocity_weights(motion, kind)
    slope_x = edge_slopes(motion[OFFSET_X], kind & LEFT_EDGE, kind & RIGHT_EDGE)
    slope_y = edge_slopes(motion[OFFSET_Y], kind & BASE_EDGE, 0)
    mean = vec4(0.0, 0.0, 0.0, 0.0)
    across = vec4(0.0, 0.0, 0.0, 0.0)
    upward = vec4(0.0, 0.0, 0.0, 0.0)
    for i in ti.static(range(3)):
        for j in ti.static(range(3)):
            value = velocity[home + (i - 1) * columns + (j - 1)]
            mean += weight_x[i] * weight_y[j] * value
            across += slope_x[i] * weight_y[j] * value
            upward += weight_x[i] * slope_y[j] * value
    return mean, vec4(across[VX], across[VY], upward[VX], upward[VY]) / cell


@ti.func
def gather_inside(velocity: A, home, columns, weight_x, weight_y):
    """Sums over the nodes of a point that is away from the edges.

    Returns:
        mean: of velocity and its change [m/s]; across, upward: of the same times the number of
        columns and of rows between node and home.
    """
    first = bounded(home - columns - 1)
    mean = vec4(0.0, 0.0, 0.0, 0.0)
    across = vec4(0.0, 0.0, 0.0, 0.0)
    upward = vec4(0.0, 0.0, 0.0, 0.0)
    for i in ti.static(range(3)):
        node = bounded(first + i * columns)
        low = weight_y[0] * velocity[node]
        high = weight_y[2] * velocity[node + 2]
        line = (low + weight_y[1] * velocity[node + 1] + high) * weight_x[i]
        mean += line
        across += (i - 1) * line
        upward += weight_x[i] * (high - low)
    return mean, across, upward


@ti.func
def gradient_inside(offset, mean, across, upward, per_cell):
    """Velocity gradient from the sums of `gather_inside`; `offset` [cells] begins a motion."""
    return (4.0 * per_cell) * vec4(
        across[VX] - offset[OFFSET_X] * mean[VX],
        across[VY] - offset[OFFSET_X] * mean[VY],
        upward[VX] - offset[OFFSET_Y] * mean[VX],
        upward[VY] - offset[OFFSET_Y] * mean[VY],
    )


@ti.func
def move(motion, columns, mean, blend, dt, per_cell):
    """New motion of a point; `blend` is the share of PIC in this step, `per_cell` 1 / cell.

    A point that would move more than two cells in one step, or whose position is not a number,
    stays where it is and raises the alarm.

    Returns:
        motion: (4,); shift: how many nodes its home lies further on; alarm: 1 or 0.
    """
    x = motion[OFFSET_X] + (dt * per_cell) * mean[VX]
    y = motion[OFFSET_Y] + (dt * per_cell) * mean[VY]
    across, along = ti.floor(x + 0.5), ti.floor(y + 0.5)
    near = (across >= -1.0) & (across <= 2.0) & (along >= -1.0) & (along <= 2.0)
    right = ti.select(near, ti.cast(across, ti.i32), 0)
    up = ti.select(near, ti.cast(along, ti.i32), 0)
    x, y = ti.select(near, x, motion[OFFSET_X]), ti.select(near, y, motion[OFFSET_Y])
    flip = 1.0 - blend
    new = vec4(
        x - ti.cast(right, ti.f32),
        y - ti.cast(up, ti.f32),
        flip * (motion[VELOCITY_X] + mean[CHANGE_X]) + blend * mean[VX],
        flip * (motion[VELOCITY_Y] + mean[CHANGE_Y]) + blend * mean[VY],
    )
    return new, right * columns + up, ti.select(near, 0, 1)
