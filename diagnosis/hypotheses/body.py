"""What is put on trial of a body in three dimensions: the assumptions that its solver takes.

Other soils, contacts with the base and stresses at the start are those of a section. The water of
a terrain is level. Strength may differ between the zones of one parameter, and between thirds of
them in plan. The solver has no effects, and a drawn boundary or base stays where it is.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from diagnosis.hypotheses import ground, soil, start, water
from diagnosis.hypotheses.assumption import (
    RUNGS,
    Assumption,
    Found,
    Sensitivities,
    possible,
    slug,
)
from diagnosis.hypotheses.model import Candidate, switch_of
from diagnosis.hypotheses.strength import ALONG, CONTRAST, CONTRAST_STD, Span
from geometry.scenes3d.scene3d import PlanZone, Terrain, overlap, plan_domain
from inversion.back_analysis.deviations import LEFT_OUT
from inversion.engines.body_setup import BodySetup
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO, WaterLevel, ZoneBoundary
from mpm_taichi.effects import effect, effects
from pipeline.cli import InputError

POOL_LEVEL = "pool_level"
#: One standard deviation of the level of a pool where nothing is known [m]: of old cases it is
#: known to 0.5 to 2 m (`mpm_taichi.effects.pool_level`).
POOL_STD = 1.0
#: What the thirds of the liquefied soil across x are called.
ACROSS = ("small_y", "middle_y", "large_y")


def assumptions(setup: BodySetup, sensitivities: Sensitivities) -> Found:
    """What may be otherwise, in the order in which it acts, and what three dimensions lack."""
    section, terrain = setup.scene.section, setup.scene.document.terrain
    touched = terrain if section is None else section.ground
    assert touched is not None  # a document has a section or a terrain
    stresses, left_out = start.stresses(setup)
    contacts = [one for one in ground.contacts(touched) if one.candidate.name != ground.UNBONDED]
    pools = [] if terrain is None else _water(setup, terrain, sensitivities)
    soils, _ = soil.assumptions(setup, sensitivities)
    found = [*contacts, *pools, *soils, *_parts(setup), *stresses]
    known = {one.candidate.name for one in found}
    left_out |= {name: LEFT_OUT for name in effects() if name not in known}
    boundaries = [one for one in sensitivities if isinstance(one, ZoneBoundary)]
    return found, left_out | {f"boundary_{slug(one.name)}": LEFT_OUT for one in boundaries}


def _water(setup: BodySetup, terrain: Terrain, sensitivities: Sensitivities) -> list[Assumption]:
    """No water, another level, or a pool where a terrain has none."""

    def at(setup: BodySetup, level: float | None) -> BodySetup:
        assert isinstance(setup.soil, Terrain)
        if setup.soil.water_level != own:
            raise InputError(f"{POOL_LEVEL}: there is no water")
        return setup.with_soil(setup.soil.model_copy(update={"water_level": level}))

    height, own = setup.problem.position[:, 2], terrain.water_level
    low, deep = float(height.min()), float(np.ptp(height))
    if own is None:
        pool = Candidate(
            name=water.POOL,
            family="water",
            words="the body stood in water",
            unit="m",
            low=0.0,
            high=water.DEEPEST * deep,
            ladder=tuple(share * deep for share in water.DEPTHS),
        )
        return [Assumption(pool, lambda s, depth: at(s, low + depth))]
    stated = [one.std_m for one in sensitivities if isinstance(one, WaterLevel)]
    std = stated[0] if stated else POOL_STD
    level = Candidate(
        name=POOL_LEVEL,
        family="water",
        words="the water stood at another level",
        unit="m",
        low=-RUNGS[-1] * std,
        high=RUNGS[-1] * std,
        ladder=tuple(sorted(sign * rung * std for sign in (-1.0, 1.0) for rung in RUNGS)),
        prior_mean=0.0,
        prior_std=std,
        screened=True,
    )
    none = switch_of(water.NO_WATER, "water", "there was no water")
    return [
        Assumption(none, lambda s, _: at(s, None)),
        Assumption(level, lambda s, rise: at(s, own + rise)),
    ]


def _parts(setup: BodySetup) -> list[Assumption]:
    """Zones, and thirds of the liquefied soil in plan, with another strength than the rest."""
    asked = [
        list(spec.zones)
        for spec in setup.parameters.specs
        if spec.property in (RESIDUAL_STRENGTH, STRENGTH_RATIO)
    ]
    found = []
    for zones in asked:
        # Of two zones one is enough: the other is weaker where it is stronger.
        for zone in zones if len(zones) > 2 else zones[: len(zones) - 1]:
            words = f"zone {zone} is stronger or weaker than the rest of its soil"
            found.append(_part(f"contrast_of_{slug(zone)}", words, {zone: None}))
    liquid = [zone for zones in asked for zone in zones]
    if not isinstance(setup.soil, Terrain) or not liquid:
        return found
    for axis, names in enumerate((ALONG, ACROSS)):
        spans = _thirds(setup, liquid, axis)
        for name, span in zip(names, spans, strict=True) if spans else ():
            third = f"third at {name.replace('_', ' ')}" if axis else f"{name} third"
            words = f"the {third} of the liquefied soil is stronger or weaker"
            stretch = f"{name}_stretch", f"{words} than the rest"
            one = _part(*stretch, {zone: (axis, span) for zone in liquid})
            if possible(one, setup, 0.1):
                found.append(one)
    return found


def _thirds(setup: BodySetup, zones: list[str], axis: int) -> list[Span]:
    """Intervals of x or y [m] that each hold a third of some zones; none: they are too narrow.

    They end between columns of points, which then stand where they did.
    """
    place = setup.problem.position[_within(setup, zones), axis]
    domain, step = plan_domain(setup.scene), setup.scene.spacing
    low, high = domain[2 * axis : 2 * axis + 2]
    cuts = low + step * np.round((np.quantile(place, (1 / 3, 2 / 3)) - low) / step)
    ends = [low - step, *cuts.tolist(), high + 2.0 * step]
    spans = list(zip(ends[:-1], ends[1:], strict=True))
    held = [np.any((place > a) & (place < b)) for a, b in spans]
    return spans if all(held) else []


def _within(setup: BodySetup, zones: list[str]) -> np.ndarray:
    """(N,) bool: points of some zones."""
    names = [zone.name for zone in setup.soil.zones]
    return np.isin(setup.problem.zone, [names.index(zone) for zone in zones])


Place = tuple[int, Span] | None
"""Axis in plan and an interval of it [m]; None: all of a zone."""


def _part(name: str, words: str, places: dict[str, Place]) -> Assumption:
    """Another strength where `places` say, by zone."""
    ladder = effect(CONTRAST).amplitude.ladder
    candidate = Candidate(
        name=name,
        family="strength",
        words=words,
        unit=effect(CONTRAST).amplitude.unit,
        low=effect(CONTRAST).amplitude.low,
        high=effect(CONTRAST).amplitude.high,
        ladder=tuple(sorted([*ladder, *(-rung for rung in ladder)])),
        prior_mean=0.0,
        prior_std=CONTRAST_STD,
        screened=True,
    )

    def change(setup: BodySetup, size: float) -> BodySetup:
        if setup.factors:
            raise InputError(f"{name}: another part has its own strength already")
        for zone, place in places.items():
            setup = _stronger(setup, zone, place, math.exp(size), name)
        _ = setup.problem  # every part holds points
        return setup

    return Assumption(candidate, change)


def _stronger(setup: BodySetup, zone: str, place: Place, factor: float, name: str) -> BodySetup:
    """A zone, or what lies of it in an interval, with `factor` times the strength."""
    parts = [zone]
    if place is not None:
        axis, (low, high) = place
        own = setup.problem.position[_within(setup, [zone]), axis]
        inside = (own > low) & (own < high)
        if not inside.any():
            return setup
        if not inside.all():
            setup, parts = _cut(setup, zone, f"{name} of {zone}", axis, (low, high))
    return replace(setup, factors={**setup.factors, **dict.fromkeys(parts, factor)})


def _cut(
    setup: BodySetup, zone: str, part: str, axis: int, span: Span
) -> tuple[BodySetup, list[str]]:
    """A zone of which `part` takes what lies in an interval; the names of all its pieces."""
    scene, terrain = setup.scene, setup.soil
    assert isinstance(terrain, Terrain) and scene.ground is not None
    number = [one.name for one in terrain.zones].index(zone)
    whole, ends = terrain.zones[number], list(overlap(scene))
    ends[2 * axis : 2 * axis + 2] = span
    plan: shapely.Geometry = shapely.box(ends[0], ends[2], ends[1], ends[3])
    if whole.plan is not None:
        plan = shapely.intersection(plan, shapely.Polygon(whole.plan))
    pieces = [one for one in shapely.get_parts(plan) if isinstance(one, shapely.Polygon)]
    names = [f"{part} {place}".removesuffix(" 1") for place in range(1, len(pieces) + 1)]
    corners = [list(one.exterior.coords)[:-1] for one in pieces]
    zones = [
        PlanZone(**{**whole.model_dump(), "name": name, "plan": plan})
        for name, plan in zip(names, corners, strict=True)
    ]
    limits = scene.ground.limits
    document = terrain.model_copy(
        update={"zones": [*terrain.zones[:number], *zones, *terrain.zones[number:]]}
    )
    limits = (*limits[:number], *[limits[number]] * len(zones), *limits[number:])
    scene = replace(scene.with_soil(document), ground=replace(scene.ground, limits=limits))
    specs = [
        spec.model_copy(update={"zones": [*spec.zones, *names]}) if zone in spec.zones else spec
        for spec in setup.parameters.specs
    ]
    return replace(setup, scene=scene, parameters=Parameters(specs)), names
