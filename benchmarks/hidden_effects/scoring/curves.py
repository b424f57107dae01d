"""The curve that a hidden strength law has, and whether a diagnosis has found it.

A law outside the library cannot be named. Where it changes a strength, the diagnosis should say
what the strength depends on, and draw how, or name a law of the library that runs alike. The
constant is not asked for: it is part of S_r.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.hidden_effects.scoring.digest import CurveDigest
from geometry.scenes.scene import Scene
from mpm_taichi.effects import effects, effects_on
from mpm_taichi.effects.framework.base import Active

#: Correlation of the logarithms of two curves from which they are the same shape.
ALIKE = 0.7
#: Stands for a field that is fixed in space: height above the base of its points [m].
FIELD_HEIGHT = 1.0
#: Least multiplier whose logarithm is taken: a law may take all strength away somewhere.
LEAST = 1e-6
#: Where two laws are compared, by variable: overburden [kPa], log10 of the strain rate [1/s],
#: plastic strain, time [s]; laws of the position between the feet of the section.
COMPARED = {
    "overburden": np.linspace(10.0, 190.0, 10),
    "strain_rate": np.linspace(-2.0, 1.0, 10),
    "strain": np.linspace(0.0, 2.0, 10),
    "time": np.linspace(0.0, 40.0, 10),
}


def recovered(curve: CurveDigest | None, scene: Scene, effect: str, law: str) -> bool:
    """The curve depends on the right variable and has the right shape.

    Args:
        curve: that was drawn; None: none.
        scene: the section with the effect on.
        effect: its name.
        law: variable that its strength depends on.
    """
    if curve is None or curve.variable != law:
        return False
    (active,) = [one for one in effects_on(scene) if one.effect.name == effect]
    true = ln_multiplier(active, scene, law, np.array(curve.knots))
    found = np.log(np.maximum(curve.multiplier, LEAST))
    return alike(true, found)


def runs_alike(named: Mapping[str, float], scene: Scene, effect: str, law: str) -> bool:
    """A law of the library was named that depends on the same variable and has the same shape.

    Args:
        named: effects of the verdict with their amplitudes.
        scene: the section with the hidden effect on.
        effect: its name.
        law: variable that its strength depends on.
    """
    if len(named) != 1:
        return False
    ((name, amplitude),) = named.items()
    known = effects().get(name)
    if known is None or (known.field is not None) != (law == "position"):
        return False  # an error of the survey; or one depends on the place and the other does not
    if known.field is None and known.strength is None:
        return False
    knots = COMPARED.get(law, np.linspace(scene.foot("left"), scene.foot("right"), 10))
    curves = [
        ln_multiplier(active, on, law, knots)
        for on in (scene, scene.changed(effects={name: amplitude}))
        for active in effects_on(on)
        if active.effect.name in (effect, name)
    ]
    return len(curves) == 2 and alike(*curves)  # an amplitude of zero is not an effect


def alike(one: np.ndarray, other: np.ndarray) -> bool:
    """Two curves (n,) have the same shape; a level one is like none."""
    if np.ptp(one) < 1e-9 or np.ptp(other) < 1e-9:
        return False
    return float(np.corrcoef(one, other)[0, 1]) >= ALIKE


def ln_multiplier(active: Active, scene: Scene, variable: str, knots: np.ndarray) -> np.ndarray:
    """Logarithm of what an effect multiplies a strength of 1 by, at knots (n,) of a variable."""
    if active.effect.field is not None:
        height = scene.ground.height(knots) + FIELD_HEIGHT
        field = active.effect.field(
            scene, np.column_stack([knots, height]), active.amplitude, active.parameters
        )
        return np.log(field)
    names = active.effect.columns
    effect = SimpleNamespace(**dict(zip(names, active.numbers(scene), strict=True)))
    return np.array([_ln_at(active, effect, variable, u, knots) for u in knots])


def _ln_at(active: Active, effect: Any, variable: str, u: float, knots: np.ndarray) -> float:
    here = SimpleNamespace(
        liquefied=1.0, strain_rate=0.0, strain=0.0, time=0.0, overburden=0.0,
        mean_overburden=1e3 * float(np.mean(knots)), x0=0.0, cell=1.0,
    )  # fmt: skip
    if variable == "strain_rate":
        here.strain_rate = 10.0**u
    elif variable == "overburden":
        here.overburden = 1e3 * u
    else:
        setattr(here, {"position": "x0"}.get(variable, variable), u)
    soil = SimpleNamespace(cohesion=1.0, friction=0.0, cap=0.0)
    return math.log(max(active.effect.strength(effect, soil, here).cohesion, LEAST))
