"""Stress of a point after a step in three dimensions: exact rotation, elasticity, Mohr-Coulomb.

The return is that of the two-dimensional solver, on ordered principal stresses. It needs no
eigenvectors: the new stress is an isotropic function of the trial stress with the same principal
axes, and Newton's interpolation through its three principal values, with the two far ones first,
gives it from the trial stress and its square. Each divided difference of the return lies between 0
and 1, so equal principal stresses do no harm. Float64, since the difference of two nearly equal
principal stresses has only half of the digits.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import taichi as ti

from mpm_taichi.layout import BULK_MODULUS, SHEAR_MODULUS
from mpm_taichi.materials.elasticity import LEAST_STRESS
from mpm_taichi.materials.mohr_coulomb import (
    CAP,
    INTERCEPT,
    SIN_PHI,
    plastic_step,
    principal_return,
)
from mpm_taichi.solver3d.layout import XX, XY, XZ, YY, YZ, ZZ, vec6

NEAR_EQUAL = 1.0e-7
"""Difference of two principal stresses, as a share of sqrt(J2), below which they count as equal."""


@ti.func
def matrix_of(s):
    """The symmetric matrix of (XX, YY, ZZ, XY, YZ, XZ)."""
    return ti.Matrix([[s[XX], s[XY], s[XZ]], [s[XY], s[YY], s[YZ]], [s[XZ], s[YZ], s[ZZ]]])


@ti.func
def volume_rate(g, dt):
    """Rate at which volume grows in a step [1/s]: (det(I + dt L) - 1) / dt."""
    minors = (g[0] * g[4] - g[1] * g[3]) + (g[4] * g[8] - g[5] * g[7]) + (g[0] * g[8] - g[2] * g[6])
    determinant = (
        g[0] * (g[4] * g[8] - g[5] * g[7])
        - g[1] * (g[3] * g[8] - g[5] * g[6])
        + g[2] * (g[3] * g[7] - g[4] * g[6])
    )
    return (g[0] + g[4] + g[8]) + dt * (minors + dt * determinant)


@ti.func
def elastic_trial(s, g, volumetric, dt, elastic):
    """Trial stress [Pa], (6,): turned by the rotation of I + dt L, then linear elasticity.

    The rotation vector t solves (tr(S) I - S) t = 2 a to second order in the strain, with S the
    symmetric part of I + dt L and a the axial vector of the skew part: the polar decomposition,
    exact for a plane turn. Deviatoric strain is dt dev(D) - dt^2 dev(w w^T) / 2, the second term
    nil for a rigid turn together with the growth of volume that I + dt L has.

    Args:
        s: stress before [Pa].
        g: velocity gradient [1/s].
        volumetric: volumetric strain increment [-].
        dt: [s].
        elastic: row of `MaterialTable.elastic`.
    """
    wx, wy, wz = 0.5 * dt * (g[7] - g[5]), 0.5 * dt * (g[2] - g[6]), 0.5 * dt * (g[3] - g[1])
    exx, eyy, ezz = dt * g[0], dt * g[4], dt * g[8]
    exy, eyz, exz = 0.5 * dt * (g[1] + g[3]), 0.5 * dt * (g[5] + g[7]), 0.5 * dt * (g[2] + g[6])
    trace = (exx + eyy) + ezz
    tx = wx - 0.5 * (trace * wx - (exx * wx + exy * wy + exz * wz))
    ty = wy - 0.5 * (trace * wy - (exy * wx + eyy * wy + eyz * wz))
    tz = wz - 0.5 * (trace * wz - (exz * wx + eyz * wy + ezz * wz))
    # The length of t is the tangent of the angle; that of q the tangent of its half.
    half = 1.0 / (1.0 + ti.sqrt(1.0 + (tx * tx + ty * ty + tz * tz)))
    qx, qy, qz = half * tx, half * ty, half * tz
    q2 = qx * qx + qy * qy + qz * qz
    scale = 2.0 / (1.0 + q2)
    turn = ti.Matrix(
        [
            [1.0 - scale * (qy * qy + qz * qz), scale * (qx * qy - qz), scale * (qx * qz + qy)],
            [scale * (qx * qy + qz), 1.0 - scale * (qx * qx + qz * qz), scale * (qy * qz - qx)],
            [scale * (qx * qz - qy), scale * (qy * qz + qx), 1.0 - scale * (qx * qx + qy * qy)],
        ]
    )
    turned = turn @ matrix_of(s) @ turn.transpose()
    w2 = wx * wx + wy * wy + wz * wz
    shear = 2.0 * elastic[SHEAR_MODULUS]
    mean = elastic[BULK_MODULUS] * volumetric - shear * (1.0 / 3.0) * (trace - 0.5 * w2)
    return vec6(
        turned[0, 0] + (mean + shear * (exx - 0.5 * wx * wx)),
        turned[1, 1] + (mean + shear * (eyy - 0.5 * wy * wy)),
        turned[2, 2] + (mean + shear * (ezz - 0.5 * wz * wz)),
        turned[0, 1] + shear * (exy - 0.5 * wx * wy),
        turned[1, 2] + shear * (eyz - 0.5 * wy * wz),
        turned[0, 2] + shear * (exz - 0.5 * wx * wz),
    )


@ti.func
def principal_values(xx, yy, zz, xy, yz, xz, j2):
    """Ordered principal values (3,) float64 of a deviator with second invariant j2 > 0.

    The one far from the other two by one step of Halley's method from a polynomial that is within
    5e-6 of cos(acos(r) / 3), then exact to rounding; the other two from a quadratic, so that they
    may be equal.
    """
    j3 = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    size = ti.sqrt(j2 / 3.0)
    r = ti.min(0.5 * ti.abs(j3) / (size * size * size), 1.0)
    c = 0.86602981 + r * (0.16642951 + r * (-0.04600662 + r * (0.01764364 - 0.00409973 * r)))
    value, slope = (4.0 * c * c - 3.0) * c - r, 12.0 * c * c - 3.0
    c -= value * slope / (slope * slope - 12.0 * c * value)
    far = 2.0 * size * c
    gap = ti.sqrt(ti.max(4.0 * j2 - 3.0 * far * far, 0.0))
    result = ti.Vector([far, 0.5 * (gap - far), -0.5 * (gap + far)])
    if j3 < 0.0:
        result = ti.Vector([0.5 * (far + gap), 0.5 * (far - gap), -far])
    return result


@ti.func
def difference(new_a, new_b, a, b, least):
    """Divided difference of the return between two principal stresses a >= b."""
    result = ti.cast(1.0, ti.f64)
    if a - b > least:
        result = (new_a - new_b) / (a - b)
    return result


@ti.func
def mohr_coulomb(trial, elastic, strength):
    """Return of a trial stress (6,) [Pa] to yield.

    Returns:
        stress: (6,) [Pa]; shear: plastic shear strain increment [-]; opening: plastic volumetric
        strain increment of the tension cap [-]; work: plastic dissipation [J/m3].
    """
    stress = trial
    shear, opening, work = 0.0, 0.0, 0.0
    mean = (trial[XX] + trial[YY] + trial[ZZ]) * (1.0 / 3.0)
    x, y, z = trial[XX] - mean, trial[YY] - mean, trial[ZZ] - mean
    size = ti.sqrt(
        0.5 * (x * x + y * y + z * z)
        + (trial[XY] * trial[XY] + trial[YZ] * trial[YZ] + trial[XZ] * trial[XZ])
    )
    # Bounds of hi - lo, hi + lo and hi over all Lode angles: most points need no more.
    bound = 2.0002 * size + (2.0 * mean + 0.5775 * size) * strength[SIN_PHI] - strength[INTERCEPT]
    if (bound > 0.0) | (mean + 1.1549 * size > strength[CAP]):
        s = ti.cast(trial, ti.f64)
        m = (s[XX] + s[YY] + s[ZZ]) / 3.0
        dx, dy, dz = s[XX] - m, s[YY] - m, s[ZZ] - m
        j2 = 0.5 * (dx * dx + dy * dy + dz * dz) + (s[XY] * s[XY] + s[YZ] * s[YZ] + s[XZ] * s[XZ])
        values = ti.Vector([m, m, m])
        least = NEAR_EQUAL * ti.sqrt(j2)
        if j2 > LEAST_STRESS * LEAST_STRESS:
            values += principal_values(dx, dy, dz, s[XY], s[YZ], s[XZ], j2)
        hi, mid, lo = values[0], values[1], values[2]
        excess = (hi - lo) + ((hi + lo) * strength[SIN_PHI] - strength[INTERCEPT])
        if (excess > 0.0) | (hi > strength[CAP]):
            new = principal_return(hi, mid, lo, excess, elastic, strength)
            shear, opening, work = plastic_step(
                ti.cast(new, ti.f32), ti.cast(values - new, ti.f32), elastic, strength
            )
            first = difference(new[0], new[2], hi, lo, least)
            second = ti.cast(0.0, ti.f64)
            if hi - lo > least:
                if mid - lo > hi - mid:
                    second = (difference(new[0], new[1], hi, mid, least) - first) / (mid - lo)
                else:
                    second = (difference(new[1], new[2], mid, lo, least) - first) / (mid - hi)
            a, b, c = s[XX] - hi, s[YY] - hi, s[ZZ] - hi
            d, e, f = s[XX] - lo, s[YY] - lo, s[ZZ] - lo
            xy, yz, xz = s[XY], s[YZ], s[XZ]
            stress = vec6(
                new[0] + first * a + second * (a * d + xy * xy + xz * xz),
                new[0] + first * b + second * (b * e + xy * xy + yz * yz),
                new[0] + first * c + second * (c * f + xz * xz + yz * yz),
                first * xy + second * (a * xy + xy * e + xz * yz),
                first * yz + second * (xy * xz + b * yz + yz * f),
                first * xz + second * (a * xz + xy * yz + xz * f),
            )
    return stress, shear, opening, work
