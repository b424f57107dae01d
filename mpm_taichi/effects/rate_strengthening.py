"""Rate strengthening: liquefied soil resists more, the faster it shears (logarithmic law)."""

from __future__ import annotations

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, needs_liquefied_soil, ti


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a log10(max(rate / rate_0, 1)))."""
    if here.liquefied > 0.5:
        decades = ti.log(ti.max(here.strain_rate / effect.reference_rate_per_s, 1.0)) * 0.43429448
        soil.cohesion *= 1.0 + effect.amplitude * decades
    return soil


EFFECT = Effect(
    name="rate_strengthening",
    words="the liquefied soil resists more the faster it shears",
    equation="S = S_r (1 + a log10(max(g' / g'_0, 1)))",
    source=(
        "logarithmic rate law, 5-20 % per decade in undrained shear of clays and liquefied sands: "
        "Kulhawy and Mayne (1990), EPRI EL-6800; Biscontin and Pestana (2001)"
    ),
    looks_like=(
        "the mass moves more slowly and stops a little earlier; front and slip surface, where it "
        "shears fastest, are held back most; the duration says more than the final profile"
    ),
    amplitude=Amplitude(
        unit="per decade",
        low=0.0,
        high=2.0,
        ladder=(0.05, 0.1, 0.2),
        meaning="share by which the strength grows for every tenfold rate of shear",
    ),
    parameters=(
        Parameter(
            "reference_rate_per_s",
            "1/s",
            0.01,
            1e-6,
            1e3,
            "g'_0, rate of shear below which nothing is added",
        ),
    ),
    strength=strength,
    applies=needs_liquefied_soil,
)
