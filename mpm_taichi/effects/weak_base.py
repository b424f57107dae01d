"""Weak base: the contact between soil and ground is weaker than the soil above it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def ground(effect, base, node):  # noqa: ANN001, ANN201
    """Friction and adhesion of the ground at (1 - a) of what they were, within the window."""
    if node.x >= effect.x_from_m and node.x <= effect.x_to_m:
        base.friction *= 1.0 - effect.amplitude
        base.adhesion *= 1.0 - effect.amplitude
    return base


def applies(scene: Scene) -> str:
    """Bonded ground has no strength of its own that could be lowered."""
    if scene.ground.contact == "no_slip":
        return "ground.contact is no_slip: soil is bonded to it"
    if scene.ground.contact == "coulomb" and not scene.ground.friction_coefficient:
        return "ground.friction_coefficient is 0 already"
    return ""


EFFECT = Effect(
    name="weak_base",
    words="the soil slips on its base more easily than it shears within",
    equation="tau_base = (1 - a) (c cos(phi) + sigma sin(phi)); (1 - a) mu sigma on Coulomb ground",
    source=(
        "reduced strength of an interface (Potyondy 1961, Geotechnique 11(4)): alpha S_r with "
        "alpha = 1 - a under soil without friction, a lower Coulomb angle under soil with it; "
        "traction of rough ground after Davis (1968)"
    ),
    looks_like=(
        "the mass slides out as a whole: longer runout, a flat deposit, and markers near the base "
        "that move as far as those above them"
    ),
    family="ground",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1.0,
        ladder=(0.03, 0.08, 0.2),
        meaning="share of its strength that the base lacks; at 1 it is smooth",
    ),
    parameters=(
        Parameter("x_from_m", "m", -1e6, -1e6, 1e6, "the base is weak from here to the right"),
        Parameter("x_to_m", "m", 1e6, -1e6, 1e6, "... to here"),
    ),
    ground=ground,
    applies=applies,
)
