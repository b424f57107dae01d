"""Calibration: from a first guess to the answer, by the method asked for.

In: a `Search` and first guesses. Out: `SearchResult`.

On a slope that stands, the runout does not depend on the strength and its derivative says nothing.
So the strengths are first multiplied by one factor after the other of a geometric series until the
toes have moved by two spacings (`scan`, iteration 0). A search can also end in the wrong valley:
below some strength the whole slope has gone, and weaker soil hardly changes where it lies. One that
ends far from the data looks once over all strengths between the bounds (`look_around`).

The misfit of many numbers is a smooth valley with ripples: where exactly the points lie moves each
number a little, and a search ends in some ripple near the bottom. So at last some runs across the
valley are taken together (`smoothed`): each number becomes a quadratic function of the parameters,
and the bottom of the valley is that of these functions. The places are rounded, so that searches
which ended near each other use the same runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from geometry.scenes.doubts import thin_layers
from inversion.estimation.derivatives import LOG_STEPS
from inversion.estimation.flow_limit import flow_limit
from inversion.estimation.forward import Forward, SectionSetup
from inversion.estimation.gauss_newton import LARGEST_BOX, NOISE, best_step, gauss_newton, met
from inversion.estimation.lbfgsb import lbfgsb
from inversion.estimation.misfit import Objective
from inversion.estimation.search import Evaluation, Linearised, Search, SearchResult
from inversion.estimation.unknowns import Parameters
from pipeline.cli import WorkFailed
from pipeline.ties import smallest

Method = Literal["gauss_newton", "lbfgsb"]
METHODS = {"gauss_newton": gauss_newton, "lbfgsb": lbfgsb}
#: A minimum that is found to a tolerance lies elsewhere within it on every processor.
TO_THE_END = {"ftol": 1e-14, "xtol": 1e-14, "gtol": 1e-14}

#: A derivative whose best step lowers the sum of squares by a smaller share says nothing.
LEAST_PROMISE = 0.1
#: A fit is far off where it is worse than expected by this many standard deviations.
FAR_OFF = 4.0
#: The smoothed answer lies in no ripple and may be worse by this multiple of what noise adds.
MOST_WORSE = 3.0
#: Further starts: strengths times this, and friction angles at this share of their bounds.
OTHER_STARTS = ((0.65, 0.25), (1.6, 0.75), (0.45, 0.6), (2.2, 0.4))
#: Ratio of the series of a scan, and runs of one batch: as many as processor cores usually.
RATIO, BATCH = 0.8, 2
#: Ratio of the strengths that are tried when a search looks around, and how many at most.
AROUND_RATIO, AROUND_MOST = 1.25, 24
#: Smoothed are places on either side, in half-widths: of a log strength (more where steps may be
#: wider than usual), of an angle [deg].
PLACES, HALF_LOG, HALF_DEGREES = (0.5, 1.0, 1.5), 0.04, 2.0
#: The places move with the bottom, so often at most.
MOST_MOVES = 3
#: Runs between two on either side of the data, at most; how far from either end at least.
MOST_BETWEEN, INSIDE = 8, (0.1, 0.9)
#: Logarithms of a strength within which the runs of a search make one trend.
TREND_LOG = 0.4
#: Runs without which the functions are not known.
LEAST_RUNS = 5


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
    if far_off(search.objective, found.best) and search.runs < search.max_runs:
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


def _searched(search: Search, first: Linearised, method: Method) -> SearchResult:
    """Search from an evaluation; an end that is not a minimum is not an end.

    L-BFGS-B may stop at a point whose derivative still promises a better fit, when its line search
    fails in a ripple of the loss. It then starts once more from there, with no memory of curvature.
    """
    found = METHODS[method](search, first)
    if method == "gauss_newton":
        return between(search, found)
    if found.best is first or found.reached or search.exhausted:
        return found
    if _promise(search, found.best) < LEAST_PROMISE:
        return found
    search.start_again()
    return METHODS[method](search, found.best)


def between(search: Search, found: SearchResult) -> SearchResult:
    """A search of runouts that ended in noise goes on between runs on either side of the data.

    Of a far, thin flow a derivative may have the wrong sign, and steps become small where nothing
    fits. Two runs between which the data lie need none (regula falsi). Without a run on the other
    side, or with a loss that is no runout, the search stays as it ended.
    """
    objective, parameters = search.objective, search.objective.parameters
    if objective.loss != "runout" or found.reached or found.words != NOISE:
        return found
    best: Evaluation = found.best
    here, there = best, _beyond(search, best)
    for _ in range(MOST_BETWEEN):
        if there is None or search.exhausted:
            break
        ends = [parameters.to_fitted(one.values) for one in (here, there)]
        off = objective.difference(here.prediction)
        away = off @ (off - objective.difference(there.prediction))
        share = float(np.clip(off @ off / away, *INSIDE))
        values = parameters.to_values(ends[0] + share * (ends[1] - ends[0]))
        (prediction,) = search.predict([values])
        trial = search.record(values, "scan", found.iterations, prediction)
        if not np.isfinite(trial.loss):
            break
        if off @ objective.difference(prediction) > 0.0:
            here = trial
        else:
            there = trial
        if trial.loss < best.loss:
            best = trial
        if best.loss < objective.tolerance or met(search, best):
            break
    if best is found.best:
        return replace(found, runs=search.runs)
    last = search.evaluate(best.values, "gauss_newton", found.iterations + 1)
    last = search.evaluations[-1] = _with_trend(search, last)
    reached = last.loss < objective.tolerance
    words = f"loss {last.loss:.2g} below the tolerance {objective.tolerance:g}" * reached
    words = words or met(search, last)
    return replace(found, best=last, reached=bool(words), words=words or NOISE, runs=search.runs)


def _with_trend(search: Search, last: Linearised) -> Linearised:
    """An evaluation with the slope of all runs around it, where one strength is unknown.

    A difference of two near runs was no guide, so it is none for the error of the answer either.
    """
    if len(last.values) > 1 or not search.objective.parameters.logarithmic[0]:
        return last
    around = [
        one
        for one in search.evaluations
        if np.isfinite(one.loss) and abs(np.log(one.values[0] / last.values[0])) <= TREND_LOG
    ]
    values = np.array([one.values[0] for one in around])
    if np.ptp(values) < abs(last.steps[0]):
        return last
    numbers = np.array([one.prediction.values for one in around])
    away = values - values.mean()
    slope = away @ numbers / (away @ away)
    return replace(last, derivative=slope[:, None], steps=np.array([np.ptp(values)]))


def _beyond(search: Search, best: Evaluation) -> Evaluation | None:
    """The nearest run on the other side of the data."""
    objective, to_fitted = search.objective, search.objective.parameters.to_fitted
    off, here = objective.difference(best.prediction), to_fitted(best.values)
    beyond = [
        one
        for one in search.evaluations
        if np.isfinite(one.loss) and off @ objective.difference(one.prediction) < 0.0
    ]

    def apart(one: Evaluation) -> float:
        return float(np.abs(to_fitted(one.values) - here).max())

    return smallest(beyond, apart) if beyond else None


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


def far_off(objective: Objective, evaluation: Evaluation) -> bool:
    """The fit is worse than the survey's errors explain: chance does so once in 30,000 times."""
    if not np.isfinite(evaluation.loss):
        return True
    if objective.loss == "runout":
        return evaluation.loss > max(
            objective.tolerance, FAR_OFF**2 * float(np.trace(objective.covariance))
        )
    numbers = len(objective.covariance)
    return evaluation.loss > numbers + FAR_OFF * np.sqrt(2.0 * numbers)


def _says_nothing(search: Search, evaluation: Linearised, least_m: float) -> bool:
    """The fit is bad, and nothing moves or no step promises to make it better."""
    if not np.isfinite(evaluation.loss) or evaluation.loss < search.objective.tolerance:
        return False
    if not moved(search, evaluation, least_m).any():
        return True
    return _promise(search, evaluation) < LEAST_PROMISE


def _promise(search: Search, evaluation: Linearised) -> float:
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
            anything = anything or bool(changed.any())
            everything = everything or bool(changed.all())
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
            few = thin_layers(search.setup.scene) if isinstance(search.setup, SectionSetup) else []
            advice = "lower the bounds, check section and water, or fit another measurement"
            raise WorkFailed(
                f"nothing moves by {least_m:g} m in what is fitted, not even at {weakest}; "
                + "; ".join([*few, advice])
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
    nearest = smallest(evaluations, lambda evaluation: evaluation.loss, default=best)
    return nearest if nearest.loss < best.loss else None


def smoothed(search: Search, best: Evaluation, engine: Forward) -> Linearised | None:
    """An evaluation at the bottom of the valley; None: not found, or outside the places tried.

    Args:
        search: of a fit with noise; given the evaluation.
        best: where the search ended.
        engine: is run across the valley.
    """
    parameters = search.objective.parameters
    half_log = HALF_LOG * search.steps.widest_log / LOG_STEPS[2]
    half = np.where(parameters.logarithmic, half_log, HALF_DEGREES) / parameters.prior_std
    bottom, centre = parameters.to_fitted(best.values), None
    for _ in range(MOST_MOVES):
        rounded = half * np.round(bottom / half)
        rounded = np.clip(rounded, parameters.fitted_low, parameters.fitted_high)
        if centre is not None and np.array_equal(rounded, centre):
            break
        centre = rounded
        found = _bottom(search, engine, centre, half)
        if found is None:
            return None
        bottom = found
    iteration = max(evaluation.iteration for evaluation in search.evaluations) + 1
    return search.evaluate(parameters.to_values(bottom), best.kind, iteration)


def _bottom(
    search: Search, engine: Forward, centre: np.ndarray, half: np.ndarray
) -> np.ndarray | None:
    """The bottom seen from around `centre`, fitted (p,); None: too few runs, or at the rim."""
    parameters = search.objective.parameters
    offsets = [np.zeros(len(half))]
    for axis in np.eye(len(half)):
        offsets += [sign * place * axis for place in PLACES for sign in (1.0, -1.0)]
    fitted = np.clip(
        centre + half * np.array(offsets), parameters.fitted_low, parameters.fitted_high
    )
    values = [parameters.to_values(place) for place in fitted]
    predictions = engine.predict([search.setup.at(one) for one in values])
    mask = search.objective.targets.fitted
    kept = np.array([np.all(np.isfinite(p.values[mask])) for p in predictions])
    if kept.sum() < max(LEAST_RUNS, 2 * len(half) + 1):
        return None
    numbers = np.array(
        [p.values[mask] for p, whole in zip(predictions, kept, strict=True) if whole]
    )
    return _least_squares(search, (fitted[kept] - centre) / half, numbers, centre, half)


def _least_squares(
    search: Search, places: np.ndarray, numbers: np.ndarray, centre: np.ndarray, half: np.ndarray
) -> np.ndarray | None:
    """Least squares of the smooth functions, fitted (p,); None where it lies at the rim."""
    objective = search.objective
    rows, constants = objective.prior
    mask = objective.targets.fitted
    goal, bounded = objective.targets.measured[mask], objective.targets.censored[mask]

    def terms(place: np.ndarray) -> np.ndarray:
        return np.concatenate([[1.0], place, place**2])

    matrix = np.array([terms(place) for place in places])
    coefficients = np.linalg.lstsq(matrix, numbers, rcond=None)[0]

    def residuals(place: np.ndarray) -> np.ndarray:
        smooth = terms(place) @ coefficients
        kept = bounded & (smooth < goal)  # a limit that is kept costs nothing
        data = objective.whitener @ np.where(kept, 0.0, smooth - goal)
        return np.concatenate([data, rows @ (centre + half * place) - constants])

    def slope(place: np.ndarray) -> np.ndarray:
        kept = bounded & (terms(place) @ coefficients < goal)
        _, straight, bent = np.split(coefficients, [1, 1 + len(place)])
        data = objective.whitener @ np.where(kept, 0.0, straight + 2.0 * place[:, None] * bent).T
        return np.concatenate([data, rows * half])

    low, high = places.min(axis=0), places.max(axis=0)
    found = least_squares(
        residuals,
        np.clip(np.zeros(len(half)), low, high),
        slope,
        bounds=(low - 1e-9, high + 1e-9),
        **TO_THE_END,
    ).x
    if np.any((found < low + 1e-3) | (found > high - 1e-3)):
        return None
    return centre + half * found
