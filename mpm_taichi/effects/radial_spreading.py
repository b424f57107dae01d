"""Radial spreading: the slide widens on its way, like a fan, or like a cylinder that collapses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm_taichi.effects.framework.base import Amplitude, Effect, ti
from mpm_taichi.effects.obstacles import applies, feet_with_room
from mpm_taichi.effects.side_shear import section_height

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.effects.framework.base import Numbers

NEAR_AXIS = 0.25
"""Cells from the axis within which the width stays: strain across grows as 1 / distance there."""


def width(effect, place):  # noqa: ANN001, ANN201
    """Width over that at the foot, and its slope along x [1/m]."""
    left, right = effect.left_foot - place.x, place.x - effect.right_foot
    beyond, sign = ti.max(left, right), ti.select(left > right, -1.0, 1.0)
    slope = effect.amplitude / effect.height
    if beyond < 0.0:
        slope = ti.min(slope, effect.slope_inside)
    found, least = 1.0 + slope * beyond, NEAR_AXIS * place.cell * slope
    return ti.Vector([ti.max(found, least), ti.select(found > least, sign * slope, 0.0)])


def widths(scene: Scene, position: np.ndarray, amplitude: float, parameters: Numbers) -> np.ndarray:
    """The same width at places (N, 2) [m], (N,)."""
    at = constants(scene, amplitude, parameters)
    x, slope = position[:, 0], amplitude / at["height"]
    beyond = np.maximum(at["left_foot"] - x, x - at["right_foot"])
    slopes = np.where(beyond < 0.0, min(slope, at["slope_inside"]), slope)
    return np.maximum(1.0 + slopes * beyond, NEAR_AXIS * scene.cell_size * slopes)


def constants(scene: Scene, amplitude: float, parameters: Numbers) -> dict[str, float]:
    """Feet and height [m], and the most by which the width falls towards a wall [1/m].

    That is to 0 at a wall the section leans on, and not at all within a section that leans on none.
    """
    walls = [
        scene.foot(other) - scene.end(side)
        for side, other in (("left", "right"), ("right", "left"))
        if scene.domain.walls == "closed"
        and not scene.domain.goes_on(side)
        and abs(scene.end(side) - scene.domain.wall(side)) < scene.spacing
    ]
    height = section_height(scene, amplitude, parameters)
    inside = 1.0 / abs(walls[0]) if len(walls) == 1 else 0.0
    return {**feet_with_room(scene), **height, "slope_inside": inside}


EFFECT = Effect(
    name="radial_spreading",
    words="the slide spreads to the sides as it runs out",
    equation=(
        "width w = 1 + a d / H, d the way beyond the foot; strain across ln(w / w_0), and its "
        "stress pushes outward by sigma_zz w' / w. Of a section that leans on a wall also d < 0, "
        "to 0 at the wall at most: with a = H / L half a section through a cylinder of radius L"
    ),
    source=(
        "material points of an axially symmetric body: Sulsky and Schreyer (1996), Comput. "
        "Methods Appl. Mech. Eng. 139; a fan of half-angle b before a breach of width B has "
        "a = 2 tan(b) H / B: 0.1 to 1 for dams of H / B 0.1 to 1"
    ),
    looks_like=(
        "a thin deposit that ends early, beyond the foot alone, while remnant and scarp hardly "
        "change; less soil is found in the section than left it"
    ),
    family="dimension",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=10.0,
        ladder=(0.1, 0.3, 1.0),
        meaning="growth of the width over a way of the section's height, as a share of that at "
        "the foot",
    ),
    constant_names=("left_foot", "right_foot", "height", "slope_inside"),
    constants=constants,
    width=width,
    field=widths,
    applies=applies,
)
