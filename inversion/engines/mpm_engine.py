"""The material point method as a forward engine.

Derivatives are finite differences from one batch of perturbed scenes with common seeds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inversion.engines.read_run import prediction_of, read_start
from inversion.engines.run_store import KeptRun, RunStore
from inversion.estimation.forward import Forward, Prediction, Request


class MPMEngine(Forward):
    """`inversion.estimation.forward.Forward` by the material point method."""

    def __init__(self, store: RunStore) -> None:
        super().__init__()
        self.store = store

    def kept_run(self, request: Request) -> KeptRun:
        """The whole run of a request, for pictures."""
        return self._fetched([request])[0]

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Predictions of all requests as one batch."""
        self.runs += len(requests)
        starts: dict[tuple, np.ndarray] = {}
        found = []
        for request, run in zip(requests, self._fetched(requests), strict=True):
            # Runs that differ in strength alone begin from the same points.
            setup = request.section
            key = (id(setup.targets), tuple(setup.foot.items()), run.initial.tobytes())
            if key not in starts:
                starts[key] = read_start(setup, run)
            found.append(prediction_of(setup, run, starts[key]))
        return found

    def _fetched(self, requests: Sequence[Request]) -> list[KeptRun]:
        return self.store.fetch(
            [(request.scene, request.setup.settings) for request in requests],
            [request.section.reader for request in requests],
        )
