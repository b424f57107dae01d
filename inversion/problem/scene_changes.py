"""The same section with other properties of some zones, or with its pool at another level."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar, cast

import numpy as np

from geometry.scenes.scene import UNCHECKED, Scene
from geometry.scenes3d.scene3d import Terrain

Soil = TypeVar("Soil", bound=Scene | Terrain)
"""What has zones and materials."""


def with_properties(base: Soil, changes: Sequence[tuple[str, str, float | bool]]) -> Soil:
    """A scene, or a terrain, in which some zones have other properties.

    Where zones that share a material come to differ, each changed group gets a material of its own,
    so that a zone that is not named keeps its soil. Equal changes keep equal materials, so the
    scene, and with it the key of its run, does not depend on the order of the changes.

    A zone that is given a cohesion, which is S_r where it liquefies, has no strength ratio any more
    unless that is given too: the cohesion is then the least strength.

    Args:
        base: the scene or terrain.
        changes: (zone, property, value), the property a key of a scene's material.
    """
    document = base.model_dump()
    wanted: dict[str, dict[str, float | bool]] = {zone.name: {} for zone in base.zones}
    for zone, name, value in changes:
        wanted[zone][name] = value
    materials: dict[str, dict] = {}
    for zone in document["zones"]:
        old = zone["material"]
        soil = {**document["materials"][old], **wanted[zone["name"]]}
        if "cohesion_kpa" in wanted[zone["name"]] and "strength_ratio" not in wanted[zone["name"]]:
            soil.pop("strength_ratio", None)
        extra = soil["density"] - document["materials"][old]["density"]
        if extra and soil["saturated_density"] is not None:
            soil["saturated_density"] += extra
        name = old
        while materials.setdefault(name, soil) != soil:
            name = f"{name}_{zone['name']}"
        zone["material"] = name
    document["materials"] = materials
    # Shapes are those of `base`, which were checked with it; only soils can be at fault now.
    return cast(Soil, type(base).model_validate(document, context=UNCHECKED))


#: Two places nearer than this are one and the same [m].
SAME_PLACE_M = 0.05


def moves_with_pool(scene: Scene) -> np.ndarray:
    """Which vertices of the phreatic line stand at pool level, (L,) bool.

    A scene without a phreatic line of its own has one at pool level, with a vertex at either end.
    """
    if scene.phreatic_line is None:
        return np.ones(2, dtype=bool)
    heights = np.array([y for _, y in scene.phreatic_line])
    return np.abs(heights - scene.water_level) <= SAME_PLACE_M


def pool_at(scene: Scene, level: float) -> dict[str, Any]:
    """The document of the scene with its pool at another level [m]; not checked yet.

    The phreatic line moves where it stands at pool level.
    """
    line = scene.phreatic_line
    if line is not None:
        line = [
            (x, level if moves else y)
            for (x, y), moves in zip(line, moves_with_pool(scene), strict=True)
        ]
    return {**scene.model_dump(), "water_level": level, "phreatic_line": line}
