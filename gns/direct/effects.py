"""Physical effects as inputs of the direct model: a number each, the same in all columns.

An amplitude that has units is taken in those of the section, rho g height and sqrt(height / g), and
every one is divided by a large one. Further numbers of an effect are learned at their defaults
alone. `strength_contrast` and `pool_level` are no inputs: they change strength and water, which the
columns hold. `dilatancy` and `radial_spreading` change the volume, which the model keeps.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi.effects import effect, effects_on
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from pipeline.random_numbers import Stream


@dataclass(frozen=True)
class Input:
    """An effect that the model has as an input.

    Attributes:
        name: of the effect.
        large: an amplitude that counts as 1, in units of the section.
        stress: power of rho g height in the unit of the amplitude.
        time: power of sqrt(height / g) in it.
        length: power of the height in it.
        turned: its amplitude changes its sign in the mirror image.
    """

    name: str
    large: float
    stress: int = 0
    time: int = 0
    length: int = 0
    turned: bool = False


# A model names those that it has learned; the order is that of their channels.
EFFECTS = (
    Input("strain_softening", 0.8),
    Input("rate_strengthening", 0.2),
    Input("overburden_strength", 1.0),
    Input("late_liquefaction", 20.0, time=1),
    Input("reconsolidation", 1.5),
    Input("apparent_cohesion", 0.05, stress=1),
    Input("remoulding", 0.7),
    Input("bingham", 0.025, stress=1, time=1),
    Input("pore_pressure", 0.4),
    Input("inertial_friction", 0.35),
    Input("cracking", 1.0),
    Input("weak_base", 0.2),
    Input("hydroplaning", 0.25),
    Input("obstacles", 0.08, stress=1, length=-1),
    Input("shaking", 0.6, turned=True),
    Input("water_drag", 1.5),
    Input("side_shear", 0.12),
    Input("side_friction", 0.15),
)
NAMES = tuple(one.name for one in EFFECTS)
#: Drawn amplitudes, in top rungs of their ladders: beyond the top one, so that it is learned too.
DRAWN = (0.05, 1.25)
#: Runs with an effect from which on a model may learn it.
LEAST_RUNS = 20
#: Spacing of the runs that are learned from [m]. Some laws of effects have lengths and times of
#: their own, which the model does not know: it has learned them where these runs were made.
SPACING = 2.0


def most(name: str) -> float:
    """The largest amplitude, of either sign, that a model has learned from."""
    return DRAWN[1] * effect(name).amplitude.ladder[-1]


def learned_of(scenes: Iterable[Scene]) -> tuple[str, ...]:
    """Effects that so many of the scenes have on that a model can learn them, as in EFFECTS."""
    counts = Counter(name for scene in scenes for name in scene.effects)
    return tuple(name for name in NAMES if counts[name] >= LEAST_RUNS)


def inputs_of(scene: Scene, height: float, unit_kpa: float, unit_s: float) -> np.ndarray:
    """Amplitudes of EFFECTS as the model sees them, (E,); 0 where one is off.

    Args:
        scene: with its effects.
        height: of the section [m].
        unit_kpa: rho g height [kPa].
        unit_s: sqrt(height / g) [s].

    Raises:
        InputError: an effect that no model has learned so: with other further numbers than its
            defaults, with a larger amplitude, or at another spacing.
    """
    acting = {one.effect.name: one for one in effects_on(scene)}
    found = np.zeros(len(EFFECTS))
    for place, one in enumerate(EFFECTS):
        if (active := acting.get(one.name)) is None:
            continue
        for number in active.effect.parameters:
            if active.parameters[number.name] != number.default:
                raise InputError(
                    f"{scene.name}: effects: {one.name}: {number.name}: "
                    f"{active.parameters[number.name]:g}; the direct model knows "
                    f"{number.default:g} alone"
                )
        where = f"{scene.name}: effects: {one.name}"
        if abs(active.amplitude) > 1.001 * most(one.name):
            raise InputError(
                f"{where}: {active.amplitude:g}; the direct model knows up to {most(one.name):g}"
            )
        if abs(scene.spacing / SPACING - 1.0) > 0.01:
            raise InputError(
                f"{where}: the direct model knows effects at a spacing of {SPACING:g} m alone"
            )
        unit = unit_kpa**one.stress * unit_s**one.time * height**one.length
        found[place] = active.amplitude / (unit * one.large)
    return found


def draw_effects(scene: Scene, stream: Stream, count: int) -> Scene:
    """The scene with so many effects of random size, of those that can act in it."""
    able = [one.name for one in EFFECTS if not effect(one.name).applies(scene)]
    drawn: dict[str, float] = {}
    for _ in range(min(count, len(able))):
        name = able.pop(stream.integer(0, len(able) - 1))
        scale = effect(name).amplitude
        size = stream.uniform(*DRAWN) * scale.ladder[-1]
        sign = -1.0 if scale.two_signed and stream.unit() < 0.5 else 1.0
        drawn[name] = round(min(max(sign * size, scale.low), scale.high), 6)
    return scene.changed(effects={**scene.effects, **drawn})


def turned() -> list[int]:
    """Places of those that change their sign in the mirror image."""
    return [place for place, one in enumerate(EFFECTS) if one.turned]
