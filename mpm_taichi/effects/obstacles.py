"""Obstacles: what stands before the dam holds back the soil that runs over it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, ti
from mpm_taichi.effects.framework.free_water import FAR

if TYPE_CHECKING:
    from geometry.scenes.scene import Domain, Scene
    from geometry.sides import Side


def resistance(effect, here):  # noqa: ANN001, ANN201
    """The same force per volume beyond the feet, setting in over one cell [N/m3]."""
    beyond = ti.max(effect.left_foot - here.x, here.x - effect.right_foot)
    return effect.amplitude * ti.min(ti.max(beyond / here.cell + 0.5, 0.0), 1.0)


def feet_with_room(scene: Scene) -> dict[str, float]:
    """Places [m] of the feet that have bare ground before them; far away where they have none."""
    room = 2.0 * scene.cell_size
    left, right = scene.foot("left"), scene.foot("right")
    domain = scene.domain
    return {
        "left_foot": left if _has_room("left", domain, left - room > domain.x_min) else -FAR,
        "right_foot": right if _has_room("right", domain, right + room < domain.x_max) else FAR,
    }


def _has_room(side: Side, domain: Domain, away_from_wall: bool) -> bool:
    """Bare ground lies before a foot; where the ground goes on, soil does."""
    return not domain.goes_on(side) and (domain.is_open(side) or away_from_wall)


def constants(scene: Scene, amplitude: float, parameters: Mapping[str, float]) -> dict[str, float]:
    """Feet of the section [m]."""
    return feet_with_room(scene)


def applies(scene: Scene) -> str:
    """Needs ground before a foot."""
    if feet_with_room(scene) == {"left_foot": -FAR, "right_foot": FAR}:
        return "no foot of the section has room before it"
    return ""


EFFECT = Effect(
    name="obstacles",
    words="what stands on the ground before the dam holds back the soil that runs over it",
    equation="f = a against the motion, beyond the feet",
    source=(
        "piles in cohesive soil that flows past them take 9 S d each for every metre of depth "
        "(Broms 1964, J. Soil Mech. Found. Div. 90(2), recalled): n stems or posts of diameter d "
        "on a square metre make f = 9 S d n, 0.5 kN/m³ for a trunk of 0.3 m on 100 m² at 20 kPa "
        "and 5 kN/m³ for one on 10 m²; walls, rubble and dense wood are of that size"
    ),
    looks_like=(
        "a thick front that stops early and steeply beyond the old toe, while remnant, crest and "
        "scarp are as they were"
    ),
    family="ground",
    amplitude=Amplitude(
        unit="kN/m3",
        low=0.0,
        high=20.0,
        ladder=(0.2, 0.6, 1.5),
        meaning="force per volume of the soil beyond the old toe",
        si=1e3,
    ),
    constant_names=("left_foot", "right_foot"),
    constants=constants,
    resistance=resistance,
    applies=applies,
)
