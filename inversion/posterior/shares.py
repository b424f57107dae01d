"""What moves the answer: Sobol shares of the strength that fits best.

Everything but the first parameter varies as before the data, and the survey errs as its covariance
says; for each such draw the first parameter is the one that fits the drawn data best (on the
emulator). Inputs are independent, so the variance of that answer has Sobol shares in the usual
sense: first order, what an input explains by itself; total, with all its interactions (Sobol 1993;
Saltelli et al. 2010, by `scipy.stats.sobol_indices`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, sobol_indices

from inversion.posterior.likelihood import EmulatedLikelihood
from inversion.posterior.unknowns import PriorSpace

GRID = 41
"""Values of the first parameter that are tried for each draw."""

SURVEY = "error of the survey and of the model"


@dataclass(frozen=True)
class Share:
    """Shares of the variance of the answer that an input explains."""

    name: str
    first: float
    total: float


def sobol_shares(
    space: PriorSpace, likelihood: EmulatedLikelihood, *, draws: int = 512, seed: int = 0
) -> list[Share]:
    """Sobol shares of all inputs, the largest total first.

    Args:
        space: the unknowns; the first parameter is the answer.
        likelihood: what is fitted, and with which errors.
        draws: base sample, a power of 2.
        seed: of the sample.
    """
    inputs = space.d - 1
    answer = _Answer(space, likelihood)
    found = sobol_indices(
        func=lambda shares: answer(shares[:inputs].T, norm.ppf(shares[inputs:].T)),
        n=draws,
        dists=[_Uniform()] * (inputs + answer.errors),
        rng=np.random.default_rng(seed),
    )
    first, total = found.first_order, found.total_order
    names = [one.name for one in space.unknowns[1:]]
    shares = [Share(name, float(first[i]), float(total[i])) for i, name in enumerate(names)]
    shares.append(Share(SURVEY, float(first[inputs:].sum()), float(total[inputs:].sum())))
    return sorted(shares, key=lambda one: -one.total)


class _Uniform:
    """Even from 0 to 1, as `sobol_indices` asks for distributions."""

    def ppf(self, shares: np.ndarray) -> np.ndarray:
        return np.clip(shares, 1e-9, 1.0 - 1e-9)


class _Answer:
    """The first parameter that fits best, over everything else."""

    def __init__(self, space: PriorSpace, likelihood: EmulatedLikelihood) -> None:
        self.space, self.likelihood = space, likelihood
        targets, places = likelihood.targets, likelihood.fitted
        self.places = places
        error = (targets.covariance + likelihood.model_covariance)[np.ix_(places, places)]
        values, vectors = np.linalg.eigh(error)
        # Few directions carry the error of a long series; the rest counts as exact.
        kept = values > 1e-3 * values.max()
        self.root = (vectors * np.sqrt(np.maximum(values, 0.0)))[:, kept][:, ::-1][:, :8]
        self.whitener = np.linalg.inv(np.linalg.cholesky(error))
        self.errors = self.root.shape[1]
        low, high = space.unknowns[0].low, space.unknowns[0].high
        self.grid = np.linspace(low, high, GRID)

    def __call__(self, shares: np.ndarray, errors: np.ndarray) -> np.ndarray:
        """Answers (n,) in units of its fit, of shares of the priors (n, d - 1) and errors."""
        n = len(shares)
        whole = np.column_stack([np.full(n, 0.5), shares])
        x = self.space.from_shares(whole)
        measured = self.likelihood.targets.measured[self.places] + errors @ self.root.T
        misfit = np.empty((n, GRID))
        for column, value in enumerate(self.grid):
            x[:, 0] = value
            predicted = self.likelihood.emulator(x)[0]
            white = (measured - predicted[:, self.places]) @ self.whitener.T
            misfit[:, column] = np.sum(white**2, axis=1)
        return _lowest(self.grid, misfit)


def _lowest(grid: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    """Where a curve sampled on an even grid (k,) is lowest, by a parabola, for each row (n, k)."""
    place = np.argmin(misfit, axis=1).clip(1, len(grid) - 2)
    rows = np.arange(len(misfit))
    left, middle, right = (misfit[rows, place + shift] for shift in (-1, 0, 1))
    curvature = left - 2.0 * middle + right
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(curvature > 0.0, 0.5 * (left - right) / curvature, 0.0)
    return grid[place] + np.clip(shift, -1.0, 1.0) * (grid[1] - grid[0])
