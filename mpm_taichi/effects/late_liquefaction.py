"""Late liquefaction: soil holds a peak strength as it begins to move, and loses it in time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from mpm_taichi.effects.framework.base import (
    DEGREE,
    Amplitude,
    Effect,
    Parameter,
    needs_liquefied_soil,
    ti,
)

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.base import Numbers


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r + q (S_p - S_r), tan(phi) = q tan(phi_p), q from 1 to 0 between h T and T."""
    if here.liquefied > 0.5 and here.field > 0.5:
        left = (effect.amplitude - here.time) / ((1.0 - effect.hold) * effect.amplitude)
        left = ti.min(ti.max(left, 0.0), 1.0)
        soil.cohesion *= 1.0 + (effect.peak_ratio - 1.0) * left
        soil.friction += ti.tan(effect.peak_friction_deg) * left
    return soil


def of_zone(
    scene: Scene, position: np.ndarray, amplitude: float, parameters: Numbers
) -> np.ndarray:
    """1 where a point lies in the zone that liquefied late before the slide, else 0, (N,)."""
    number = round(parameters["zone"])
    if number == 0:
        return np.ones(len(position))
    if number > len(scene.zones):
        return np.zeros(len(position))
    outline = shapely.Polygon(scene.zones[number - 1].polygon)
    # Points at rest lie half a spacing from a border; those of a jittered scene may cross it.
    return shapely.intersects_xy(outline, position).astype(float)


def until(scene: Scene, amplitude: float, parameters: Numbers) -> float:
    """The time at which all has liquefied [s]."""
    return amplitude


PEAK = (
    Parameter(
        "peak_ratio",
        "",
        3.0,
        0.0,
        100.0,
        "k, undrained strength before it liquefied over S_r; 0 where it was drained",
    ),
    Parameter(
        "peak_friction_deg",
        "deg",
        0.0,
        0.0,
        60.0,
        "phi_p, friction angle before it liquefied, of soil that was drained",
        DEGREE,
    ),
)
"""What liquefied soil had before: undrained or drained."""


EFFECT = Effect(
    name="late_liquefaction",
    words="the soil liquefied little by little, and not before it began to move",
    equation="S = S_r + q (S_p - S_r) + q sigma tan(phi_p), S_p = k S_r; q = 1 until h T, "
    "then linear to 0 at T",
    source=(
        "excess pore pressure goes on rising after the shaking: Lower San Fernando slid about 35 s "
        "after its end (Seed 1979, Geotechnique 29(3), recalled); undrained peak over liquefied "
        "strength, k, of 2-5: yield strength ratios of 0.2-0.3 (Olson and Stark 2003, recalled) "
        "over S_r / sigma'_v0 of 0.05-0.12"
    ),
    looks_like=(
        "the slide starts slowly and lasts about T; it falls with less swing, so that the toe "
        "stops nearer at the same S_r; at rest the surface is near that which S_r just holds"
    ),
    amplitude=Amplitude(
        unit="s",
        low=0.0,
        high=600.0,
        ladder=(5.0, 15.0, 40.0),
        meaning="T, time after which the strength has fallen to S_r",
    ),
    parameters=(
        *PEAK,
        Parameter(
            "hold",
            "",
            0.0,
            0.0,
            0.99,
            "h, share of T in which the peak holds; 0: it falls from the start",
        ),
        Parameter(
            "zone",
            "",
            0.0,
            0.0,
            1e3,
            "number of the zone that was late, 1 for the first of the scene; 0: all of them",
        ),
    ),
    strength=strength,
    field=of_zone,
    until=until,
    applies=needs_liquefied_soil,
)
