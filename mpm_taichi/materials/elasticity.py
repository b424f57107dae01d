"""Isotropic linear elasticity with exact rotation: the trial stress of the material laws."""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

import numpy as np
import taichi as ti

from mpm_taichi.layout import (
    BULK_MODULUS,
    DVX_DX,
    DVX_DY,
    DVY_DX,
    DVY_DY,
    SHEAR_MODULUS,
    XX,
    XY,
    YY,
    ZZ,
    vec4,
)

CENTRE, HALF, OUT, TRIAL_XY = range(4)
"""Columns of a trial stress [Pa]: centre of Mohr's circle in the plane, half of xx - yy, the stress
zz out of the plane, xy."""

LEAST_STRESS = 1.0e-6
"""Radius of Mohr's circle [Pa] below which it counts as a point."""


def elastic_constants(*, youngs_modulus: float, poisson_ratio: float) -> np.ndarray:
    """A row of `layout.MaterialTable.elastic`, (4,) float32, of E [Pa] and nu [-]."""
    shear = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    bulk = youngs_modulus / (3.0 * (1.0 - 2.0 * poisson_ratio))
    return np.array([shear, bulk, 0.5 / shear, 1.0 / bulk], np.float32)


@ti.func
def larger(a, b):
    """The larger of two numbers, in one instruction where `ti.max` takes three to handle NaN."""
    return ti.select(a > b, a, b)


@ti.func
def smaller(a, b):
    """The smaller of two numbers; see `larger`."""
    return ti.select(a < b, a, b)


@ti.func
def elastic_trial(stress, gradient, volumetric, dt, elastic):
    """Trial stress after one step: exact rotation by the spin, then linear elasticity.

    `stress` and `gradient` are rows of `layout.PointState`; `volumetric` is the volumetric strain
    increment [-], which F-bar averages over a cell and which may thus differ from dt tr(gradient).
    F = I + dt L turns by the angle theta of its polar decomposition, tan(theta) =
    (F_yx - F_xy) / (F_xx + F_yy), which leaves the invariants as they are. Strain is dt sym(L) and
    half of dt^2 det(L) on both axes: nil for a rigid turn, and with the area that F has.

    Returns:
        (CENTRE, HALF, OUT, TRIAL_XY) [Pa].
    """
    stretch = dt * (gradient[DVX_DX] + gradient[DVY_DY])
    growth = dt * dt * (gradient[DVX_DX] * gradient[DVY_DY] - gradient[DVY_DX] * gradient[DVX_DY])
    along = 1.0 + 0.5 * stretch
    across = 0.5 * dt * (gradient[DVY_DX] - gradient[DVX_DY])
    along2 = along * along
    across2 = across * across
    scale = 1.0 / (along2 + across2)
    cos2 = (along2 - across2) * scale
    sin2 = (2.0 * along * across) * scale
    swell = elastic[BULK_MODULUS] * volumetric
    third = elastic[SHEAR_MODULUS] * (1.0 / 3.0) * (stretch + growth)
    half = 0.5 * (stress[XX] - stress[YY])
    return vec4(
        0.5 * (stress[XX] + stress[YY]) + (swell + third),
        (half * cos2 - stress[XY] * sin2)
        + elastic[SHEAR_MODULUS] * dt * (gradient[DVX_DX] - gradient[DVY_DY]),
        stress[ZZ] + (swell - 2.0 * third),
        (stress[XY] * cos2 + half * sin2)
        + elastic[SHEAR_MODULUS] * dt * (gradient[DVY_DX] + gradient[DVX_DY]),
    )
