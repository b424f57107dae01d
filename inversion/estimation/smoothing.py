"""The last step of a fit to many numbers: out of the noise of the simulation.

The misfit of many numbers is a smooth valley with ripples: where exactly the points lie moves each
number a little, and a search ends in some ripple near the bottom. So some runs across the valley
are taken together: each number becomes a smooth (quadratic) function of the parameters, fitted to
all of them, and the bottom of the valley is that of these functions. The places are rounded, so
that searches which ended near each other use the same runs.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from inversion.estimation.derivatives import LOG_STEPS
from inversion.estimation.forward import Forward
from inversion.estimation.search import Evaluation, Search

#: Places on either side, in half-widths; half-width of a strength's logarithm (more where steps may
#: be wider than usual), of an angle [deg].
PLACES, HALF_LOG, HALF_DEGREES = (0.5, 1.0, 1.5), 0.04, 2.0
#: The places move with the bottom, so often at most.
MOST_MOVES = 3
#: Runs without which the functions are not known.
LEAST_RUNS = 5


def smoothed(search: Search, best: Evaluation, engine: Forward) -> Evaluation | None:
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

    low, high = places.min(axis=0), places.max(axis=0)
    found = least_squares(residuals, np.clip(np.zeros(len(half)), low, high),
                          bounds=(low - 1e-9, high + 1e-9)).x  # fmt: skip
    if np.any((found < low + 1e-3) | (found > high - 1e-3)):
        return None
    return centre + half * found
