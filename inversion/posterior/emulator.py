"""An emulator of the numbers of a simulation: a quadratic trend and Gaussian processes.

Simulations X (n, d), Y (n, m) are reduced to k principal components of Y in units of `scale`. Each
has a trend by least squares: quadratic, cubic in the first coordinate, which matters most, and with
its products with the others. What that leaves is a Gaussian process with a Matern 5/2 kernel of its
own: one length for every coordinate, and white noise, which is what jittering the points does to a
simulation. Lengths and noise maximise the marginal likelihood (Rasmussen and Williams 2006,
chapter 5; fitted by scikit-learn).

Errors are those of leave-one-out prediction (the same, eqs 5.10-5.12): where these are larger than
a process claims, its standard deviation grows by their ratio.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

LEFT_OUT = 1e-3
"""Principal components are kept until they leave out less than this share of the variance."""

MOST_COMPONENTS = 8

SHORTEST = 1.0
"""Least length of a kernel: what changes within a standard deviation is noise of the points."""


@dataclass(frozen=True)
class Emulator:
    """A fitted emulator of m numbers over d coordinates, by k components.

    Attributes:
        centre: (m,) and scale (m,): y = centre + scale * (z @ components) of components z (k,).
        scale: unit of each number.
        components: (k, m).
        trend: (3 d + 1, k) of the trend's terms.
        points: (k, n, d) where it was fitted, in lengths of each component.
        lengths: (k, d) of the kernels.
        weights: (k, n) of the kernels' values.
        inverse: (k, n, n) of the kernels' matrices, noise included.
        size: (k,) standard deviation of each process, as leave-one-out errors have it.
        noise: (k,) share of white noise in its variance.
        discarded: (m,) standard deviation of what the components leave out, in units of y.
        left_out: (n, m) leave-one-out errors of y.
        left_out_std: (n, m) their standard deviations as the emulator has them.
    """

    centre: np.ndarray
    scale: np.ndarray
    components: np.ndarray
    trend: np.ndarray
    points: np.ndarray
    lengths: np.ndarray
    weights: np.ndarray
    inverse: np.ndarray
    size: np.ndarray
    noise: np.ndarray
    discarded: np.ndarray
    left_out: np.ndarray
    left_out_std: np.ndarray

    def components_at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the components, each (n, k), at points (n, d).

        The standard deviation is that of a simulation: the noise of its points is part of it.
        """
        kernel = _matern(x / self.lengths[:, None, :], self.points)
        mean = _basis(x) @ self.trend + (kernel @ self.weights[..., None])[..., 0].T
        explained = np.sum((kernel @ self.inverse) * kernel, axis=2).T
        spread = np.sqrt(np.maximum(1.0 - explained, 0.0) + self.noise)
        return mean, spread * self.size

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the numbers, each (n, m), at points (n, d)."""
        mean, std = self.components_at(np.atleast_2d(x))
        variance = (std**2) @ (self.components * self.scale) ** 2 + self.discarded**2
        return self.mean(mean), np.sqrt(variance)

    def mean(self, components: np.ndarray) -> np.ndarray:
        """Numbers (..., m) of components (..., k)."""
        return self.centre + self.scale * (components @ self.components)


def fit_emulator(x: np.ndarray, y: np.ndarray, scale: np.ndarray, seed: int = 0) -> Emulator:
    """Fit an emulator to simulations.

    Args:
        x: (n, d), n > 3 d + 1; the first coordinate is the one that matters most.
        y: (n, m), finite.
        scale: (m,) by which numbers are made comparable, such as their standard errors.
        seed: of the optimiser.
    """
    n = len(x)
    centre = y.mean(axis=0)
    standard = (y - centre) / scale
    components = _components(standard)
    z = standard @ components.T
    trend = np.linalg.lstsq(_basis(x), z, rcond=None)[0]
    rest = z - _basis(x) @ trend
    lengths, weights, inverses, sizes, noises, errors, claims = [], [], [], [], [], [], []
    for own in rest.T:
        length, noise = _kernel(x, own, seed)
        inverse = np.linalg.inv(_matern(x / length, x / length) + (noise + 1e-10) * np.eye(n))
        # Given lengths and noise, the process's size follows from the data.
        size = np.sqrt(own @ inverse @ own / n)
        alone = 1.0 / np.diag(inverse)
        error, claim = (inverse @ own) * alone, np.sqrt(alone) * size
        inflation = max(float(np.sqrt(np.mean((error / claim) ** 2))), 1.0)
        for kept, value in zip(
            (lengths, weights, inverses, sizes, noises, errors, claims),
            (length, inverse @ own, inverse, size * inflation, noise, error, claim * inflation),
            strict=True,
        ):
            kept.append(value)
    loading = components * scale
    discarded = scale * np.sqrt(np.mean((standard - z @ components) ** 2, axis=0))
    return Emulator(
        centre=centre, scale=scale, components=components, trend=trend,
        points=x / np.array(lengths)[:, None, :], lengths=np.array(lengths),
        weights=np.array(weights), inverse=np.array(inverses), size=np.array(sizes),
        noise=np.array(noises), discarded=discarded, left_out=np.array(errors).T @ loading,
        left_out_std=np.sqrt(np.array(claims).T ** 2 @ loading**2 + discarded**2),
    )  # fmt: skip


def _kernel(x: np.ndarray, rest: np.ndarray, seed: int) -> tuple[np.ndarray, float]:
    """Lengths (d,) and share of noise that make what is left of one component most likely."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Matern, WhiteKernel

    d = x.shape[1]
    kernel = Matern(np.full(d, 4.0), (SHORTEST, 100.0), nu=2.5) + WhiteKernel(0.05, (1e-5, 10.0))
    process = GaussianProcessRegressor(kernel, random_state=seed)
    with warnings.catch_warnings():  # a length at its bound: the coordinate does not matter
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(x, rest / max(float(rest.std()), 1e-12))
    length = np.broadcast_to(process.kernel_.k1.length_scale, (d,)).copy()
    return length, float(process.kernel_.k2.noise_level)


def _components(standard: np.ndarray) -> np.ndarray:
    """Principal components (k, m) of centred numbers (n, m), of unit length."""
    _, size, rows = np.linalg.svd(standard, full_matrices=False)
    share = np.cumsum(size**2) / max(float(np.sum(size**2)), 1e-300)
    enough = int(np.searchsorted(share, 1.0 - LEFT_OUT)) + 1
    return rows[: min(enough, MOST_COMPONENTS)]


def _basis(x: np.ndarray) -> np.ndarray:
    """[1, x, x^2, x_0^3, x_0 x_j] (n, 3 d + 1) of points (n, d)."""
    first = x[:, :1]
    return np.concatenate([np.ones((len(x), 1)), x, x**2, first**3, first * x[:, 1:]], axis=1)


def _matern(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Matern 5/2 correlation (..., n, k) of points a (..., n, d) and b (..., k, d), in lengths."""
    square = (
        np.sum(a**2, axis=-1)[..., None]
        + np.sum(b**2, axis=-1)[..., None, :]
        - 2.0 * a @ np.swapaxes(b, -1, -2)
    )
    r = np.sqrt(5.0 * np.maximum(square, 0.0))
    return (1.0 + r + r**2 / 3.0) * np.exp(-r)
