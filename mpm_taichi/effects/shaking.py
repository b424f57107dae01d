"""Horizontal shaking of the ground while the soil flows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import STANDARD_GRAVITY, Amplitude, Effect, Parameter, ti

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.base import Numbers


def acceleration(effect, node):  # noqa: ANN001, ANN201
    """Force of inertia per mass in axes that go with the ground, -a_g(t)."""
    result = ti.Vector([0.0, 0.0])
    since = node.time - effect.start_s
    if since > 0.0 and since < effect.duration_s:
        window = ti.sin(3.14159265 * since / effect.duration_s)
        wave = ti.cos(6.2831853 * effect.frequency_hz * (since - 0.5 * effect.duration_s))
        result[0] = -effect.amplitude * window * window * wave
    return result


def until(scene: Scene, amplitude: float, parameters: Numbers) -> float:
    """The end of the shaking [s]."""
    return parameters["start_s"] + parameters["duration_s"]


EFFECT = Effect(
    name="shaking",
    words="the ground went on shaking while the soil flowed",
    equation="a_g = A cos(2 pi f (t - t_m)) sin^2(pi (t - t_0) / D), t_m = t_0 + D/2; soil: -a_g",
    source=(
        "inertia in the frame of the ground, as in Newmark (1965), Geotechnique 15(2); the pulse "
        "is a wave in a Hann window: where f D is whole and at least 2, the ground ends at rest "
        "and where it was"
    ),
    looks_like=(
        "the crest and what remains of it sink and their slopes flatten, strong soil that would "
        "stand moves as well; the toe moves less; more for slow waves; the two signs differ little"
    ),
    amplitude=Amplitude(
        unit="g",
        low=-2.0,
        high=2.0,
        ladder=(0.15, 0.3, 0.6),
        meaning="A, peak acceleration of the ground, to the right in the middle of the shaking",
        two_signed=True,
        si=STANDARD_GRAVITY,
    ),
    parameters=(
        Parameter("frequency_hz", "1/s", 1.0, 0.05, 20.0, "f, of the wave"),
        Parameter("start_s", "s", 0.0, 0.0, 1e4, "t_0, when it begins; 0: as the flow begins"),
        Parameter("duration_s", "s", 10.0, 0.1, 1e4, "D, how long it lasts"),
    ),
    acceleration=acceleration,
    until=until,
)
