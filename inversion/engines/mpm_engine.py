"""The material point method as a forward engine.

Derivatives are finite differences from one batch of perturbed scenes with common seeds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inversion.engines.run_store import KeptRun, RunStore
from inversion.engines.setup import Setup, prediction_of, read_start
from inversion.problem.forward import Forward, Prediction


class MPMEngine(Forward):
    """`inversion.problem.forward.Forward` by the material point method."""

    def __init__(self, setup: Setup, store: RunStore) -> None:
        super().__init__(setup)
        self.store = store

    def kept_run(self, values: np.ndarray) -> KeptRun:
        """The whole run of a parameter vector, for pictures."""
        return self.store.fetch([(self.scene(values), self.setup.settings)], [self.setup.reader])[0]

    def predict_each(self, requests: Sequence[tuple[Forward, np.ndarray]]) -> list[Prediction]:
        """One parameter vector for each of several engines, as one batch."""
        engines: list[MPMEngine] = [engine for engine, _ in requests]
        wanted = [(engine.scene(values), engine.setup.settings) for engine, values in requests]
        runs = self.store.fetch(wanted, [engine.setup.reader for engine in engines])
        for engine in engines:
            engine.runs += 1
        starts: dict[tuple, np.ndarray] = {}
        found = []
        for engine, run in zip(engines, runs, strict=True):
            # Runs that differ in strength alone begin from the same points.
            setup = engine.setup
            key = (id(setup.targets), tuple(setup.foot.items()), run.initial.tobytes())
            if key not in starts:
                starts[key] = read_start(engine.setup, run)
            found.append(prediction_of(engine.setup, run, starts[key]))
        return found
