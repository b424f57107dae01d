"""Where nothing moves at the start, lower all unknown strengths until something does.

On a slope that stands, the runout does not depend on the strength and its derivative says nothing.
So, before the first iteration, the strengths are multiplied by one factor after the other of a
geometric series until the toes have moved by two spacings (iteration 0), and the search begins from
the best of these runs.

A search can also end in the wrong valley: below some strength the whole slope has gone, and weaker
soil hardly changes where it lies. A search that ends far from the data therefore looks around once,
over all strengths between the bounds, and goes on from the best place if there is a better one.
"""

from __future__ import annotations

import numpy as np

from inversion.estimation.search import Evaluation, Search
from pipeline.cli import WorkFailed

#: Ratio of the series, and runs of one batch: as many as there are usually processor cores.
RATIO, BATCH = 0.8, 2
#: Ratio of the strengths that are tried when a search looks around, and how many at most.
AROUND_RATIO, AROUND_MOST = 1.25, 24


def moved(
    search: Search, evaluation: Evaluation, least_m: float, since: np.ndarray | None = None
) -> np.ndarray:
    """Which fitted numbers differ by more than `least_m` from before the slide, (k,) bool.

    Args:
        search: the problem.
        evaluation: where.
        least_m: how much [m].
        since: numbers (k,) to compare with instead, such as those of another evaluation.
    """
    mask = search.objective.targets.fitted
    before = evaluation.prediction.at_start[mask] if since is None else since
    with np.errstate(invalid="ignore"):
        return np.abs(evaluation.prediction.values[mask] - before) > least_m


def scan(search: Search, first: Evaluation, least_m: float) -> Evaluation:
    """Lower the strengths geometrically; the evaluation with the least loss, the first included.

    The scan ends when every fitted number has moved, or when some have and a further batch makes
    the loss no smaller.

    Args:
        search: keeps every run, as iteration 0.
        first: where nothing moves, or the derivative says nothing.
        least_m: how much must move [m].

    Raises:
        WorkFailed: no strength is unknown, or nothing moves, not even at the lowest bounds.
    """
    parameters = search.objective.parameters
    strengths = parameters.strengths
    if not strengths.any():
        raise WorkFailed(
            "nothing moves at the start, and no strength is calibrated that could be "
            "lowered; give the parameters weaker starts"
        )
    still = first.prediction.values[search.objective.targets.fitted]
    best, anything, factor = first, False, 1.0
    while True:
        trials = []
        for _ in range(BATCH):
            factor *= RATIO
            lowered = np.where(strengths, first.values * factor, first.values)
            trials.append(parameters.clipped(lowered))
        improved = everything = False
        for values, prediction in zip(trials, search.predict(trials), strict=True):
            evaluation = search.record(values, "scan", 0, prediction)
            changed = moved(search, evaluation, least_m, still)
            anything, everything = anything or changed.any(), everything or changed.all()
            if evaluation.loss < best.loss:
                best, improved = evaluation, True
        lowest = np.all(trials[-1][strengths] <= parameters.low[strengths])
        if anything and (everything or not improved or lowest or search.exhausted):
            return best
        if lowest or search.exhausted:
            if moved(search, first, least_m).any():
                return best  # all has gone already: stronger soil is tried by looking around
            weakest = ", ".join(
                f"{name} {value:.3g}"
                for name, value in zip(parameters.names, trials[-1], strict=True)
            )
            raise WorkFailed(
                f"nothing moves by {least_m:g} m, not even at {weakest}; lower the bounds, or "
                "check section and water"
            )


def look_around(search: Search, start: np.ndarray, best: Evaluation) -> Evaluation | None:
    """Try strengths between the bounds, in the ratios of `start`; the best, if it is better.

    The places do not depend on where the search ended, so that several searches of one question
    share the runs.

    Args:
        search: keeps every run, as belonging to the iteration it has reached.
        start: first guess of the question (p,).
        best: where the search ended.
    """
    parameters = search.objective.parameters
    strengths = parameters.strengths
    if not strengths.any():
        return None
    half = AROUND_MOST // 2
    factors = AROUND_RATIO ** np.arange(-half, half + 1.0)
    inside = [
        factor
        for factor in factors
        if np.all((factor * start >= parameters.low)[strengths])
        and np.all((factor * start <= parameters.high)[strengths])
    ]
    trials = [np.where(strengths, factor * start, start) for factor in inside]
    iteration = max(evaluation.iteration for evaluation in search.evaluations)
    evaluations = [
        search.record(values, "scan", iteration, prediction)
        for values, prediction in zip(trials, search.predict(trials), strict=True)
    ]
    nearest = min(evaluations, key=lambda evaluation: evaluation.loss, default=best)
    return nearest if nearest.loss < best.loss else None
