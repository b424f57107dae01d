"""How far a scene lies from those that a model has learned from.

In: scenes before they move. Out: `KnownScenes`, which a model keeps with its weights. A scene is
described by what its two sides look like to a slide (`gns.data.scene_features`) and by its water,
density, stiffness and number of spacings. The distance is that to the nearest scene learned from
(root mean square over the numbers of a description), in units in which INSIDE of those have a
nearer neighbour. A direct model describes its sections otherwise (`gns.direct.predictor`) and
measures alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from geometry.sides import SIDES
from gns.data.scene_facts import SOIL, SceneFacts
from gns.data.scene_features import side_view

INSIDE = 0.99
"""The unit of a distance: this share of the scenes learned from have a nearer neighbour."""
FARTHEST = 2.0
"""Beyond this a question is refused unless an answer is asked for all the same."""
LEAST_SPREAD = 0.05
"""Of a number that hardly differs between the scenes learned from."""
SAME = 1e-4
"""Scenes nearer than this are one and the same [spreads]; descriptions are kept in float32."""
LEAST_UNIT = 1e-6
"""Of a distance, where scenes are copies of each other."""


def described(start: np.ndarray, facts: SceneFacts) -> np.ndarray:
    """A scene in a few dimensionless numbers, and its mirror image, (2, F).

    Args:
        start: positions at t = 0, (N, 2) [m].
        facts: of the scene.
    """
    soil = facts.type == SOIL
    push = float(facts.properties[soil, 3].mean())
    left, right = (side_view(start, facts, side).features for side in SIDES)
    density = float(facts.properties[soil, 2].mean())
    unit = density * facts.gravity * facts.spacing
    height = (start[soil, 1] - facts.ground_height(start[soil, 0])).max()
    common = [
        math.log(max(float(height), facts.spacing) / facts.spacing),
        density / 1000.0,
        math.log(facts.numbers["youngs_modulus"] / unit),
    ]
    return np.array([[-push, *left, *right, *common], [push, *right, *left, *common]])


class Neighbours:
    """Descriptions, and how far from the nearest of them others are.

    Args:
        points: (N, F), numbers that count alike.
    """

    def __init__(self, points: np.ndarray) -> None:
        self._tree = cKDTree(points)

    def distance(self, point: np.ndarray) -> float:
        """From a description (F,) to the nearest."""
        return float(self._tree.query(point)[0]) / self._root

    def unit(self, alike: int = 1) -> float:
        """The distance to the nearest other that INSIDE of them have; 1 where there is no other.

        Args:
            alike: so many in a row describe the same scene and are no others of each other.
        """
        away, found = self._tree.query(self._tree.data, k=range(1, alike + 2))
        own = np.arange(self._tree.n)[:, None] // alike == found // alike
        nearest = np.where(own, np.inf, away).min(axis=1) / self._root
        known = nearest[np.isfinite(nearest)]
        return max(float(np.quantile(known, INSIDE)), LEAST_UNIT) if known.size else 1.0

    @property
    def _root(self) -> float:
        return math.sqrt(self._tree.m)


@dataclass(frozen=True)
class KnownScenes:
    """The scenes that a model has learned from.

    Attributes:
        features: `described`, (2 R, F).
        spread: of each feature, (F,).
        unit: of a distance, in spreads.
    """

    features: np.ndarray
    spread: np.ndarray
    unit: float

    @classmethod
    def of(cls, scenes: Sequence[np.ndarray]) -> KnownScenes:
        """From the descriptions of R scenes, each (2, F)."""
        features = np.concatenate(scenes)
        spread = np.maximum(features.std(axis=0), LEAST_SPREAD)
        return cls(features, spread, Neighbours(features / spread).unit(alike=2))

    def joined(self, scenes: Sequence[np.ndarray]) -> KnownScenes:
        """With the descriptions of more scenes, each (2, F); those that are known count once."""
        new = [one for one in scenes if self._away(one) > SAME]
        pairs = self.features.reshape(-1, 2, self.features.shape[1])
        return KnownScenes.of([*pairs, *new])

    def holds(self, start: np.ndarray, facts: SceneFacts) -> bool:
        """A scene is one of those that were learned from."""
        return self._away(described(start, facts)) <= SAME

    def _away(self, description: np.ndarray) -> float:
        """Of a description (2, F) from the nearest [spreads]."""
        return self._neighbours.distance(description[0] / self.spread)

    def distance(self, start: np.ndarray, facts: SceneFacts) -> float:
        """Of a scene to the nearest that was learned from; 1: as its outermost scenes."""
        return self._away(described(start, facts)) / self.unit

    @cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(self.features / self.spread)
