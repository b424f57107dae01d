"""A flow slide in one dimension: a body of liquefied soil that spreads, and what is seen of it.

A triangular section of height 18 m and base length 60 m spreads to the right. Its toe at R(t) obeys

    dv/dt = g h / L - S / (rho h) - 0.02 g tan phi / tan 32 deg + ...,    L = L0 + R,  h = A / L,

and the deposit is a family of profiles whose exponent follows R and phi. Every effect changes the
equation, the profile, or the way markers travel, most of them bent in their amplitude, several much
alike. SI units; strengths in kPa outside. Nothing here is meant as a model of a real slide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

G, DENSITY = 9.81, 1900.0
HEIGHT, LENGTH = 18.0, 60.0
AREA = 0.5 * HEIGHT * LENGTH
STEP, END = 0.1, 26.0

#: Where and when it can be observed: profile x [m], markers as shares of the section, times [s].
PROFILE_X = np.array(
    [-55, -50, -45, -40, -35, -30, -25, -20, -16, -12, -8, -4, 0, 3, 6, 9, 12, 15, 18, 21], float
)
MARKERS = np.array([0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.92])
TIMES = np.array([1.5, 3.0, 4.5, 6.0, 7.5, 9.0, 11.0, 13.0, 15.0, 18.0])
#: Numbers in an observation: toe, crest settlement, profile, markers (dx, dy), history.
SIZE = 2 + len(PROFILE_X) + 2 * len(MARKERS) + len(TIMES)
TOE, CREST = 0, 1
PROFILE = slice(2, 2 + len(PROFILE_X))
MARKER = slice(PROFILE.stop, PROFILE.stop + 2 * len(MARKERS))
HISTORY = slice(MARKER.stop, SIZE)

#: Effects that act on the motion.
MOVING = (
    "strain_softening", "rate_strengthening", "pore_pressure", "overburden_strength", "weak_base",
    "hydroplaning", "dilatancy", "bingham", "side_shear", "water_drag", "shaking",
    "outside_speed", "outside_healing", "outside_ridge",
)  # fmt: skip

#: Variables of an unknown strength curve and their knots.
CURVES = {
    "strain_rate": (0.05, 0.15, 0.3, 0.5, 0.8),
    "strain": (0.2, 0.8, 1.6, 2.6, 3.8),
    "time": (1.0, 3.0, 6.0, 10.0, 15.0),
    "overburden": (5.5, 6.3, 7.1, 8.0, 8.8),
}


@dataclass(frozen=True)
class Numerics:
    """How a slide is computed.

    Attributes:
        cell: cell size, 1: the diagnosing model's own.
        damping: extra loss of the transfer scheme.
    """

    cell: float = 1.0
    damping: float = 0.0


def observe(
    strength: np.ndarray,
    friction: np.ndarray,
    effects: dict[str, np.ndarray],
    numerics: Numerics = Numerics(),  # noqa: B008 (frozen)
    curves: dict[str, np.ndarray] | None = None,
    jolt: np.ndarray | None = None,
) -> np.ndarray:
    """What is seen of many slides at once.

    Args:
        strength: S_r (n,) [kPa].
        friction: of the shell (n,) [degrees].
        effects: amplitudes by name, (n,) each; a missing name is 0.
        numerics: how it is computed.
        curves: variable -> ln multiplier of the strength at the knots, (n, knots).
        jolt: disturbance by the positions of the points, (n, 12), of order 1.

    Returns:
        (n, SIZE) [m].
    """
    n = len(strength)
    e = {name: np.asarray(a, dtype=float) for name, a in effects.items()}

    def a(name: str) -> np.ndarray:
        return e.get(name, np.zeros(n))

    jolt = np.zeros((n, 12)) if jolt is None else jolt
    toe, history = _motion(strength, friction, a, curves or {}, numerics)
    scale = 1.0 - 0.06 * numerics.cell - numerics.damping + 0.035 * jolt[:, 0]
    toe, history = toe * scale, history * scale[:, None]
    history = history * (1.0 + 0.03 * np.sin(0.5 * TIMES + 2.0 * jolt[:, [1]]) * jolt[:, [2]])
    shape = _shape(toe, friction, a, numerics, jolt)
    heights = _heights(toe, shape, PROFILE_X)
    crest = _heights(toe, shape, np.array([-LENGTH + 2.0]))[:, 0]
    wiggle = 0.25 * jolt[:, [3]] * np.sin(PROFILE_X / 7.0 + 3.0 * jolt[:, [4]])
    wiggle = wiggle + 0.25 * jolt[:, [5]] * np.sin(PROFILE_X / 3.0 + 3.0 * jolt[:, [6]])
    heights = np.maximum(heights + np.where(heights > 0.3, wiggle, 0.0), 0.0)
    dx, dy = _markers(toe, shape, a, numerics, jolt)
    found = np.empty((n, SIZE))
    found[:, TOE], found[:, CREST] = toe, HEIGHT * (1 - 2.0 / LENGTH) - crest
    found[:, PROFILE] = heights
    found[:, MARKER] = np.stack([dx, dy], axis=2).reshape(n, -1)
    found[:, HISTORY] = history
    return found


def _motion(strength, friction, a, curves, numerics):
    """Runout (n,) and toe at TIMES (n, times) [m]."""
    n = len(strength)
    toe, speed = np.zeros(n), np.full(n, 0.2)
    count = round(END / STEP)
    path = np.zeros((count + 1, n))
    base = 1e3 * strength
    h0 = AREA / LENGTH
    shell = 0.2 * np.tan(np.radians(friction)) / np.tan(np.radians(32.0))
    knots = {name: np.array(CURVES[name]) for name in curves}
    pool = 1.0 - 0.05 * a("pool_level")
    on = {name: a(name) for name in MOVING if np.any(a(name))}
    for number in range(count):
        time = number * STEP
        length = LENGTH + toe
        h = AREA / length
        rate = speed / h
        s = base
        # The last three are outside the library: strength that weakens with speed, or heals with
        # time, and a ridge on the base that the toe must climb.
        for name, amplitude in on.items():
            if name == "strain_softening":
                s = s * (1.0 + amplitude * np.exp(-toe / 5.0))
            elif name == "rate_strengthening":
                s = s * (1.0 + amplitude * np.log10(np.maximum(rate / 0.02, 1.0)))
            elif name == "pore_pressure":
                s = s * (1.0 - amplitude * np.exp(-time / 6.0))
            elif name == "overburden_strength":
                s = s * (1.0 + amplitude * (h / h0 - 1.0) * 1.5)
            elif name == "weak_base":
                s = s * (1.0 - 0.5 * amplitude * LENGTH / length)
            elif name == "hydroplaning":
                s = s * (1.0 - amplitude * np.minimum(1.6 * toe / length, 1.0))
            elif name == "dilatancy":
                s = s * (1.0 + amplitude * (1.0 - np.exp(-toe / 12.0)))
            elif name == "outside_speed":
                s = s * (1.0 - amplitude * np.minimum(speed / 8.0, 1.0) ** 2)
            elif name == "outside_healing":
                s = s * (1.0 + amplitude * max(time - 5.0, 0.0) / 5.0)
        for name, c in curves.items():
            u = {"strain_rate": rate, "strain": toe / h, "time": time + 0 * h, "overburden": h}
            s = s * np.exp(_hats(u[name], knots[name], c))
        if "bingham" in on:
            s = s + 3e3 * on["bingham"] * rate
        if "side_shear" in on:
            s = s + 1e3 * on["side_shear"] * h / h0 * (1.0 + 0.3 * toe / length)
        force = G * h / length * pool - s / (DENSITY * h) - shell
        if "water_drag" in on:
            force = force - 0.4 * on["water_drag"] * speed**2 / h
        if "shaking" in on and time < 10.0:
            force = force + G * (0.5 * on["shaking"] ** 2 + 0.02 * on["shaking"])
        if "outside_ridge" in on:
            force = force - on["outside_ridge"] * np.exp(-(((toe - 9.0) / 4.0) ** 2))
        speed = np.maximum(speed + STEP * force, 0.0)
        toe = toe + STEP * speed
        path[number + 1] = toe
    at = np.round(TIMES / STEP).astype(int)
    return toe, path[at].T


def _hats(u: np.ndarray, knots: np.ndarray, c: np.ndarray) -> np.ndarray:
    """sum_j c_j phi_j(u) for (n,) u and (n, knots) c."""
    place = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((u - knots[place]) / (knots[place + 1] - knots[place]), 0.0, 1.0)
    row = np.arange(len(u))
    return (1 - share) * c[row, place] + share * c[row, place + 1]


@dataclass(frozen=True)
class Shape:
    """Profile: exponent and weights of three bumps, (n,) each."""

    exponent: np.ndarray
    crest: np.ndarray
    middle: np.ndarray
    tail: np.ndarray


def _shape(toe, friction, a, numerics, jolt) -> Shape:
    exponent = 0.55 + 0.45 * np.exp(-toe / 20.0) + 0.012 * (friction - 32.0)
    crest = 0.6 * a("cracking") / (0.5 + a("cracking")) + 0.20 * a("strain_softening")
    crest = crest - 1.5 * a("shaking") ** 2 - 0.1 * a("shaking") + 0.01 * a("side_shear")
    crest = crest + 0.02 * a("pool_level")
    middle = -0.30 * a("weak_base") + 0.12 * a("overburden_strength") - 0.20 * a("pore_pressure")
    middle = middle + 0.10 * a("dilatancy") + 0.15 * a("outside_ridge") + 0.01 * a("side_shear")
    tail = 0.30 * a("hydroplaning") - 0.40 * a("overburden_strength") * toe / (10.0 + toe)
    tail = tail + 0.15 * a("weak_base") + 0.15 * a("outside_ridge") + 0.2 * a("outside_speed")
    tail = tail + 0.15 * a("rate_strengthening") + 0.01 * a("bingham") - 0.04 * a("pool_level")
    tail = tail - 0.04 * numerics.cell - 0.5 * numerics.damping + 0.025 * jolt[:, 7]
    crest = crest + 0.03 * numerics.cell + 0.02 * jolt[:, 8]
    middle = middle + 0.02 * jolt[:, 9]
    return Shape(exponent, crest, middle, tail)


def _raw(s: np.ndarray, shape: Shape) -> np.ndarray:
    """Profile before its area is set; s (n, k): 0 at the back, 1 at the toe."""
    inside = np.clip(1.0 - s, 0.0, 1.0)
    bumps = shape.crest[:, None] * np.exp(-((s / 0.12) ** 2))
    bumps = bumps + shape.middle[:, None] * np.exp(-(((s - 0.45) / 0.15) ** 2))
    bumps = bumps + shape.tail[:, None] * np.exp(-(((s - 0.85) / 0.12) ** 2))
    return np.maximum(inside ** shape.exponent[:, None] + bumps * (s < 1.0), 0.0)


def _heights(toe, shape, x):
    """Heights (n, k) at x (k,); the front is read through a kernel about 1 m wide."""
    grid = np.linspace(0.0, 1.0, 81)[None, :]
    area = np.trapezoid(_raw(np.repeat(grid, len(toe), axis=0), shape), grid[0], axis=1)
    length = (LENGTH + toe)[:, None]
    s = (x[None, :] + LENGTH) / length
    front = 1.0 / (1.0 + np.exp(np.clip((x[None, :] - toe[:, None]) / 0.6, -40, 40)))
    return AREA / (length * area[:, None]) * _raw(np.minimum(s, 0.999), shape) * front


def _markers(toe, shape, a, numerics, jolt):
    """Displacement of the markers to the right and upwards, (n, markers) each."""
    exponent = 1.35 - 0.35 * a("weak_base") + 0.3 * a("hydroplaning")
    exponent = exponent + 0.3 * a("overburden_strength") + 0.12 * a("strain_softening")
    exponent = exponent + 0.06 * numerics.cell + 0.04 * jolt[:, 10]
    dx = toe[:, None] * MARKERS[None, :] ** exponent[:, None]
    dx = dx * (1.0 + 0.04 * jolt[:, [11]] * np.sin(9.0 * MARKERS))
    before = 0.5 * HEIGHT * (1.0 - MARKERS)
    after = 0.5 * _raw_heights(toe, shape, MARKERS[None, :] * LENGTH + dx)
    return dx, after - before[None, :]


def _raw_heights(toe, shape, along):
    """Heights at places (n, k) that differ from slide to slide, measured from the back [m]."""
    grid = np.linspace(0.0, 1.0, 81)[None, :]
    area = np.trapezoid(_raw(np.repeat(grid, len(toe), axis=0), shape), grid[0], axis=1)
    length = (LENGTH + toe)[:, None]
    return AREA / (length * area[:, None]) * _raw(np.minimum(along / length, 0.999), shape)
