"""A third engine in two files: this one, and the test that registers it.

Every number of a survey falls with the logarithm of the first strength; a weak base adds a pattern
of its own, and another seed of the points a little noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inversion.engine_registry import Engine
from inversion.engines.run_store import RunStore
from inversion.engines.setup import Setup
from inversion.problem.forward import Forward, Prediction

NOISE = 0.01


class FormulaEngine(Forward):
    """`inversion.problem.forward.Forward` by a formula."""

    def __init__(self, setup: Setup, store: RunStore) -> None:
        super().__init__(setup)

    def predict_each(self, requests: Sequence[tuple[Forward, np.ndarray]]) -> list[Prediction]:
        return [engine._one(np.asarray(values, dtype=float)) for engine, values in requests]

    def _one(self, values: np.ndarray) -> Prediction:
        self.runs += 1
        scene = self.scene(values)
        place = np.arange(len(self.names))
        numbers = 30.0 - (5.0 + 0.1 * place) * np.log(values[0])
        numbers += 8.0 * scene.effects.get("weak_base", 0.0) * np.sin(1.0 + place)
        if scene.jitter:
            numbers += NOISE * np.random.default_rng(scene.seed).standard_normal(len(place))
        unknown = np.full(len(values), np.nan)
        return Prediction(
            numbers, np.zeros(len(place)), sigma_v0_kpa=unknown, sigma_v0_std_kpa=unknown
        )


FORMULA = Engine(
    name="formula",
    title="formula",
    description="a formula",
    short="formula",
    folder="inversion_formula",
    forward=FormulaEngine,
)
