"""Dilatancy: frictional soil changes its volume as it shears, until a critical strain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, ti

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def dilation(effect, here):  # noqa: ANN001, ANN201
    """sin(psi) = a (1 - g / g_c), nil beyond g_c, and never above sin(phi)."""
    left = ti.max(1.0 - here.strain / effect.critical_strain, 0.0)
    sine = 0.0
    if here.liquefied < 0.5 and here.friction > 0.0:
        most = here.friction / ti.sqrt(1.0 + here.friction * here.friction)
        sine = ti.min(effect.amplitude * left, most)
    return sine


def applies(scene: Scene) -> str:
    """Needs frictional soil that has not liquefied: that one shears at constant volume."""
    for zone in scene.zones:
        material = scene.materials[zone.material]
        if material.friction_deg > 0.0 and not material.liquefied:
            return ""
    return "no soil with friction, other than liquefied soil, is there to dilate"


EFFECT = Effect(
    name="dilatancy",
    words="the frictional soil changes its volume as it shears",
    equation="de_v = sin(psi) dg, sin(psi) = min(a (1 - g / g_c), sin(phi)) for g < g_c, else 0; "
    "in all a g_c / 2",
    source=(
        "Rowe (1962), Proc. R. Soc. A 269, and Bolton (1986), Geotechnique 36(1): dense sand has "
        "psi 5-20 degrees at its peak in plane strain, nil at the critical state, reached at "
        "shear strains of 0.2-1; loose sand contracts. With psi > phi dilation would make energy"
    ),
    looks_like=(
        "a dense shell swells by a per cent or two: remnant a little higher, toe a little farther; "
        "a loose one (a < 0) shrinks, and remnant and toe draw back; the deposit's area shows it"
    ),
    amplitude=Amplitude(
        unit="",
        low=-0.5,
        high=0.6,
        ladder=(0.05, 0.1, 0.2),
        meaning="sine of the angle of dilation before any shear; negative where soil contracts",
        two_signed=True,
    ),
    parameters=(
        Parameter(
            "critical_strain",
            "",
            0.5,
            0.01,
            10.0,
            "g_c, plastic shear strain beyond which the volume stays",
        ),
    ),
    dilation=dilation,
    applies=applies,
)
