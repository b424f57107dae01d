"""Transfer between material points and a grid in three dimensions.

Quadratic B-splines that end at walls, flanks and level ground (`solver.splines`), with the moments
of MLS-MPM away from them. A block's points are worked on by one thread in their order and blocks
that share nodes one after the other (`kernels`): no atomics.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import taichi as ti

from mpm_taichi.layout import VOLUMETRIC, A, bounded
from mpm_taichi.solver.splines import (
    BASE_EDGE,
    LEFT_EDGE,
    RIGHT_EDGE,
    edge_slopes,
    edge_weights,
    mass_offset,
    spline_weights,
)
from mpm_taichi.solver3d.layout import CHANGE, OFFSET, SPEED, vec2, vec8, vec9

NEAR_EDGE, FAR_EDGE = 8192, 16384
"""Bits of a node's type: it lies on the flank at y_min, at y_max."""

EDGES = BASE_EDGE | LEFT_EDGE | RIGHT_EDGE | NEAR_EDGE | FAR_EDGE


@ti.func
def mass_weights(motion, kind):
    """Weights along x, y and z by which a point gives its mass, each (3,)."""
    wx = spline_weights(motion[OFFSET])
    wy = spline_weights(motion[OFFSET + 1])
    wz = spline_weights(motion[OFFSET + 2])
    if kind & EDGES:
        left, right = kind & LEFT_EDGE, kind & RIGHT_EDGE
        near, far, base = kind & NEAR_EDGE, kind & FAR_EDGE, kind & BASE_EDGE
        wx = edge_weights(mass_offset(motion[OFFSET], left, right), left, right)
        wy = edge_weights(mass_offset(motion[OFFSET + 1], near, far), near, far)
        wz = edge_weights(mass_offset(motion[OFFSET + 2], base, 0), base, 0)
    return wx, wy, wz


@ti.func
def contribution(p, step: A, points: A, mass):
    """What a point gives to its nodes, without their weights: base + i across + j along + k up.

    Each (8,): momentum, internal force, mass, volume.
    """
    m, g, s = points.motion[p], points.gradient[p], points.stress[p]
    volume = points.volume[p]
    pull = (-4.0 / step.cell) * volume * (1.0 + points.history[p][VOLUMETRIC])
    spread = mass * step.cell
    across = vec8(
        spread * g[0], spread * g[3], spread * g[6], pull * s[0], pull * s[3], pull * s[5], 0.0, 0.0
    )
    along = vec8(
        spread * g[1], spread * g[4], spread * g[7], pull * s[3], pull * s[1], pull * s[4], 0.0, 0.0
    )
    up = vec8(
        spread * g[2], spread * g[5], spread * g[8], pull * s[5], pull * s[4], pull * s[2], 0.0, 0.0
    )
    centre = vec8(
        mass * m[SPEED], mass * m[SPEED + 1], mass * m[SPEED + 2], 0.0, 0.0, 0.0, mass, volume
    )
    base = centre - m[OFFSET] * across - m[OFFSET + 1] * along - m[OFFSET + 2] * up
    return base, across, along, up


@ti.func
def scatter(p, step: A, points: A, load: A, kind, mass):
    """Add a point's momentum, internal force, mass and volume to its 27 nodes."""
    if kind & EDGES:
        scatter_at_edge(p, step, points, load, kind, mass)
    else:
        base, across, along, up = contribution(p, step, points, mass)
        m = points.motion[p]
        wx, wy = spline_weights(m[OFFSET]), spline_weights(m[OFFSET + 1])
        wz = spline_weights(m[OFFSET + 2])
        layer = step.ny * step.nz
        first = bounded(points.home[p] - layer - step.nz - 1)
        for i in ti.static(range(3)):
            plane = base + (i - 1) * across
            for j in ti.static(range(3)):
                share = wx[i] * wy[j]
                line = share * (plane + (j - 1) * along)
                rise = share * up
                node = bounded(first + i * layer + j * step.nz)
                load[node] = load[node] + wz[0] * (line - rise)
                load[node + 1] = load[node + 1] + wz[1] * line
                load[node + 2] = load[node + 2] + wz[2] * (line + rise)


@ti.func
def scatter_at_edge(p, step: A, points: A, load: A, kind, mass):
    """`scatter` of a point next to level ground, a wall or a flank."""
    m, g, s = points.motion[p], points.gradient[p], points.stress[p]
    left, right = kind & LEFT_EDGE, kind & RIGHT_EDGE
    near, far, base = kind & NEAR_EDGE, kind & FAR_EDGE, kind & BASE_EDGE
    x = mass_offset(m[OFFSET], left, right)
    y = mass_offset(m[OFFSET + 1], near, far)
    z = mass_offset(m[OFFSET + 2], base, 0)
    mass_x, mass_y, mass_z = mass_weights(m, kind)
    wx, sx = edge_weights(m[OFFSET], left, right), edge_slopes(m[OFFSET], left, right)
    wy, sy = edge_weights(m[OFFSET + 1], near, far), edge_slopes(m[OFFSET + 1], near, far)
    wz, sz = edge_weights(m[OFFSET + 2], base, 0), edge_slopes(m[OFFSET + 2], base, 0)
    volume = points.volume[p]
    pull = (-1.0 / step.cell) * volume * (1.0 + points.history[p][VOLUMETRIC])
    layer = step.ny * step.nz
    for i in range(3):
        for j in range(3):
            for k in range(3):
                weight = mass_x[i] * mass_y[j] * mass_z[k]
                dx = step.cell * ((i - 1) - x)
                dy = step.cell * ((j - 1) - y)
                dz = step.cell * ((k - 1) - z)
                fx = pull * sx[i] * wy[j] * wz[k]
                fy = pull * wx[i] * sy[j] * wz[k]
                fz = pull * wx[i] * wy[j] * sz[k]
                node = points.home[p] + (i - 1) * layer + (j - 1) * step.nz + (k - 1)
                load[node] = load[node] + vec8(
                    weight * mass * (m[SPEED] + g[0] * dx + g[1] * dy + g[2] * dz),
                    weight * mass * (m[SPEED + 1] + g[3] * dx + g[4] * dy + g[5] * dz),
                    weight * mass * (m[SPEED + 2] + g[6] * dx + g[7] * dy + g[8] * dz),
                    fx * s[0] + fy * s[3] + fz * s[5],
                    fx * s[3] + fy * s[1] + fz * s[4],
                    fx * s[5] + fy * s[4] + fz * s[2],
                    weight * mass,
                    weight * volume,
                )


@ti.func
def scatter_strength(p, step: A, points: A, soil: A, kind, friction, adhesion):
    """Add volume x strength in simple shear of a point near rough ground to its nodes."""
    wx, wy, wz = mass_weights(points.motion[p], kind)
    volume = points.volume[p]
    value = vec2(volume * friction, volume * adhesion)
    layer = step.ny * step.nz
    for i in range(3):
        for j in range(3):
            for k in range(3):
                node = points.home[p] + (i - 1) * layer + (j - 1) * step.nz + (k - 1)
                soil[node] = soil[node] + wx[i] * wy[j] * wz[k] * value


@ti.func
def gather(home, step: A, velocity: A, kind, motion):
    """Velocity and its change (8,) [m/s] and velocity gradient (9,) [1/s] at a point."""
    mean, across, along, up = vec8(0.0), vec8(0.0), vec8(0.0), vec8(0.0)
    layer = step.ny * step.nz
    first = bounded(home - layer - step.nz - 1)
    wx, wy = spline_weights(motion[OFFSET]), spline_weights(motion[OFFSET + 1])
    wz = spline_weights(motion[OFFSET + 2])
    if kind & EDGES:
        left, right = kind & LEFT_EDGE, kind & RIGHT_EDGE
        near, far, base = kind & NEAR_EDGE, kind & FAR_EDGE, kind & BASE_EDGE
        x, y, z = motion[OFFSET], motion[OFFSET + 1], motion[OFFSET + 2]
        wx, sx = edge_weights(x, left, right), edge_slopes(x, left, right)
        wy, sy = edge_weights(y, near, far), edge_slopes(y, near, far)
        wz, sz = edge_weights(z, base, 0), edge_slopes(z, base, 0)
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    value = velocity[bounded(first + i * layer + j * step.nz) + k]
                    mean += wx[i] * wy[j] * wz[k] * value
                    across += sx[i] * wy[j] * wz[k] * value
                    along += wx[i] * sy[j] * wz[k] * value
                    up += wx[i] * wy[j] * sz[k] * value
        across *= 1.0 / step.cell
        along *= 1.0 / step.cell
        up *= 1.0 / step.cell
    else:
        for i in ti.static(range(3)):
            for j in ti.static(range(3)):
                node = bounded(first + i * layer + j * step.nz)
                share = wx[i] * wy[j]
                low, high = wz[0] * velocity[node], wz[2] * velocity[node + 2]
                line = share * (low + wz[1] * velocity[node + 1] + high)
                mean += line
                across += (i - 1) * line
                along += (j - 1) * line
                up += share * (high - low)
        scale = 4.0 / step.cell
        across = scale * (across - motion[OFFSET] * mean)
        along = scale * (along - motion[OFFSET + 1] * mean)
        up = scale * (up - motion[OFFSET + 2] * mean)
    gradient = vec9(
        across[0], along[0], up[0], across[1], along[1], up[1], across[2], along[2], up[2]
    )
    return mean, gradient


@ti.func
def move(motion, step: A, mean):
    """Motion of a point after a step: (8,), how many nodes its home lies further on, alarm.

    A point that would move more than half a cell in a step, or to a place that is not a number,
    stays where it is and raises the alarm.
    """
    new = motion
    shift, alarm = 0, 0
    stride = ti.Vector([step.ny * step.nz, step.nz, 1])
    flip = 1.0 - step.blend
    for a in ti.static(range(3)):
        way = (step.dt / step.cell) * mean[a]
        if not ti.abs(way) <= 0.5:
            alarm = 1
            way = 0.0
        place = motion[OFFSET + a] + way
        nodes = ti.floor(place + 0.5)
        shift += ti.cast(nodes, ti.i32) * stride[a]
        new[OFFSET + a] = place - nodes
        new[SPEED + a] = flip * (motion[SPEED + a] + mean[CHANGE + a]) + step.blend * mean[a]
    return new, shift, alarm
