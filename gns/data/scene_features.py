"""A scene in a dozen dimensionless numbers, as a slide to one side sees it.

In: facts and positions at t = 0. Out: what the baselines of `gns.evaluation.baselines` predict a
runout from. The length is the root of the soil's area: it depends neither on the spacing nor on how
a section happens to be cut. A slide to the left is the mirror image of one to the right, so every
scene counts twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry.sides import Side
from gns.data.scene_facts import SOIL, SceneFacts

NAMES = (
    "height",  # of the highest point over the ground at the foot
    "width",  # of the section
    "centre_height",  # of the centre of mass over the ground at the foot
    "centre_distance",  # from the centre of mass to the foot
    "face",  # height over distance from the foot to the crest
    "strength",  # log of the mean strength along the base over rho g length
    "weakest",  # the same of the weakest fifth of the soil
    "mean_strength",  # the same of all soil
    "liquefied",  # share of the soil without friction
    "buoyancy",  # mean weight under water over weight in air
    "speed_outward",  # mean velocity over sqrt(g length)
    "speed_upward",
    "fall",  # of the ground, from below the centre of mass to a length beyond the foot
    "wall",  # distance from the foot to the wall, at most FARTHEST_WALL
)
"""Names of the features, lengths in roots of the soil's area."""

LEAST_STRENGTH = 1e-3
"""Strengths are taken as at least this [rho g length], for the logarithm."""

FARTHEST_WALL = 6.0
"""A wall that is farther away [lengths] makes no difference."""

BASE = 0.1
"""Soil within this many lengths of the ground is its base."""


@dataclass(frozen=True)
class SideView:
    """A scene, seen by a slide to one side.

    Attributes:
        features: in the order of NAMES.
        length: root of the soil's area [m].
        block_travel: travel of a sliding block, `sliding_block`, in lengths.
    """

    features: np.ndarray
    length: float
    block_travel: float


def side_view(start: np.ndarray, facts: SceneFacts, side: Side) -> SideView:
    """Features of the ground ahead of a slide to `side`.

    Args:
        start: positions at t = 0, (N, 2) [m].
        facts: of the scene.
        side: left or right.
    """
    soil = facts.type == SOIL
    outward = -1.0 if side == "left" else 1.0
    x, y = outward * start[soil, 0].astype(float), start[soil, 1].astype(float)
    tangent, cohesion, density, _, weight = facts.properties[soil, :5].astype(float).T
    factor = -weight
    speed = facts.initial_velocity[soil].astype(float)
    length = math.sqrt(soil.sum()) * facts.spacing
    height = y - facts.ground_height(outward * x)
    foot = float(x.max()) + 0.5 * facts.spacing
    centre = np.array([x.mean(), y.mean()])
    level = float(facts.ground_height(outward * foot))
    crest = float(x[y > y.max() - 0.5 * facts.spacing].max())  # its outer edge
    unit = density * facts.gravity * length
    strength = (cohesion + tangent * factor * density * facts.gravity * _cover(x, y, facts)) / unit
    base = height < BASE * length
    walls = facts.numbers
    wall = walls["x_max"] - foot if outward > 0 else -foot - walls["x_min"]
    ends = facts.ground_height(outward * np.array([centre[0], foot + length]))
    resistance = _mean_log(strength[base]) if base.any() else _mean_log(strength)
    features = {
        "height": (y.max() - level) / length,
        "width": (x.max() - x.min()) / length,
        "centre_height": (centre[1] - level) / length,
        "centre_distance": (foot - centre[0]) / length,
        "face": (y.max() - level) / max(foot - crest, facts.spacing),
        "strength": resistance,
        "weakest": _mean_log(np.sort(strength)[: max(len(strength) // 5, 1)]),
        "mean_strength": _mean_log(strength),
        "liquefied": np.mean(tangent == 0.0),
        "buoyancy": factor.mean(),
        "speed_outward": outward * speed[:, 0].mean() / math.sqrt(facts.gravity * length),
        "speed_upward": speed[:, 1].mean() / math.sqrt(facts.gravity * length),
        "fall": (ends[0] - ends[1]) / length,
        "wall": FARTHEST_WALL if walls["walls_open"] else min(wall / length, FARTHEST_WALL),
    }
    values = np.array([features[name] for name in NAMES], dtype=float)
    return SideView(values, length, sliding_block(features))


def sliding_block(features: dict[str, float]) -> float:
    """Travel of a block that slides out on its base until friction has used up its energy.

    The centre of mass falls from its height to half of it, with its speed on top; the strength S
    along the base holds against it: s S / (rho g h) = dz + v^2 / (2 g), h the mean thickness (area
    over width) and rho g that of the weight under water. All in lengths.

    Args:
        features: by name; strength as a logarithm.
    """
    thickness = 1.0 / max(features["width"], 1e-3)
    resistance = math.exp(features["strength"]) / thickness / max(features["buoyancy"], 0.1)
    fall = max(0.5 * features["centre_height"] + features["fall"], 0.0)
    energy = fall + 0.5 * max(features["speed_outward"], 0.0) ** 2
    return energy / max(resistance, 1e-2)


def _cover(x: np.ndarray, y: np.ndarray, facts: SceneFacts) -> np.ndarray:
    """Height of soil over each point [m]: of the points in its own column, (N,)."""
    column = np.floor(x / facts.spacing).astype(int)
    order = np.lexsort((-y, column))
    above = np.empty(len(x))
    first = np.r_[True, np.diff(column[order]) != 0]
    start = np.maximum.accumulate(np.where(first, np.arange(len(x)), 0))
    above[order] = (np.arange(len(x)) - start) * facts.spacing
    return above


def _mean_log(strength: np.ndarray) -> float:
    """Logarithm of the mean strength [rho g length]."""
    return math.log(max(float(strength.mean()), LEAST_STRENGTH))
