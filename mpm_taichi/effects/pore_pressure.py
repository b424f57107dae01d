"""Excess pore pressure in saturated frictional soil, fading with time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, ti
from mpm_taichi.effects.framework.free_water import soaked_area

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """tan(phi_m) = (1 - r_u exp(-t / T)) tan(phi) where the soil was saturated."""
    if here.field > 0.5:
        ratio = effect.amplitude * ti.exp(-here.time / effect.dissipation_time_s)
        soil.friction *= 1.0 - ratio
    return soil


def saturated(
    scene: Scene, position: np.ndarray, amplitude: float, parameters: Mapping[str, float]
) -> np.ndarray:
    """1 for points below the phreatic line before the slide, else 0, (N,)."""
    return (position[:, 1] < scene.phreatic_level(position[:, 0])).astype(float)


def applies(scene: Scene) -> str:
    """Needs frictional soil below the phreatic line."""
    if not scene.has_water:
        return "there is no water"
    for zone in scene.zones:
        if scene.materials[zone.material].friction_deg > 0.0:
            if soaked_area(scene, zone) > 0.5 * scene.spacing**2:
                return ""
    return "no soil with friction lies below the phreatic line"


EFFECT = Effect(
    name="pore_pressure",
    words="excess pore pressure weakens the saturated frictional soil and fades with time",
    equation="t = c + (1 - r_u exp(-t / T)) s'_n tan(phi) in what was saturated at the start",
    source=(
        "effective stress: Terzaghi (1943); r_u as a share of the normal stress on the slip "
        "surface: Bishop and Morgenstern (1960), Geotechnique 10(4); fading during a flow slide: "
        "Hutchinson (1986), Can. Geotech. J. 23(2). T of the order of H^2 / (4 c_v): seconds in "
        "gravel, many minutes in silty sand"
    ),
    looks_like=(
        "shells that stand in water spread and sink: a lower remnant and crest and a fuller toe, "
        "while S_r and the dry shell are as before; a small friction angle of the shell looks the "
        "same, unless the motion outlasts T"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=0.95,
        ladder=(0.1, 0.2, 0.4),
        meaning="r_u at t = 0: excess pore pressure over the normal stress it takes away from",
    ),
    parameters=(
        Parameter(
            "dissipation_time_s", "s", 60.0, 0.1, 1e5, "T, time in which the excess falls to 1/e"
        ),
    ),
    strength=strength,
    field=saturated,
    applies=applies,
)
