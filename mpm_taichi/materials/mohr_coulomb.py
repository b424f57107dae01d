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

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from typing import TYPE_CHECKING

import numpy as np
import taichi as ti

from mpm_taichi.layout import (
    BULK_COMPLIANCE,
    BULK_MODULUS,
    SHEAR_COMPLIANCE,
    SHEAR_MODULUS,
    vec4,
    vec8,
)
from mpm_taichi.materials.elasticity import (
    CENTRE,
    HALF,
    LEAST_STRESS,
    OUT,
    TRIAL_XY,
    larger,
    smaller,
)
from mpm_taichi.materials.law import CONSTANTS, MaterialLaw

if TYPE_CHECKING:
    from geometry.scenes.scene import Material

SIN_PHI, INTERCEPT, CAP, UPPER_EDGE, LOWER_EDGE, CORNER = range(6)
"""Constants: sin(phi) [-]; k = 2 c cos(phi) [Pa]; T [Pa]; 1/(3 - sin phi) and 1/(3 + sin phi) of
the edges hi = mid and mid = lo; lo at the corner of tension and shear [Pa]."""

NO_CAP = 1.0e30
"""Tension cap [Pa] that is never reached."""


@ti.pyfunc
def constants_of(tangent, sine, cosine, cohesion, cap):
    """The six constants of a soil, on the host in float64 and in kernels in float32.

    Args:
        tangent: tan(phi) [-].
        sine: sin(phi) [-].
        cosine: cos(phi) [-].
        cohesion: c [Pa].
        cap: T [Pa] if that is below the apex, c cot(phi).
    """
    k = 2.0 * cohesion * cosine
    apex = NO_CAP
    if tangent > 0.0:
        apex = cohesion / tangent
    cut = min(apex, cap)
    corner = cut
    if cut < apex:
        corner = (cut * (1.0 + sine) - k) / (1.0 - sine)
    return sine, k, cut, 1.0 / (3.0 - sine), 1.0 / (3.0 + sine), corner


def material_constants(
    *, friction_angle: float, cohesion: float, tension_cap: float | None = None
) -> np.ndarray:
    """Constants of one material as the kernels read them, (8,) float32.

    Args:
        friction_angle: phi [rad], 0 <= phi < pi/2.
        cohesion: c [Pa].
        tension_cap: T [Pa]; None is the apex c cot(phi), and no cap at all where phi = 0.
    """
    sine, cosine = np.sin(friction_angle), np.cos(friction_angle)
    cap = NO_CAP if tension_cap is None else tension_cap
    row = np.zeros(CONSTANTS, np.float32)
    row[: CORNER + 1] = constants_of(sine / cosine, sine, cosine, cohesion, cap)
    return row


def _constants(material: "Material") -> np.ndarray:
    return material_constants(
        friction_angle=material.friction_rad,
        cohesion=material.cohesion_pa,
        tension_cap=material.tension_cap_pa,
    )


def _settling_constants(material: "Material") -> np.ndarray:
    """Pre-failure strength if the case gives one, else a strength that is never reached."""
    before = material.pre_failure
    if before is None:
        return material_constants(friction_angle=0.0, cohesion=0.5 * NO_CAP)
    return material_constants(friction_angle=before.friction_rad, cohesion=before.cohesion_pa)


@ti.func
def strength_constants(soil):
    """`material_constants` of the strength that effects leave of a point."""
    tangent = ti.max(soil.friction, 0.0)
    cohesion = ti.max(soil.cohesion, 0.0)
    cosine = 1.0 / ti.sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    sin_phi, k, cap, upper, lower, corner = constants_of(tangent, sine, cosine, cohesion, soil.cap)
    return vec8(sin_phi, k, cap, upper, lower, corner, 0.0, 0.0)


@ti.func
def ground_strength(strength):
    """Friction coefficient and adhesion [Pa] of soil that shears at constant volume (psi = 0).

    It resists sigma sin(phi) + c cos(phi) along a plane (Davis 1968).
    """
    return strength[SIN_PHI], 0.5 * strength[INTERCEPT]


@ti.func
def main_return(trial, elastic, strength):
    """Return of a trial stress that stays elastic or returns to the main plane.

    These are by far the most frequent, and which of the two changes from step to step: so there is
    no branch. `trial` is what `elastic_trial` returns.

    Returns:
        stress: (xx, yy, zz, xy) [Pa].
        shear: plastic shear strain increment, hi minus lo principal [-].
        work: plastic dissipation [J/m3].
        elsewhere: above 0 where the stress returns elsewhere (`other_return`).
    """
    centre, half, out = trial[CENTRE], trial[HALF], trial[OUT]
    radius = ti.sqrt(half * half + trial[TRIAL_XY] * trial[TRIAL_XY])
    hi = larger(centre + radius, out)
    lo = smaller(centre - radius, out)
    excess = (hi - lo) + ((hi + lo) * strength[SIN_PHI] - strength[INTERCEPT])
    beyond = larger(excess, 0.0)
    reduced = radius - 0.5 * beyond
    scale = reduced / larger(radius, LEAST_STRESS)
    turned = half * scale
    shear = beyond * elastic[SHEAR_COMPLIANCE]
    off = larger(ti.abs(out - centre) - reduced, centre + reduced - strength[CAP])
    elsewhere = ti.select(excess > 0.0, off, hi - strength[CAP])
    stress = vec4(centre + turned, centre - turned, out, trial[TRIAL_XY] * scale)
    return stress, shear, reduced * shear, elsewhere


@ti.func
def other_return(trial, elastic, strength):
    """Return to an edge, to the tension cap or to a corner of both.

    Returns:
        stress: (xx, yy, zz, xy) [Pa].
        shear: plastic shear strain increment, hi minus lo principal [-].
        opening: plastic volumetric strain increment of the tension cap [-].
        work: plastic dissipation [J/m3].
    """
    centre, half, out = trial[CENTRE], trial[HALF], trial[OUT]
    radius = ti.sqrt(half * half + trial[TRIAL_XY] * trial[TRIAL_XY])
    hi = larger(centre + radius, out)
    lo = smaller(centre - radius, out)
    mid = 2.0 * centre + out - hi - lo
    excess = (hi - lo) + ((hi + lo) * strength[SIN_PHI] - strength[INTERCEPT])
    new = principal_return(hi, mid, lo, excess, elastic, strength)
    lost = ti.Vector([hi, mid, lo]) - new
    shear, opening, work = plastic_step(new, lost, elastic, strength)
    # Put the three back where they came from: two in the plane, one out of it.
    high, low, out_new = new[0], new[2], new[1]
    if out > centre + radius:
        high, out_new = new[1], new[0]
    elif out < centre - radius:
        low, out_new = new[1], new[2]
    middle = 0.5 * (high + low)
    scale = 0.5 * (high - low) / ti.max(radius, LEAST_STRESS)
    stress = vec4(middle + half * scale, middle - half * scale, out_new, trial[TRIAL_XY] * scale)
    return stress, shear, opening, work


@ti.func
def plastic_step(new, lost, elastic, strength):
    """What a return to yield leaves of ordered principal stresses `new` that have `lost` some [Pa].

    Returns:
        shear: plastic shear strain increment, hi minus lo principal [-].
        opening: plastic volumetric strain increment of the tension cap [-].
        work: plastic dissipation [J/m3].
    """
    pressure = (new[0] + new[1] + new[2]) * (1.0 / 3.0)
    # Shear keeps the mean stress: what rounding leaves of it must not pass for an opening.
    pressure_lost = 0.0
    if new[0] >= strength[CAP]:
        pressure_lost = (lost[0] + lost[1] + lost[2]) * (1.0 / 3.0)
    shear = (lost[0] - lost[2]) * elastic[SHEAR_COMPLIANCE]
    opening = pressure_lost * elastic[BULK_COMPLIANCE]
    sheared = (new.dot(lost) - 3.0 * pressure * pressure_lost) * elastic[SHEAR_COMPLIANCE]
    return shear, opening, sheared + pressure * opening


@ti.func
def principal_return(hi, mid, lo, excess, elastic, strength):
    """Ordered principal stresses returned to yield: main plane, both edges, tension, corners."""
    sine = strength[SIN_PHI]
    cap = strength[CAP]
    new = ti.Vector([hi, mid, lo])
    if excess > 0.0:
        new = ti.Vector([hi - 0.5 * excess, mid, lo + 0.5 * excess])
        if new[0] < mid:  # edge hi = mid
            both = 0.5 * (hi + mid)
            shift = (both * (1.0 + sine) - lo * (1.0 - sine) - strength[INTERCEPT]) * strength[
                UPPER_EDGE
            ]
            new = ti.Vector([both - shift, both - shift, lo + 2.0 * shift])
        elif new[2] > mid:  # edge mid = lo
            both = 0.5 * (lo + mid)
            shift = (hi * (1.0 + sine) - both * (1.0 - sine) - strength[INTERCEPT]) * strength[
                LOWER_EDGE
            ]
            new = ti.Vector([hi - 2.0 * shift, both + shift, both + shift])
    if new[0] > cap:
        # Rankine alone: one, two or three principal stresses at the cap.
        lame = elastic[BULK_MODULUS] - (2.0 / 3.0) * elastic[SHEAR_MODULUS]
        flow = (hi - cap) / (lame + 2.0 * elastic[SHEAR_MODULUS])
        mid_new = mid - lame * flow
        lo_new = lo - lame * flow
        if mid_new > cap:
            flow = (hi + mid - 2.0 * cap) / (2.0 * (lame + elastic[SHEAR_MODULUS]))
            mid_new = cap
            lo_new = ti.min(lo - lame * flow, cap)
        if (cap - lo_new) + (cap + lo_new) * sine - strength[INTERCEPT] > 0.0:
            # Both surfaces: hi and lo are fixed by the corner, mid lies between them.
            lo_new = strength[CORNER]
            flow = (hi + lo - cap - lo_new) / (2.0 * (lame + elastic[SHEAR_MODULUS]))
            mid_new = ti.min(ti.max(mid - lame * flow, lo_new), cap)
        new = ti.Vector([cap, mid_new, lo_new])
    return new


MOHR_COULOMB = MaterialLaw(
    name="mohr_coulomb",
    constants=_constants,
    settling_constants=_settling_constants,
    usual_return=main_return,
    usual_constants=CAP + 1,
    rare_return=other_return,
    ground_strength=ground_strength,
    strength_constants=strength_constants,
)
