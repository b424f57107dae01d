"""The same section with other properties of some zones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from geometry.scenes.scene import Scene
from geometry.scenes3d.scene3d import Terrain

Soil = TypeVar("Soil", Scene, Terrain)
"""What has zones and materials."""


def with_properties(base: Soil, changes: Sequence[tuple[str, str, float | bool]]) -> Soil:
    """A scene, or a terrain, in which some zones have other properties.

    Where zones that share a material come to differ, each changed group gets a material of its own,
    so that a zone that is not named keeps its soil. Equal changes keep equal materials, so the
    scene, and with it the key of its run, does not depend on the order of the changes.

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
        extra = soil["density"] - document["materials"][old]["density"]
        if extra and soil["saturated_density"] is not None:
            soil["saturated_density"] += extra
        name = old
        while materials.setdefault(name, soil) != soil:
            name = f"{name}_{zone['name']}"
        zone["material"] = name
    document["materials"] = materials
    return type(base).model_validate(document)
