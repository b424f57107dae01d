"""Step 3: is the model adequate?

Tests of the projected residual (I - Q Q') r of a fit, each against noise that is simulated and
projected in the same way:

- *chi2*: sum of squares, on n + n_prior - p degrees of freedom;
- *autocorrelation*: of neighbours along the series, together; persistent errors are not noise;
- *groups*: the measurement that is farthest off as a whole;
- *score*: the largest score of any candidate (`diagnosis.signatures.signatures`), where
  signatures are known;
- *held_out*: misfit of the held-out numbers, predicted conditional on the fitted residuals, with
  covariance C_h|f + G V G', G = J_h - C_hf C_ff^-1 J_f.

Combined p = min(1, number of tests x least p).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from inversion.estimation.data import Data, Places
from inversion.estimation.misfit import System, augmented_residual, system
from inversion.estimation.surface_search import Fit
from pipeline.ties import largest, smallest


@dataclass(frozen=True)
class Test:
    """One test: its name, statistic and p."""

    name: str
    statistic: float
    p: float


@dataclass(frozen=True)
class GroupMisfit:
    """Misfit of one measurement: z (about normal for noise), sum of squares, its mean for noise."""

    name: str
    z: float
    chi2: float
    expected: float
    n: int


@dataclass(frozen=True)
class HeldOutMisfit:
    """Misfit of the held-out numbers, n of them.

    Attributes:
        chi2: with the covariance of their prediction.
        n: how many.
        p: of noise; None where nothing was held out.
        ln_density: of the held-out numbers as predicted; 0 where there are none.
    """

    chi2: float
    n: int
    p: float | None
    ln_density: float


@dataclass(frozen=True)
class Adequacy:
    """What the tests say of one fit.

    Attributes:
        tests: each of them.
        p_combined: of all.
        groups: by measurement.
        held_out: on data no fit has seen.
        chi2: sum of squares of the augmented residual.
        dof: its degrees of freedom.
    """

    tests: list[Test]
    p_combined: float
    groups: list[GroupMisfit]
    held_out: HeldOutMisfit
    chi2: float
    dof: int

    @property
    def worst(self) -> Test:
        """The test that noise would pass least."""
        return smallest(self.tests, lambda test: test.p, unit=0.0)


@dataclass(frozen=True)
class ProjectedFit:
    """A fit with its linear system, its projected residual, and projected noise.

    Attributes:
        fit: the model.
        system: A = Q R there.
        residual: (I - Q Q') r, (k + r,).
        noise: simulated, projected in the same way, (k + r, draws).
    """

    fit: Fit
    system: System
    residual: np.ndarray
    noise: np.ndarray


def judged(data: Data, fit: Fit, *, draws: int, seed: int) -> ProjectedFit:
    """Project the residual of a fit, and simulated noise with it."""
    linear = system(data, fit.space, fit.derivative, fit.x)
    residual = augmented_residual(data, fit.space, fit.prediction, fit.x)
    noise = np.random.default_rng([seed, 1]).standard_normal((len(residual), draws))
    return ProjectedFit(fit, linear, linear.project(residual), linear.project(noise))


def assess(found: ProjectedFit, places: list[Places], *, score: Test | None = None) -> Adequacy:
    """Run the tests.

    Args:
        found: the fit with its projected residual and noise.
        places: of the measurements.
        score: the largest score, where signatures are known.
    """
    data = found.system.data
    total = found.fit.total
    groups = group_misfits(found, places)
    # Without a degree of freedom the fitted numbers say nothing; held-out ones still may.
    p_fit = float(chdtrc(found.system.dof, total)) if found.system.dof > 0 else 1.0
    tests = [Test("chi2", total, p_fit)]
    neighbours = neighbour_pairs(data, places)
    if len(neighbours):
        statistic = autocorrelation(found.residual[:, None], neighbours)[0]
        null = autocorrelation(found.noise, neighbours)
        tests.append(Test("autocorrelation", float(statistic), exceedance(null, statistic)))
    if len(groups) > 1:
        worst = largest(groups, lambda group: group.z)
        null = np.max(_group_z(found, places, found.noise), axis=0)
        tests.append(Test(f"group {worst.name}", worst.z, exceedance(null, worst.z)))
    if score is not None:
        tests.append(score)
    held_out = held_out_misfit(found.fit, found.system)
    if held_out.p is not None:
        tests.append(Test("held_out", held_out.chi2, held_out.p))
    combined = min(1.0, len(tests) * min(test.p for test in tests))
    return Adequacy(tests, combined, groups, held_out, total, found.system.dof)


def exceedance(null: np.ndarray, observed: float) -> float:
    """Share of simulated statistics (draws,) at least as large, the observed one among them."""
    return float((1 + np.count_nonzero(null >= observed)) / (len(null) + 1))


def fitted_rows(data: Data, place: Places) -> np.ndarray:
    """Places in the residual of the fitted numbers of one measurement."""
    return np.flatnonzero(np.isin(data.fitted, place.index))


def neighbour_pairs(data: Data, places: list[Places]) -> np.ndarray:
    """Places in the residual of neighbours along a series with nothing held out between, (n, 2)."""
    pairs = []
    for place in places:
        if place.series:
            rows = fitted_rows(data, place)
            numbers = data.fitted[rows]
            together = np.flatnonzero(np.diff(numbers) == 1)
            pairs += [(rows[at], rows[at + 1]) for at in together]
    return np.array(pairs, dtype=int).reshape(-1, 2)


def autocorrelation(residuals: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Mean product of neighbours, residuals (k, draws), pairs (n, 2): (draws,).

    Not divided by the residuals' size: where that is smaller than the noise, what they have in
    common is not a misfit, however smooth. The smoothness of the model's own error is uncertain.
    """
    before, after = residuals[pairs[:, 0]], residuals[pairs[:, 1]]
    return np.mean(before * after, axis=0)


def group_misfits(found: ProjectedFit, places: list[Places]) -> list[GroupMisfit]:
    """Misfit of every measurement that has fitted numbers."""
    z = _group_z(found, places, found.residual[:, None])[:, 0]
    groups, place_of_z = [], 0
    for place in places:
        rows = fitted_rows(found.system.data, place)
        if len(rows):
            chi2 = float(np.sum(found.residual[rows] ** 2))
            expected = float(np.trace(_remaining(found.system, rows)))
            groups.append(GroupMisfit(place.name, float(z[place_of_z]), chi2, expected, len(rows)))
            place_of_z += 1
    return groups


def _remaining(linear: System, rows: np.ndarray) -> np.ndarray:
    """Covariance of projected noise in some rows: a block of I - Q Q'."""
    basis = linear.basis[rows]
    return np.eye(len(rows)) - basis @ basis.T


def _group_z(found: ProjectedFit, places: list[Places], residuals: np.ndarray) -> np.ndarray:
    """Standardised sums of squares by measurement, (groups, draws) of residuals (k + r, draws)."""
    blocks = [fitted_rows(found.system.data, place) for place in places]
    return np.array(
        [
            standardised_sum(np.sum(residuals[rows] ** 2, axis=0), _remaining(found.system, rows))
            for rows in blocks
            if len(rows)
        ]
    )


def standardised_sum(sums: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Sums of squares of noise of that covariance, made about standard normal.

    Mean and variance of a quadratic form are tr K and 2 tr K^2; a chi2 of the same mean and
    variance is turned by the cube root of Wilson and Hilferty (1931).
    """
    if np.trace(covariance) < 1e-9:  # limits that are kept alone: they say nothing
        return np.zeros_like(sums)
    mean = float(np.trace(covariance))
    variance = max(2.0 * float(np.sum(covariance**2)), 1e-24)
    freedom = 2.0 * mean**2 / variance
    spread = 2.0 / (9.0 * freedom)
    return (np.cbrt(sums / mean) - (1.0 - spread)) / np.sqrt(spread)


def held_out_misfit(fit: Fit, linear: System) -> HeldOutMisfit:
    """Misfit of the held-out numbers, predicted from the fit and its residuals."""
    data = linear.data
    n = len(data.held_out)
    if n == 0:
        return HeldOutMisfit(0.0, 0, None, 0.0)
    gain, own = data.conditional
    difference = data.measured - fit.prediction
    surprise = difference[data.held_out] - gain @ difference[data.fitted]
    slope = fit.derivative[data.held_out] - gain @ fit.derivative[data.fitted]
    spread = own + slope @ linear.posterior @ slope.T
    chi2 = float(surprise @ np.linalg.solve(spread, surprise))
    ln_density = -0.5 * (chi2 + float(np.linalg.slogdet(2.0 * np.pi * spread)[1]))
    return HeldOutMisfit(chi2, n, float(chdtrc(n, chi2)), ln_density)
