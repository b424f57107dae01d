"""The water on trial: was there any, how high, and how does it act on the soil?

A section without water may have stood in some: a pool all around it, or one on either side with a
water table that falls to the other foot, which acts as the settings say or in the other form. A
section with water may have had none, its pool may have fallen while the soil was still full, and
its pressure may act otherwise than the settings say. The level of a pool that is known is an effect
of the library (`pool_level`).
"""

from __future__ import annotations

from typing import Any, Literal

from shapely import LineString, Polygon
from shapely.ops import unary_union

from diagnosis.hypotheses.assumption import (
    Assumption,
    Found,
    Sensitivities,
    with_setting,
)
from diagnosis.hypotheses.model import Candidate, switch_of
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.sides import SIDES, Side
from inversion.estimation.forward import SectionSetup
from inversion.problem.scene_changes import SAME_PLACE_M
from pipeline.cli import InputError

NO_WATER, WEIGHT, PRESSURE = "no_water", "water_as_weight", "water_as_pressure"
POOL, DRAWDOWN, FACE = "pool", "drawdown", "other_water_face"

WaterForm = Literal["buoyant", "pore_pressure"]
FORM_NAMES: dict[WaterForm, str] = {"buoyant": "as_weight", "pore_pressure": "as_pressure"}
FORM_WORDS: dict[WaterForm, str] = {
    "buoyant": "the water takes off weight alone, and no pool pushes",
    "pore_pressure": "the water acts by its pressure, and the pool pushes what holds it back",
}

#: Depths that are tried, as shares of the height of the section or of the depth of its pool, each
#: about twice that before; the deepest that is believed. By judgement: a pool stands below the
#: crest.
DEPTHS, DEEPEST = (0.2, 0.4, 0.7), 0.95


def assumptions(setup: SectionSetup, sensitivities: Sensitivities) -> Found:
    """What the water may have been."""
    scene = setup.scene
    if any(spec.property == "water_level" for spec in setup.parameters.specs):
        return [], {POOL: "the level of the pool is calibrated"}
    if not scene.has_water:
        none = {name: "the section has no water" for name in (NO_WATER, WEIGHT, DRAWDOWN, FACE)}
        other: WaterForm = "buoyant" if setup.settings.water == "pore_pressure" else "pore_pressure"
        pools = [_pool(scene, side) for side in (None, *SIDES)]
        # Where the water is level, pressure and reduced weight are one.
        return pools + [_pool(scene, side, other) for side in SIDES], none
    return _forms(setup)


def _pool(scene: Scene, side: Side | None, form: WaterForm | None = None) -> Assumption:
    """A pool where the section has none, as deep as the amplitude says.

    Args:
        scene: without water.
        side: where it stood; None: all around.
        form: how its water acts on the soil; None: as the settings say.
    """
    low, high = scene.extent
    height = high - low
    words = {
        None: "the section stood in water",
        "left": "a pool stood on the left, and the water table fell to the right foot",
        "right": "a pool stood on the right, and the water table fell to the left foot",
    }[side]
    name = POOL if side is None else f"{POOL}_on_the_{side}"
    if form is not None:
        name, words = f"{name}_{FORM_NAMES[form]}", f"{words}; {FORM_WORDS[form]}"
    candidate = Candidate(
        name=name,
        family="water",
        words=words,
        unit="m",
        low=0.0,
        high=DEEPEST * height,
        ladder=tuple(share * height for share in DEPTHS),
    )

    def change(setup: SectionSetup, depth: float) -> SectionSetup:
        own = setup.scene
        level = own.extent[0] + depth
        line = None if side is None else _falling(own, level, side)
        changes = {"water_level": level, "phreatic_line": line}
        setup = setup.with_scene(_changed(own, changes, candidate.name))
        return setup if form is None else with_setting(setup, water=form)

    return Assumption(candidate, change)


def _falling(scene: Scene, level: float, side: Side) -> list[tuple[float, float]] | None:
    """A water table from a pool on one side to the foot of the other; None: it would not fall."""
    shore = _shores(scene, level)
    if shore is None:
        return None
    near = 0 if side == "left" else 1
    foot = scene.foot("right" if side == "left" else "left")
    dry = float(scene.ground.height(foot))
    if dry >= level or abs(foot - shore[near]) <= SAME_PLACE_M:
        return None
    line = [(shore[near], level), (foot, dry)]
    return line if side == "left" else line[::-1]


def _shores(scene: Scene, level: float) -> tuple[float, float] | None:
    """Where a water level meets the section from the left and from the right; None: it does not."""
    left, right = scene.end("left"), scene.end("right")
    outline = unary_union([Polygon(zone.polygon) for zone in scene.zones])
    cut = outline.intersection(LineString([(left - 1.0, level), (right + 1.0, level)]))
    return None if cut.is_empty else (cut.bounds[0], cut.bounds[2])


def _forms(setup: SectionSetup) -> Found:
    """Other forms of the water that the section has."""
    scene, settings = setup.scene, setup.settings
    left_out = {POOL: "the section has water; pool_level moves it"}
    found = [
        Assumption(
            switch_of(NO_WATER, "water", "there was no water"),
            lambda setup, _: setup.with_scene(
                _changed(setup.scene, {"water_level": None}, NO_WATER)
            ),
        )
    ]
    pushes = settings.water == "pore_pressure"
    if not scene.head_falls:
        level = "the water is level: pressure and reduced weight are one"
        left_out |= {WEIGHT: level, PRESSURE: level}
    elif pushes:
        found.append(_setting(WEIGHT, FORM_WORDS["buoyant"], water="buoyant"))
    else:
        found.append(_setting(PRESSURE, FORM_WORDS["pore_pressure"], water="pore_pressure"))
    if pushes and scene.head_falls:
        moves = settings.water_face == "moving"
        words = "the water table stays where it was, whatever moves"
        if not moves:
            words = "the water table moves with the soil"
        found.append(_setting(FACE, words, water_face="fixed" if moves else "moving"))
    fallen = _drawdown(scene)
    if fallen is None:
        left_out[DRAWDOWN] = "no pool stands against the section"
    else:
        found.append(fallen)
    return found, left_out


def _setting(name: str, words: str, **changes: object) -> Assumption:
    return Assumption(switch_of(name, "water", words), lambda s, _: with_setting(s, **changes))


def _drawdown(scene: Scene) -> Assumption | None:
    """The pool had fallen by the amplitude, and the soil behind its shore was still full."""
    sides = [side for side in SIDES if _pool_depth(scene, side) > SAME_PLACE_M]
    if not sides:
        return None
    deepest = max(_pool_depth(scene, side) for side in sides)
    candidate = Candidate(
        name=DRAWDOWN,
        family="water",
        words="the pool had fallen before the slide, and the soil was still full of water",
        unit="m",
        low=0.0,
        high=deepest,
        ladder=tuple(share * deepest for share in DEPTHS),
    )

    def change(setup: SectionSetup, fall: float) -> SectionSetup:
        own = setup.scene
        if own.water_level is None:
            raise InputError(f"{DRAWDOWN}: there is no pool that could have fallen")
        level = own.water_level - fall
        high, low = _shores(own, own.water_level), _shores(own, level)
        line = list(own.phreatic_line or [])
        for side in sides:
            if high is None or low is None:
                break
            line = _drawn_down(own.water_level, line, side, (high, low), level)
        changes: dict[str, Any] = {"water_level": level, "phreatic_line": line or None}
        return setup.with_scene(_changed(own, changes, DRAWDOWN))

    return Assumption(candidate, change)


def _pool_depth(scene: Scene, side: Side) -> float:
    """Depth of the pool at the foot of one side [m]; 0 where the water table lies below it."""
    foot = scene.foot(side)
    level = scene.water_level
    if (
        level is None
        or scene.domain.goes_on(side)
        or float(scene.phreatic_level(foot)) < level - SAME_PLACE_M
    ):
        return 0.0
    return max(level - float(scene.ground.height(foot)), 0.0)


def _drawn_down(
    full: float,
    line: list[tuple[float, float]],
    side: Side,
    shores: tuple[tuple[float, float], tuple[float, float]],
    level: float,
) -> list[tuple[float, float]]:
    """The water table with the pool of one side fallen from `full` to `level` [m].

    It goes from the new shore up to the old one.
    """
    high, low = shores
    if side == "left":
        kept = [(x, y) for x, y in line if x > high[0] + SAME_PLACE_M]
        kept = kept or [(high[1], full)]
        return [(low[0], level), (high[0], full), *kept]
    kept = [(x, y) for x, y in line if x < high[1] - SAME_PLACE_M]
    kept = kept or [(high[0], full)]
    return [*kept, (high[1], full), (low[1], level)]


def _changed(scene: Scene, changes: dict[str, Any], name: str) -> Scene:
    return scene_from_mapping({**scene.model_dump(), **changes}, name)
