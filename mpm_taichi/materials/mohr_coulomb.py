"""Mohr-Coulomb in plane strain: the exact return to the yield surface.

Stress is tension positive. Principal stresses are ordered hi >= mid >= lo, the out-of-plane
stress included. With friction angle phi, cohesion c and k = 2 c cos(phi):

    shear   f = (hi - lo) + (hi + lo) sin(phi) - k <= 0   (flow without dilation, psi = 0)
    tension     hi - T <= 0                               (associated flow, Rankine)

The shear flow direction (1, 0, -1) keeps the mean stress, so the return to the main plane and to
both edges is a closed form, and there is no plastic way to the apex: stresses beyond it are
returned by the tension cap T = c cot(phi) (none for phi = 0, unless one is set lower).
Source: de Souza Neto, Peric and Owen (2008), Computational Methods for Plasticity, ch. 8, with
psi = 0 worked out here; checked against an independent float64 solution in
`tests/mpm_taichi/test_mohr_coulomb.py`.
"""

from __future__ import annotations

import numpy as np
import taichi as ti

vec4 = ti.types.vector(4, ti.f32)

NO_CAP = 1.0e30
"""Tension cap [Pa] that is never reached."""

LEAST_STRESS = 1.0e-6
"""Radius of Mohr's circle [Pa] below which it counts as a point."""


def material_constants(
    *,
    friction_angle: float,
    cohesion: float,
    youngs_modulus: float,
    poisson_ratio: float,
    tension_cap: float | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Constants of one material as the kernels read them.

    Args:
        friction_angle: phi [rad], 0 <= phi < pi/2.
        cohesion: c [Pa].
        youngs_modulus: E [Pa].
        poisson_ratio: nu [-].
        tension_cap: T [Pa]; None is the apex c cot(phi), and no cap at all where phi = 0.

    Returns:
        elastic: (G, K, 1/(2G), 1/K), shape (4,), float32.
        strength: (sin phi, k = 2 c cos phi, T, 0), shape (4,), float32.
        edges: (1/(3 - sin phi), 1/(3 + sin phi), lo at the tension corner, 0), float32.
    """
    shear = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    bulk = youngs_modulus / (3.0 * (1.0 - 2.0 * poisson_ratio))
    sine, cosine = np.sin(friction_angle), np.cos(friction_angle)
    apex = cohesion * cosine / sine if sine > 0.0 else NO_CAP
    cap = apex if tension_cap is None else min(apex, tension_cap)
    k = 2.0 * cohesion * cosine
    corner = cap if cap == apex else (cap * (1.0 + sine) - k) / (1.0 - sine)
    elastic = np.array([shear, bulk, 0.5 / shear, 1.0 / bulk], np.float32)
    strength = np.array([sine, k, cap, 0.0], np.float32)
    edges = np.array([1.0 / (3.0 - sine), 1.0 / (3.0 + sine), corner, 0.0], np.float32)
    return elastic, strength, edges


@ti.func
def larger(a, b):
    """The larger of two numbers, in one instruction where `ti.max` takes three to mind NaN."""
    return ti.select(a > b, a, b)


@ti.func
def smaller(a, b):
    """The smaller of two numbers; see `larger`."""
    return ti.select(a < b, a, b)


@ti.func
def elastic_trial(stress, gradient, volumetric, dt, elastic):
    """Trial stress after one step: exact rotation by the spin, then linear elasticity.

    `stress` is (xx, yy, zz, xy) [Pa]; `gradient` is the velocity gradient
    (dvx/dx, dvy/dx, dvx/dy, dvy/dy) [1/s]; `volumetric` the volumetric strain increment [-], which
    F-bar averages over a cell and which may thus differ from dt tr(gradient).
    F = I + dt L turns by the angle theta of its polar decomposition, tan(theta) =
    (F_yx - F_xy) / (F_xx + F_yy), which leaves the invariants as they are. Strain is dt sym(L) and
    half of dt^2 det(L) on both axes: nil for a rigid turn, and with the area that F has.

    Returns:
        (centre, half, out, xy) [Pa]: centre of Mohr's circle in the plane, half of xx - yy, zz, xy.
    """
    stretch = dt * (gradient[0] + gradient[3])
    growth = dt * dt * (gradient[0] * gradient[3] - gradient[1] * gradient[2])
    along = 1.0 + 0.5 * stretch
    across = 0.5 * dt * (gradient[1] - gradient[2])
    along2 = along * along
    across2 = across * across
    scale = 1.0 / (along2 + across2)
    cos2 = (along2 - across2) * scale
    sin2 = (2.0 * along * across) * scale
    swell = elastic[1] * volumetric
    third = elastic[0] * (1.0 / 3.0) * (stretch + growth)
    half = 0.5 * (stress[0] - stress[1])
    return vec4(
        0.5 * (stress[0] + stress[1]) + (swell + third),
        (half * cos2 - stress[3] * sin2) + elastic[0] * dt * (gradient[0] - gradient[3]),
        stress[2] + (swell - 2.0 * third),
        (stress[3] * cos2 + half * sin2) + elastic[0] * dt * (gradient[1] + gradient[2]),
    )


@ti.func
def main_return(trial, elastic, strength):
    """Return of a trial stress that stays elastic or returns to the main plane.

    These are by far the most frequent, and which of the two changes from step to step: so there is
    no branch. `trial` is what `elastic_trial` returns.

    Returns:
        stress: (xx, yy, zz, xy) [Pa].
        shear: plastic shear strain increment, hi minus lo principal [-].
        work: plastic dissipation [J/m3].
        elsewhere: above 0 where the stress returns elsewhere (`return_to_yield`).
    """
    centre, half, out = trial[0], trial[1], trial[2]
    radius = ti.sqrt(half * half + trial[3] * trial[3])
    hi = larger(centre + radius, out)
    lo = smaller(centre - radius, out)
    excess = (hi - lo) + ((hi + lo) * strength[0] - strength[1])
    beyond = larger(excess, 0.0)
    reduced = radius - 0.5 * beyond
    scale = reduced / larger(radius, LEAST_STRESS)
    turned = half * scale
    shear = beyond * elastic[2]
    off = larger(ti.abs(out - centre) - reduced, centre + reduced - strength[2])
    elsewhere = ti.select(excess > 0.0, off, hi - strength[2])
    stress = vec4(centre + turned, centre - turned, out, trial[3] * scale)
    return stress, shear, reduced * shear, elsewhere


@ti.func
def return_to_yield(trial, elastic, strength, edges):
    """Trial stress of `elastic_trial` returned to the yield surface.

    Returns:
        stress: (xx, yy, zz, xy) [Pa].
        shear: plastic shear strain increment, hi minus lo principal [-].
        opening: plastic volumetric strain increment of the tension cap [-].
        work: plastic dissipation [J/m3].
    """
    stress, shear, work, elsewhere = main_return(trial, elastic, strength)
    opening = 0.0
    if elsewhere > 0.0:
        stress, shear, opening, work = other_return(trial, elastic, strength, edges)
    return stress, shear, opening, work


@ti.func
def other_return(trial, elastic, strength, edges):
    """Return to an edge, to the tension cap or to a corner of both, as `return_to_yield`."""
    centre, half, out = trial[0], trial[1], trial[2]
    radius = ti.sqrt(half * half + trial[3] * trial[3])
    hi = larger(centre + radius, out)
    lo = smaller(centre - radius, out)
    mid = 2.0 * centre + out - hi - lo
    excess = (hi - lo) + ((hi + lo) * strength[0] - strength[1])
    new = principal_return(hi, mid, lo, excess, elastic, strength, edges)
    lost = ti.Vector([hi, mid, lo]) - new
    pressure = (new[0] + new[1] + new[2]) * (1.0 / 3.0)
    # Shear keeps the mean stress: what rounding leaves of it must not pass for an opening.
    pressure_lost = 0.0
    if new[0] >= strength[2]:
        pressure_lost = (lost[0] + lost[1] + lost[2]) * (1.0 / 3.0)
    shear = (lost[0] - lost[2]) * elastic[2]
    opening = pressure_lost * elastic[3]
    work = (new.dot(lost) - 3.0 * pressure * pressure_lost) * elastic[2] + pressure * opening
    # Put the three back where they came from: two in the plane, one out of it.
    high, low, out_new = new[0], new[2], new[1]
    if out > centre + radius:
        high, out_new = new[1], new[0]
    elif out < centre - radius:
        low, out_new = new[1], new[2]
    middle = 0.5 * (high + low)
    scale = 0.5 * (high - low) / ti.max(radius, LEAST_STRESS)
    stress = vec4(middle + half * scale, middle - half * scale, out_new, trial[3] * scale)
    return stress, shear, opening, work


@ti.func
def principal_return(hi, mid, lo, excess, elastic, strength, edges):
    """Ordered principal stresses returned to yield: main plane, both edges, tension, corners."""
    sine = strength[0]
    cap = strength[2]
    new = ti.Vector([hi, mid, lo])
    if excess > 0.0:
        new = ti.Vector([hi - 0.5 * excess, mid, lo + 0.5 * excess])
        if new[0] < mid:  # edge hi = mid
            both = 0.5 * (hi + mid)
            shift = (both * (1.0 + sine) - lo * (1.0 - sine) - strength[1]) * edges[0]
            new = ti.Vector([both - shift, both - shift, lo + 2.0 * shift])
        elif new[2] > mid:  # edge mid = lo
            both = 0.5 * (lo + mid)
            shift = (hi * (1.0 + sine) - both * (1.0 - sine) - strength[1]) * edges[1]
            new = ti.Vector([hi - 2.0 * shift, both + shift, both + shift])
    if new[0] > cap:
        # Rankine alone: one, two or three principal stresses at the cap.
        lame = elastic[1] - (2.0 / 3.0) * elastic[0]
        flow = (hi - cap) / (lame + 2.0 * elastic[0])
        mid_new = mid - lame * flow
        lo_new = lo - lame * flow
        if mid_new > cap:
            flow = (hi + mid - 2.0 * cap) / (2.0 * (lame + elastic[0]))
            mid_new = cap
            lo_new = ti.min(lo - lame * flow, cap)
        if (cap - lo_new) + (cap + lo_new) * sine - strength[1] > 0.0:
            # Both surfaces: hi and lo are fixed by the corner, mid lies between them.
            lo_new = edges[2]
            flow = (hi + lo - cap - lo_new) / (2.0 * (lame + elastic[0]))
            mid_new = ti.min(ti.max(mid - lame * flow, lo_new), cap)
        new = ti.Vector([cap, mid_new, lo_new])
    return new
