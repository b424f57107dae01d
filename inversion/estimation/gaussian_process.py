"""Gaussian process regression of a number over many unknowns.

The prior covariance of the number at x and x' (both scaled to about -1 to 1) is

    f^2 Matern_5/2(r) + l^2 x . x' + (noise)^2 [same run],
    r^2 = sum_j ((x_j - x'_j) / length_j)^2,

a trend, and what bends about it, with a length of its own for every unknown (Rasmussen and
Williams 2006, chapters 4 and 5). Lengths and amplitudes maximise the posterior probability of the
runs; the noise is what lies between neighbouring runs without a pattern: where the points happen
to lie, what a grid does. Errors of leaving one run out come in closed form from the same inverse.
Numbers that belong together and have one unit, a surface for instance, may share lengths and
amplitudes, by which the mean of their log likelihoods is largest; each has its own mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

#: Prior of ln(length): mean and standard deviation. Scaled unknowns span about 2.
LENGTH_PRIOR = (0.7, 1.0)
#: Prior of ln(amplitude / spread of the numbers) of bend, trend and noise: means and their std.
AMPLITUDE_PRIOR, AMPLITUDE_STD = (-0.7, -0.3, -3.0), 1.5
#: Bounds of all logarithms.
LEAST, MOST = -7.0, 5.0
#: Iterations of the search for lengths and amplitudes.
ITERATIONS = 80


@dataclass(frozen=True)
class GaussianProcess:
    """A fitted process; n runs at q unknowns of a number, or (after the n) of m numbers.

    Attributes:
        points: scaled unknowns of the runs, (n, q).
        middle: mean over the runs, () or (m,).
        spread: their standard deviation, of several numbers its root mean square.
        logs: ln of lengths (q,), then of amplitudes of bend, trend and noise.
        factor: Cholesky factor of the runs' covariance, lower, (n, n).
        weights: inverse covariance times numbers, (n,) or (n, m).
        left_out: error of the process at each run without that run, likewise, in the number's unit.
        left_out_std: its standard deviation by the process itself, (n,).
    """

    points: np.ndarray
    middle: np.ndarray
    spread: float
    logs: np.ndarray
    factor: np.ndarray
    weights: np.ndarray
    left_out: np.ndarray
    left_out_std: np.ndarray

    def predict(
        self, points: np.ndarray, *, with_noise: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean, (s,) or (s, m), and variance, (s,), at scaled unknowns (s, q).

        Args:
            points: where.
            with_noise: of a run, not of the smooth number alone.
        """
        bend, trend, noise = np.exp(2.0 * self.logs[-3:])
        near = _covariance(points, self.points, self.logs)
        mean = near @ self.weights
        white = solve_triangular(self.factor, near.T, lower=True, check_finite=False)
        own = bend + trend * np.sum(points**2, axis=1) + (noise if with_noise else 0.0)
        variance = np.maximum(own - np.sum(white**2, axis=0), 1e-12)
        return self.middle + self.spread * mean, self.spread**2 * variance

    def mean(self, points: np.ndarray) -> np.ndarray:
        """The mean alone, (s,) or (s, m), at scaled unknowns (s, q)."""
        return self.middle + self.spread * (
            _covariance(points, self.points, self.logs) @ self.weights
        )

    @property
    def noise(self) -> float:
        """Standard deviation of a run about the smooth number, in its unit."""
        return self.spread * float(np.exp(self.logs[-1]))

    @property
    def lengths(self) -> np.ndarray:
        """Of the scaled unknowns, (q,)."""
        return np.exp(self.logs[:-3])


def fit(points: np.ndarray, numbers: np.ndarray) -> GaussianProcess:
    """The process of runs at scaled unknowns (n, q) with finite numbers (n,) or (n, m)."""
    middle = numbers.mean(axis=0)
    spread = max(float(np.sqrt(np.mean(numbers.var(axis=0)))), 1e-9)
    y = (numbers - middle) / spread
    q = points.shape[1]
    start = np.concatenate([np.full(q, LENGTH_PRIOR[0]), AMPLITUDE_PRIOR])
    apart = (points[:, None, :] - points[None, :, :]) ** 2
    found = minimize(
        _cost,
        start,
        args=(apart, points @ points.T, y),
        jac=True,
        method="L-BFGS-B",
        bounds=[(LEAST, MOST)] * (q + 3),
        options={"maxiter": ITERATIONS},
    )
    covariance = _covariance(points, points, found.x)
    covariance[np.diag_indices(len(y))] += np.exp(2.0 * found.x[-1]) + 1e-10
    factor, _ = cho_factor(covariance, lower=True)
    inverse = cho_solve((factor, True), np.eye(len(y)))
    weights = inverse @ y
    own = np.diag(inverse)
    return GaussianProcess(
        points=points,
        middle=middle,
        spread=spread,
        logs=found.x,
        factor=np.tril(factor),
        weights=weights,
        left_out=-spread * (weights.T / own).T,
        left_out_std=spread / np.sqrt(own),
    )


def _covariance(first: np.ndarray, second: np.ndarray, logs: np.ndarray) -> np.ndarray:
    """Of the smooth number at points (s, q) and (n, q), (s, n)."""
    lengths = np.exp(logs[:-3])
    a, b = first / lengths, second / lengths
    square = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1)[None, :] - 2.0 * a @ b.T
    r = np.sqrt(5.0 * np.maximum(square, 0.0))
    bend, trend = np.exp(2.0 * logs[-3]), np.exp(2.0 * logs[-2])
    return bend * (1.0 + r + r**2 / 3.0) * np.exp(-r) + trend * (first @ second.T)


def _cost(
    logs: np.ndarray, apart: np.ndarray, products: np.ndarray, y: np.ndarray
) -> tuple[float, np.ndarray]:
    """Minus the logarithm of the posterior of lengths and amplitudes, and its gradient.

    Args:
        logs: where, (q + 3,).
        apart: squared distances of the runs along each unknown, (n, n, q).
        products: scalar products of their points, (n, n).
        y: standardised numbers, (n,) or (n, m).
    """
    bend, trend, noise = np.exp(2.0 * logs[-3:])
    inverse_squares = np.exp(-2.0 * logs[:-3])
    r = np.sqrt(5.0 * (apart @ inverse_squares))
    decay = np.exp(-r)
    smooth = bend * (1.0 + r + r**2 / 3.0) * decay
    covariance = smooth + trend * products
    covariance[np.diag_indices(len(y))] += noise + 1e-10
    prior_mean = np.concatenate([np.full(len(logs) - 3, LENGTH_PRIOR[0]), AMPLITUDE_PRIOR])
    prior_std = np.concatenate([np.full(len(logs) - 3, LENGTH_PRIOR[1]), [AMPLITUDE_STD] * 3])
    score = (logs - prior_mean) / prior_std
    try:
        factor = cho_factor(covariance, lower=True)
    except np.linalg.LinAlgError:
        return 1e10, np.zeros(len(logs))
    inverse = cho_solve(factor, np.eye(len(y)))
    weights = inverse @ y
    w = weights.reshape(len(y), -1)
    misfit = np.vdot(y, weights) / w.shape[1]
    cost = 0.5 * misfit + np.log(np.diag(factor[0])).sum() + 0.5 * score @ score
    # d cost / d log = tr((K^-1 - w w') dK) / 2, of several numbers the mean.
    slope = 0.5 * (inverse - w @ w.T / w.shape[1])
    bent = slope * (5.0 / 3.0) * bend * (1.0 + r) * decay
    gradient = np.concatenate(
        [
            np.tensordot(bent, apart, axes=([0, 1], [0, 1])) * inverse_squares,
            [
                2.0 * np.sum(slope * smooth),
                2.0 * trend * np.sum(slope * products),
                2.0 * noise * np.trace(slope),
            ],
        ]
    )
    return cost, gradient + score / prior_std
