"""Reconsolidation: liquefied soil drains while it flows, and regains strength."""

from __future__ import annotations

from mpm_taichi.effects.framework.base import (
    Amplitude,
    Effect,
    Parameter,
    needs_liquefied_soil,
    ti,
)


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a sqrt(t / t_1))."""
    if here.liquefied > 0.5:
        drained = ti.sqrt(ti.max(here.time, 0.0) / effect.reference_s)
        soil.cohesion *= 1.0 + effect.amplitude * drained
    return soil


EFFECT = Effect(
    name="reconsolidation",
    words="the liquefied soil drains while it flows, and regains strength",
    equation="S = S_r (1 + a sqrt(t / t_1))",
    source=(
        "a layer that drains consolidates with the square root of time at first, U = 2 sqrt(c_v t "
        "/ (pi H^2)) (Terzaghi 1943): with c_v of 0.01-0.1 m²/s of liquefied silty sand and 5 m to "
        "the drain U is 7-23 % after 10 s, which of a drained strength ten times S_r is a of "
        "0.7-2; loose sand under a flood of its own water regains less"
    ),
    looks_like=(
        "the slide starts as a weak soil does and stops early: a short duration, and a larger S_r "
        "wherever a model of constant strength is fitted; at rest hardly to be told from it"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=10.0,
        ladder=(0.2, 0.6, 1.5),
        meaning="strength regained by the time t_1, over S_r",
    ),
    parameters=(
        Parameter("reference_s", "s", 10.0, 0.1, 1e4, "t_1, the time for which a is meant"),
    ),
    strength=strength,
    applies=needs_liquefied_soil,
)
