"""A setup with what was assumed of its section elsewhere by some standard deviations.

Boundaries, the level of the pool and properties of the soil that a question lists among its
sensitivities. Sensitivities put in one score of +-1 at a time, the posterior scores of all of them
at once, the diagnosis one score of any size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from pydantic import ValidationError

from geometry.dimensions.stated import FILE_NAME as FAMILY_FILE
from geometry.scenes.scene import Scene, document_error, scene_from_mapping
from geometry.scenes3d.scene3d import Terrain
from inversion.engines.body_setup import BodySetup
from inversion.estimation.forward import SectionSetup, Setup
from inversion.problem.question import (
    FixedProperty,
    UnknownDimension,
    WaterLevel,
    ZoneBoundary,
    material_key,
)
from inversion.problem.scene_changes import SAME_PLACE_M, Soil, pool_at, with_properties
from pipeline.cli import InputError

Uncertain = ZoneBoundary | WaterLevel | UnknownDimension | FixedProperty
"""A sensitivity that has a standard deviation."""
AnySetup = TypeVar("AnySetup", bound=Setup)
LEFT_OUT = "not available in three dimensions"


def deviating(
    setup: AnySetup, uncertain: Sequence[Uncertain], scores: Sequence[float], where: str
) -> AnySetup:
    """A setup whose scene differs by a standard score of each of its uncertain assumptions.

    What two of them say of one vertex, one soil or the pool adds up.

    Raises:
        InputError: beginning with `where`: the scene does not hold together there, or three
            dimensions do not have it.
    """
    if isinstance(setup, SectionSetup):
        section = _with_dimensions(setup, uncertain, scores, where)
        section = _with_boundaries(section, uncertain, scores, where)
        if (rise := _rise(uncertain, scores)) is not None:
            assert setup.scene.water_level is not None
            level = setup.scene.water_level + rise
            section = scene_from_mapping(pool_at(section, level), where)
        return setup.with_scene(_other_soil(section, setup.scene, uncertain, scores, where))
    assert isinstance(setup, BodySetup)
    for one in uncertain:
        if isinstance(one, ZoneBoundary | UnknownDimension):
            raise InputError(f"{where}: kind {one.kind}: {LEFT_OUT}")
    soil = setup.soil
    if (rise := _rise(uncertain, scores)) is not None:
        if not isinstance(soil, Terrain) or soil.water_level is None:
            raise InputError(f"{where}: only of a terrain with a water_level")
        soil = soil.model_copy(update={"water_level": soil.water_level + rise})
    soil = _other_soil(soil, setup.soil, uncertain, scores, where)
    return setup.with_soil(soil)


def _with_dimensions(
    setup: SectionSetup, uncertain: Sequence[Uncertain], scores: Sequence[float], where: str
) -> Scene:
    """Another section of the family; a dimension that is not uncertain keeps its median."""
    given = {
        one.dimension: score
        for one, score in zip(uncertain, scores, strict=True)
        if isinstance(one, UnknownDimension)
    }
    if not given:
        return setup.scene
    if setup.family is None:
        raise InputError(f"{where}: the section was drawn; there is no {FAMILY_FILE}")
    return scene_from_mapping(setup.family.document(setup.scene, given), where)


def _rise(uncertain: Sequence[Uncertain], scores: Sequence[float]) -> float | None:
    """Of the pool [m]; None: its level is not uncertain."""
    rises = [
        score * one.std_m
        for one, score in zip(uncertain, scores, strict=True)
        if isinstance(one, WaterLevel)
    ]
    return sum(rises) if rises else None


def _other_soil(
    soil: Soil, before: Soil, uncertain: Sequence[Uncertain], scores: Sequence[float], where: str
) -> Soil:
    """Soil with its uncertain properties changed from what they were before."""
    by: dict[tuple[str, str], float] = {}
    for one, score in zip(uncertain, scores, strict=True):
        if not isinstance(one, FixedProperty):
            continue
        for zone in one.zones:
            key = zone, material_key(one.property)
            by[key] = by.get(key, 0.0) + score * one.std
    changes = [
        found
        for (zone, key), change in by.items()
        for found in property_changes(before, [zone], key, change)
    ]
    return with_changes(soil, changes, where) if changes else soil


def with_changes(soil: Soil, changes: Sequence[tuple[str, str, float | bool]], where: str) -> Soil:
    """`with_properties`; no such soil is an `InputError` that begins with `where`."""
    try:
        return with_properties(soil, changes)
    except ValidationError as error:
        raise InputError(document_error(error, where)) from None


def property_changes(
    soil: Scene | Terrain, zones: Sequence[str], key: str, change: float
) -> list[tuple[str, str, float]]:
    """A material's property that differs by `change` from what it is, as `with_properties` takes.

    Of stiffness the change is that of the logarithm.
    """
    own = {zone.name: soil.materials[zone.material] for zone in soil.zones}
    values = [getattr(own[name], key) for name in zones]
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
