"""The likelihood of what was measured, with the emulator's own error in it.

The fitted numbers are y = f(x) + e. Of e are known: the survey's covariance; the error of the
correction from coarse to fine runs; differences d of other ways to simulate, as d d'; what the
components of the emulator leave out; and, different at every point, the standard deviations of the
components. Only the last changes with x and it has few dimensions, so all else is whitened once and
each evaluation works in the span of the components. Censored numbers (a limit that was not
exceeded) are taken as independent of the others: Phi((limit - f) / s).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import log_ndtr

from inversion.estimation.data import Targets, symmetric_whitener
from inversion.posterior.emulator import Emulator


@dataclass(frozen=True)
class Correction:
    """From the emulator of coarse runs to fine runs: fine = offset + gain x emulated, by number.

    Attributes:
        offset: (m,) and gain (m,).
        gain: the same.
        covariance: of single fine runs about it, (m, m).
        runs: fine runs it comes from.
    """

    offset: np.ndarray
    gain: np.ndarray
    covariance: np.ndarray
    runs: int = 0

    def applied(self, emulator: Emulator) -> Emulator:
        """An emulator of fine runs from one of coarse runs.

        Fine runs scatter about it by `covariance`, which takes the place of the coarse runs' noise.
        """
        return replace(
            emulator,
            noise=emulator.noise * (self.runs == 0),
            centre=self.offset + self.gain * emulator.centre,
            scale=self.gain * emulator.scale,
            discarded=np.abs(self.gain) * emulator.discarded,
        )


def no_correction(numbers: int) -> Correction:
    """Where the simulations are as fine as they are to be."""
    return Correction(np.zeros(numbers), np.ones(numbers), np.zeros((numbers, numbers)))


def correction_of(emulated: np.ndarray, fine: np.ndarray) -> Correction:
    """Fit a correction to numbers (n, m) at the same points, n >= 3.

    A number that differs from point to point by less than it scatters has an offset alone.
    """
    n = len(fine)
    middle, change = emulated.mean(axis=0), fine.mean(axis=0) - emulated.mean(axis=0)
    around, there = emulated - middle, fine - fine.mean(axis=0)
    size = np.sum(around**2, axis=0)
    scatter = np.sum((there - around) ** 2, axis=0)
    clear = size > scatter
    gain = np.where(clear, np.sum(around * there, axis=0) / np.where(clear, size, 1.0), 1.0)
    rest = there - gain * around
    return Correction(middle * (1.0 - gain) + change, gain, rest.T @ rest / (n - 2), n)


@dataclass(frozen=True)
class EmulatedLikelihood:
    """ln p(measured | x) of the fitted numbers.

    Attributes:
        targets: m measured numbers.
        emulator: of the same numbers, as fine runs give them.
        correction: from coarse to fine runs, whose error counts.
        alternatives: (a, m) differences that other ways to simulate make.
    """

    targets: Targets
    emulator: Emulator
    correction: Correction
    alternatives: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "_fixed", self._prepare())

    @property
    def fitted(self) -> np.ndarray:
        """Places of the fitted numbers that were measured, (k,)."""
        return np.flatnonzero(self.targets.fitted & ~self.targets.censored)

    @property
    def limits(self) -> np.ndarray:
        """Places of the fitted numbers of which a limit is known."""
        return np.flatnonzero(self.targets.fitted & self.targets.censored)

    @cached_property
    def model_covariance(self) -> np.ndarray:
        """Covariance (m, m) of the model's errors that are the same at every point."""
        return (
            self.correction.covariance
            + self.alternatives.T @ self.alternatives
            + np.diag(self.emulator.discarded**2)
        )

    @cached_property
    def _loading(self) -> np.ndarray:
        """Numbers per component, (m, k)."""
        return (self.emulator.components * self.emulator.scale).T

    def _prepare(self) -> tuple:
        places = self.fitted
        covariance = (self.targets.covariance + self.model_covariance)[np.ix_(places, places)]
        if not len(places):
            return None
        whitener = symmetric_whitener(covariance)
        loading = whitener @ self._loading[places]
        residual = whitener @ (self.targets.measured - self.emulator.centre)[places]
        base, _ = np.linalg.qr(loading)
        across = residual - base @ (base.T @ residual)
        constant = -0.5 * (
            across @ across + len(places) * np.log(2.0 * np.pi) + np.linalg.slogdet(covariance)[1]
        )
        return base.T @ loading, base.T @ residual, constant

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """(n,) at points (n, d)."""
        mean, std = self.emulator.components_at(x)
        found = np.zeros(len(x))
        if self._fixed is not None:
            loading, residual, constant = self._fixed
            error = residual - mean @ loading.T
            spread = loading * std[:, None, :]
            total = np.eye(len(residual)) + spread @ spread.transpose(0, 2, 1)
            factor = np.linalg.cholesky(total)
            white = np.linalg.solve(factor, error[..., None])[..., 0]
            ln_det = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
            found += constant - ln_det - 0.5 * np.sum(white**2, axis=1)
        for place in self.limits:
            predicted = self.emulator.centre[place] + mean @ self._loading[place]
            variance = (std**2) @ self._loading[place] ** 2
            variance += self.targets.covariance[place, place] + self.model_covariance[place, place]
            found += log_ndtr((self.targets.measured[place] - predicted) / np.sqrt(variance))
        return found

    def predictive(self, x: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        """Draws (n, m) of what a survey would have measured at points (n, d)."""
        mean, std = self.emulator.components_at(x)
        z = mean + std * generator.standard_normal(std.shape)
        numbers = self.emulator.mean(z)
        error = self.targets.covariance + self.model_covariance
        return numbers + generator.multivariate_normal(
            np.zeros(len(error)), error, len(x), method="eigh", check_valid="ignore"
        )
