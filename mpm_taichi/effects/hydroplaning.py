"""Hydroplaning: beyond the old toe the base holds only a share of its strength."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect, ti
from mpm_taichi.effects.framework.free_water import FAR, pool_of
from mpm_taichi.effects.obstacles import feet_with_room

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene


def ground(effect, base, node):  # noqa: ANN001, ANN201
    """Base strength times beta = 1 - a beyond the feet, setting in over one cell."""
    beyond = ti.max(effect.left_foot - node.x, node.x - effect.right_foot)
    kept = 1.0 - effect.amplitude * ti.min(ti.max(beyond / node.cell + 0.5, 0.0), 1.0)
    base.friction *= kept
    base.adhesion *= kept
    return base


def feet_in_water(scene: Scene) -> dict[str, float]:
    """Places [m] of the feet before which a pool stands; far away where none does."""
    pool = pool_of(scene)
    if pool is None:
        return {"left_foot": -FAR, "right_foot": FAR}
    left, right = scene.foot("left"), scene.foot("right")
    feet = feet_with_room(scene)
    if not (pool.left < left and pool.level > scene.ground.height(left)):
        feet["left_foot"] = -FAR
    if not (pool.right > right and pool.level > scene.ground.height(right)):
        feet["right_foot"] = FAR
    return feet


def constants(scene: Scene, amplitude: float, parameters: Mapping[str, float]) -> dict[str, float]:
    """Feet of the section in water [m]."""
    return feet_in_water(scene)


def applies(scene: Scene) -> str:
    """Needs a foot in a pool, and ground that soil can slip on."""
    if scene.ground.contact == "no_slip":
        return "the ground is bonded (contact: no_slip)"
    feet = feet_in_water(scene)
    if feet == {"left_foot": -FAR, "right_foot": FAR}:
        return "no foot of the section stands in a pool with room before it"
    return ""


EFFECT = Effect(
    name="hydroplaning",
    words="the front rides on a film of water beyond the old toe, where the base holds less",
    equation="base strength x (1 - a) beyond the feet that stand in a pool",
    source=(
        "Mohrig et al. (1998), GSA Bulletin 110(3): fronts under water lift off their bed above a "
        "densimetric Froude number v / sqrt((rho / rho_w - 1) g h) of 0.3-0.4, which a slide of "
        "5 m/s and 5 m thickness exceeds; De Blasio et al. (2004) put the base there at a few to "
        "fifty percent of its strength"
    ),
    looks_like=(
        "a long, thin front beyond the old toe, while remnant, crest and scarp are as they were; "
        "the first metres of runout come as before, the last ones are added"
    ),
    family="ground",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1.0,
        ladder=(0.03, 0.1, 0.25),
        meaning="share of the base strength lost beyond the old toe, 1 - beta",
    ),
    constant_names=("left_foot", "right_foot"),
    constants=constants,
    ground=ground,
    applies=applies,
)
