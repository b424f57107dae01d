"""Calibration: from a first guess to the answer, by the method asked for.

In: a `Search` and first guesses. Out: `SearchResult`. A start at which nothing moves, or whose
derivative says nothing, goes through the geometric scan first; a search that ends far from the data
looks around once and goes on from the best place it sees; a misfit of many numbers is smoothed at
last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from inversion.estimation.flow_limit import flow_limit
from inversion.estimation.forward import Forward
from inversion.estimation.gauss_newton import LARGEST_BOX, best_step, gauss_newton
from inversion.estimation.geometric_scan import look_around, moved, scan
from inversion.estimation.lbfgsb import lbfgsb
from inversion.estimation.search import Evaluation, Search, SearchResult
from inversion.estimation.smoothing import smoothed
from inversion.estimation.unknowns import Parameters

Method = Literal["gauss_newton", "lbfgsb"]
METHODS = {"gauss_newton": gauss_newton, "lbfgsb": lbfgsb}

#: A derivative whose best step lowers the sum of squares by a smaller share says nothing.
LEAST_PROMISE = 0.1
#: A fit is far off where it is worse than expected by this many standard deviations.
FAR_OFF = 4.0
#: The smoothed answer lies in no ripple and may be worse by this multiple of what noise adds.
MOST_WORSE = 3.0
#: Further starts: strengths times this, and friction angles at this share of their bounds.
OTHER_STARTS = ((0.65, 0.25), (1.6, 0.75), (0.45, 0.6), (2.2, 0.4))


def calibrate(search: Search, start: np.ndarray, *, method: Method, least_m: float) -> SearchResult:
    """Search from one first guess.

    Args:
        search: the problem.
        start: values (p,).
        method: gauss_newton or lbfgsb.
        least_m: what must move at the start, else the strengths are scanned first [m].

    Raises:
        WorkFailed: nothing moves at all, or the first run failed; the limit of flow lies beyond the
            bounds.
    """
    if search.objective.limit:
        return flow_limit(search, start)
    first = search.evaluate(start, "start", 0)
    if _says_nothing(search, first, least_m):
        best = scan(search, first, least_m)
        search.measure_noise(None, best.values)
        first = first if best is first else search.evaluate(best.values, "scan", 0)
    else:
        search.measure_noise(first, start)
    found = _searched(search, first, method)
    if _far_off(search, found.best) and search.runs < search.max_runs:
        better = look_around(search, search.objective.parameters.start, found.best)
        if better is not None:
            search.start_again()
            first = search.evaluate(better.values, "scan", better.iteration)
            found = _searched(search, first, method)
    return _polished(search, found, search.engine)


def refine(
    search: Search,
    start: np.ndarray,
    *,
    method: Method,
    sampled: Callable[[Evaluation], Forward],
) -> SearchResult:
    """Search on from the answer of a coarser engine: no scan, and no looking around.

    Args:
        search: the problem.
        start: that answer, (p,).
        method: gauss_newton or lbfgsb.
        sampled: the cheaper engine that is run around the end of the search to smooth a misfit,
            given the evaluation with which it must agree.

    Raises:
        WorkFailed: the first run failed.
    """
    if search.objective.limit:
        return flow_limit(search, start)
    found = _searched(search, search.evaluate(start, "start", 0), method)
    return _polished(search, found, sampled(found.best))


def _searched(search: Search, first: Evaluation, method: Method) -> SearchResult:
    """Search from an evaluation; an end that is not a minimum is not an end.

    L-BFGS-B may stop at a point whose derivative still promises a better fit, when its line search
    fails in a ripple of the loss. It then starts once more from there, with no memory of curvature.
    """
    found = METHODS[method](search, first)
    if method != "lbfgsb" or found.best is first or found.reached or search.exhausted:
        return found
    if _promise(search, found.best) < LEAST_PROMISE:
        return found
    search.start_again()
    return METHODS[method](search, found.best)


def _polished(search: Search, found: SearchResult, engine: Forward) -> SearchResult:
    """The bottom of the valley, where many numbers are fitted and the simulation has noise."""
    if search.objective.loss != "misfit" or not np.any(search.steps.noise > 0):
        return found
    if not np.isfinite(found.best.loss) or search.exhausted:
        return found
    evaluation = smoothed(search, found.best, engine)
    if evaluation is None:
        return found
    ripple = np.sum((search.objective.survey_whitener * search.steps.noise[None, :]) ** 2)
    if not evaluation.loss <= found.best.loss + MOST_WORSE * ripple:
        search.reject(evaluation)
        return found
    return replace(found, best=evaluation, runs=search.runs, words=f"{found.words}, smoothed")


def _far_off(search: Search, evaluation: Evaluation) -> bool:
    """The fit is worse than the survey's errors explain: chance does so once in 30,000 times."""
    objective = search.objective
    if not np.isfinite(evaluation.loss):
        return True
    if objective.loss == "runout":
        return evaluation.loss > max(
            objective.tolerance, FAR_OFF**2 * float(np.trace(objective.covariance))
        )
    numbers = len(objective.covariance)
    return evaluation.loss > numbers + FAR_OFF * np.sqrt(2.0 * numbers)


def _says_nothing(search: Search, evaluation: Evaluation, least_m: float) -> bool:
    """The fit is bad, and nothing moves or no step promises to make it better."""
    if not np.isfinite(evaluation.loss) or evaluation.loss < search.objective.tolerance:
        return False
    if not moved(search, evaluation, least_m).any():
        return True
    return _promise(search, evaluation) < LEAST_PROMISE


def _promise(search: Search, evaluation: Evaluation) -> float:
    """Share of the sum of squares that the best linear step from an evaluation would remove."""
    residuals = search.objective.residuals(
        evaluation.prediction, search.objective.parameters.to_fitted(evaluation.values)
    )
    return best_step(search, evaluation, LARGEST_BOX).gain / max(
        float(residuals @ residuals), 1e-300
    )


def further_starts(parameters: Parameters, number: int) -> Sequence[np.ndarray]:
    """Further first guesses, (p,) each: weaker, stronger, other angles."""
    found = []
    for factor, share in OTHER_STARTS[:number]:
        inside = parameters.low + share * (parameters.high - parameters.low)
        scaled = np.where(parameters.strengths, parameters.start * factor, parameters.start)
        values = np.where(parameters.logarithmic, scaled, inside)
        found.append(parameters.clipped(values))
    return found
