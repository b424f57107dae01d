"""Every array of the scenes in flight, its columns, shape and unit: the one table of the solver.

A slot is a fixed stretch of every array and holds one scene. The arrays belong to five groups, each
a `NamedTuple` here; the annotation of a member is its Taichi type (INDEX and I32 hold integers,
REAL and F32 float32, F64 float64, VECn vectors of n float32). Functions of the kernels take whole
groups; `kernel_arguments` writes the argument lists of the kernels, and `runtime` makes the arrays,
from these annotations. A new array is one line here.

A packed array is read by the names of its columns, which stand next to its group.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from typing import Any, NamedTuple

import taichi as ti

vec2 = ti.types.vector(2, ti.f32)
vec4 = ti.types.vector(4, ti.f32)
vec8 = ti.types.vector(8, ti.f32)

TILE = 8
"""Points that the scene schedule takes through a step together (`tiles`): as many numbers as a
vector register of the usual size holds. Half and double are both a fifth slower."""

MAX_ROWS = 32
"""Most material rows of a scene (materials, and saturated forms of them)."""

LARGEST_INDEX = (1 << 27) - 1


@ti.func
def bounded(index):
    """The index itself, which the compiler then knows to be neither negative nor very large.

    It can then fold constant offsets into the address; otherwise it has to compute every address
    separately, in case a sum wraps around at 32 bits: a tenth of a step.
    """
    return index & LARGEST_INDEX


A = ti.template()
"""How a function takes an array or a group of arrays: by reference."""

F32 = ti.types.ndarray(dtype=ti.f32, ndim=2)
F64 = ti.types.ndarray(dtype=ti.f64, ndim=3)
I32 = ti.types.ndarray(dtype=ti.i32, ndim=2)
INDEX = ti.types.ndarray(dtype=ti.i32, ndim=1)
VEC4 = ti.types.ndarray(dtype=vec4, ndim=1)
VEC8 = ti.types.ndarray(dtype=vec8, ndim=1)
REAL = ti.types.ndarray(dtype=ti.f32, ndim=1)
FRAMES = ti.types.ndarray(dtype=vec2, ndim=3)


class SlotState(NamedTuple):
    """Properties of a scene as a whole: one row per slot."""

    integers: I32  # FIRST_POINT ... EFFECTS_ON
    numbers: F32  # CELL ... FRAME_START
    effect_numbers: F32  # amplitudes, parameters and constants of effects: `EffectTable.first`


# Columns of `integers`. Points and nodes are numbered through all slots; LAST_ is one past the end.
FIRST_POINT, LAST_POINT, LAST_SETTLED, FIRST_NODE, LAST_NODE, COLUMNS, PHASE, FRAME_COUNT = range(8)
ALARM, SETTLE_STEPS, STEPS, SUBSTEPS = range(8, 12)
FRAMES_DONE, GROWN, EFFECTS_ON = range(12, 15)
INTEGERS = 15
# Columns of `numbers`, in SI.
CELL, FRAME_TIME, PIC_RATE, GRAVITY, COURANT, WAVE_SPEED, SPEED, FIXED_STEP = range(8)
DAMPING, UNBALANCED, RELIEF, TIME_STEP, BLEND, SHARE, SMOOTHING, FRAME_START = range(8, 16)
ORIGIN_X, ORIGIN_Y, MEAN_OVERBURDEN = range(16, 19)
NUMBERS = 19

IDLE, SETTLING, MOVING = 0, 1, 2
"""Phases of a slot."""


class PointState(NamedTuple):
    """State of the material points: one row per point; a slot has room for whole tiles."""

    home: INDEX  # number of the node nearest to the point
    row: INDEX  # number of its row in the `MaterialTable`
    volume: REAL  # at the start [m2]
    motion: VEC4  # OFFSET_X, OFFSET_Y [cells], -0.5 <= offset < 0.5; VELOCITY_X, VELOCITY_Y [m/s]
    gradient: VEC4  # of velocity: DVX_DX, DVY_DX, DVX_DY, DVY_DY [1/s]
    stress: VEC4  # XX, YY, ZZ, XY [Pa], tension positive
    history: VEC4  # VOLUMETRIC, OPENING, SHEAR [-], DISSIPATED [J/m]
    initial_stress: VEC4  # stress at t = 0 [Pa], after settling
    variables: F32  # history variables of the material law: `MaterialLaw.variables`, or 1 unused
    facts: F32  # with effects: what they know of a point, columns of `effects.framework.table`
    own_strength: VEC8  # with effects: a row of `MaterialTable.strength` of the point's own


OFFSET_X, OFFSET_Y, VELOCITY_X, VELOCITY_Y = range(4)
DVX_DX, DVY_DX, DVX_DY, DVY_DY = range(4)
XX, YY, ZZ, XY = range(4)
# VOLUMETRIC strain; OPENING, the volumetric strain by which a point is open under tension; plastic
# SHEAR strain, largest minus smallest principal one; energy DISSIPATED.
VOLUMETRIC, OPENING, SHEAR, DISSIPATED = range(4)


class NodeState(NamedTuple):
    """State of the grid nodes: one row per node."""

    kind: INDEX  # bits of `boundary` and `splines`
    surroundings: VEC8  # NORMAL_X ... ROWS: ground, water (`boundary.node_tables`)
    load: VEC8  # MOMENTUM_X ... NODE_FRICTION: sums over the points around the node
    velocity: VEC4  # VX, VY after the step and their CHANGE_X, CHANGE_Y over it [m/s]
    cell_mean: VEC4  # DIVERGENCE ... CLOSED_POINTS: sums, then means, over the points of a cell
    resistance: REAL  # with effects: force against the motion of the node [N/m]


# `surroundings`: normal out of the ground; Coulomb COEFFICIENT; AREA of the ground [m2 per m];
# force of water per volume [N/m3]; PER_COVER, 1 / volume at full contact [1/m2]; ROWS of the column
# whose lowest node this is (`boundary.LOWEST`).
NORMAL_X, NORMAL_Y, COEFFICIENT, AREA, WATER_X, WATER_Y, PER_COVER, ROWS = range(8)
# `load`: momentum [kg m/s per m]; internal force [N/m]; mass [kg/m]; where asked for, volume
# [m2] and volume x strength of soil in simple shear: adhesion [Pa m2], friction coefficient [m2].
MOMENTUM_X, MOMENTUM_Y, FORCE_X, FORCE_Y, NODE_MASS = range(5)
NODE_VOLUME, NODE_ADHESION, NODE_FRICTION = range(5, 8)
VX, VY, CHANGE_X, CHANGE_Y = range(4)
# `cell_mean`: divergence of velocity [1/s]; smoothed mean stress [Pa]; mean stress [Pa]; number of
# closed points. The cell of F-bar is the knot span around a node.
DIVERGENCE, SMOOTHED, MEAN_STRESS, CLOSED_POINTS = range(4)


class MaterialTable(NamedTuple):
    """Constants of the soils: `MAX_ROWS` rows per slot, one per material and saturated form."""

    elastic: VEC4  # SHEAR_MODULUS, BULK_MODULUS [Pa], SHEAR_COMPLIANCE 1/(2G), BULK_COMPLIANCE 1/K
    strength: VEC8  # constants of the material law, see its file in `materials`
    settle_strength: VEC8  # the same before failure, while the initial stress settles
    density: REAL  # [kg/m3]


SHEAR_MODULUS, BULK_MODULUS, SHEAR_COMPLIANCE, BULK_COMPLIANCE = range(4)


class FrameState(NamedTuple):
    """Output of a chunk of frames for the host."""

    positions: FRAMES  # (slot, frame, point) from the grid's first node [m]
    sums: F64  # (slot, frame, KINETIC ... EFFECT_WORK)


# Columns of `sums` [J/m; m/s].
KINETIC, ELASTIC, PLASTIC, CONTACT_LOSS, WATER_WORK, TOP_SPEED, EFFECT_WORK = range(7)
SUMS = 7


class SolverState(NamedTuple):
    """All arrays, by group."""

    slots: SlotState
    points: PointState
    nodes: NodeState
    materials: MaterialTable
    frames: FrameState


GROUPS = SolverState.__annotations__
"""Group's name -> its type."""
ARRAYS = {name: kind for group in GROUPS.values() for name, kind in group.__annotations__.items()}
"""Array's name -> its Taichi type, in the order in which kernels take them."""


class StepNumbers(NamedTuple):
    """Numbers of one step of one scene, which the functions of a kernel share: its locals.

    A kernel makes it by `ti.static(Step(...))`, so that functions take it by reference.
    """

    slot: Any
    first_node: Any
    columns: Any  # nodes in a column of the grid: neighbours along x are so far apart
    cell: Any  # [m]
    per_cell: Any  # 1 / cell
    dt: Any  # [s]
    blend: Any = 0.0  # share of PIC in this step
    share: Any = 0.0  # share of the pressure differences in a cell that this step removes
    gravity: Any = 0.0  # [m/s2]
    damping: Any = 0.0  # Cundall's local damping
    time: Any = 0.0  # since the start [s]
    on: Any = 0  # bits of the effects that the scene has on


SETTLE_LIMIT = 6000
"""Most steps of settling; reaching it is reported."""
SETTLE_TOLERANCE = 1e-4
"""Settled: unbalanced nodal forces below this share of the weight."""
SETTLE_DAMPING = 0.7
SETTLE_COURANT = 0.5
