"""What can be hidden in a slide by another code: one thing missing of every family, and strangers.

A thing has an amplitude and perhaps further numbers; it acts through one or more of: the scene, the
cohesion of the particles, a force on them, the contact with the ground, the start, or the survey.
A verdict is right if it names one of the thing's `right` candidates or one of its `families` (of
physical effects the name: each is a law of its own); a stranger has no family. `alike` are
candidates with the stranger's own law, which explain it in other words.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from shapely.geometry import Point as Place
from shapely.geometry import Polygon
from shapely.ops import unary_union

from geometry.scenes.overburden import WATER_DENSITY
from geometry.scenes.scene import Scene, scene_from_mapping
from pipeline.cli import InputError
from pipeline.random_numbers import Stream

if TYPE_CHECKING:
    from benchmarks.hidden_effects.foreign.loading import Loading, Moment

#: Families of hypotheses; a thing of none of them is a stranger.
FAMILIES = ("physics", "water", "soil", "strength", "ground", "section", "survey", "start")
GRAVITY, KPA = 9.81, 1e3


@dataclass(frozen=True)
class Hidden:
    """A thing that is hidden, with its size.

    Attributes:
        name: of `THINGS`.
        amplitude: in the thing's unit.
        numbers: further numbers of it.
    """

    name: str
    amplitude: float
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def entry(self) -> dict[str, float]:
        """As a truth has it."""
        return {"amplitude": self.amplitude, **self.numbers}

    @classmethod
    def of(cls, name: str, entry: Mapping[str, float]) -> Hidden:
        """From the entry of a truth."""
        numbers = {key: value for key, value in entry.items() if key != "amplitude"}
        return cls(name, entry["amplitude"], numbers)


def _same_scene(scene: Scene, one: Hidden) -> Scene:
    return scene


def _same_cohesion(
    one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray
) -> np.ndarray:
    return cohesion


def _no_force(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    return np.zeros((len(loading.points), 2))


@dataclass(frozen=True)
class Thing:
    """A thing that can be hidden.

    Attributes:
        name: of it; words: what it is, for tables; unit: of its amplitude.
        sizes: ranges of amplitudes from which one is drawn, each as likely.
        right: candidates of a diagnosis whose name is right.
        families: of hypotheses whose name is right; empty: a stranger.
        alike: candidates with a stranger's own law.
        applies: why it cannot act on a scene; empty: it can.
        numbers: further numbers, drawn for a scene.
        scene: the scene with it.
        cohesion: that of the particles with it, from that without; changes: with time.
        acceleration: force per mass on the particles.
        base_share: of the ground's strength that is left.
        settled: the section has settled before the liquefaction.
        later: added after the first four sets, whose plans do not deal it.
        survey: change of surveyed elevations at places x [m] within (first, last), [m].
    """

    name: str
    words: str
    unit: str
    sizes: Sequence[tuple[float, float]]
    right: frozenset[str] = frozenset()
    families: frozenset[str] = frozenset()
    alike: frozenset[str] = frozenset()
    applies: Callable[[Scene], str] = lambda scene: ""
    numbers: Callable[[Scene, Stream], dict[str, float]] = lambda scene, stream: {}
    scene: Callable[[Scene, Hidden], Scene] = _same_scene
    cohesion: Callable[[Hidden, Loading, Moment, np.ndarray], np.ndarray] = _same_cohesion
    changes: bool = False
    acceleration: Callable[[Hidden, Loading, Moment], np.ndarray] = _no_force
    base_share: Callable[[Hidden], float] = lambda one: 1.0
    settled: bool = True
    later: bool = False
    survey: Callable[[Hidden, np.ndarray], np.ndarray] | None = None

    @property
    def stranger(self) -> bool:
        """No hypothesis is about it."""
        return not self.families

    def draw(self, scene: Scene, stream: Stream) -> Hidden:
        """One of random size."""
        low, high = self.sizes[stream.integer(0, len(self.sizes) - 1)]
        numbers = {k: round(v, 4) for k, v in self.numbers(scene, stream).items()}
        return Hidden(self.name, float(f"{stream.uniform(low, high):.4g}"), numbers)


def check(one: Hidden, scene: Scene) -> None:
    """Refuse what cannot be hidden in a scene.

    Raises:
        InputError: unknown, or it cannot act; one line.
    """
    if one.name not in THINGS:
        raise InputError(f"hidden: {one.name!r} is unknown; known: {', '.join(THINGS)}")
    reason = THINGS[one.name].applies(scene)
    if reason:
        raise InputError(f"hidden: {one.name}: {reason}")


# --- the section's own numbers ---


def liquefied_extent(scene: Scene) -> tuple[float, float]:
    """Ends of the liquefied soil before the slide [m]."""
    x = [x for zone in scene.zones if scene.materials[zone.material].liquefied
         for x, _ in zone.polygon]  # fmt: skip
    return min(x), max(x)


def outward(scene: Scene) -> tuple[float, float]:
    """The foot towards which the slide runs [m], and the direction from it, -1 or 1."""
    first, last = liquefied_extent(scene)
    left = first - scene.foot("left") < scene.foot("right") - last
    left = left and scene.domain.walls == "open"  # a wall is not a foot
    return (scene.foot("left"), -1.0) if left else (scene.foot("right"), 1.0)


def height(scene: Scene) -> float:
    """Of the section above its lowest ground [m]."""
    return scene.extent[1] - scene.ground.lowest


def _beyond_foot(loading: Loading, moment: Moment) -> np.ndarray:
    foot, sign = outward(loading.scene)
    return (moment.position[:, 0] - foot) * sign


def _has_no_water(scene: Scene) -> str:
    return "the section has water already" if scene.has_water else ""


def _head_falls(scene: Scene) -> str:
    return "" if scene.head_falls else "the water level is the same everywhere"


# --- physics ---


def _viscous(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """S = S_r + eta g'."""
    return cohesion + np.where(loading.liquefied, one.amplitude * KPA * moment.rate, 0.0)


def _softens(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """S = S_r (1 + a exp(-g / g_r))."""
    more = one.amplitude * np.exp(-moment.strain / one.numbers["reference_strain"])
    return np.where(loading.liquefied, cohesion * (1.0 + more), cohesion)


def _pulse(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    """Inertia in the frame of ground that shakes by A cos(2 pi f (t - D/2)) in a Hann window D."""
    duration = one.numbers["duration_s"]
    since = moment.time / duration
    size = 0.0
    if 0.0 < since < 1.0:
        wave = np.cos(2.0 * np.pi * one.numbers["frequency_hz"] * (moment.time - 0.5 * duration))
        size = -one.amplitude * GRAVITY * np.sin(np.pi * since) ** 2 * wave
    return np.tile([size, 0.0], (len(loading.points), 1))


def _spreads(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """Soil that has not yet liquefied has `excess` times S_r more; a front runs from the foot."""
    first, last = liquefied_extent(loading.scene)
    _, sign = outward(loading.scene)
    x = loading.points.position[:, 0]
    way = (last - x if sign > 0.0 else x - first) / (last - first)
    waiting = loading.liquefied & (moment.time < one.amplitude * way)
    return np.where(waiting, cohesion * (1.0 + one.numbers["excess"]), cohesion)


# --- water ---


def _pool(scene: Scene, one: Hidden) -> Scene:
    """A pool and a table of the same level, a share of the height above the lowest ground."""
    level = scene.ground.lowest + one.amplitude * height(scene)
    return scene.changed(water_level=round(level, 3), phreatic_line=None)


def _thrust(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    """The horizontal part of -grad u, u = rho_w g (h(x) - y), for a line that stays."""
    x, y = moment.position.T
    scene, cell = loading.scene, loading.scene.cell_size
    fall = (scene.phreatic_level(x - 0.5 * cell) - scene.phreatic_level(x + 0.5 * cell)) / cell
    share = np.clip((scene.phreatic_level(x) - y) / cell + 0.5, 0.0, 1.0)
    push = one.amplitude * GRAVITY * WATER_DENSITY / loading.density * share * fall
    return np.column_stack([push, np.zeros_like(push)])


# --- other soils ---


def _changed_soil(scene: Scene, number: int, **factors: float) -> Scene:
    """The scene with properties of the soil of one zone, and of it alone, multiplied."""
    document = scene.model_dump()
    zone = document["zones"][number]
    soil = dict(document["materials"][zone["material"]])
    for name, factor in factors.items():
        if soil.get(name) is not None:
            soil[name] *= factor
    others = [z["material"] for k, z in enumerate(document["zones"]) if k != number]
    name = f"{zone['material']}_hidden" if zone["material"] in others else zone["material"]
    document["materials"][name] = soil
    zone["material"] = name
    return scene_from_mapping(document, scene.name)


def _other_zones(scene: Scene) -> list[int]:
    """Zones that did not liquefy, by their area, the largest first."""
    areas = {
        k: Polygon(zone.polygon).area
        for k, zone in enumerate(scene.zones)
        if not scene.materials[zone.material].liquefied
    }
    return sorted(areas, key=lambda k: -areas[k])


def _some_zone(scene: Scene, stream: Stream) -> dict[str, float]:
    large = _other_zones(scene)[:3]
    return {"zone": float(large[stream.integer(0, len(large) - 1)])}


def _soil_strength(scene: Scene, one: Hidden) -> Scene:
    """tan(phi) and c of a zone, times the amplitude."""
    number = int(one.numbers["zone"])
    soil = scene.materials[scene.zones[number].material]
    angle = np.degrees(np.arctan(one.amplitude * np.tan(soil.friction_rad)))
    factor = angle / soil.friction_deg if soil.friction_deg else 1.0
    return _changed_soil(scene, number, friction_deg=factor, cohesion_kpa=one.amplitude)


def _soil_density(scene: Scene, one: Hidden) -> Scene:
    """Density of a zone, times the amplitude."""
    a = one.amplitude
    return _changed_soil(scene, int(one.numbers["zone"]), density=a, saturated_density=a)


def _no_other_zone(scene: Scene) -> str:
    return "" if _other_zones(scene) else "there is no soil that did not liquefy"


# --- strength within the zone ---


def _block_place(scene: Scene, stream: Stream) -> dict[str, float]:
    first, last = liquefied_extent(scene)
    width = stream.uniform(0.15, 0.3)
    begin = stream.uniform(0.15, 0.85 - width)
    end = begin + width
    return {"from_m": first + begin * (last - first), "to_m": first + end * (last - first)}


def _block(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """S = a S_r in a block of the liquefied soil; it moves with the soil."""
    x = loading.points.position[:, 0]
    inside = loading.liquefied & (x > one.numbers["from_m"]) & (x < one.numbers["to_m"])
    return np.where(inside, one.amplitude * cohesion, cohesion)


def _depth(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """S = S_r (1 - a + a sigma'_v0 / its mean)."""
    own = loading.liquefied
    ratio = loading.overburden / loading.overburden[own].mean()
    share = np.maximum(1.0 - one.amplitude + one.amplitude * ratio, 0.02)
    return np.where(own, share * cohesion, cohesion)


def _layers(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """S = S_r (1 + a) in the lower half of the liquefied soil, S_r / (1 + a) above."""
    own, y = loading.liquefied, loading.points.position[:, 1]
    deep = y < np.median(y[own])
    share = np.where(deep, 1.0 + one.amplitude, 1.0 / (1.0 + one.amplitude))
    return np.where(own, share * cohesion, cohesion)


# --- ground and section ---


def _bump_place(scene: Scene, stream: Stream) -> dict[str, float]:
    return {"beyond_foot_m": stream.uniform(0.3, 1.0) * height(scene)}


def _bump(scene: Scene, one: Hidden) -> Scene:
    """A ridge of the ground beyond the foot, as high as the amplitude, with slopes of 1 : 2."""
    foot, sign = outward(scene)
    begin, rise = foot + sign * one.numbers["beyond_foot_m"], 2.0 * one.amplitude
    x = np.array([begin, begin + sign * rise, begin + 2.0 * sign * rise])
    y = scene.ground.height(x) + np.array([0.0, one.amplitude, 0.0])
    return _with_ground(scene, x, y)


def _foreland(scene: Scene, one: Hidden) -> Scene:
    """The ground beyond the foot rises outward (negative: falls) with this slope for 6 heights."""
    foot, sign = outward(scene)
    x = np.array([foot, foot + sign * 6.0 * height(scene)])
    y = scene.ground.height(x) + np.array([0.0, one.amplitude * 6.0 * height(scene)])
    return _with_ground(scene, x, y, sign)


def _with_ground(scene: Scene, x: np.ndarray, y: np.ndarray, sign: float = 0.0) -> Scene:
    """The ground through further points; with a sign none of the old ones beyond the first."""
    old = [p for p in scene.ground.points if not sign or (p[0] - x[0]) * sign <= 0.0]
    points = {**dict(old), **dict(zip(x.tolist(), y.tolist(), strict=True))}
    far = scene.domain.x_max if sign > 0.0 else scene.domain.x_min
    if sign and (x[-1] - far) * sign < 0.0:
        points[far] = float(y[-1])
    ground = scene.ground.model_dump() | {"points": sorted(points.items())}
    return scene.changed(ground=ground)


def _boundary(scene: Scene, one: Hidden) -> Scene:
    """The top of the liquefied soil lies higher by the amplitude: vertices within the outline."""
    outline = unary_union([Polygon(zone.polygon) for zone in scene.zones]).exterior
    liquid = {p for z in scene.zones if scene.materials[z.material].liquefied for p in z.polygon}
    walls = (scene.domain.x_min, scene.domain.x_max) if scene.domain.walls == "closed" else ()
    base = scene.ground.height
    moved = {
        (x, y): (x, y + one.amplitude)
        for x, y in liquid
        if y > float(base(x)) + 0.1 and (x in walls or outline.distance(Place(x, y)) > 0.1)
    }
    if not moved:
        raise InputError(f"hidden: {one.name}: no boundary of liquefied soil lies within")
    document = scene.model_dump()
    for zone in document["zones"]:
        zone["polygon"] = [moved.get(tuple(p), tuple(p)) for p in zone["polygon"]]
    return scene_from_mapping(document, scene.name)


# --- strangers ---


def _regains(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """S = S_r (1 + a sqrt(t / 10 s))."""
    more = 1.0 + one.amplitude * np.sqrt(max(moment.time, 0.0) / 10.0)
    return np.where(loading.liquefied, more * cohesion, cohesion)


def _foreland_drag(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    """A resistance of a kN/m3 beyond the foot, against the motion; gentle below 0.1 m/s."""
    speed = np.linalg.norm(moment.velocity, axis=1)
    size = np.where(_beyond_foot(loading, moment) > 0.0, one.amplitude * KPA / loading.density, 0.0)
    return -moment.velocity * (size / np.maximum(speed, 0.1))[:, None]


def _wave(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    """A push of a g outward on all soil, from 2 to 6 s, as the half of a sine."""
    share = np.sin(np.pi * np.clip((moment.time - 2.0) / 4.0, 0.0, 1.0))
    _, sign = outward(loading.scene)
    return np.tile([one.amplitude * GRAVITY * sign * share, 0.0], (len(loading.points), 1))


def _turbulent(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    """A force of a |v| v per mass on all that moves; a in 1/m."""
    return -one.amplitude * np.linalg.norm(moment.velocity, axis=1)[:, None] * moment.velocity


def _slips_as_it_moves(
    one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray
) -> np.ndarray:
    """S = S_r / (1 + a |v|), a in s/m."""
    speed = np.linalg.norm(moment.velocity, axis=1)
    return np.where(loading.liquefied, cohesion / (1.0 + one.amplitude * speed), cohesion)


def _upwelling(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    """A force of a g upward on the liquefied soil, that fades within 10 s."""
    size = one.amplitude * GRAVITY * np.clip(1.0 - moment.time / 10.0, 0.0, 1.0)
    up = np.where(loading.liquefied, size, 0.0)
    return np.column_stack([np.zeros_like(up), up])


def _mixes(one: Hidden, loading: Loading, moment: Moment, cohesion: np.ndarray) -> np.ndarray:
    """S = S_r (1 + a d / H) of soil that has travelled d from its place, H the section's height."""
    way = np.linalg.norm(moment.position - loading.points.position, axis=1)
    more = 1.0 + one.amplitude * way / height(loading.scene)
    return np.where(loading.liquefied, more * cohesion, cohesion)


def _aftershock(one: Hidden, loading: Loading, moment: Moment) -> np.ndarray:
    """Shaking of a g at 1 Hz from 8 to 14 s."""
    since = (moment.time - 8.0) / 6.0
    size = 0.0
    if 0.0 < since < 1.0:
        size = -(np.sin(np.pi * since) ** 2) * np.cos(2.0 * np.pi * (moment.time - 8.0))
    return np.tile([one.amplitude * GRAVITY * size, 0.0], (len(loading.points), 1))


def _right(*names: str) -> frozenset[str]:
    return frozenset(names)


THINGS: dict[str, Thing] = {
    one.name: one
    for one in (
        Thing("viscosity", "liquefied soil is viscous", "kPa s", [(8.0, 40.0)],
              _right("bingham", "rate_strengthening"), _right("physics"),
              cohesion=_viscous, changes=True),
        Thing("softening", "liquefied soil softens as it shears", "", [(0.5, 2.0)],
              _right("strain_softening"), _right("physics"),
              numbers=lambda scene, stream: {"reference_strain": stream.uniform(0.2, 0.6)},
              cohesion=_softens, changes=True),
        Thing("shaking", "the ground shakes during the flow", "g", [(0.2, 0.5)],
              _right("shaking"), _right("physics"),
              numbers=lambda scene, stream: {
                  "frequency_hz": stream.uniform(0.6, 1.4),
                  "duration_s": stream.uniform(6.0, 12.0)},
              acceleration=_pulse),
        Thing("spreading_liquefaction", "liquefaction spreads from the foot", "s", [(4.0, 15.0)],
              _right("late_liquefaction", "spreading_liquefaction"), _right("physics", "start"),
              numbers=lambda scene, stream: {"excess": stream.uniform(1.5, 4.0)},
              cohesion=_spreads, changes=True),
        Thing("pool", "a pool and a table where the section has none", "of the height",
              [(0.3, 0.7)], _right(), _right("water"), applies=_has_no_water, scene=_pool),
        Thing("thrust", "the thrust of the pool", "", [(0.7, 1.3)],
              _right(), _right("water"), applies=_head_falls, acceleration=_thrust),
        Thing("soil_strength", "another zone is weaker or stronger", "times",
              [(0.35, 0.65), (1.5, 2.5)], _right(), _right("soil"), applies=_no_other_zone,
              numbers=_some_zone, scene=_soil_strength),
        Thing("soil_density", "the density of a zone is another", "times",
              [(0.75, 0.85), (1.15, 1.25)], _right(), _right("soil"),
              numbers=_some_zone, applies=_no_other_zone, scene=_soil_density),
        Thing("strong_block", "a block of the liquefied soil is strong", "times", [(2.5, 6.0)],
              _right("strength_contrast"), _right("strength"), numbers=_block_place,
              cohesion=_block),
        Thing("weak_block", "a block of the liquefied soil is weak", "times", [(0.15, 0.45)],
              _right("strength_contrast"), _right("strength"), numbers=_block_place,
              cohesion=_block),
        Thing("depth", "strength grows with depth", "", [(0.5, 1.0)],
              _right("overburden_strength"), _right("strength"), cohesion=_depth),
        Thing("two_layers", "a strong layer lies under a weak one", "", [(0.3, 0.8)],
              _right("overburden_strength"), _right("strength"), cohesion=_layers),
        Thing("weak_base", "the contact with the ground is weak", "", [(0.4, 0.8)],
              _right("weak_base"), _right("ground"), base_share=lambda one: 1.0 - one.amplitude),
        Thing("bump", "a ridge lies beyond the foot", "m", [(1.5, 4.0)],
              _right(), _right("ground"), numbers=_bump_place, scene=_bump),
        Thing("foreland", "the ground beyond the foot is not level", "",
              [(-0.06, -0.03), (0.03, 0.06)], _right(), _right("ground"), scene=_foreland),
        Thing("boundary", "the top of the liquefied soil lies elsewhere", "m",
              [(-3.5, -1.5), (1.5, 3.0)], _right(), _right("section"), scene=_boundary),
        Thing("datum", "all surveyed elevations are too high", "m", [(-2.0, -0.8), (0.8, 2.0)],
              _right("datum_shift"), _right("survey"),
              survey=lambda one, share: np.full(share.shape, one.amplitude)),
        Thing("tilt", "the levelling line is tilted", "m", [(-2.0, -0.8), (0.8, 2.0)],
              _right("datum_tilt"), _right("survey"),
              survey=lambda one, share: one.amplitude * share),
        Thing("sudden", "the section had not settled before it liquefied", "", [(1.0, 1.0)],
              _right(), _right("start"), settled=False),
        Thing("regaining", "liquefied soil regains strength with time", "", [(0.5, 2.0)],
              cohesion=_regains, changes=True, alike=_right("strength_in_time")),
        Thing("foreland_drag", "something beyond the foot resists", "kN/m3", [(0.5, 2.0)],
              acceleration=_foreland_drag, alike=_right("water_drag", "weak_base")),
        Thing("wave", "a push outward a few seconds later", "g", [(0.05, 0.15)],
              acceleration=_wave, alike=_right("shaking")),
        Thing("turbulence", "a resistance with the square of the speed", "1/m", [(0.02, 0.1)],
              acceleration=_turbulent, alike=_right("water_drag", "rate_strengthening")),
        # Two of the strangers above are in the library since; as what can be named.
        Thing("draining", "liquefied soil drains and regains strength", "", [(0.5, 2.0)],
              _right("reconsolidation"), _right("physics"), cohesion=_regains, changes=True,
              later=True),
        Thing("obstacles", "obstacles beyond the foot", "kN/m3", [(0.5, 2.0)],
              _right("obstacles"), _right("ground"), acceleration=_foreland_drag, later=True),
        Thing("speed_weakening", "liquefied soil is weaker the faster it moves", "s/m",
              [(0.1, 0.5)], cohesion=_slips_as_it_moves, changes=True, later=True),
        Thing("upwelling", "water that wells up lifts the liquefied soil", "g", [(0.15, 0.4)],
              acceleration=_upwelling, later=True),
        Thing("mixing", "liquefied soil regains strength on its way", "", [(0.15, 0.6)],
              cohesion=_mixes, changes=True, later=True),
        Thing("aftershock", "the ground shakes again during the flow", "g", [(0.3, 0.8)],
              acceleration=_aftershock, later=True),
    )
}  # fmt: skip
