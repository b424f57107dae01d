"""The ground on trial: how soil and base meet, and where the base and the foreland lie.

A base is drawn through few borings, a foreland often level because no map shows more, and an
obstacle that the slide has buried is on no plan. The base below the section moves between the feet
only, where nobody sees it; the zones that stand on it reach down, or end, where it then lies. A
base that is weaker than the soil on it is an effect of the library (`weak_base`, by a share), of
the same family; where the base is stated as bonded it is tried on one that was not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from diagnosis.hypotheses.assumption import (
    LEVEL_STD,
    RUNGS,
    WORST_KNOWN_M,
    AnySetup,
    Assumption,
    Found,
    Sensitivities,
    possible,
)
from diagnosis.hypotheses.model import Candidate, switch_of
from diagnosis.hypotheses.physics import candidate_of
from geometry.scenes.scene import Ground, Point, Scene, scene_from_mapping
from geometry.scenes3d.scene3d import Terrain
from geometry.sides import SIDES, Side
from inversion.estimation.forward import SectionSetup
from mpm_taichi.effects import effect

BONDED, ROUGH, FRICTION, COEFFICIENT = (
    "bonded_base",
    "rough_base",
    "base_of_friction",
    "base_friction",
)
WEAK, UNBONDED = "weak_base", "weak_unbonded_base"
LEVEL, TILT, FORELAND, BUMP = "base_level", "base_tilt", "foreland", "bump"

#: Coulomb coefficient from which `base_of_friction` takes its share: a rough base under dry sand,
#: tan 31 deg.
STRONGEST = 0.6
#: Shares of it that are tried: coefficients of 0.42, 0.24 and 0.09, each about half of that before.
SHARES = (0.3, 0.6, 0.85)
#: One standard deviation where nothing is known, by judgement: of the base's rise between the feet,
#: as a share of the section's height, about that of a difference of two levels; of the slope of a
#: foreland, 1.7 deg; of a coefficient, as a share, like that of a strength (`soil.SHARES`).
TILT_STD, FORELAND_STD, COEFFICIENT_STD = 0.1, 0.03, 0.25
#: The base takes up its new place over this share of the section's length from either foot. By
#: judgement: over less it has a step that holds a slide back, over 0.5 nothing lies at the new
#: place.
FADE = 0.15
#: A foreland slopes over this many heights of the section, and is level beyond. By judgement: about
#: as far as a slide runs; without an end it would leave the domain.
FORELAND_LENGTH = 6.0
#: Where the top of a bump lies beyond the foot, in heights: each twice as far as that before.
BUMP_PLACES = {"close_to": 0.5, "near": 1.0, "far_from": 2.0}
#: Its heights that are tried, in heights of the section, and the highest [m]; run of its faces over
#: their rise. By judgement: a slide does not bury, unseen, what is much higher.
BUMP_HEIGHTS, HIGHEST_BUMP_M, BUMP_FACE = (0.1, 0.2, 0.35), 5.0, 2.0
#: Factor between the distances that are tried, three of which make one of the given twice as far,
#: and how many there are from 0.3 to 3 heights.
BUMP_STEP, BUMPS = 1.25, 11
_BUMP = re.compile(rf"{BUMP}_(\d+(?:\.\d+)?)_m_before_the_(left|right)_foot")
#: A vertex nearer to the base than this stands on it [m]: finer than drawings are, and no rounding.
ON_BASE_M = 1e-3


def assumptions(setup: SectionSetup, sensitivities: Sensitivities) -> Found:
    """What the ground may have been."""
    scene = setup.scene
    found = [*contacts(scene.ground), *_below(scene)]
    for side in _sides(setup):
        found += _beyond(scene, side)
    kept, left_out = [], {}
    for one in found:
        candidate = one.candidate
        rungs = tuple(rung for rung in candidate.ladder if possible(one, setup, rung))
        if not rungs:
            left_out[candidate.name] = f"at {scene.spacing:g} m spacing no section has it"
            continue
        if rungs != candidate.ladder:  # the base would cut through a layer, say
            low, high = min(0.0, *rungs, 0.0), max(0.0, *rungs, 0.0)
            candidate = replace(candidate, ladder=rungs, low=low, high=high)
        kept.append(replace(one, candidate=candidate))
    return kept, left_out


def contacts(ground: Ground | Terrain) -> list[Assumption]:
    """Other contacts of soil and ground than that of a section or a terrain."""
    bonded = switch_of(BONDED, "ground", "the soil was bonded to its base")
    rough = switch_of(ROUGH, "ground", "the soil slipped on its base by its own strength")
    contact = ground.contact
    if contact == "coulomb":
        own = float(ground.friction_coefficient or 0.0)
        found = [_contact(bonded, "no_slip"), _contact(rough, "rough")]
        return [*found, _coefficient(own)] if own > 0.0 else found
    friction = Candidate(
        name=FRICTION,
        family="ground",
        words=f"the base resisted by friction alone, with a coefficient of {STRONGEST:g} (1 - a)",
        unit="",
        low=0.0,
        high=1.0,
        ladder=SHARES,
    )
    slipping: Assumption = Assumption(
        friction, lambda s, a: _touching(s, "coulomb", STRONGEST * (1.0 - a))
    )
    if contact == "rough":
        return [_contact(bonded, "no_slip"), slipping]
    return [_contact(rough, "rough"), _unbonded(), slipping]


def _unbonded() -> Assumption:
    """A base that is stated as bonded was not, and is weaker than the soil on it.

    Bonded ground has no strength that `weak_base` could lower.
    """
    weak = candidate_of(effect(WEAK), {})
    words = f"the base was not bonded, and {weak.words}"
    candidate = replace(weak, name=UNBONDED, words=words)

    def change(setup: SectionSetup, share: float) -> SectionSetup:
        rough = _touching(setup, "rough")
        effects = {**rough.scene.effects, WEAK: share}
        return rough.with_scene(rough.scene.changed(effects=effects))

    return Assumption(candidate, change)


def _contact(candidate: Candidate, contact: str) -> Assumption:
    return Assumption(candidate, lambda setup, _: _touching(setup, contact))


def _coefficient(own: float) -> Assumption:
    """Another coefficient of a Coulomb base; the amplitude is the difference."""
    std = COEFFICIENT_STD * own
    candidate = Candidate(
        name=COEFFICIENT,
        family="ground",
        words="the friction of the base is another",
        unit="",
        low=-own,
        high=2.0 * own,
        ladder=_both_signs(std),
        prior_mean=0.0,
        prior_std=std,
        screened=True,
    )
    return Assumption(candidate, lambda s, a: _touching(s, "coulomb", max(own + a, 0.0)))


def _touching(setup: AnySetup, contact: str, coefficient: float | None = None) -> AnySetup:
    changes, soil = {"contact": contact, "friction_coefficient": coefficient}, setup.soil
    if isinstance(soil, Terrain):
        return setup.with_soil(soil.model_copy(update=changes))
    return setup.with_soil(soil.changed(ground=soil.ground.model_dump() | changes))


def _below(scene: Scene) -> list[Assumption]:
    """The base between the feet, higher or lower, or tilted."""
    height = scene.height
    shapes = {
        LEVEL: (LEVEL_STD, (1.0, 1.0), "the base below the section lies higher (below 0: lower)"),
        TILT: (
            TILT_STD,
            (-0.5, 0.5),
            "the base below the section rises to the right "
            "(below 0: to the left), by the amplitude from foot to foot",
        ),
    }
    found = []
    for name, (share, ends, words) in shapes.items():
        std = min(share * height, WORST_KNOWN_M)
        candidate = Candidate(
            name=name,
            family="ground",
            words=words,
            unit="m",
            low=-RUNGS[-1] * std,
            high=RUNGS[-1] * std,
            ladder=_both_signs(std),
            prior_mean=0.0,
            prior_std=std,
            screened=True,
        )
        found.append(Assumption(candidate, _moved_base(candidate.name, ends)))
    return found


def _moved_base(
    name: str, ends: tuple[float, float]
) -> Callable[[SectionSetup, float], SectionSetup]:
    """The base between the feet moved by the amplitude times `ends`, from left to right [m]."""

    def change(setup: SectionSetup, amplitude: float) -> SectionSetup:
        left, right = setup.scene.end("left"), setup.scene.end("right")
        fade = FADE * (right - left)
        knots = [
            (left, 0.0),
            (left + fade, ends[0] * amplitude),
            (right - fade, ends[1] * amplitude),
            (right, 0.0),
        ]
        # The lattice goes with the base: ground between lines of nodes holds a slide back more.
        rise = amplitude * (ends[0] + ends[1]) / 2.0
        return setup.with_scene(with_base(setup.scene, knots, name, lattice_rise=rise))

    return change


def _beyond(scene: Scene, side: Side) -> list[Assumption]:
    """The ground beyond a foot: sloped, or with a bump."""
    height = scene.height
    foot, outward = scene.foot(side), -1.0 if side == "left" else 1.0

    def sloped(setup: SectionSetup, slope: float) -> SectionSetup:
        length = FORELAND_LENGTH * height
        knots = [(foot, 0.0), (foot + outward * length, slope * length)]
        return setup.with_scene(with_base(setup.scene, sorted(knots), FORELAND))

    found = [
        Assumption(
            Candidate(
                name=f"{FORELAND}_on_the_{side}",
                family="ground",
                words=f"the ground before the {side} foot rises outwards (below 0: falls)",
                unit="",
                low=-2.0 * RUNGS[-1] * FORELAND_STD,
                high=2.0 * RUNGS[-1] * FORELAND_STD,
                ladder=_both_signs(FORELAND_STD),
                prior_mean=0.0,
                prior_std=FORELAND_STD,
                screened=True,
            ),
            sloped,
        )
    ]
    return found + [
        _bump(scene, side, heights * height, f"{BUMP}_{where}_the_{side}_foot")
        for where, heights in BUMP_PLACES.items()
    ]


def _bump(scene: Scene, side: Side, distance: float, name: str) -> Assumption:
    """A ridge whose top lies at a distance [m] before a foot."""
    height = scene.height
    top = scene.foot(side) + (-distance if side == "left" else distance)

    def raised(setup: SectionSetup, rise: float) -> SectionSetup:
        half = BUMP_FACE * rise
        knots = [(top - half, 0.0), (top, rise), (top + half, 0.0)]
        return setup.with_scene(with_base(setup.scene, knots, BUMP))

    scale = min(height, HIGHEST_BUMP_M / BUMP_HEIGHTS[-1])
    high = distance / BUMP_FACE
    rises = (share * scale for share in BUMP_HEIGHTS)
    candidate = Candidate(
        name=name,
        family="ground",
        words=f"a ridge or a buttress stood {distance:.3g} m before the {side} foot",
        unit="m",
        low=0.0,
        high=high,
        ladder=tuple(rise for rise in rises if rise <= high),
        screened=True,
        placed=BUMPS,
    )
    return Assumption(candidate, raised)


def bump_at(scene: Scene, name: str) -> Assumption | None:
    """The ridge that a name such as `bump_17_m_before_the_left_foot` gives; None: no such name."""
    found = _BUMP.fullmatch(name)
    if found is None:
        return None
    return _bump(scene, _side_of(found[2]), float(found[1]), name)


def _side_of(word: str) -> Side:
    return "left" if word == "left" else "right"


def neighbours(scene: Scene, name: str) -> list[str]:
    """Ridges a step nearer to the foot and farther from it; none where `name` is no ridge."""
    height = scene.height
    given = {
        f"{BUMP}_{where}_the_{side}_foot": (share * height, side)
        for where, share in BUMP_PLACES.items()
        for side in ("left", "right")
    }
    found = _BUMP.fullmatch(name)
    if name not in given and found is None:
        return []
    distance, side = given[name] if found is None else (float(found[1]), found[2])
    return [
        f"{BUMP}_{distance * factor:.3g}_m_before_the_{side}_foot"
        for factor in (BUMP_STEP, 1.0 / BUMP_STEP)
    ]


def _sides(setup: SectionSetup) -> tuple[Side, ...]:
    """Sides with bare ground to which the slide ran, as far as measurements say; else both."""
    named = {getattr(entry, "side", None) for entry in setup.targets.entries}
    bare = tuple(side for side in SIDES if not setup.scene.domain.goes_on(side))
    return tuple(side for side in bare if side in named) or bare


def _both_signs(std: float) -> tuple[float, ...]:
    return tuple(sorted(sign * rung * std for sign in (-1.0, 1.0) for rung in RUNGS))


def with_base(
    scene: Scene, knots: Sequence[Point], name: str, *, lattice_rise: float = 0.0
) -> Scene:
    """The scene with its ground line higher by `knots`, (x, rise) [m], linear between them.

    Zones that stand on the ground reach down to where it then lies; what lies below it is cut off.
    Points and grid count from where they did, or from `lattice_rise` [m] above: another lattice
    would make another slide of the same section.

    Raises:
        InputError: there is no such section.
    """
    place, rise = np.array(knots).T
    x = np.unique([*place, *(x for x, _ in scene.ground.points)])
    y = scene.ground.height(x) + np.interp(x, place, rise)
    line = list(zip(x.tolist(), y.tolist(), strict=True))
    document = scene.model_dump()
    document["ground"]["points"] = line
    document["lattice_from_y"] = scene.lattice_y + lattice_rise
    left, right = scene.end("left"), scene.end("right")
    if np.any((x > left) & (x < right) & (np.abs(y - scene.ground.height(x)) > 0.0)):
        rock = _rock(scene, line)
        for zone in document["zones"]:
            zone["polygon"] = _standing(scene, zone, rock)
    return scene_from_mapping(document, name)


def _rock(scene: Scene, line: Sequence[Point]) -> shapely.Polygon:
    """What lies below a ground line, far enough down and out."""
    far = 10.0 * (scene.end("right") - scene.end("left"))
    ends = [(line[0][0] - far, line[0][1]), *line, (line[-1][0] + far, line[-1][1])]
    deep = min(y for _, y in line) - far
    return shapely.Polygon([*ends, (ends[-1][0], deep), (ends[0][0], deep)])


def _standing(scene: Scene, zone: dict[str, Any], rock: shapely.Polygon) -> list[Point]:
    """The polygon of a zone on new ground."""
    corners = [tuple(corner) for corner in zone["polygon"]]
    deep = rock.bounds[1]
    parts = [shapely.Polygon(corners)]
    for begin, end in zip(corners, [*corners[1:], corners[0]], strict=True):
        middle = (0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1]))
        on_base = [
            abs(y - float(scene.ground.height(x))) < ON_BASE_M for x, y in (begin, middle, end)
        ]
        if all(on_base) and begin[0] != end[0]:
            parts.append(shapely.Polygon([begin, end, (end[0], deep), (begin[0], deep)]))
    above = shapely.set_precision(shapely.union_all(parts).difference(rock), 1e-6)
    largest = max(shapely.get_parts(above), key=lambda part: part.area, default=None)
    if largest is None or largest.is_empty:
        return corners  # refused: it lies below the ground
    return [(float(x), float(y)) for x, y in largest.exterior.coords[:-1]]
