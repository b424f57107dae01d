"""A forward engine of one's own: a formula, which needs no simulation.

Every measured number falls with the logarithm of the first strength; a weak base adds a pattern of
its own, and another seed of the points a little noise. Use it with

    from inversion.engines.registry import register_engine
    register_engine(FORMULA)
    flowslide.back_analyse("my_dam", engine="formula")
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inversion.engines.registry import Engine
from inversion.engines.run_store import RunStore
from inversion.estimation.forward import Forward, Prediction, Request

NOISE = 0.01


class FormulaEngine(Forward):
    """`inversion.estimation.forward.Forward` by a formula."""

    def __init__(self, store: RunStore) -> None:
        super().__init__()  # a formula keeps no runs in the store

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """All requests, one after the other."""
        self.runs += len(requests)
        return [predicted(request) for request in requests]


def predicted(request: Request) -> Prediction:
    """The measured numbers of one request, in the order of its targets."""
    scene, place = request.scene, np.arange(len(request.setup.targets.names))
    numbers = 30.0 - (5.0 + 0.1 * place) * np.log(request.values[0])
    numbers += 8.0 * scene.effects.get("weak_base", 0.0) * np.sin(1.0 + place)
    if scene.jitter:
        numbers += NOISE * np.random.default_rng(scene.seed).standard_normal(len(place))
    unknown = np.full(len(request.values), np.nan)  # vertical stress before failure
    return Prediction(numbers, np.zeros(len(place)), sigma_v0_kpa=unknown, sigma_v0_std_kpa=unknown)


FORMULA = Engine(
    name="formula",
    title="formula",
    description="a formula",
    short="formula",
    folder="inversion_formula",
    forward=FormulaEngine,
)
