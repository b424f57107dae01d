"""Pool level: the pool stands higher or lower than the section says, and groundwater with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def moved(scene: Scene, amplitude: float, parameters: Mapping[str, float]) -> Scene:
    """The scene with its pool `amplitude` m higher and its phreatic line drawn along.

    The head above the lowest point of the line, the tailwater, grows or shrinks in one proportion;
    a pool that falls below the tailwater takes the line with it. A level line moves as a whole.
    """
    level = scene.water_level + amplitude
    line = scene.phreatic_line
    if line is None:
        return scene.changed(water_level=level)
    tail = min(y for _, y in line)
    head = scene.water_level - tail
    if head <= 0.0:
        shifted = [(x, y + amplitude) for x, y in line]
    else:
        share = max(level - tail, 0.0) / head
        shifted = [(x, min(tail, level) + (y - tail) * share) for x, y in line]
    return scene.changed(water_level=level, phreatic_line=shifted)


def applies(scene: Scene) -> str:
    """Needs water that soil stands in."""
    if not scene.has_water:
        return "there is no water"
    return ""


EFFECT = Effect(
    name="pool_level",
    words="the pool stood at another level than the section says",
    equation="h = h_0 + a; of the phreatic line y = y_tail + (y_0 - y_tail) (h - y_tail) / "
    "(h_0 - y_tail)",
    source=(
        "hydrostatic pressure; steady lines of seepage scale with the head (Casagrande 1937, in "
        "proportion for a given section). Gauges are read to centimetres, yet levels of old cases "
        "are known to 0.5-2 m, and a pool falls in a drawdown or rises by the wave of the slide"
    ),
    looks_like=(
        "a higher pool carries more of the weight and pushes harder on what holds it back: a slide "
        "into the pool runs shorter and settles less (one away from it may run farther), much as a "
        "larger S_r; it acts on all that is submerged, so shells and remnant move along"
    ),
    family="water",
    amplitude=Amplitude(
        unit="m",
        low=-30.0,
        high=30.0,
        ladder=(0.5, 1.0, 2.0),
        meaning="height of the pool above the level in the scene",
        two_signed=True,
    ),
    scene=moved,
    applies=applies,
)
