"""The likelihood of what was measured, ordinary and censored numbers together.

With errors e ~ N(0, C) of measured minus predicted numbers, those that were measured have a
Gaussian density. Of a censored number only an upper limit is known: given the others its error is
N(g, s^2), and the probability that it stayed below is

    Phi((limit - predicted - g) / s),

g = 0 and s its own standard deviation where errors do not correlate. Unlike the sum of squares of a
fit (`Targets.counted`), this also counts how far below the limit a prediction lies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import log_ndtr

from inversion.estimation.data import Targets
from inversion.posterior.emulator import Emulator


@dataclass(frozen=True)
class Likelihood:
    """The likelihood of the measurements by an emulator.

    Attributes:
        emulator: of numbers that include the fitted ones.
        targets: the measurements, (m,).
        errors: covariance of all errors but the emulator's, (m, m).
    """

    emulator: Emulator
    targets: Targets
    errors: np.ndarray

    @cached_property
    def _fitted(self) -> np.ndarray:
        """Places of the fitted numbers among the measurements."""
        return np.flatnonzero(self.targets.fitted)

    @cached_property
    def _places(self) -> list[int]:
        """The same in the emulator."""
        return [self.emulator.names.index(self.targets.names[k]) for k in self._fitted]

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Its logarithm (s,) at values of the unknowns (s, q)."""
        mean, std = self.emulator.predict(values, self._places)
        predicted = np.full((len(values), len(self.targets.names)), np.nan)
        predicted[:, self._fitted] = mean
        total = np.repeat(self.errors[None], len(values), axis=0)
        total[:, self._fitted, self._fitted] += std**2
        return log_likelihood(self.targets, predicted, total)


def log_likelihood(
    targets: Targets, predictions: np.ndarray, covariance: np.ndarray | None = None
) -> np.ndarray:
    """Logarithm of the likelihood of the fitted numbers.

    Args:
        targets: m measured numbers.
        predictions: of all of them, (..., m).
        covariance: C of all errors, those of the model included, (m, m), or one for each
            prediction (..., m, m); None: the targets' own.

    Returns:
        (...,); minus infinity where a fitted number could not be predicted.
    """
    total = targets.covariance if covariance is None else covariance
    known = np.flatnonzero(targets.fitted & ~targets.censored)
    limits = np.flatnonzero(targets.fitted & targets.censored)
    error = targets.measured - np.asarray(predictions, dtype=float)
    failed = ~np.all(np.isfinite(error[..., targets.fitted]), axis=-1)
    error = np.where(failed[..., None], 0.0, error)

    whitener = np.linalg.inv(np.linalg.cholesky(_part(total, known, known)))
    white = np.einsum("...ij,...j->...i", whitener, error[..., known])
    found = -0.5 * np.sum(white**2 + np.log(2.0 * np.pi), axis=-1)
    found = found + np.log(np.diagonal(whitener, axis1=-2, axis2=-1)).sum(axis=-1)

    if len(limits):
        cross = whitener @ _part(total, known, limits)
        spread = _part(total, limits, limits) - np.swapaxes(cross, -1, -2) @ cross
        room = error[..., limits] - np.einsum("...ij,...i->...j", cross, white)
        found = found + _log_below(room, spread)
    return np.where(failed, -np.inf, found)


def _part(matrix: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Rows and columns of matrices (..., m, m)."""
    return matrix[..., rows[:, None], columns[None, :]]


def _log_below(room: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Logarithm of the probability that N(0, C (..., l, l)) stays below `room` (..., l)."""
    std = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    across = covariance * (1.0 - np.eye(covariance.shape[-1]))
    if np.all(np.abs(across) <= 1e-12 * float(std.max()) ** 2):
        return log_ndtr(room / std).sum(axis=-1)
    if covariance.ndim > 2:
        covariance = np.broadcast_to(covariance, (*room.shape, room.shape[-1]))
        return np.array(
            [_log_below(room[place], covariance[place]) for place in np.ndindex(room.shape[:-1])]
        ).reshape(room.shape[:-1])
    from scipy.stats import multivariate_normal  # takes half a second to import

    normal = multivariate_normal(np.zeros(len(std)), covariance, seed=0)  # integrates by sampling
    probability = normal.cdf(room)
    return np.log(np.maximum(probability, np.finfo(float).tiny))
