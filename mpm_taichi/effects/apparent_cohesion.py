"""Apparent cohesion: soil that did not liquefy holds together by suction, or as it cannot drain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi.effects.framework.base import KPA, Amplitude, Effect, Parameter

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.base import Numbers


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """Cohesion c = c_0 + a, of soil that lay below the phreatic line c_0 + k a."""
    if here.liquefied < 0.5:
        soil.cohesion += effect.amplitude * here.field
    return soil


def share(scene: Scene, position: np.ndarray, amplitude: float, parameters: Numbers) -> np.ndarray:
    """Share of the amplitude that the points have, (N,): 1, and k below the phreatic line."""
    below = position[:, 1] < scene.phreatic_level(position[:, 0])
    return np.where(below, parameters["share_below_water"], 1.0)


def applies(scene: Scene) -> str:
    """Needs soil that has not liquefied."""
    if all(scene.materials[zone.material].liquefied for zone in scene.zones):
        return "all soil has liquefied"
    return ""


EFFECT = Effect(
    name="apparent_cohesion",
    words="the soil that did not liquefy has cohesion that nobody counted",
    equation="c = c_0 + a; c_0 + k a in what lay below the phreatic line before the slide",
    source=(
        "suction in moist sand of 1-10 kPa, lost when it is soaked; undrained strength of fine "
        "fill that shears too fast to drain; both usual in back-analyses (recalled)"
    ),
    looks_like=(
        "cover and shells come down in blocks and bridge what flows below; a steeper scarp, a "
        "higher remnant and crest, a toe that stops nearer"
    ),
    amplitude=Amplitude(
        unit="kPa",
        low=0.0,
        high=500.0,
        ladder=(3.0, 10.0, 30.0),
        meaning="cohesion in addition to that of the scene",
        si=KPA,
    ),
    parameters=(
        Parameter(
            "share_below_water",
            "",
            1.0,
            0.0,
            1.0,
            "k, share of it below the phreatic line; 0: suction, which is gone there",
        ),
    ),
    strength=strength,
    field=share,
    applies=applies,
)
