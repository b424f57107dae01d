"""A third engine in two files: this one, and the test that registers it.

Every number of a survey falls with the logarithm of the first strength; a weak base adds a pattern
of its own, and another seed of the points a little noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inversion.engine_registry import Engine
from inversion.engines.run_store import RunStore
from inversion.problem.forward import Forward, Prediction, Request

NOISE = 0.01


class FormulaEngine(Forward):
    """`inversion.problem.forward.Forward` by a formula."""

    def __init__(self, store: RunStore) -> None:
        super().__init__()

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        self.runs += len(requests)
        return [_numbers(request) for request in requests]


def _numbers(request: Request) -> Prediction:
    scene, place = request.scene, np.arange(len(request.setup.targets.names))
    numbers = 30.0 - (5.0 + 0.1 * place) * np.log(request.values[0])
    numbers += 8.0 * scene.effects.get("weak_base", 0.0) * np.sin(1.0 + place)
    if scene.jitter:
        numbers += NOISE * np.random.default_rng(scene.seed).standard_normal(len(place))
    unknown = np.full(len(request.values), np.nan)
    return Prediction(numbers, np.zeros(len(place)), sigma_v0_kpa=unknown, sigma_v0_std_kpa=unknown)


FORMULA = Engine(
    name="formula",
    title="formula",
    description="a formula",
    short="formula",
    folder="inversion_formula",
    forward=FormulaEngine,
)
