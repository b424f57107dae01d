"""An effect of one's own: liquefied soil that regains strength as time passes.

Water drains from liquefied soil and its grains settle into contact again. Here the regain is one
exponential in time. Use it with

    flowslide simulate FOLDER --effects docs/examples/my_effect.py ...

and in the scene

    effects: {strength_regain: {amplitude: 0.5, time_s: 8}}
"""

from mpm_taichi.effects import Amplitude, Effect, Parameter, needs_liquefied_soil, ti


def strength(effect, soil, here):
    """S = S_r (1 + a (1 - exp(-t / T))): what the solver asks of every point in every step."""
    if here.liquefied > 0.5:
        regained = 1.0 - ti.exp(-here.time / effect.time_s)
        soil.cohesion *= 1.0 + effect.amplitude * regained
    return soil


def until(scene, amplitude, parameters):
    """After five times T nothing changes any more; a run at rest may end then."""
    return 5.0 * parameters["time_s"]


STRENGTH_REGAIN = Effect(
    name="strength_regain",
    words="the liquefied soil regains strength as time passes",
    equation="S = S_r (1 + a (1 - exp(-t / T)))",
    source="an example; the form is that of one-dimensional consolidation after its first moments",
    looks_like="a slide that starts as fast as without it and stops early; its duration tells",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=5.0,
        ladder=(0.25, 0.5, 1.0),
        meaning="strength regained in the end, as a share of S_r",
    ),
    parameters=(
        Parameter("time_s", "s", 10.0, 0.1, 1000.0, "T, after which 63 % of it is regained"),
    ),
    strength=strength,
    until=until,
    applies=needs_liquefied_soil,
)
