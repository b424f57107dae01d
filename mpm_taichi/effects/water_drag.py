"""Water drag: the pool resists soil that moves through it, with the square of the speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mpm_taichi.effects.framework.base import Amplitude, Effect
from mpm_taichi.effects.framework.free_water import pool_of, soil_in_pool

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene

WATER_DENSITY = 1000.0
"""Density of fresh water [kg/m3]."""


def resistance(effect, here):  # noqa: ANN001, ANN201
    """Drag f = rho_w C_d v^2 / (2 L) in the pool [N/m3]."""
    force = 0.0
    if here.y < effect.level and here.x > effect.left and here.x < effect.right:
        force = effect.amplitude * effect.factor * here.speed * here.speed
    return force


def constants(scene: Scene, amplitude: float, parameters: Mapping[str, float]) -> dict[str, float]:
    """Extent of the pool [m] and rho_w / (2 L) [kg/m4]."""
    pool = pool_of(scene)
    area, height = soil_in_pool(scene, pool)
    # Another effect may have drawn the pool down to below all soil.
    factor = 0.5 * WATER_DENSITY * height / area if area > 0.0 else 0.0
    return {"level": pool.level, "left": pool.left, "right": pool.right, "factor": factor}


def applies(scene: Scene) -> str:
    """Needs soil that stands in a pool."""
    pool = pool_of(scene)
    if pool is None:
        return "there is no pool"
    if soil_in_pool(scene, pool)[0] <= 0.0:
        return "no soil stands in the pool"
    return ""


EFFECT = Effect(
    name="water_drag",
    words="the water of the pool brakes the soil that moves through it",
    equation="f = rho_w C_d v^2 / (2 L) against the motion, L = area / height of soil in the pool",
    source=(
        "drag on the front of a subaqueous slide, shared over its length as in block models "
        "(De Blasio et al. 2004, Ocean Engineering / Norwegian J. Geol. 86, 2006): C_d 0.5-2 for "
        "blunt fronts, up to 4 where the mass of water set in motion is counted as drag"
    ),
    looks_like=(
        "lower velocities and a somewhat shorter runout without a change of the surface behind the "
        "front; nothing at all where the slide is slow, so it shows in toe history and velocity"
    ),
    family="water",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=20.0,
        ladder=(0.2, 0.6, 1.5),
        meaning="drag coefficient C_d of a front as high as the soil in the pool",
    ),
    constant_names=("level", "left", "right", "factor"),
    constants=constants,
    resistance=resistance,
    applies=applies,
)
