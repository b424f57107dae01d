"""Spatial variability: S_r of the liquefied soil varies along the section about its mean."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from geometry.scenes.fill import contains
from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, needs_liquefied_soil
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene

WAVES = 512
"""Waves of which the random field is made."""


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r m(x), x the place of the soil before the slide."""
    if here.liquefied > 0.5:
        soil.cohesion *= here.field
    return soil


def gaussian_field(x: np.ndarray, *, correlation_length: float, seed: int) -> np.ndarray:
    """A Gaussian field of mean 0 and variance 1 over a line, correlated as exp(-|dx| / l).

    Args:
        x: places [m], (N,). The value at a place does not depend on the other places.
        correlation_length: l [m].
        seed: of the realisation.

    Returns:
        (N,). Waves of equal power whose numbers divide the spectrum 1 / (1 + (k l)^2) evenly, with
        normal coefficients.
    """
    shares = (np.arange(WAVES) + 0.5) / WAVES
    number = np.tan(0.5 * np.pi * shares) / correlation_length
    one, other = np.random.default_rng(seed).standard_normal((2, WAVES)) / np.sqrt(WAVES)
    phase = np.multiply.outer(np.asarray(x, dtype=float), number)
    return np.cos(phase) @ one + np.sin(phase) @ other


def multiplier(
    scene: Scene, position: np.ndarray, amplitude: float, parameters: Mapping[str, float]
) -> np.ndarray:
    """Multiplier m = exp(s z(x)) over its mean in the liquefied soil, s^2 = ln(1 + a^2), (N,)."""
    seed = parameters["seed"]
    if seed != round(seed):
        raise InputError(
            f"{scene.name}: effects: spatial_variability: seed {seed:g}: allowed are whole numbers"
        )
    places, place = np.unique(position[:, 0], return_inverse=True)
    field = gaussian_field(
        places,
        correlation_length=parameters["correlation_length_m"],
        seed=round(seed),
    )
    value = np.exp(np.sqrt(np.log1p(amplitude**2)) * field)[place]
    inside = np.zeros(len(position), bool)
    for zone in scene.zones:
        if scene.materials[zone.material].liquefied:
            inside |= contains(np.asarray(zone.polygon, dtype=float), position)
    return value / value[inside].mean() if inside.any() else value


EFFECT = Effect(
    name="spatial_variability",
    words="the strength of the liquefied soil varies along the section",
    equation="S = S_r m(x), m lognormal with mean 1, coefficient of variation a, and correlation "
    "exp(-|dx| / l) of ln m",
    source=(
        "Phoon and Kulhawy (1999), Can. Geotech. J. 36(4): undrained strength varies by 10-55 % "
        "about its trend, with horizontal scales of fluctuation (2 l) of 20-80 m; exponential "
        "correlation: Liu et al. (2020), AIMS Geosciences 6(1)"
    ),
    looks_like=(
        "an uneven surface, thick where the soil is strong and thin where it is weak, at distances "
        "of the correlation length; the toe moves either way; another seed, another pattern"
    ),
    family="strength",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1.5,
        ladder=(0.1, 0.2, 0.4),
        meaning="coefficient of variation of S_r along the section",
    ),
    parameters=(
        Parameter(
            "correlation_length_m",
            "m",
            20.0,
            0.01,
            1e4,
            "l, distance in which the correlation of ln m falls to 1/e",
        ),
        Parameter("seed", "", 1.0, 0.0, 1e6, "which realisation; a whole number"),
    ),
    realisation="seed",
    strength=strength,
    field=multiplier,
    applies=needs_liquefied_soil,
)
