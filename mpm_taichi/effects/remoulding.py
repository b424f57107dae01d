"""Remoulding: soil that did not liquefy loses cohesion as it shears, and the slide works back."""

from __future__ import annotations

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, needs_cohesion, ti
from mpm_taichi.effects.strain_softening import BY_CELL


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """Cohesion c = c_0 (1 - a (1 - exp(-g / g_r))), with g_r for the current cell."""
    if here.liquefied < 0.5:
        scale = ti.pow(effect.reference_cell_m / here.cell, effect.cell_exponent)
        remoulded = 1.0 - ti.exp(-here.strain / (effect.reference_strain * scale))
        soil.cohesion *= 1.0 - effect.amplitude * remoulded
    return soil


EFFECT = Effect(
    name="remoulding",
    words="the soil that did not liquefy loses cohesion as it shears, and the slide works its way "
    "back",
    equation="c = c_0 (1 - a (1 - exp(-g / g_r))), g_r = g_ref (h_ref / h)^n",
    source=(
        "undrained strength of clay falls to the remoulded one, which is a half to a quarter of it "
        "in most clays: Skempton and Northey (1952, recalled); slides that retrogress where "
        "remoulded soil does not support the scarp: Bjerrum (1955, recalled); n as for "
        "strain_softening"
    ),
    looks_like=(
        "core and cohesive cover break off in slices along a steep scarp: the crest sinks far and "
        "the scarp moves back, while what did not move stands as high as before; the toe goes a "
        "little farther"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1.0,
        ladder=(0.2, 0.4, 0.7),
        meaning="share of the cohesion that is lost, 1 - remoulded / undisturbed",
    ),
    parameters=(
        Parameter(
            "reference_strain",
            "",
            0.3,
            0.001,
            100.0,
            "g_ref, plastic shear strain at which 1/e of what is lost in the end is left",
        ),
        *BY_CELL,
    ),
    strength=strength,
    applies=needs_cohesion,
)
