"""Strain softening: liquefied soil begins at a peak strength and loses it as it shears."""

from __future__ import annotations

from mpm_taichi.effects.base import Amplitude, Effect, Parameter, needs_liquefied_soil, ti


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a exp(-g / g_r)), with g_r for the cell at hand."""
    if here.liquefied > 0.5:
        reference = effect.reference_strain * effect.reference_cell_m / here.cell
        soil.cohesion *= 1.0 + effect.amplitude * ti.exp(-here.strain / reference)
    return soil


EFFECT = Effect(
    name="strain_softening",
    words="the liquefied soil starts stronger and loses strength as it shears",
    equation="S = S_r + (S_p - S_r) exp(-g / g_r), S_p = (1 + a) S_r, g_r = g_ref h_ref / h",
    source=(
        "exponential decay to the residual: Skempton (1985), Geotechnique 35(1), and undrained "
        "softening of sands in Castro (1987); scaling of the softening modulus with the cell h so "
        "that the energy of a shear band stays: Pietruszczak and Mroz (1981), IJNME 17"
    ),
    looks_like=(
        "shorter runout and a higher remnant; shear gathers in bands, so that the mass breaks into "
        "blocks; with a large peak part of the section does not start at all"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=20.0,
        ladder=(0.2, 0.6, 1.5),
        meaning="S_p / S_r - 1: how much stronger than S_r the soil is before it has sheared",
    ),
    parameters=(
        Parameter("reference_strain", "", 0.3, 0.001, 100.0,
                  "g_ref, plastic shear strain at which the excess has fallen to 1/e"),
        Parameter("reference_cell_m", "m", 2.0, 1e-3, 100.0,
                  "h_ref, the cell for which g_ref is meant"),
    ),
    strength=strength,
    applies=needs_liquefied_soil,
)  # fmt: skip
