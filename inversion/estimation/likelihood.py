"""The likelihood of what was measured, ordinary and censored numbers together.

With errors e ~ N(0, C) of measured minus predicted numbers, those that were measured have a
Gaussian density. Of a censored number only an upper limit is known: given the others its error is
N(g, s^2), and the probability that it stayed below is

    Phi((limit - predicted - g) / s),

g = 0 and s its own standard deviation where errors do not correlate. Unlike the sum of squares of a
fit (`Targets.counted`), this also counts how far below the limit a prediction lies.
"""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr
from scipy.stats import multivariate_normal

from inversion.estimation.data import Targets


def log_likelihood(
    targets: Targets, predictions: np.ndarray, covariance: np.ndarray | None = None
) -> np.ndarray:
    """Logarithm of the likelihood of the fitted numbers.

    Args:
        targets: m measured numbers.
        predictions: of all of them, (..., m).
        covariance: C of all errors, those of the model included, (m, m); None: the targets' own.

    Returns:
        (...,); minus infinity where a fitted number could not be predicted.
    """
    total = targets.covariance if covariance is None else covariance
    known = np.flatnonzero(targets.fitted & ~targets.censored)
    limits = np.flatnonzero(targets.fitted & targets.censored)
    error = targets.measured - np.asarray(predictions, dtype=float)
    failed = ~np.all(np.isfinite(error[..., targets.fitted]), axis=-1)
    error = np.where(failed[..., None], 0.0, error)

    whitener = np.linalg.inv(np.linalg.cholesky(total[np.ix_(known, known)]))
    white = error[..., known] @ whitener.T
    found = -0.5 * np.sum(white**2 + np.log(2.0 * np.pi), axis=-1)
    found = found + np.log(np.diag(whitener)).sum()

    if len(limits):
        cross = whitener @ total[np.ix_(known, limits)]
        spread = total[np.ix_(limits, limits)] - cross.T @ cross
        found = found + _log_below(error[..., limits] - white @ cross, spread)
    return np.where(failed, -np.inf, found)


def _log_below(room: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Logarithm of the probability that N(0, covariance (l, l)) stays below `room` (..., l)."""
    std = np.sqrt(np.diag(covariance))
    if np.allclose(covariance, np.diag(std**2), atol=1e-12 * float(std.max()) ** 2):
        return log_ndtr(room / std).sum(axis=-1)
    normal = multivariate_normal(np.zeros(len(std)), covariance, seed=0)  # integrates by sampling
    probability = normal.cdf(room)
    return np.log(np.maximum(probability, np.finfo(float).tiny))
