"""Inertial friction: friction rises with the rate of shear, mu(I); fast thin fronts are braked.

A Mohr-Coulomb soil that shears in a plane at constant volume has both normal stresses equal to
their mean p and the shear stress p sin(phi) (Davis 1968): the sin(phi) of the material is the mu_s
of the law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, ti

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """sin(phi) = sin(phi_s) + a / (1 + I_0 / I), I = g' d / sqrt(p / rho_s)."""
    if soil.friction > 0.0:
        # A point that opens for a step has no pressure and would have all of the rise: less than
        # the weight of half a spacing of grains, g cell / 4, is not resolved and not believed.
        least = 0.25 * 9.81 * effect.grain_density_kg_m3 * here.cell
        pressure = ti.max(here.plane_pressure, least)
        speed = ti.sqrt(pressure / effect.grain_density_kg_m3)
        inertia = here.strain_rate * effect.grain_size_mm / speed
        sine = soil.friction / ti.sqrt(1.0 + soil.friction * soil.friction)
        sine += effect.amplitude * inertia / (inertia + effect.inertial_number)
        sine = ti.min(sine, 0.99)
        soil.friction = sine / ti.sqrt(1.0 - sine * sine)
    return soil


def applies(scene: Scene) -> str:
    """Needs frictional soil."""
    if any(scene.materials[zone.material].friction_deg > 0.0 for zone in scene.zones):
        return ""
    return "no soil has friction"


EFFECT = Effect(
    name="inertial_friction",
    words="the friction of the soil rises with its rate of shear",
    equation="sin(phi) = sin(phi_s) + a / (1 + I_0 / I), a = mu_2 - mu_s, "
    "I = g' d / sqrt(p / rho_s), p the mean stress in the plane, at least rho_s g cell / 4",
    source=(
        "mu(I): Jop, Forterre and Pouliquen (2006), Nature 441; of glass beads mu_s = tan 20.9, "
        "mu_2 = tan 32.8 degrees and I_0 = 0.279 (a = 0.26; recalled)"
    ),
    looks_like=(
        "a thin front that runs fast over its base stops nearer and is blunter, while the body of "
        "the deposit, slow and thick, stays as it was; nothing where grains are small against the "
        "flow: I of sand of 1 mm in a slide 10 m thick is below 0.001"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=0.6,
        ladder=(0.1, 0.2, 0.35),
        meaning="mu_2 - mu_s: how much more friction there is in fast than in slow shear",
    ),
    parameters=(
        Parameter(
            "grain_size_mm",
            "mm",
            1.0,
            1e-3,
            1e5,
            "d; of an experiment whose lengths are multiplied, multiplied as well",
            1e-3,
        ),
        Parameter(
            "inertial_number",
            "",
            0.279,
            0.01,
            10.0,
            "I_0, inertial number at which half of the rise is reached",
        ),
        Parameter("grain_density_kg_m3", "kg/m3", 2650.0, 100.0, 2e4, "rho_s, of the grains"),
    ),
    strength=strength,
    applies=applies,
)
