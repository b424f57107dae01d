"""Layout of the arrays of the scenes in flight: types, columns, phases, limits of settling."""

import taichi as ti

vec2 = ti.types.vector(2, ti.f32)
vec4 = ti.types.vector(4, ti.f32)
vec8 = ti.types.vector(8, ti.f32)

TILE = 8
"""Points that the scene schedule takes through a step side by side (`tiles`): as many numbers as a
vector register of the usual size holds. Half and double are both a fifth slower."""

LARGEST_INDEX = (1 << 27) - 1


@ti.func
def known(index):
    """The index itself, which the compiler now knows to be neither negative nor very large.

    It may then add what follows to the address once and for all; otherwise it must work out every
    place anew, lest a sum wrap around at 32 bits: a tenth of a step.
    """
    return index & LARGEST_INDEX


A = ti.template()
"""How a function takes an array: as it is, not by value."""

F32 = ti.types.ndarray(dtype=ti.f32, ndim=2)
F64 = ti.types.ndarray(dtype=ti.f64, ndim=3)
I32 = ti.types.ndarray(dtype=ti.i32, ndim=2)
INDEX = ti.types.ndarray(dtype=ti.i32, ndim=1)
VEC4 = ti.types.ndarray(dtype=vec4, ndim=1)
VEC8 = ti.types.ndarray(dtype=vec8, ndim=1)
REAL = ti.types.ndarray(dtype=ti.f32, ndim=1)
FRAMES = ti.types.ndarray(dtype=vec2, ndim=3)

# Columns of the integer table of a slot (a slot holds one scene).
FIRST_POINT, LAST_POINT, LAST_SETTLED, FIRST_NODE, LAST_NODE, COLUMNS, PHASE, FRAME_COUNT = range(8)
ALARM, SETTLE_STEPS, STEPS, SUBSTEPS = range(8, 12)
FRAMES_DONE, GROWN, EFFECTS_ON = range(12, 15)
INTEGERS = 15
# Columns of the table of numbers of a slot.
CELL, VOLUME, FRAME_TIME, PIC_RATE, GRAVITY, COURANT, WAVE_SPEED, SPEED = range(8)
FIXED_STEP, DAMPING, UNBALANCED, RELIEF, TIME_STEP, BLEND, SHARE, SMOOTHING = range(8, 16)
ORIGIN_X, ORIGIN_Y, MEAN_OVERBURDEN, FRAME_START = range(16, 20)
NUMBERS = 20
# Columns of the sums of a frame [J/m; m/s].
KINETIC, ELASTIC, PLASTIC, CONTACT_LOSS, WATER_WORK, TOP_SPEED, EFFECT_WORK = range(7)
SUMS = 7

IDLE, SETTLING, MOVING = 0, 1, 2
"""Phases of a slot."""

SETTLE_LIMIT = 6000
"""Most steps of settling; reaching it is reported."""
SETTLE_TOLERANCE = 1e-4
"""Settled: unbalanced nodal forces below this share of the weight."""
SETTLE_DAMPING = 0.7
SETTLE_COURANT = 0.5
