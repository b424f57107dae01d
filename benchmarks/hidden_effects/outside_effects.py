"""Effects that no library has, to be hidden from a diagnosis that does not know them.

Given to `python -m benchmarks.hidden_effects make` alone; a diagnosis of the benchmark never loads
this file.
"""

from __future__ import annotations

from mpm_taichi.effects import Amplitude, Effect, liquefied_zones, needs_liquefied_soil, ti

SOURCE = "made up for the benchmark"


def _extent(scene) -> tuple[float, float]:
    """Ends of the liquefied soil before the slide [m]."""
    names = liquefied_zones(scene)
    x = [x for zone in scene.zones if zone.name in names for x, _ in zone.polygon]
    return min(x), max(x)


def regains(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a sqrt(t / 10 s))."""
    if here.liquefied > 0.5:
        soil.cohesion *= 1.0 + effect.amplitude * ti.sqrt(ti.max(here.time, 0.0) * 0.1)
    return soil


STRENGTH_IN_TIME = Effect(
    name="strength_in_time",
    words="the liquefied soil regains strength with time",
    equation="S = S_r (1 + a sqrt(t / 10 s))",
    source=SOURCE,
    looks_like="the slide starts as without it and stops early",
    amplitude=Amplitude("", 0.0, 10.0, (0.2, 0.6, 2.0), "share gained in 10 s"),
    strength=regains,
    applies=needs_liquefied_soil,
)


def lens(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a) between the ends of a lens."""
    if here.liquefied > 0.5:
        if here.x0 > effect.begin and here.x0 < effect.end:
            soil.cohesion *= 1.0 + effect.amplitude
    return soil


def lens_ends(scene, amplitude, parameters):  # noqa: ANN001, ANN201
    """The lens takes the middle fifth of the liquefied soil."""
    first, last = _extent(scene)
    return {"begin": first + 0.4 * (last - first), "end": first + 0.6 * (last - first)}


STRONG_LENS = Effect(
    name="strong_lens",
    words="a lens within the liquefied soil did not liquefy",
    equation="S = S_r (1 + a) within the lens",
    source=SOURCE,
    looks_like="the surface is high above the lens",
    amplitude=Amplitude("", 0.0, 40.0, (0.5, 1.5, 5.0), "excess of the lens's strength"),
    strength=lens,
    constant_names=("begin", "end"),
    constants=lens_ends,
    applies=needs_liquefied_soil,
)


def layers(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a) deep down, S_r / (1 + a) above."""
    if here.liquefied > 0.5:
        if here.overburden > here.mean_overburden:
            soil.cohesion *= 1.0 + effect.amplitude
        else:
            soil.cohesion *= 1.0 / (1.0 + effect.amplitude)
    return soil


TWO_LAYERS = Effect(
    name="two_layers",
    words="the liquefied soil has a strong and a weak layer",
    equation="S = S_r (1 + a) below, S_r / (1 + a) above the mean overburden",
    source=SOURCE,
    looks_like="as a strength that grows with overburden, but in a step",
    amplitude=Amplitude("", 0.0, 3.0, (0.1, 0.3, 1.0), "excess of the deep layer"),
    strength=layers,
    applies=needs_liquefied_soil,
)


def root_of_rate(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r (1 + a sqrt(rate s))."""
    if here.liquefied > 0.5:
        soil.cohesion *= 1.0 + effect.amplitude * ti.sqrt(here.strain_rate)
    return soil


ROOT_OF_RATE = Effect(
    name="root_of_rate",
    words="the liquefied soil resists with the root of the rate of shear",
    equation="S = S_r (1 + a sqrt(g' s))",
    source=SOURCE,
    looks_like="between rate strengthening and a viscous fluid",
    amplitude=Amplitude("", 0.0, 10.0, (0.2, 0.6, 2.0), "excess at a rate of 1/s"),
    strength=root_of_rate,
    applies=needs_liquefied_soil,
)


def obstacles(effect, here):  # noqa: ANN001, ANN201
    """The same resistance everywhere beyond the old toe: r = a."""
    result = 0.0
    if (here.x - effect.foot) * effect.outward > 0.0:
        result = effect.amplitude
    return result


def foreland(scene, amplitude, parameters):  # noqa: ANN001, ANN201
    """The foot towards which the slide runs, and the direction from it."""
    first, last = _extent(scene)
    left = first - scene.foot("left") < scene.foot("right") - last
    if scene.domain.walls == "closed":  # a wall is not a foot
        left = False
    return {"foot": scene.foot("left" if left else "right"), "outward": -1.0 if left else 1.0}


ROUGH_FORELAND = Effect(
    name="rough_foreland",
    words="obstacles before the old toe hold back what runs over them",
    equation="r = a beyond the old toe",
    source=SOURCE,
    looks_like="a thick front that stops early",
    amplitude=Amplitude("kN/m3", 0.0, 10.0, (0.2, 0.5, 1.5), "force per volume", si=1e3),
    resistance=obstacles,
    constant_names=("foot", "outward"),
    constants=foreland,
)
