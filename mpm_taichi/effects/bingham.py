"""Bingham viscosity: liquefied soil resists in proportion to its rate of shear, above S_r."""

from __future__ import annotations

from mpm_taichi.effects.framework.base import KPA, Amplitude, Effect, needs_liquefied_soil


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r + eta g'."""
    if here.liquefied > 0.5:
        soil.cohesion += effect.amplitude * here.strain_rate
    return soil


EFFECT = Effect(
    name="bingham",
    words="the liquefied soil is viscous: it resists in proportion to its rate of shear",
    equation="S = S_r + eta g', g' the rate of shear in the plane (largest less least principal)",
    source=(
        "Bingham (1922); for flow slides Jeyapalan, Duncan and Seed (1983), J. Geotech. Eng. "
        "109(2), whose tailings are of 0.05-1 kPa s; liquefied sand in models and back-analyses "
        "of lateral spreads is mostly put at 0.1-100 kPa s"
    ),
    looks_like=(
        "slower and longer lasting; the runout is a little shorter and the front blunter, and more "
        "so the thinner and faster the layer; the deposit at rest is held by S_r alone, so its "
        "final surface says little and velocities or the duration say most"
    ),
    amplitude=Amplitude(
        unit="kPa s",
        low=0.0,
        high=100.0,
        ladder=(2.0, 7.0, 25.0),
        meaning="viscosity eta",
        si=KPA,
    ),
    strength=strength,
    applies=needs_liquefied_soil,
)
