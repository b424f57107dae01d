"""How far a scene lies from those that a model has learned from.

In: scenes before they move. Out: `KnownScenes`, which a model keeps with its weights. A scene is
described by what its two sides look like to a slide (`gns.data.scene_features`) and by its water,
density, stiffness and number of spacings; the distance is that to the nearest scene learned from,
in units in which INSIDE of those have a nearer neighbour.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.survey.columns import SIDES
from gns.data.scene_facts import SOIL, SceneFacts
from gns.data.scene_features import side_view

INSIDE = 0.99
"""The unit of a distance: this share of the scenes learned from have a nearer neighbour."""
FARTHEST = 2.0
"""Beyond this a question is refused unless an answer is asked for all the same."""
LEAST_SPREAD = 0.05
"""Of a number that hardly differs between the scenes learned from."""


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
        scaled = features / spread
        nearest = []
        for number in range(0, len(scaled), 2):
            away = np.sqrt(np.mean((scaled - scaled[number]) ** 2, axis=1))
            away[number : number + 2] = np.inf  # itself and its mirror image
            nearest.append(away.min())
        known = [one for one in nearest if np.isfinite(one)]
        unit = float(np.quantile(known, INSIDE)) if known else 1.0
        return cls(features, spread, max(unit, 1e-6))

    def distance(self, start: np.ndarray, facts: SceneFacts) -> float:
        """Of a scene to the nearest that was learned from; 1: as its outermost scenes."""
        away = (self.features - described(start, facts)[0]) / self.spread
        return float(np.sqrt(np.mean(away**2, axis=1)).min() / self.unit)
