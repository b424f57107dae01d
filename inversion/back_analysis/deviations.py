"""A setup with what was assumed of its section elsewhere by some standard deviations.

Boundaries, the level of the pool and properties of the soil that a question lists among its
sensitivities. Sensitivities put in one score of +-1 at a time, the posterior scores of all of them
at once, the diagnosis one score of any size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydantic import ValidationError

from geometry.scenes.scene import Scene, document_error, scene_from_mapping
from inversion.estimation.forward import Setup
from inversion.problem.question import (
    FixedProperty,
    WaterLevel,
    ZoneBoundary,
    material_key,
)
from inversion.problem.scene_changes import SAME_PLACE_M, pool_at, with_properties
from pipeline.cli import InputError

Uncertain = ZoneBoundary | WaterLevel | FixedProperty
"""A sensitivity that has a standard deviation."""


def deviating(
    setup: Setup, uncertain: Sequence[Uncertain], scores: Sequence[float], where: str
) -> Setup:
    """A setup whose section differs by a standard score of each of its uncertain assumptions.

    What two of them say of one vertex, one soil or the pool adds up.

    Raises:
        InputError: beginning with `where`: the section does not hold together there.
    """
    before = setup.scene
    scene = _with_boundaries(before, uncertain, scores, where)
    rise: float | None = None
    of_soil: dict[tuple[str, str], float] = {}
    for one, score in zip(uncertain, scores, strict=True):
        if isinstance(one, WaterLevel):
            rise = (rise or 0.0) + score * one.std_m
        elif isinstance(one, FixedProperty):
            for zone in one.zones:
                key = zone, material_key(one.property)
                of_soil[key] = of_soil.get(key, 0.0) + score * one.std
    if rise is not None:
        scene = scene_from_mapping(pool_at(scene, before.water_level + rise), where)
    changes = [
        found
        for (zone, key), change in of_soil.items()
        for found in property_changes(before, [zone], key, change)
    ]
    if changes:
        scene = with_changes(scene, changes, where)
    return setup.with_scene(scene)


def with_changes(
    scene: Scene, changes: Sequence[tuple[str, str, float | bool]], where: str
) -> Scene:
    """`with_properties`; no such soil is an `InputError` that begins with `where`."""
    try:
        return with_properties(scene, changes)
    except ValidationError as error:
        raise InputError(document_error(error, where)) from None


def property_changes(
    scene: Scene, zones: Sequence[str], key: str, change: float
) -> list[tuple[str, str, float]]:
    """A material's property that differs by `change` from the scene's, as `with_properties` takes.

    Of stiffness the change is that of the logarithm.
    """
    soil = {zone.name: scene.materials[zone.material] for zone in scene.zones}
    values = [getattr(soil[name], key) for name in zones]
    if key == "youngs_modulus_mpa":
        values = [value * math.exp(change) for value in values]
    elif key == "density":
        values = [value + change for value in values]
    else:  # no soil has less than no strength
        values = [max(value + change, 0.0) for value in values]
    return [(name, key, value) for name, value in zip(zones, values, strict=True)]


def _with_boundaries(
    scene: Scene, uncertain: Sequence[Uncertain], scores: Sequence[float], where: str
) -> Scene:
    """Vertices moved in every line that has them: polygons of zones, and the base.

    What two boundaries share moves by the sum.
    """
    document = scene.model_dump()
    lines = [*(zone["polygon"] for zone in document["zones"]), document["ground"]["points"]]
    ends = np.cumsum([len(line) for line in lines])[:-1]
    points = np.concatenate([np.asarray(line, dtype=float) for line in lines])
    moves = np.zeros_like(points)
    for one, score in zip(uncertain, scores, strict=True):
        for vertex in one.vertices if isinstance(one, ZoneBoundary) else ():
            hit = np.hypot(*(points - vertex.at).T) <= SAME_PLACE_M
            if not hit.any():
                x, y = vertex.at
                raise InputError(f"{where}: vertices: no zone has a vertex at ({x:g}, {y:g})")
            moves[hit] += score * np.asarray(vertex.move)
    for line, moved in zip(lines, np.split(points + moves, ends), strict=True):
        line[:] = moved.tolist()
    return scene_from_mapping(document, where)
