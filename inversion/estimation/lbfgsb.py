"""L-BFGS-B, the paper's search (Byrd and others 1995): the gradient of the loss, within bounds.

The paper minimises the squared runout error alone. With the loss `misfit` the priors are added.
The scaled parameters are stretched so that a unit step is a tenth of a strength or one degree, and
the function is divided by its first slope: where all parameters have bounds, the method first tries
a step as long as the slope, which would otherwise throw a strength to its bound.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from scipy.optimize import minimize

from inversion.estimation.misfit import Objective
from inversion.estimation.search import Linearised, Search, SearchResult
from pipeline.cli import WorkFailed

#: A unit step: of the logarithm of a strength, and degrees of a friction angle.
UNIT_LOG, UNIT_DEGREES = 0.1, 1.0


class _Ended(Exception):  # noqa: N818
    """The loss is below the tolerance, or the allowance is used up."""


def lbfgsb(search: Search, first: Linearised) -> SearchResult:
    """Search from an evaluation with its derivative; see `gauss_newton.gauss_newton`."""
    objective, parameters = search.objective, search.objective.parameters
    if not np.isfinite(first.loss):
        raise WorkFailed(f"the simulation at the start failed: {first.prediction.reason}")
    unit = np.where(parameters.logarithmic, UNIT_LOG, UNIT_DEGREES) / parameters.prior_std
    best = first
    steepness = float(np.linalg.norm(value_and_gradient(objective, first)[1] * unit))
    scale = 1.0 / max(steepness, 1e-12)

    def evaluate(scaled: np.ndarray) -> tuple[float, np.ndarray]:
        nonlocal best
        values = parameters.to_values(scaled * unit)
        if np.allclose(values, first.values, rtol=1e-12):
            evaluation = first
        else:
            if search.exhausted:
                raise _Ended
            number = max(kept.iteration for kept in search.evaluations) + 1
            evaluation = search.evaluate(values, "lbfgsb", number)
        if not np.isfinite(evaluation.loss):  # a guard stopped the run: turn the line search back
            search.reject(evaluation)
            return 1e3 * scale * max(first.loss, 1.0), np.zeros(len(unit))
        if evaluation.loss < best.loss:
            best = evaluation
        elif evaluation is not first:
            search.reject(evaluation)
        if evaluation.loss < objective.tolerance and objective.loss == "runout":
            raise _Ended
        value, slope = value_and_gradient(objective, evaluation)
        return scale * value, scale * slope * unit

    bounds = list(zip(parameters.fitted_low / unit, parameters.fitted_high / unit, strict=True))
    words = ""
    with suppress(_Ended):
        done = minimize(
            evaluate,
            parameters.to_fitted(first.values) / unit,
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": search.max_iterations, "ftol": 1e-9, "gtol": 1e-6},
        )
        words = f"L-BFGS-B: {str(done.message).lower()}"
    reached = best.loss < objective.tolerance
    if objective.loss == "misfit":
        reached = "convergence" in words
    if not words:
        words = (
            f"loss {best.loss:.2g} below the tolerance {objective.tolerance:g}"
            if reached
            else f"stopped after {search.runs} simulations, as allowed"
        )
    return SearchResult(best, reached, words, search.evaluations, search.runs)


def value_and_gradient(objective: Objective, evaluation: Linearised) -> tuple[float, np.ndarray]:
    """The function that is minimised and its gradient by the scaled parameters (p,)."""
    derivative = objective.fitted_derivative(evaluation.derivative, evaluation.values)
    if objective.loss == "runout":  # paper: the squared runout error
        difference = objective.difference(evaluation.prediction)
        return float(difference @ difference), 2.0 * derivative.T @ difference
    residuals = objective.residuals(
        evaluation.prediction, objective.parameters.to_fitted(evaluation.values)
    )
    matrix = objective.jacobian(evaluation.derivative, evaluation.values)
    return float(residuals @ residuals), 2.0 * matrix.T @ residuals
