"""Strength contrast: a block, layer, stretch or lens of the liquefied soil has another strength."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, needs_liquefied_soil

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.base import Numbers

ENDLESS = 1e6
"""Half a width [m] beyond every section."""


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r exp(a w), w by the place of the soil before the slide."""
    if here.liquefied > 0.5:
        soil.cohesion *= here.field
    return soil


def inside(place: np.ndarray, centre: float, half: float, edge: float) -> np.ndarray:
    """Share of an interval at places: 1 within, 0 outside, a cubic between them.

    Args:
        place: (N,) [m].
        centre: of the interval [m].
        half: half its width [m]; the share is 1/2 there.
        edge: width over which the share falls from 1 to 0, over `half`.

    Returns:
        (N,). With an edge of at most 2 intervals that touch add up to 1 where they meet.
    """
    t = np.clip((1.0 - np.abs(place - centre) / half) / edge + 0.5, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def multiplier(
    scene: Scene, position: np.ndarray, amplitude: float, parameters: Numbers
) -> np.ndarray:
    """exp(a w) of the points, (N,)."""
    edge = parameters["edge"]
    across = inside(position[:, 0], parameters["x_m"], parameters["half_width_m"], edge)
    upwards = inside(position[:, 1], parameters["y_m"], parameters["half_height_m"], edge)
    return np.exp(amplitude * across * upwards)


EFFECT = Effect(
    name="strength_contrast",
    words="a part of the liquefied soil is stronger or weaker than the rest",
    equation="S = S_r exp(a w), w = s(|x_0 - x| / b) s(|y_0 - y| / h), s from 1 to 0 over an edge "
    "around 1, by a cubic",
    source=(
        "layers and lenses of silt and sand in hydraulic fill, whose undrained strengths differ by "
        "a factor of two and more: Seed, Lee and Idriss (1975, recalled); the shape is a smooth "
        "window, so that windows side by side add up to one"
    ),
    looks_like=(
        "a strong block stays or is carried along and leaves a step, with a gap before it; a weak "
        "layer lets what lies on it slide out as a whole; a weak stretch sinks and pushes out what "
        "is before it; elsewhere the surface is that of the rest's S_r"
    ),
    amplitude=Amplitude(
        unit="ln ratio",
        low=-3.0,
        high=3.0,
        ladder=(0.2, 0.4, 0.8),
        meaning="natural logarithm of the strength of the part over that of the rest",
        two_signed=True,
    ),
    parameters=(
        Parameter("x_m", "m", 0.0, -ENDLESS, ENDLESS, "x, the part's centre along the section"),
        Parameter("y_m", "m", 0.0, -ENDLESS, ENDLESS, "y, height of its centre"),
        Parameter(
            "half_width_m", "m", ENDLESS, 1e-3, ENDLESS, "b, half its length; endless: a layer"
        ),
        Parameter(
            "half_height_m", "m", ENDLESS, 1e-3, ENDLESS, "h, half its height; endless: a stretch"
        ),
        Parameter(
            "edge", "", 0.5, 0.01, 2.0, "width of its edge over b (h); 0.01: it ends abruptly"
        ),
    ),
    place=("half_width_m", "half_height_m"),
    family="strength",
    strength=strength,
    field=multiplier,
    applies=needs_liquefied_soil,
)
