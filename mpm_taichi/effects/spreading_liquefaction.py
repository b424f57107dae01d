"""Spreading liquefaction: a front passes through the soil, which loses its peak strength behind."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi.effects.framework.base import (
    Amplitude,
    Effect,
    Parameter,
    needs_liquefied_soil,
    ti,
)
from mpm_taichi.effects.late_liquefaction import PEAK

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.base import Numbers

AT_TOE = 1e6
"""`from_x_m` [m] that stands for the toe."""


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r + q (S_p - S_r), tan(phi) = q tan(phi_p); q from 1 to 0 over a length behind it."""
    if here.liquefied > 0.5:
        passed = (here.time / effect.amplitude - here.field) / effect.front_length_m
        left = 1.0 - ti.min(ti.max(passed, 0.0), 1.0)
        soil.cohesion *= 1.0 + (effect.peak_ratio - 1.0) * left
        soil.friction += ti.tan(effect.peak_friction_deg) * left
    return soil


def reach(scene: Scene) -> tuple[float, float]:
    """Left and right end of the liquefied soil before the slide [m]."""
    x = [
        vertex[0]
        for zone in scene.zones
        if scene.materials[zone.material].liquefied
        for vertex in zone.polygon
    ]
    return min(x), max(x)


def sources(scene: Scene, from_x: float) -> list[float]:
    """Where the front starts [m]: the given place, or the end of the liquefied soil next to a foot.

    Both ends where they are equally near to theirs, as in a symmetric embankment.
    """
    if from_x != AT_TOE:
        return [from_x]
    left, right = reach(scene)
    gaps = left - scene.end("left"), scene.end("right") - right
    near = min(gaps) + 1e-6 * (right - left)
    return [end for end, gap in zip((left, right), gaps, strict=True) if gap <= near]


def distance(
    scene: Scene, position: np.ndarray, amplitude: float, parameters: Numbers
) -> np.ndarray:
    """Way of the front to the points [m], (N,), along the section as it was before the slide."""
    starts = np.array(sources(scene, parameters["from_x_m"]))
    return np.abs(position[:, :1] - starts).min(axis=1)


def until(scene: Scene, amplitude: float, parameters: Numbers) -> float:
    """The time at which the front has left the liquefied soil [s]."""
    ends = np.array([[x, 0.0] for x in (*reach(scene), sum(reach(scene)) / 2.0)])
    farthest = distance(scene, ends, amplitude, parameters).max()
    return float(amplitude * (farthest + parameters["front_length_m"]))


EFFECT = Effect(
    name="spreading_liquefaction",
    words="liquefaction spread through the soil behind a front and not everywhere at once",
    equation="S = S_r + q (S_p - S_r) + q sigma tan(phi_p), S_p = k S_r; q from 1 at the front, "
    "|x_0 - x_f| = t / a, to 0 a length l behind it",
    source=(
        "retrogressive flow slides, in which a part liquefies when the part before it has gone, "
        "and fronts of pore pressure that pass from loose soil into its surroundings: Seed (1979, "
        "recalled), Castro, Seed, Keller and Seed (1992, recalled) on Lower San Fernando; k as "
        "for late_liquefaction"
    ),
    looks_like=(
        "the toe leaves first and the crest follows later: a longer slide, in slices, with a lower "
        "scarp at its back; the farther back a part, the later it moves"
    ),
    amplitude=Amplitude(
        unit="s/m",
        low=0.0,
        high=20.0,
        ladder=(0.05, 0.15, 0.5),
        meaning="time in which the front advances by a metre, 1 / v",
    ),
    parameters=(
        Parameter(
            "from_x_m",
            "m",
            AT_TOE,
            -AT_TOE,
            AT_TOE,
            "x_f, where the front starts; 1e6: at the toe, the end of the liquefied soil "
            "next to a foot of the section",
        ),
        Parameter(
            "front_length_m",
            "m",
            2.0,
            0.01,
            1e4,
            "l, length behind the front in which the strength falls",
        ),
        *PEAK,
    ),
    strength=strength,
    field=distance,
    until=until,
    applies=needs_liquefied_soil,
)
