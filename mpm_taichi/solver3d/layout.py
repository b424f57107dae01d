"""Columns of the arrays of a three-dimensional run: x along the section, y across, z up; SI.

Nodes are numbered (i * ny + j) * nz + k: z runs fastest.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from typing import Any, NamedTuple

import taichi as ti

from mpm_taichi.layout import INDEX, VEC4, VEC8, bounded, vec4, vec8

__all__ = ["INDEX", "VEC4", "VEC8", "bounded", "vec4", "vec8"]

vec2 = ti.types.vector(2, ti.f32)
vec3 = ti.types.vector(3, ti.f32)
vec6 = ti.types.vector(6, ti.f32)
vec9 = ti.types.vector(9, ti.f32)
VEC2 = ti.types.ndarray(dtype=vec2, ndim=1)
VEC6 = ti.types.ndarray(dtype=vec6, ndim=1)
VEC9 = ti.types.ndarray(dtype=vec9, ndim=1)
REAL = ti.types.ndarray(dtype=ti.f32, ndim=1)
SUMS = ti.types.ndarray(dtype=ti.f64, ndim=2)


class Points(NamedTuple):
    """Arrays of the material points: one row per point, in the order of their blocks."""

    home: INDEX  # node nearest to the point
    row: INDEX  # material row
    volume: REAL  # at the start [m3]
    motion: VEC8  # OFFSET 3 [cells], VELOCITY 3 [m/s], two unused
    gradient: VEC9  # dv_a/dx_b at 3 a + b [1/s]
    stress: VEC6  # XX, YY, ZZ, XY, YZ, XZ [Pa], tension positive
    history: VEC4  # VOLUMETRIC, OPENING, SHEAR [-], DISSIPATED [J], as `mpm_taichi.layout`


class Nodes(NamedTuple):
    """Arrays of the grid."""

    kind: INDEX  # bits of `boundary`
    surroundings: VEC8  # NORMAL 3 ... ROWS
    water: VEC4  # force of still water per volume of soil [N/m3]: x, y, z, one unused
    load: VEC8  # MOMENTUM 3 [kg m/s], FORCE 3 [N], NODE_MASS [kg], NODE_VOLUME [m3]
    soil: VEC2  # volume x strength in simple shear: FRICTION [m3], ADHESION [Pa m3]
    velocity: VEC8  # velocity 3, its CHANGE 3 over the step [m/s], two unused
    cell_sum: VEC4  # of closed points: DIVERGENCE [1/s], -, MEAN_STRESS [Pa], CLOSED_POINTS
    cell_mean: VEC4  # mean DIVERGENCE, SMOOTHED mean stress, MEAN_STRESS, CLOSED_POINTS


class Tables(NamedTuple):
    """Constants of the material rows and first points of the blocks."""

    elastic: VEC4  # as `mpm_taichi.layout.MaterialTable`
    strength: VEC8
    settle_strength: VEC8
    density: REAL  # kg/m3
    first: INDEX  # first point of each block, and one past the last
    column_sums: SUMS  # by column of nodes: CONTACT_LOSS, WATER_WORK, or UNBALANCED, WEIGHT
    block_sums: SUMS  # by block: KINETIC, ELASTIC, PLASTIC, squared speed
    block_reach: REAL  # largest speed of a point in the last step [m/s]; infinite: alarm


class SolverState(NamedTuple):
    """All arrays, by group."""

    points: Points
    nodes: Nodes
    tables: Tables


GROUPS = SolverState.__annotations__
ARRAYS = {name: kind for group in GROUPS.values() for name, kind in group.__annotations__.items()}

OFFSET, SPEED = 0, 3  # of `motion`, first of three
XX, YY, ZZ, XY, YZ, XZ = range(6)
NORMAL, COEFFICIENT, AREA, PER_COVER, ROWS, FLANK_AREA = 0, 3, 4, 5, 6, 7
MOMENTUM, FORCE, NODE_MASS, NODE_VOLUME = 0, 3, 6, 7
CHANGE = 3
FRICTION, ADHESION = 0, 1
CONTACT_LOSS, WATER_WORK = 0, 1


class StepNumbers(NamedTuple):
    """Numbers of a step that its functions share."""

    cell: Any
    dt: Any
    blend: Any
    share: Any
    smoothing: Any
    gravity: Any
    ny: Any
    nz: Any
