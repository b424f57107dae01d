"""Strength in proportion to the stress before failure: deep liquefied soil is stronger."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, liquefied_zones, ti

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r ((1 - a) + a sigma'_v0 / mean)."""
    if here.liquefied > 0.5 and here.mean_overburden > 0.0:
        ratio = here.overburden / here.mean_overburden
        soil.cohesion *= ti.max((1.0 - effect.amplitude) + effect.amplitude * ratio, 0.0)
    return soil


def applies(scene: Scene) -> str:
    """Needs liquefied soil of one strength: a strength ratio is this effect at amplitude 1."""
    liquefied = liquefied_zones(scene)
    if any(soil.strength_ratio is not None for soil in scene.materials.values()):
        return "the strength of liquefied soil already follows its strength_ratio; keep one of both"
    return "" if liquefied else "no material is marked liquefied: true"


EFFECT = Effect(
    name="overburden_strength",
    words="the liquefied soil is stronger where it lay deeper",
    equation="S = S_r ((1 - a) + a sigma'_v0 / mean(sigma'_v0)), the mean over the liquefied soil",
    source=(
        "strength ratios S_r / sigma'_v0: Stark and Mesri (1992), J. Geotech. Eng. 118(11); Olson "
        "and Stark (2002), Can. Geotech. J. 39(3). sigma'_v0 is that of the settled section"
    ),
    looks_like=(
        "thin soil near the old toe is weaker and runs far and thin, the soil under the crest "
        "holds back: thickness near the old toe says it, the toe alone does not"
    ),
    family="strength",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1.0,
        ladder=(0.25, 0.5, 1.0),
        meaning="share of the strength that goes with the stress; at 1 all of it, a strength ratio",
    ),
    strength=strength,
    applies=applies,
)
