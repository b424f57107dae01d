"""A family of sections: every dimension of a slide with its distribution, stated or assumed.

A dimension takes a standard score z ~ N(0, 1). Stated with a standard deviation it is lognormal,
value exp(z std / value), so that it stays positive; between two ends, low + (high - low) Phi(z).
The section is a dam on a level base with its slid face on the left and its foot at x = 0, y = 0:
what liquefied lies in its lowest part, from the slid face inward; all other soil is one fill.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from geometry.dimensions.stated import SlideDimensions, StatedNumber
from geometry.random_scenes.embankment_dam import CREST, FACE, FRICTION
from geometry.random_scenes.standing_dam import DENSITY, POOL
from geometry.scenes.scene import Scene

Point = tuple[float, float]
LIQUEFIED, FILL = "liquefied_soil", "fill"

_RANDOM_DAMS = "the range of our random dams, which holds the San Fernando dams and La Marquesa"
_ASSUMED = "assumed"
#: Range of what is not stated, unit and source. A length is a share of the height.
PRIORS: dict[str, tuple[float, float, str]] = {
    "slope_h_per_v": (*FACE, _RANDOM_DAMS),
    "other_slope_h_per_v": (*FACE, _RANDOM_DAMS),
    "crest_width_share": (*CREST, _RANDOM_DAMS),
    "liquefied_share": (0.15, 0.6, f"{_ASSUMED}; 0.32 at Lower San Fernando"),
    "liquefied_reach": (0.5, 1.2, f"{_ASSUMED}; 0.80 at Lower San Fernando"),
    "pool_share": (*POOL, _RANDOM_DAMS),
    "density": (*DENSITY, _RANDOM_DAMS),
    "fill_friction_deg": (*FRICTION, _RANDOM_DAMS),
}
LABELS: dict[str, tuple[str, str]] = {
    "height_m": ("height", "m"),
    "slope_h_per_v": ("slope of the slid face", "h:v"),
    "other_slope_h_per_v": ("slope of the other face", "h:v"),
    "base_width_m": ("width of the base", "m"),
    "crest_width_m": ("width of the crest", "m"),
    "crest_width_share": ("width of the crest", "H"),
    "liquefied_thickness_m": ("thickness of what liquefied", "m"),
    "liquefied_share": ("thickness of what liquefied", "H"),
    "liquefied_reach": ("reach of what liquefied", "of the way to the crest"),
    "pool_m": ("depth of the pool", "m"),
    "pool_share": ("depth of the pool", "H"),
    "density": ("density", "kg/m3"),
    "fill_friction_deg": ("friction of the fill", "deg"),
}
"""Each dimension in words, and its unit; H: heights."""

#: Shares of the height: of soil left beside and above what liquefied, and of a pool's freeboard.
BESIDE, ABOVE, FREEBOARD = 0.15, 0.1, 0.02
#: Reach from which what liquefied lies under the whole dam, and share within which a number is had.
WHOLE_DAM, ALIKE = 1.5, 0.02
#: Where the water of a pool begins and ends to fall, in heights from the middle of the crest.
FALLS = (-0.1, 0.5)
#: Room beside the section in heights, and in runouts.
ROOM, ROOM_RUNOUTS = 4.0, 2.0


@dataclass(frozen=True)
class Dimension:
    """One dimension with its distribution.

    Attributes:
        key: as in the file; lengths that are not stated end in `_share` and are heights.
        low: of the range; of a lognormal three standard deviations below the median.
        high: the same above.
        normal: median and standard deviation of the logarithm; None: all between is alike.
        source: where it comes from, in words.
        stated: it is in the file; else it is a prior.
    """

    key: str
    low: float
    high: float
    normal: tuple[float, float] | None
    source: str
    stated: bool

    @property
    def label(self) -> str:
        """In words."""
        return LABELS[self.key][0]

    @property
    def unit(self) -> str:
        """Of the value; H: heights."""
        return LABELS[self.key][1]

    def at(self, score: float) -> float:
        """The value of a standard score."""
        if self.normal is None:
            return self.low + (self.high - self.low) * float(ndtr(score))
        median, std = self.normal
        return median * math.exp(std * score)

    def score(self, value: float) -> float:
        """The standard score of a value; of what lies outside a range, far out."""
        if self.normal is None:
            share = (value - self.low) / (self.high - self.low)
            return float(ndtri(np.clip(share, 1e-9, 1.0 - 1e-9)))
        median, std = self.normal
        return math.log(value / median) / std


@dataclass(frozen=True)
class SectionFamily:
    """All sections that agree with what is stated of a slide."""

    stated: SlideDimensions

    @cached_property
    def dimensions(self) -> tuple[Dimension, ...]:
        """Those of this family, by key, in the order of the file."""
        return tuple(self._dimension(key) for key in self._keys())

    @property
    def keys(self) -> list[str]:
        """Of the dimensions."""
        return [one.key for one in self.dimensions]

    def __getitem__(self, key: str) -> Dimension:
        return next(one for one in self.dimensions if one.key == key)

    def values(self, scores: Mapping[str, float]) -> dict[str, float]:
        """Value of every dimension; one without a score is at its median."""
        return {one.key: one.at(scores.get(one.key, 0.0)) for one in self.dimensions}

    def has_median(self, scene: Scene) -> bool:
        """A scene is that of the medians."""
        names = {zone.name for zone in scene.zones}
        if names != {LIQUEFIED, FILL} or FILL not in scene.materials:
            return False
        wanted = self.document(scene, {})
        mine = scene.model_dump()
        keys = ("zones", "materials", "water_level", "phreatic_line")
        return all(_alike(wanted[key], mine[key]) for key in keys)

    def document(self, base: Scene, scores: Mapping[str, float]) -> dict[str, Any]:
        """The document of a section of the family; not checked yet.

        Args:
            base: another section of it, which decides names, strengths, domain and spacing.
            scores: of the dimensions by key; one without a score is at its median.
        """
        document, values = base.model_dump(), self.values(scores)
        shape = shape_of(values, self.stated.slid_face)
        for zone in document["zones"]:
            zone["polygon"] = shape.zones[zone["name"]]
        domain = _with_room(document, shape)
        document["water_level"], document["phreatic_line"] = shape.water(domain)
        for soil in document["materials"].values():
            soil["density"] = round(values["density"], 4)
        document["materials"][FILL]["friction_deg"] = round(values["fill_friction_deg"], 4)
        return document

    def doubts(self) -> Iterator[str]:
        """Lines on stated numbers that the median section cannot have; `shape_of` says why."""
        values = self.values({})
        shape = shape_of(values, self.stated.slid_face)
        (inner, thick), (left, right, height) = shape.zones[LIQUEFIED][2], shape.crest
        reach, whole = inner / (0.5 * (left + right)), values["liquefied_reach"] >= WHOLE_DAM
        had: dict[str, float] = {
            "liquefied_thickness_m": thick,
            "liquefied_share": thick / height,
            "liquefied_reach": values["liquefied_reach"] if whole else reach,
            "pool_m": shape.pool_m or 0.0,
            "slope_h_per_v": left / height,
        }
        for key, has in had.items():
            if key not in values or not self[key].stated:
                continue
            if not math.isclose(values[key], has, rel_tol=ALIKE):
                yield f"{key} {values[key]:.3g}: the other numbers leave room for {has:.3g}"

    def _keys(self) -> list[str]:
        given = self.stated

        def first(*keys: str) -> str:
            return next((key for key in keys if getattr(given, key, None) is not None), keys[-1])

        slopes = [first("slope_h_per_v"), first("base_width_m", "other_slope_h_per_v")]
        if given.base_width_m is not None and given.slope_h_per_v is None:
            slopes = ["base_width_m"]  # both faces have the slope that it leaves
        pool = [] if given.slid_face == "dry" else [first("pool_m", "pool_share")]
        return [
            "height_m",
            *slopes,
            first("crest_width_m", "crest_width_share"),
            first("liquefied_thickness_m", "liquefied_share"),
            "liquefied_reach",
            *pool,
            "density",
            "fill_friction_deg",
        ]

    def _dimension(self, key: str) -> Dimension:
        stated: StatedNumber | None = getattr(self.stated, key, None)
        if stated is None:
            low, high, source = PRIORS[key]
            return Dimension(key, low, high, None, f"not stated: {source}", stated=False)
        source = ", ".join(filter(None, (stated.how, stated.source)))
        if stated.value is None:
            return Dimension(key, *stated.ends, None, source, stated=True)
        std = stated.deviation / stated.value
        ends = [stated.value * math.exp(3.0 * sign * std) for sign in (-1.0, 1.0)]
        return Dimension(key, ends[0], ends[1], (stated.value, std), source, stated=True)


@dataclass(frozen=True)
class Shape:
    """Outlines of a section of a family [m].

    Attributes:
        zones: by name.
        crest: x of its left and right end, y.
        pool_m: level of the pool; None: no water.
        pool_first: the pool is on the side of the slid face.
    """

    zones: dict[str, list[Point]]
    crest: tuple[float, float, float]
    pool_m: float | None
    pool_first: bool

    def water(self, domain: Mapping[str, Any]) -> tuple[float | None, list[Point] | None]:
        """Level and phreatic line from end to end of a domain; none without a pool.

        The line falls through the middle of the dam from a pool at the slid face, whose shell is
        then full of water; a pool behind seeps to the slid foot.
        """
        if self.pool_m is None:
            return None, None
        left, right, height = self.crest
        middle = 0.5 * (left + right)
        level = self.pool_m
        if self.pool_first:
            falls = [
                (middle + share * height, y) for share, y in zip(FALLS, (level, 0.0), strict=True)
            ]
        else:
            falls = [(0.0, 0.0), (middle - FALLS[0] * height, level)]
        ends = (falls[0][1], falls[-1][1])
        return level, _rounded([(domain["x_min"], ends[0]), *falls, (domain["x_max"], ends[1])])


def _with_room(document: dict[str, Any], shape: Shape) -> dict[str, Any]:
    """The domain of a document, which a section that is wider or higher makes larger."""
    domain = document["domain"]
    foot, height = shape.zones[FILL][1][0], shape.crest[2]
    wide = max(domain["x_max"], math.ceil(foot + height))
    if wide > domain["x_max"]:
        *level, (_, y) = document["ground"]["points"]
        document["ground"] = {**document["ground"], "points": [*level, (float(wide), y)]}
    domain |= {"x_max": float(wide), "y_max": max(domain["y_max"], math.ceil(1.5 * height))}
    return domain


def shape_of(values: Mapping[str, float], slid_face: str) -> Shape:
    """The section of values of all dimensions.

    What cannot be is taken as the nearest that can: soil is left above and beside what liquefied,
    and the pool stays below the crest.
    """
    height = values["height_m"]
    crest = _length(values, "crest_width", height)
    slid, other = _slopes(values, crest)
    left, right = slid * height, slid * height + crest
    base = right + other * height
    thick = min(_length(values, "liquefied", height), (1.0 - ABOVE) * height)
    beside = BESIDE * height
    # Under the whole dam the zone still ends inside the other face.
    inner = values["liquefied_reach"] * 0.5 * (left + right)
    inner = min(max(inner, slid * thick + beside), base - other * thick - beside)
    thick = min(thick, max(inner - beside, 0.0) / slid)
    pool = None
    if slid_face != "dry":
        pool = min(_length(values, "pool", height), (1.0 - FREEBOARD) * height)
    face = (slid * thick, thick)
    return Shape(
        {
            LIQUEFIED: _rounded([(0.0, 0.0), (inner, 0.0), (inner, thick), face]),
            FILL: _rounded(
                [(inner, 0.0), (base, 0.0), (right, height), (left, height), face, (inner, thick)]
            ),
        },
        (left, right, height),
        None if pool is None else round(pool, 4),
        slid_face == "upstream",
    )


def _length(values: Mapping[str, float], name: str, height: float) -> float:
    """A length that is stated in m or drawn in heights."""
    share = values.get(f"{name}_share")
    if share is not None:
        return share * height
    return values[next(key for key in (f"{name}_m", f"{name}_thickness_m") if key in values)]


def _slopes(values: Mapping[str, float], crest: float) -> tuple[float, float]:
    """Of the slid and of the other face, at least 0.3 horizontal per vertical."""
    if "base_width_m" not in values:
        return values["slope_h_per_v"], values["other_slope_h_per_v"]
    both = max((values["base_width_m"] - crest) / values["height_m"], 0.6)
    slid = values.get("slope_h_per_v", 0.5 * both)
    return slid, max(both - slid, 0.3)


def _rounded(points: Sequence[Point]) -> list[Point]:
    return [(round(x, 4), round(y, 4)) for x, y in points]


def _alike(one: Any, other: Any) -> bool:
    """Parts of two documents are the same, numbers to within a millimetre or its like."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-3)
    return bool(one == other)
