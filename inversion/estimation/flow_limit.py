"""The smallest strength at which nothing runs: what `no_flow` measurements alone can tell.

A slope that did not flow has no runout to fit. All that is known of its strength is a lower bound:
the limit of flow, at which the toe would just have moved as far as the measurement excludes. All
unknown strengths are multiplied by one factor; a series of factors brackets the limit from both
sides, and a bracketed secant (regula falsi, Illinois variant) closes in on it. Where the movement
leaps over the limit from one strength to the next, the answer is the side on which nothing runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inversion.estimation.search import Evaluation, Kind, Search, SearchResult
from pipeline.cli import WorkFailed

#: Ratio of the factors that bracket the limit, and runs of one batch.
RATIO, BATCH = 0.75, 2
#: Width, in the logarithm of the strength, at which the limit is known though the movement leaps
#: over it; most runs that close in on it.
NARROW, MOST = 0.004, 20


@dataclass(frozen=True)
class Trial:
    """A run at exp(`place`) times the first guess.

    Attributes:
        place: logarithm of the factor.
        evaluation: there.
        excess: largest movement beyond a limit, in standard deviations of its survey.
    """

    place: float
    evaluation: Evaluation
    excess: float


def flow_limit(search: Search, start: np.ndarray) -> SearchResult:
    """Search the limit of flow from a first guess, along the ratios of its strengths.

    Args:
        search: its objective seeks the limit (`Objective.limit`).
        start: values (p,).

    Raises:
        WorkFailed: no strength is unknown, the first run failed, or the limit lies beyond the
            bounds.
    """
    if not search.objective.parameters.strengths.any():
        raise WorkFailed("no flow was measured, and no strength is calibrated that it could bound")
    first = _run(search, start, [0.0], "start")[0]
    if not np.isfinite(first.evaluation.loss):
        raise WorkFailed(
            f"the simulation at the start failed: {first.evaluation.prediction.reason}"
        )
    flows, stands = _bracket(search, start, first)
    found = _closed_in(search, start, flows, stands).evaluation
    search.measure_noise(None, found.values)
    best = search.evaluate(found.values, "limit", found.iteration + 1)
    words = "the limit of flow"
    if not best.loss < search.objective.tolerance:
        words += f": nothing runs here, and with {NARROW:.1%} less strength it does"
    return SearchResult(best, True, words, search.evaluations, search.runs)


def _bracket(search: Search, start: np.ndarray, first: Trial) -> tuple[Trial, Trial]:
    """A trial at which something runs and a stronger one at which nothing does."""
    step = np.log(RATIO) if first.excess < 0.0 else -np.log(RATIO)
    before = first
    while True:
        places = [before.place + step * number for number in range(1, BATCH + 1)]
        for trial in _run(search, start, places, "scan"):
            if np.sign(trial.excess) != np.sign(first.excess):
                return (trial, before) if step < 0.0 else (before, trial)
            if np.array_equal(trial.evaluation.values, before.evaluation.values):
                raise WorkFailed(_beyond(search, trial))
            before = trial
        if search.exhausted:
            raise WorkFailed(f"the limit of flow was not found within {search.runs} simulations")


def _beyond(search: Search, last: Trial) -> str:
    parameters, strengths = search.objective.parameters, search.objective.parameters.strengths
    values = ", ".join(
        f"{name} {value:.3g}"
        for name, value, own in zip(
            parameters.names, last.evaluation.values, strengths, strict=True
        )
        if own
    )
    if last.excess < 0.0:
        return f"nothing runs, not even at {values}: no lower bound follows; give a smaller `low`"
    return (
        f"it runs even at {values}, where no flow was measured; give a greater `high`, or check "
        "section and water"
    )


def _closed_in(search: Search, start: np.ndarray, flows: Trial, stands: Trial) -> Trial:
    """The weakest trial at which nothing runs, once it is within the tolerance of the limit."""
    low, high = flows.excess, stands.excess
    for _ in range(MOST):
        width = stands.place - flows.place
        at_limit = stands.evaluation.loss < search.objective.tolerance
        if at_limit or width < NARROW or search.exhausted:
            break
        share = float(np.clip(low / (low - high), 0.1, 0.9)) if np.isfinite(low) else 0.5
        (trial,) = _run(search, start, [flows.place + share * width], "limit")
        if trial.excess < 0.0:
            # Illinois: an end that stays twice loses half its weight, so that both ends close in.
            low, high, stands = 0.5 * low, trial.excess, trial
        else:
            low, high, flows = trial.excess, 0.5 * high, trial
    return stands


def _run(search: Search, start: np.ndarray, places: Sequence[float], kind: Kind) -> list[Trial]:
    """Runs at places, recorded one after the other; a run that fails counts as one that flows."""
    parameters = search.objective.parameters
    values = [
        parameters.clipped(np.where(parameters.strengths, start * np.exp(place), start))
        for place in places
    ]
    before = max((evaluation.iteration for evaluation in search.evaluations), default=-1)
    iteration = before + 1 if kind == "limit" else 0
    found = []
    for place, own, prediction in zip(places, values, search.predict(values), strict=True):
        evaluation = search.record(own, kind, iteration, prediction)
        excess = search.objective.excess(prediction)
        found.append(Trial(place, evaluation, excess))
    return found
