"""Cracking: soil that has not liquefied holds little tension, and a crack takes its cohesion."""

from __future__ import annotations

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, needs_cohesion, ti


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """Cap T = (1 - a) T_0, T_0 = c min(cot(phi), 2) of what is left of the cohesion."""
    if here.liquefied < 0.5:
        open_share = ti.min(here.memory * here.cell / effect.crack_width_m, 1.0)
        soil.cohesion *= 1.0 - effect.amplitude * effect.cohesion_lost * open_share
        whole = 2.0 * soil.cohesion
        if soil.friction > 0.5:
            whole = soil.cohesion / soil.friction
        soil.cap = ti.min(soil.cap, (1.0 - effect.amplitude) * whole)
    return soil


def memory(effect, here):  # noqa: ANN001, ANN201
    """The widest the soil has been open, as a strain [-]; a crack that closes does not heal."""
    return ti.max(here.memory, here.opening)


EFFECT = Effect(
    name="cracking",
    words="the soil that did not liquefy cracks: it holds less tension than its cohesion allows",
    equation="T = (1 - a) c min(cot(phi), 2), c = c_0 (1 - a k min(w / w_c, 1)), w the widest "
    "opening of a cell",
    source=(
        "tension cut-off by Rankine: de Souza Neto, Peric and Owen (2008), ch. 8, counted from the "
        "apex, or from 2 c where that is lower; saturated clay cracks at a small share of its "
        "undrained strength: Thusyanthan et al. (2007), Geotechnique 57(7); strength lost over a "
        "width of opening, not a strain: Hillerborg, Modeer and Petersson (1976)"
    ),
    looks_like=(
        "a cohesive crust breaks up instead of holding together: its blocks part and are carried "
        "off, the toe goes farther and the crest sinks more, with gaps and steps in the surface; "
        "nothing changes where cohesion is a few kPa or the soil is pressed together"
    ),
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1.0,
        ladder=(0.2, 0.5, 1.0),
        meaning="share of the tensile strength that is missing; 1: none is left",
    ),
    parameters=(
        Parameter(
            "crack_width_m",
            "m",
            0.02,
            1e-4,
            10.0,
            "w_c, opening at which a crack has taken all it takes of the cohesion",
        ),
        Parameter(
            "cohesion_lost",
            "",
            0.5,
            0.0,
            1.0,
            "k, share of the cohesion that a crack takes where a = 1",
        ),
    ),
    strength=strength,
    memory=memory,
    applies=needs_cohesion,
)
