"""How far a prediction is from what was measured: the paper's loss and the standardised misfit.

The sum of squares that Gauss-Newton makes small has three parts:

- *data*: the fitted numbers. With the loss `runout` each difference is divided by a third of the
  root of the tolerance, so that fitting it comes before everything else (the paper fits the runout
  alone, to 0.1 m2, however well it is known). With `misfit` the differences are made independent
  by the Cholesky factor of their covariance.
- *priors*: (value - mean) / std, of the logarithm for strengths.
- *preferences*, which choose among answers that fit equally well and do nothing else: friction
  angles without a prior stay near their first guess (std: width of the bounds / sqrt(12)); several
  strengths without a prior keep the ratios of their first guesses (to a factor of e), whatever
  their level. A single strength without a prior has none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from inversion.problem.forward import Prediction
from inversion.problem.parameters import Parameters
from inversion.problem.predictions import Targets

#: Spread of the logarithm of strength ratios that the preference for the first guesses allows.
RATIO_STD = 1.0


@dataclass(frozen=True)
class Objective:
    """The function that is made small; f are the k fitted numbers, p the parameters.

    Attributes:
        parameters: what is sought.
        targets: what was measured.
        loss: runout or misfit.
        tolerance: loss below which a prediction is good enough.
    """

    parameters: Parameters
    targets: Targets
    loss: Literal["runout", "misfit"]
    tolerance: float

    @property
    def unit(self) -> Literal["m2", "standardised"]:
        """Unit of the loss."""
        return "m2" if self.loss == "runout" else "standardised"

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the fitted numbers' errors, (k, k)."""
        mask = self.targets.fitted
        return self.targets.covariance[np.ix_(mask, mask)]

    @cached_property
    def survey_whitener(self) -> np.ndarray:
        """W (k, k) with W' W = covariance^-1: W @ differences are independent, of variance 1."""
        factor = np.linalg.cholesky(self.covariance)
        return np.linalg.solve(factor, np.eye(len(factor)))

    @cached_property
    def whitener(self) -> np.ndarray:
        """W (k, k) of the search: the survey's, or sharper with the loss `runout`."""
        if self.loss == "misfit":
            return self.survey_whitener
        return np.eye(int(self.targets.fitted.sum())) * 3.0 / np.sqrt(self.tolerance)

    def difference(self, prediction: Prediction) -> np.ndarray:
        """Predicted minus measured, fitted numbers (k,)."""
        mask = self.targets.fitted
        return prediction.values[mask] - self.targets.measured[mask]

    def value(self, prediction: Prediction) -> float:
        """The loss: m2, or the sum of squared standardised differences; infinite if it failed."""
        difference = self.difference(prediction)
        if not np.all(np.isfinite(difference)):
            return float("inf")
        if self.loss == "runout":
            return float(difference @ difference)
        standardised = self.survey_whitener @ difference
        return float(standardised @ standardised)

    def residuals(self, prediction: Prediction, fitted: np.ndarray) -> np.ndarray:
        """All that is squared and summed: data, priors, preferences."""
        data = self.whitener @ self.difference(prediction)
        rows, constant = self.regularisation
        return np.concatenate([data, rows @ fitted - constant])

    def jacobian(self, derivative: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivative of `residuals` by the fitted parameters.

        Args:
            derivative: of all predictions by the values, (m, p), per outside unit; columns of NaN
                (a run that failed) count as zero.
            values: (p,) where it was taken.
        """
        scaled = self.fitted_derivative(derivative, values)
        return np.concatenate([self.whitener @ scaled, self.regularisation[0]])

    def fitted_derivative(self, derivative: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivative of the fitted numbers (k, p) by the fitted (scaled) parameters."""
        known = np.nan_to_num(derivative[self.targets.fitted])
        return known * self.parameters.value_per_fitted(values)[None, :]

    @cached_property
    def regularisation(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (r, p) and constants (r,): rows @ fitted - constants is squared and summed."""
        parameters = self.parameters
        p = len(parameters.specs)
        free = parameters.logarithmic & ~parameters.has_prior
        held = ~free
        mean = parameters.to_fitted(parameters.prior_mean)
        rows, constants = [np.eye(p)[held]], [mean[held]]
        if free.sum() >= 2:
            # Deviations of ln(value / first guess) from their mean.
            centre = np.zeros((p, p))
            centre[np.ix_(free, free)] = np.eye(int(free.sum())) - 1.0 / free.sum()
            weight = (centre * parameters.prior_std[None, :])[free] / RATIO_STD
            rows.append(weight)
            constants.append(weight @ parameters.to_fitted(parameters.start))
        return np.concatenate(rows), np.concatenate(constants)
