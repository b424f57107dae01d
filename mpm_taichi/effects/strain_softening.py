"""Strain softening: liquefied soil begins at a peak strength and loses it as it shears.

How much strain goes with a slip depends on the cell where shear gathers in bands of a cell or two,
and does not where a whole layer shears. Flow slides lie between: on three sections at spacings of
1 to 3 m the change of the toe differed by up to 3.7 times with g_r in proportion to 1 / h, by 1.9
times with g_r fixed, and by 1.2 (1.7 where the effect is smallest) with g_r as 1 / sqrt(h).
"""

from __future__ import annotations

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, needs_liquefied_soil, ti


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a exp(-g / g_r)), with g_r for the current cell."""
    if here.liquefied > 0.5:
        scale = ti.pow(effect.reference_cell_m / here.cell, effect.cell_exponent)
        reference = effect.reference_strain * scale
        soil.cohesion *= 1.0 + effect.amplitude * ti.exp(-here.strain / reference)
    return soil


BY_CELL = (
    Parameter(
        "reference_cell_m", "m", 2.0, 1e-3, 100.0, "h_ref, the cell for which g_ref is meant"
    ),
    Parameter(
        "cell_exponent",
        "",
        0.5,
        0.0,
        1.0,
        "n: 0 where a whole layer shears, 1 where all shear is in bands of a cell",
    ),
)
"""How the strain that goes with a slip depends on the cell."""


EFFECT = Effect(
    name="strain_softening",
    words="the liquefied soil starts stronger and loses strength as it shears",
    equation="S = S_r + (S_p - S_r) exp(-g / g_r), S_p = (1 + a) S_r, g_r = g_ref (h_ref / h)^n",
    source=(
        "exponential decay to the residual, as usual in numerical work on softening soil; that the "
        "residual needs large displacements: Skempton (1985), Geotechnique 35(1); scaling with the "
        "cell, n = 1 for bands of a cell: Pietruszczak and Mroz (1981), IJNME 17; n = 1/2: measured"
    ),
    looks_like=(
        "shorter runout and a higher remnant; shear gathers in bands, so that the mass breaks into "
        "blocks; with a large peak part of the section does not start at all"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=20.0,
        ladder=(0.1, 0.3, 0.8),
        meaning="S_p / S_r - 1: how much stronger than S_r the soil is before it has sheared",
    ),
    parameters=(
        Parameter(
            "reference_strain",
            "",
            0.3,
            0.001,
            100.0,
            "g_ref, plastic shear strain at which the excess has fallen to 1/e",
        ),
        *BY_CELL,
    ),
    strength=strength,
    applies=needs_liquefied_soil,
)
