"""Where nothing moves at the start, lower all liquefied strengths until something does.

On a slope that stands, the runout does not depend on the strength and its derivative says nothing.
So, before the first iteration, the strengths that are sought are multiplied by one factor after the
other of a geometric series until a fitted number differs from what it was before the slide by two
spacings (iteration 0).
"""

from __future__ import annotations

import numpy as np

from inversion.search import Look, Search
from pipeline.cli import WorkFailed

#: Ratio of the series, and runs of one batch: as many as there are usually processor cores.
RATIO, BATCH = 0.8, 2


def moves(search: Search, look: Look, least_m: float) -> bool:
    """A fitted number differs by more than `least_m` from what it was before the slide."""
    mask = search.objective.targets.fitted
    change = look.prediction.values[mask] - look.prediction.at_start[mask]
    return bool(np.any(np.abs(change) > least_m))


def scan(search: Search, start: np.ndarray, least_m: float) -> Look:
    """Lower the strengths geometrically until something moves; return the best look that moves.

    Args:
        search: told of every run, as iteration 0.
        start: values (p,) at which nothing moves.
        least_m: how much must move [m].

    Raises:
        WorkFailed: no strength is sought, or nothing moves at the lowest bounds either.
    """
    parameters = search.objective.parameters
    strengths = parameters.strengths
    if not strengths.any():
        raise WorkFailed(
            "nothing moves at the start, and no strength (cohesion_kpa) is sought that could be "
            "lowered; give the parameters weaker starts"
        )
    best: Look | None = None
    factor = 1.0
    while best is None:
        trials = []
        for _ in range(BATCH):
            factor *= RATIO
            values = np.where(strengths, start * factor, start)
            trials.append(parameters.clipped(values))
        for values, prediction in zip(trials, search.engine.predict(trials), strict=True):
            look = search.record(values, "scan", 0, prediction)
            moved = not prediction.failed and moves(search, look, least_m)
            if moved and (best is None or look.loss < best.loss):
                best = look
        lowest = np.all(trials[-1][strengths] <= parameters.low[strengths])
        if best is None and (lowest or search.exhausted):
            weakest = ", ".join(
                f"{name} {value:.3g}"
                for name, value in zip(parameters.names, trials[-1], strict=True)
            )
            raise WorkFailed(
                f"nothing moves by {least_m:g} m, not even at {weakest}; lower the bounds, or "
                "check section and water"
            )
    return best
