"""Bounded Gauss-Newton: the derivative of every prediction makes the steps, not of their sum alone.

Each iteration solves a linear least-squares problem within the bounds and within a box around the
present point (a trust region in scaled parameters). A step that makes things worse is taken back
and the box shrunk; if the predictions moved against what the derivative said, the run that was
taken back teaches it better (Broyden's rank-one update): the derivative of a long learned rollout
can be wrong even in sign. It ends when the loss is below the tolerance and the step that is left is
small, when nothing more can be gained, or when its allowance of iterations or runs is used up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from inversion.estimation.search import Evaluation, Linearised, Search, SearchResult
from pipeline.cli import WorkFailed

#: First, smallest and largest half-width of the box, in scaled parameters.
BOX, SMALLEST_BOX, LARGEST_BOX = 1.0, 1e-3, 4.0
#: Once the loss is low enough, steps that are not worth a run: of the logarithm of a strength, of a
#: scaled friction angle, and of the sum of squares.
SMALL_LOG, SMALL_STEP, SMALL_GAIN = 0.01, 0.1, 0.05
#: The best step gains less than this share of the sum: nothing more to be had.
STATIONARY = 1e-3
#: How a search ends whose steps have become small without making the loss smaller ...
NOISE = "no step makes it smaller: the noise of the simulation is reached"
#: ... whose answer fits if no fitted number is farther off than this many standard deviations.
MET = 0.5
LEAST = "least sum of squares"


@dataclass(frozen=True)
class Step:
    """A step of the linear problem.

    Attributes:
        fitted: new scaled parameters (p,).
        length: largest change of one of them.
        small: not worth a run once the loss is low enough.
        gain: expected decrease of the sum of squares.
    """

    fitted: np.ndarray
    length: float
    small: bool
    gain: float


def bounded_step(
    matrix: np.ndarray, right: np.ndarray, low: np.ndarray, high: np.ndarray, *, ridge: float = 0.0
) -> np.ndarray:
    """The step (q,) within bounds that brings `matrix @ step` nearest to `right` (n,).

    Args:
        matrix: (n, q).
        right: (n,).
        low: lower bounds, at most 0, (q,).
        high: upper bounds, at least 0, (q,).
        ridge: a hair of it keeps the step short along what nothing is known of; 0: none.
    """
    if ridge:
        matrix = np.vstack([matrix, ridge * np.eye(matrix.shape[1])])
        right = np.concatenate([right, np.zeros(matrix.shape[1])])
        found = np.linalg.lstsq(matrix, right, rcond=None)[0]
        if not (np.any(found < low) or np.any(found > high)):
            return found
    # lsq_linear wants the origin strictly inside; a bound that is active keeps a hair's breadth.
    bounds = (np.minimum(low, -1e-12), np.maximum(high, 1e-12))
    return lsq_linear(matrix, right, bounds=bounds, method="bvls").x


def gauss_newton(search: Search, first: Linearised) -> SearchResult:
    """Search from an evaluation with its derivative.

    Args:
        search: the problem; keeps every evaluation.
        first: where it begins; its run must not have failed.

    Raises:
        WorkFailed: the run of the first evaluation failed.
    """
    objective = search.objective
    if not np.isfinite(first.loss):
        raise WorkFailed(f"the simulation at the start failed: {first.prediction.reason}")
    best, box, iteration = first, BOX, first.iteration
    taught: np.ndarray | None = None
    while True:
        step = best_step(search, best, box, taught)
        words = _ended(search, best, step, box)
        if words:
            break
        iteration += 1
        values = objective.parameters.to_values(step.fitted)
        trial = search.evaluate(values, "gauss_newton", iteration)
        actual = _sum(search, best) - _sum(search, trial)
        ratio = actual / max(step.gain, 1e-12)
        if not np.isfinite(ratio) or actual <= 0.0:
            search.reject(trial)
            taught = taught_by(search, best, trial, taught)
            box = 0.35 * min(box, step.length)
            continue
        best, taught = trial, None
        if ratio > 0.75 and step.length > 0.9 * box:
            box = min(2.0 * box, LARGEST_BOX)
        elif ratio < 0.25:
            box = max(0.5 * step.length, SMALLEST_BOX)
    reached = best.loss < objective.tolerance
    if objective.loss == "misfit":
        reached = words.startswith(LEAST)
    if not reached and words == NOISE and (within := met(search, best)):
        reached, words = True, within
    return SearchResult(best, reached, words, search.evaluations, search.runs)


def met(search: Search, evaluation: Evaluation) -> str:
    """How well an evaluation meets the data within their errors; "": it does not.

    Far, thin flows are noisy: what meets the data well within their errors is an answer.
    """
    off = search.objective.farthest_off(evaluation.prediction)
    return f"the data are met within {off:.2g} of their standard deviations; {NOISE}" * (off < MET)


def taught_by(
    search: Search, evaluation: Linearised, trial: Linearised, taught: np.ndarray | None
) -> np.ndarray | None:
    """The derivative of the residuals (n, p) at an evaluation after a step that was taken back.

    Better (`broyden`) where the residuals moved against what the derivative says; else as it was
    (`taught`, None: the evaluation's own).
    """
    if not np.isfinite(trial.loss):
        return taught
    objective, parameters = search.objective, search.objective.parameters
    here, there = parameters.to_fitted(evaluation.values), parameters.to_fitted(trial.values)
    matrix = (
        objective.jacobian(evaluation.derivative, evaluation.values) if taught is None else taught
    )
    step = there - here
    moved = objective.residuals(trial.prediction, there)
    moved = moved - objective.residuals(evaluation.prediction, here)
    if moved @ (matrix @ step) >= 0.0:
        return taught
    return broyden(matrix, step, moved)


def broyden(slope: np.ndarray, step: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """A derivative (n, p) that gives the change (n,) which a step (p,) was seen to bring.

    Of all that do, the nearest to the old one (Broyden 1965, eq. 4.5).
    """
    return slope + np.outer(moved - slope @ step, step) / (step @ step)


def best_step(
    search: Search, evaluation: Linearised, box: float, taught: np.ndarray | None = None
) -> Step:
    """Least squares of the linearised residuals within the bounds and the box around an evaluation.

    Args:
        search: the problem.
        evaluation: where it is linearised.
        box: half-width, in scaled parameters.
        taught: derivative of the residuals (n, p) in place of the evaluation's own.
    """
    objective, parameters = search.objective, search.objective.parameters
    here = parameters.to_fitted(evaluation.values)
    residuals = objective.residuals(evaluation.prediction, here)
    matrix = (
        objective.jacobian(evaluation.derivative, evaluation.values) if taught is None else taught
    )
    low = np.maximum(parameters.fitted_low - here, -box)
    high = np.minimum(parameters.fitted_high - here, box)
    change = bounded_step(matrix, -residuals, low, high)
    left = residuals + matrix @ change
    gain = float(residuals @ residuals - left @ left)
    small = np.where(parameters.logarithmic, SMALL_LOG / parameters.prior_std, SMALL_STEP)
    return Step(
        fitted=here + change,
        length=float(np.max(np.abs(change))),
        small=bool(np.all(np.abs(change) < small)) or gain < SMALL_GAIN,
        gain=gain,
    )


def _sum(search: Search, evaluation: Linearised) -> float:
    if not np.isfinite(evaluation.loss):
        return float("inf")
    fitted = search.objective.parameters.to_fitted(evaluation.values)
    residuals = search.objective.residuals(evaluation.prediction, fitted)
    return float(residuals @ residuals)


def _ended(search: Search, evaluation: Linearised, step: Step, box: float) -> str:
    """Why the search is over, or "" if it goes on."""
    objective = search.objective
    good = objective.loss == "runout" and evaluation.loss < objective.tolerance
    if good and step.small:
        return f"loss {evaluation.loss:.2g} below the tolerance {objective.tolerance:g}"
    if step.gain < STATIONARY * max(_sum(search, evaluation), 1e-9) or (
        objective.loss == "misfit" and step.gain < objective.tolerance
    ):
        bound = [b for b in objective.parameters.at_bound(evaluation.values) if b]
        return LEAST + (", at a bound" if bound and not good else "")
    if box < SMALLEST_BOX:
        return NOISE
    if search.exhausted:
        return f"stopped after {search.runs} simulations, as allowed"
    return ""
