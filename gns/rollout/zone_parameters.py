"""A scene as a function of properties of its zones: what a back-analysis of the scene varies.

In: a scene in the model's units, its facts, and which properties of which zones are unknown. Out: a
function from their values to the scene, through which a rollout is differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from gns.data.scene_facts import SceneFacts
from gns.network.units import ScaledScene
from mpm_taichi.solver.water import WATER_DENSITY


@dataclass(frozen=True)
class UnknownProperty:
    """One number that the scene is made a function of.

    Attributes:
        property: cohesion [kPa], friction angle [deg] or density [kg/m3] of zones, or the level of
            the water [m].
        zones: places of its zones in the scene; none for the level.
        value: what the facts were made with; densities and levels change by what they differ.
        vertices: (L,) bool, vertices of the phreatic line that move with the level.
    """

    property: str
    zones: tuple[int, ...]
    value: float
    vertices: np.ndarray | None = None


def scene_function(
    base: ScaledScene, facts: SceneFacts, unknowns: Sequence[UnknownProperty]
) -> Callable[[Tensor], ScaledScene]:
    """The scene as a function of the unknown values (p,), in their outside units.

    A point that is soaked at t = 0 weighs as much as saturated soil, one that is not as much as
    moist soil: which points these are is taken from the facts and does not change with the level.

    Args:
        base: the scene with the values of the facts.
        facts: of the scene.
        unknowns: the unknowns, p of them.
    """
    members = [
        torch.from_numpy(np.isin(facts.zone, one.zones)).to(base.kinematic.device)
        for one in unknowns
    ]

    def scene_of(theta: Tensor) -> ScaledScene:
        scene = base
        for one, points, value in zip(unknowns, members, theta, strict=True):
            scene = _with(scene, one, points, value)
        return scene

    return scene_of


def _with(scene: ScaledScene, one: UnknownProperty, points: Tensor, value: Tensor) -> ScaledScene:
    """The scene with one of the numbers put in."""
    match one.property:
        case "cohesion_kpa":
            return scene.with_strength(points, cohesion_pa=1e3 * value)
        case "friction_deg":
            return scene.with_strength(points, tan_friction=torch.tan(torch.deg2rad(value)))
        case "density":
            return scene.with_density(points, WATER_DENSITY * scene.density + (value - one.value))
        case "water_level":
            moved = scene.phreatic_line.new_tensor(one.vertices)[:, None]
            upward = scene.phreatic_line.new_tensor([0.0, 1.0]) * moved
            rise = (value - one.value) / scene.spacing
            return replace(scene, phreatic_line=scene.phreatic_line + rise * upward)
