"""Other readings of a question: variants and sensitivities made into setups.

In: a setup and an entry of `inversion.yaml`. Out: changed setups, each with what is different in
words. A scene that a change would break is an `InputError` that names the entry.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic

import numpy as np

from geometry.scenes.scene import MOST_STRENGTH_RATIO, Scene, scene_from_mapping
from geometry.scenes3d.scene3d import Scene3d, Terrain
from inversion.back_analysis.deviations import (
    LEFT_OUT,
    AnySetup,
    Uncertain,
    deviating,
    property_changes,
    with_changes,
)
from inversion.estimation.data import Targets
from inversion.estimation.forward import SectionSetup, Setup
from inversion.estimation.unknowns import Parameters
from inversion.problem.changes import WATER_WORDS, Changes, OtherProperty
from inversion.problem.layers import mean_stresses_kpa
from inversion.problem.question import (
    RESIDUAL_STRENGTH,
    STRENGTH_RATIO,
    STRENGTHS,
    CellSize,
    FixedProperty,
    OtherSetting,
    ParameterSpec,
    ReadOtherwise,
    Sensitivity,
    Target,
    TimeStep,
    UnknownDimension,
    Variant,
    WaterLevel,
    ZoneBoundary,
    calibrated_keys,
    material_key,
    material_keys,
)
from inversion.problem.scene_changes import pool_at
from pipeline.cli import InputError
from pipeline.config import SimulationSettings
from pipeline.units import with_signs

READ_AS = {
    RESIDUAL_STRENGTH: "one strength everywhere in its zones",
    STRENGTH_RATIO: "strength in proportion to the stress before failure",
}
"""How the unknown strengths are read, in words."""

#: What a reading of a section may change, and one of a body may not.
OF_SECTIONS = ("zones", "pool_level_m", "water", "contact", "properties")


@dataclass(frozen=True)
class Changed(Generic[AnySetup]):
    """A setup that differs, and how, in words."""

    setup: AnySetup
    words: str


def vary(
    setup: AnySetup, variant: Variant, targets: Targets[Any], source: str
) -> Changed[AnySetup]:
    """The setup of a variant.

    Args:
        setup: the question's own.
        variant: the changes.
        targets: the measurements of the variant's set, with its choice of what is fitted.
        source: file for messages.
    """
    where = f"{source}: variants: {variant.name}"
    changed = apply_changes(setup, variant, where)
    words = [changed.words] if changed.words else []
    if variant.property is not None:
        changed = Changed(read_as(changed.setup, variant.property, where), changed.words)
        words.append(READ_AS[variant.property])
    if variant.measurements is not None:
        words.append(f"measurements {variant.measurements!r}")
    if variant.fit is not None:
        words.append(f"fitted to {', '.join(variant.fit)}")
    if variant.targets:
        _check_fitted(variant.targets, targets, where)
        try:
            targets = targets.with_values(variant.targets)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        words += [f"{name} {value:g}" for name, value in variant.targets.items()]
    return Changed(replace(changed.setup, targets=targets), ", ".join(words))


def read_as(setup: AnySetup, asked: str, where: str) -> AnySetup:
    """A setup whose unknown strengths are one S_r everywhere, or a strength ratio.

    Values and bounds stay in the unit of the question; they are turned by the mean vertical
    effective stress of the parameter's zones, by the weight above.

    Args:
        setup: of the question, with the other changes of the variant.
        asked: residual_strength_kpa or strength_ratio.
        where: begins messages.

    Raises:
        InputError: no unknown strength is read otherwise, a zone does not liquefy, a bound is too
            high for a ratio, or three dimensions.
    """
    if not isinstance(setup, SectionSetup):
        raise InputError(f"{where}: property: {LEFT_OUT}")
    specs = list(setup.parameters.specs)
    other = RESIDUAL_STRENGTH if asked == STRENGTH_RATIO else STRENGTH_RATIO
    places = [place for place, spec in enumerate(specs) if spec.property == other]
    if not places:
        raise InputError(f"{where}: property: {asked}: the question asks for no {other}")
    gravity = setup.settings.gravity_m_per_s2
    means = mean_stresses_kpa(setup.scene, [specs[place].zones for place in places], gravity)
    for place, mean in zip(places, means, strict=True):
        specs[place] = _read_otherwise(
            setup.scene, specs[place], mean, f"{where}: property: {asked}"
        )
    return replace(setup, parameters=Parameters(specs))


def _read_otherwise(scene: Scene, spec: ParameterSpec, mean: float, where: str) -> ReadOtherwise:
    if spec.property == RESIDUAL_STRENGTH:
        for zone in (zone for zone in scene.zones if zone.name in spec.zones):
            if not scene.materials[zone.material].liquefied:
                raise InputError(
                    f"{where}: the material of zone {zone.name!r} is not marked liquefied: true"
                )
        if spec.high > MOST_STRENGTH_RATIO * mean:
            raise InputError(
                f"{where}: high {spec.high:g} kPa of {spec.name!r} is more than "
                f"{MOST_STRENGTH_RATIO:g} of the mean sigma'_v0, {mean:.3g} kPa"
            )
    return ReadOtherwise(**{**spec.model_dump(), "stress_kpa": mean})


def apply_changes(setup: AnySetup, changes: Changes, where: str) -> Changed[AnySetup]:
    """A setup with another water, base, soil or simulation.

    Raises:
        InputError: beginning with `where`: a zone or parameter that does not exist, water without a
            level, a scene that does not hold together, a change that three dimensions do not have.
    """
    words: list[str] = []
    if isinstance(setup, SectionSetup):
        section, words = _other_section(setup, changes, where)
        setup = replace(
            setup, scene=section.scene, settings=section.settings, parameters=section.parameters
        )
    elif asked := [name for name in OF_SECTIONS if getattr(changes, name)]:
        raise InputError(f"{where}: {', '.join(asked)}: {LEFT_OUT}")
    if changes.simulation:
        settings, how = _simulated(setup.settings, changes.simulation)
        setup = replace(setup, settings=settings)
        words.append(how)
    return Changed(setup, ", ".join(words))


def _other_section(
    setup: SectionSetup, changes: Changes, where: str
) -> tuple[SectionSetup, list[str]]:
    """A section with another water, base or soil, and what is different in words."""
    words = []
    if changes.zones:
        setup = _shared_otherwise(setup, changes.zones, where)
        words += [f"{name} of {', '.join(zones)}" for name, zones in changes.zones.items()]
    scene, settings = setup.scene, setup.settings
    if changes.pool_level_m is not None:
        _refuse_sought_level(setup, f"{where}: pool_level_m")
        level = changes.pool_level_m
        raised = pool_at(scene, level) if scene.has_water else {"water_level": level}
        scene = scene_from_mapping({**scene.model_dump(), **raised}, where)
        words.append(f"pool at {changes.pool_level_m:g} m")
    if changes.water == "none":
        _refuse_sought_level(setup, f"{where}: water: none")
        scene = scene.changed(water_level=None)
        words.append("no water")
    elif changes.water is not None:
        if not scene.has_water:
            raise InputError(f"{where}: water: {changes.water}: the scene has no water_level")
        settings = settings.model_copy(update={"water": changes.water})
        words.append(f"water as {WATER_WORDS[changes.water]}")
    if changes.contact is not None:
        ground = {**scene.ground.model_dump(), "contact": changes.contact}
        ground["friction_coefficient"] = None
        scene = scene.changed(ground=ground)
        words.append(f"base {changes.contact.replace('_', ' ')}")
    if any(one.value is not None for one in changes.properties):
        scene = _other_soil(replace(setup, scene=scene), changes.properties, where)
        words += [_soil_words(one) for one in changes.properties]
    return replace(setup, scene=scene, settings=settings), words


def _shared_otherwise(
    setup: SectionSetup, zones: Mapping[str, Sequence[str]], where: str
) -> SectionSetup:
    """The setup with parameters of other zones, which get the soil of the parameter's first."""
    document = setup.scene.model_dump()
    known = {zone["name"]: zone for zone in document["zones"]}
    specs = list(setup.parameters.specs)
    for name, shared in zones.items():
        places = [place for place, spec in enumerate(specs) if spec.name == name]
        unknown = [zone for zone in shared if zone not in known]
        if not places or unknown or not shared:
            what = f"zones {unknown or shared}" if places else f"parameter {name!r}"
            raise InputError(f"{where}: zones: {what}: not in the case")
        soil = known[specs[places[0]].zones[0]]["material"]
        for zone in shared:
            known[zone]["material"] = soil
        specs[places[0]] = specs[places[0]].model_copy(update={"zones": list(shared)})
    used = {zone["material"] for zone in document["zones"]}
    document["materials"] = {k: v for k, v in document["materials"].items() if k in used}
    return replace(setup, scene=scene_from_mapping(document, where), parameters=Parameters(specs))


def _soil_words(one: OtherProperty) -> str:
    value = "as drawn" if one.value is None else f"{one.value:g}"
    return f"{one.property} {value} in " + (
        f"zones {', '.join(one.zones)}" if one.zones else "all zones"
    )


def _other_soil(setup: SectionSetup, properties: Sequence[OtherProperty], where: str) -> Scene:
    """The scene with other properties, but for what is calibrated; of a zone the last one holds."""
    names = [zone.name for zone in setup.scene.zones]
    calibrated = calibrated_keys(setup.parameters.specs)
    changes: dict[tuple[str, str], float | None] = {}
    for one in properties:
        for zone in one.zones or names:
            if zone not in names:
                raise InputError(
                    f"{where}: properties: no zone {zone!r} in the scene; known are "
                    f"{', '.join(names)}"
                )
            if (zone, one.property) in calibrated:
                raise InputError(f"{where}: properties: {one.property} of {zone} is calibrated")
            changes[zone, one.property] = one.value
    known = [(*key, value) for key, value in changes.items() if value is not None]
    return with_changes(setup.scene, known, f"{where}: properties")


def _simulated(
    settings: SimulationSettings, changes: Mapping[str, Any]
) -> tuple[SimulationSettings, str]:
    """The settings with some changed, and the changes in words."""
    changed = SimulationSettings.model_validate({**settings.model_dump(), **changes})
    words = [f"{name.replace('_', ' ')} {getattr(changed, name)}" for name in changes]
    return changed, ", ".join(words)


def _refuse_sought_level(setup: Setup, where: str) -> None:
    for spec in setup.parameters.specs:
        if spec.property == "water_level":
            raise InputError(f"{where}: the level of the pool is calibrated by {spec.name!r}")


def _check_fitted(names: Iterable[str], targets: Targets, where: str) -> None:
    """Another value of a number that is not fitted would change nothing."""
    for name in names:
        if name in targets.names and not targets.fitted[targets.names.index(name)]:
            fitted = ", ".join(targets.named(targets.measured, targets.fitted))
            raise InputError(f"{where}: targets: {name!r} is not fitted; fitted are {fitted}")


def sides(setup: AnySetup, sensitivity: Sensitivity, source: str) -> list[Changed[AnySetup]]:
    """The setups of a sensitivity: one, or one for each sense of a standard deviation."""
    where = f"{source}: sensitivities: {sensitivity.name}"
    match sensitivity:
        case ZoneBoundary() | WaterLevel() | UnknownDimension() | FixedProperty():
            return _deviation(setup, sensitivity, where)
        case CellSize():
            spacing = setup.scene.spacing * sensitivity.factor
            return [Changed(setup.at_spacing(spacing, where), f"spacing {spacing:.3g} m")]
        case TimeStep():
            return [_time_step(setup, sensitivity, where)]
        case OtherSetting():
            settings, words = _simulated(setup.settings, sensitivity.simulation)
            return [Changed(replace(setup, settings=settings), words)]
        case Target():
            return _target(setup, sensitivity, where)


def _deviation(setup: AnySetup, sensitivity: Uncertain, where: str) -> list[Changed[AnySetup]]:
    """One standard deviation to either side, or to the side that is asked for."""
    senses: tuple[float, ...] = (1.0, -1.0)
    soil = setup.scene.soil if isinstance(setup.scene, Scene3d) else setup.scene
    match sensitivity:
        case ZoneBoundary():
            senses = sensitivity.senses
        case WaterLevel():
            if soil.water_level is None:
                raise InputError(f"{where}: the scene has no water_level")
            _refuse_sought_level(setup, where)
        case FixedProperty():
            _refuse_calibrated(setup, sensitivity, where)
        case UnknownDimension():
            pass
    found = []
    for sense in senses:
        words, what = _deviation_words(soil, sensitivity, sense)
        changed = deviating(setup, [sensitivity], [sense], where + what)
        found.append(Changed(changed, words))
    return found


def _deviation_words(
    soil: Scene | Terrain, sensitivity: Uncertain, sense: float
) -> tuple[str, str]:
    """What is different, and the end of what messages about it begin with."""
    match sensitivity:
        case ZoneBoundary():
            farthest = max(sensitivity.vertices, key=lambda v: np.hypot(*v.move)).move
            dx, dy = (sense * part + 0.0 for part in farthest)
            return f"moved by ({dx:+.3g}, {dy:+.3g}) m", ""
        case WaterLevel():
            assert soil.water_level is not None
            return f"pool at {soil.water_level + sense * sensitivity.std_m:g} m", ""
        case UnknownDimension():
            return f"one standard deviation {'above' if sense > 0 else 'below'} its median", ""
    what = f"{sensitivity.property} {sense * sensitivity.std:+g}"
    words = f"{what} in zones {', '.join(sensitivity.zones)}"
    key = material_key(sensitivity.property)
    changes = property_changes(soil, sensitivity.zones, key, sense * sensitivity.std)
    if sense < 0 and min(value for _, _, value in changes) == 0.0:
        words += ", but not below 0"
    return words, f": {what}"


def _refuse_calibrated(setup: Setup, sensitivity: FixedProperty, where: str) -> None:
    for spec in setup.parameters.specs:
        same = material_key(sensitivity.property) in material_keys(spec.property)
        same |= {sensitivity.property, spec.property} <= set(STRENGTHS)
        if same and set(spec.zones) & set(sensitivity.zones):
            raise InputError(
                f"{where}: {sensitivity.property} there is calibrated by {spec.name!r}"
            )


def _time_step(setup: AnySetup, sensitivity: TimeStep, where: str) -> Changed[AnySetup]:
    settings, factor = setup.settings, sensitivity.factor
    if settings.time_step_s is not None:
        step = settings.time_step_s * factor
        return Changed(
            replace(setup, settings=settings.model_copy(update={"time_step_s": step})),
            f"time step {step:.3g} s",
        )
    courant = settings.courant * factor
    if courant > 0.9:
        raise InputError(
            f"{where}: factor {factor:g} makes simulation.courant {courant:g}; at most 0.9"
        )
    return Changed(
        replace(setup, settings=settings.model_copy(update={"courant": courant})),
        f"courant {courant:g} instead of {settings.courant:g}",
    )


def _target(setup: AnySetup, sensitivity: Target, where: str) -> list[Changed[AnySetup]]:
    """The ends of the stated range, or one standard deviation to either side."""
    targets = setup.targets
    entry = {e.name: e for e in targets.entries}.get(sensitivity.measurement)
    places = [
        number
        for number, group in enumerate(targets.groups)
        if targets.entries[group] is entry and targets.fitted[number]
    ]
    if entry is None or not places:
        fitted = ", ".join(targets.named(targets.measured, targets.fitted))
        raise InputError(
            f"{where}: measurement: {sensitivity.measurement!r} is not fitted; fitted are {fitted}"
        )
    if entry.stated_range is not None:
        low, high = entry.stated_range
        changes = [high - entry.values[0], low - entry.values[0]]
    else:
        changes = [entry.std, -entry.std]
    found = []
    for change in changes:
        measured = targets.measured.copy()
        measured[places] += change
        shown = f"{measured[places[0]]:g}" if len(places) == 1 else f"{change:+g}"
        found.append(
            Changed(
                replace(setup, targets=replace(targets, measured=measured)),
                f"{entry.name} {shown} {with_signs(entry.unit)}",
            )
        )
    return found
