"""How far a prediction is from what was measured: the paper's loss and the standardised misfit.

The sum of squares that Gauss-Newton makes small has two parts:

- *data*: the fitted numbers. With the loss `runout` each difference is divided by a third of the
  root of the tolerance, so that fitting it comes before everything else (the paper fits the runout
  alone, to 0.1 m2, however well it is known). With `misfit` the differences are made independent
  by the root of their covariance (`inversion.estimation.data.Data.whitener`).
- what is known beforehand, as rows P x = P0 (`inversion.estimation.unknowns`).

With A = [W J; P] = Q R and r = [W (y - f); P0 - P x], (I - Q Q') r is what no change of the
unknowns can take away, and V = (R' R)^-1 their covariance (`System`).

How sure an answer is (`Posterior`) follows from the survey's covariance C, the derivative J at the
answer, the weights W of the search and what was known before, all in scaled parameters, in which
what was known before has variance 1:

    V = H^-1 (J' W' (W C W') W J + 1) H^-1,   H = J' W' W J + 1,

the spread of what the search finds when survey and prior vary. With the loss `misfit` W is that of
the survey, W C W' = 1, and V = (J' C^-1 J + 1)^-1. With `runout` the data come first whatever the
prior says, so the prior must not narrow the answer either. An eigenvector of V with an eigenvalue
near 1 is a direction of which the data say nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from inversion.estimation.data import Data, Targets
from inversion.estimation.forward import Prediction
from inversion.estimation.unknowns import Parameters, Unknowns
from pipeline.ties import largest_place, ranked

#: Singular values of A below this share of 1 (the prior's scale) count as no knowledge at all.
NO_KNOWLEDGE = 1e-6


@dataclass(frozen=True)
class Objective:
    """The function that is made small; f are the k fitted numbers, p the parameters.

    Attributes:
        parameters: what is to be found.
        targets: what was measured.
        loss: runout or misfit.
        tolerance: loss below which a prediction is good enough.
        data_alone: without what is known beforehand: every answer that fits is as good.
        limit: only limits that were kept are fitted (`no_flow`). Every answer on one side is then
            as good, and its end is what is looked for: the limit that comes nearest to being
            broken is to be reached, the others to be kept.
    """

    parameters: Parameters
    targets: Targets
    loss: Literal["runout", "misfit"]
    tolerance: float
    data_alone: bool = False
    limit: bool = False

    @property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (r, p) and constants (r,): rows @ fitted - constants is squared and summed."""
        if self.data_alone:
            return np.zeros((0, len(self.parameters.specs))), np.zeros(0)
        return self.parameters.prior

    @property
    def unit(self) -> Literal["m2", "standardised"]:
        """Unit of the loss."""
        return "m2" if self.loss == "runout" else "standardised"

    @property
    def covariance(self) -> np.ndarray:
        """Of the fitted numbers' errors, (k, k)."""
        return self.data.fitted_covariance

    @cached_property
    def data(self) -> Data:
        """The measurements as the fit sees them, weighed by the survey's errors."""
        return self.targets.data()

    @property
    def survey_whitener(self) -> np.ndarray:
        """W (k, k) with W' W = covariance^-1: W @ differences are independent, of variance 1."""
        return self.data.whitener

    @cached_property
    def whitener(self) -> np.ndarray:
        """W (k, k) of the search: the survey's, or sharper with the loss `runout`."""
        if self.loss == "misfit":
            return self.survey_whitener
        return np.eye(int(self.targets.fitted.sum())) * 3.0 / np.sqrt(self.tolerance)

    def difference(self, prediction: Prediction) -> np.ndarray:
        """Predicted minus measured, fitted numbers (k,); 0 where they say nothing (`silent`)."""
        return self.counted(prediction) - self.targets.measured[self.targets.fitted]

    def counted(self, prediction: Prediction) -> np.ndarray:
        """The fitted numbers (k,) as the sum counts them: a limit that is kept costs nothing."""
        counted = np.where(self.silent(prediction), self.targets.measured, prediction.values)
        return counted[self.targets.fitted]

    def silent(self, prediction: Prediction) -> np.ndarray:
        """Numbers whose limit is kept and which therefore say nothing there, (m,) bool."""
        silent = self.targets.kept(prediction.values)
        if self.limit and np.any(np.isfinite(prediction.values)):
            silent[int(np.nanargmax(self._excesses(prediction)))] = False
        return silent

    def excess(self, prediction: Prediction) -> float:
        """Largest movement beyond a fitted limit, in standard deviations; infinite if it failed."""
        excesses = self._excesses(prediction)[self.targets.fitted & self.targets.censored]
        return float("inf") if np.isnan(excesses).any() else float(excesses.max())

    def _excesses(self, prediction: Prediction) -> np.ndarray:
        """Predicted minus limit in standard deviations, (m,); minus infinity without a limit."""
        std = np.sqrt(np.diag(self.targets.covariance))
        own = self.targets.fitted & self.targets.censored
        return np.where(own, (prediction.values - self.targets.measured) / std, -np.inf)

    def value(self, prediction: Prediction) -> float:
        """The loss: m2, or the sum of squared standardised differences; infinite if it failed."""
        difference = self.difference(prediction)
        if not np.all(np.isfinite(difference)):
            return float("inf")
        if self.loss == "runout":
            return float(difference @ difference)
        standardised = self.survey_whitener @ difference
        return float(standardised @ standardised)

    def farthest_off(self, prediction: Prediction) -> float:
        """Largest difference of a fitted number, in standard deviations; infinite if it failed."""
        off = np.abs(self.difference(prediction)) / np.sqrt(np.diag(self.covariance))
        return float(off.max()) if np.isfinite(off).all() else float("inf")

    def residuals(self, prediction: Prediction, fitted: np.ndarray) -> np.ndarray:
        """All that is squared and summed: data, then what is known beforehand."""
        data = self.whitener @ self.difference(prediction)
        rows, constant = self.prior
        return np.concatenate([data, rows @ fitted - constant])

    def jacobian(self, derivative: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivative of `residuals` by the fitted parameters.

        Args:
            derivative: of all predictions by the values, (m, p), per outside unit; columns of NaN
                (a run that failed) count as zero.
            values: (p,) where it was taken.
        """
        scaled = self.fitted_derivative(derivative, values)
        return np.concatenate([self.whitener @ scaled, self.prior[0]])

    def fitted_derivative(self, derivative: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivative of the fitted numbers (k, p) by the fitted (scaled) parameters."""
        known = np.nan_to_num(derivative[self.targets.fitted])
        return known * self.parameters.value_per_fitted(values)[None, :]


@dataclass(frozen=True)
class System:
    """The augmented linear system at a fit.

    Attributes:
        data: the measurements.
        derivative: of all predictions by x, (m, q).
        rows: P of the priors, (r, q).
        moving: (q,) bool: unknowns that the fit could still change; not those held at a bound.
        beyond: variance of the unknowns in addition to what the fit leaves, (q,).
    """

    data: Data
    derivative: np.ndarray
    rows: np.ndarray
    moving: np.ndarray
    beyond: np.ndarray

    @cached_property
    def matrix(self) -> np.ndarray:
        """A = [W J; P] of the moving unknowns, (k + r, number moving)."""
        return np.vstack([self.data.whitened(self.derivative), self.rows])[:, self.moving]

    @cached_property
    def _unread(self) -> np.ndarray:
        """Orthonormal columns along limits that are kept, (k + r, number kept).

        What such a limit would be exceeded by is not known: it is an unknown of its own.
        """
        places = np.flatnonzero(self.data.silent(self.derivative))
        columns = np.zeros((self.matrix.shape[0], len(places)))
        columns[: len(self.data.fitted)] = self.data.whitener[:, places]
        return np.linalg.qr(columns)[0]

    @cached_property
    def _parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Singular value decomposition of A without directions of which nothing is known."""
        read = self.matrix - self._unread @ (self._unread.T @ self.matrix)
        left, size, right = np.linalg.svd(read, full_matrices=False)
        kept = size > NO_KNOWLEDGE
        return left[:, kept], size[kept], right[kept]

    @cached_property
    def basis(self) -> np.ndarray:
        """Q: orthonormal columns that span what the unknowns can imitate, (k + r, rank).

        Limits that are kept are among them: they are neither misfit nor a degree of freedom.
        """
        return np.hstack([self._parts[0], self._unread])

    @property
    def dof(self) -> int:
        """Degrees of freedom: rows of the augmented system less the unknowns it determines."""
        return self.matrix.shape[0] - self.basis.shape[1]

    @cached_property
    def posterior(self) -> np.ndarray:
        """V of all unknowns (q, q); 0 for those at a bound, 1 along what nothing is known of."""
        _, size, right = self._parts
        missing = np.eye(right.shape[1]) - right.T @ right
        inner = (right.T / size**2) @ right + missing
        full = np.zeros((len(self.moving), len(self.moving)))
        full[np.ix_(self.moving, self.moving)] = inner
        return full

    def with_assumed(self, changes: Sequence[np.ndarray]) -> System:
        """The system with more unknowns, each a standard deviation of something assumed.

        Args:
            changes: of all predictions (m,) by one standard deviation of each.
        """
        if not changes:
            return self
        more, (r, q) = len(changes), self.rows.shape
        rows = np.zeros((r + more, q + more))
        rows[:r, :q], rows[r:, q:] = self.rows, np.eye(more)
        derivative = np.column_stack([self.derivative, *changes])
        moving = np.append(self.moving, np.ones(more, bool))
        return System(self.data, derivative, rows, moving, np.append(self.beyond, np.zeros(more)))

    def spread_with(self, error: np.ndarray | None) -> np.ndarray:
        """Standard deviations of the unknowns (q,) where the data err more than they were weighed.

        V + G E G' and what is beyond the data (`Data.strength_error`), G the change of the fit by
        the data: the fit stays the one that C made.

        Args:
            error: E, what C lacks, (m, m); None: nothing.
        """
        variance = np.diag(self.posterior) + self.beyond
        if error is not None:
            size, along = np.linalg.eigh(error)
            for one, column in zip(size, along.T, strict=True):
                if one > 0.0:
                    change = np.sqrt(one) * column
                    variance += self.imitating(self.augmented(change)) ** 2
        return np.sqrt(np.maximum(variance, 0.0))

    def project(self, rows: np.ndarray) -> np.ndarray:
        """(I - Q Q') of augmented vectors, (k + r, ...)."""
        return rows - self.basis @ (self.basis.T @ rows)

    def augmented(self, change: np.ndarray) -> np.ndarray:
        """[W change; 0] of changes of all predictions (m,), (k + r,)."""
        return np.concatenate([self.data.whitened(change), np.zeros(len(self.rows))])

    def imitating(self, augmented: np.ndarray) -> np.ndarray:
        """Change of the unknowns (q,) that comes nearest to an augmented vector (k + r,)."""
        left, size, right = self._parts
        found = np.zeros(len(self.moving))
        found[self.moving] = right.T @ ((left.T @ augmented) / size)
        return found


def system(data: Data, space: Unknowns, derivative: np.ndarray, x: np.ndarray) -> System:
    """The augmented system at x (q,).

    Parameters that rest on a bound or are fixed do not move. Amplitudes do: what they may be beyond
    their bound says nothing about the parameters.
    """
    near = 1e-6 * (space.high - space.low)
    inside = (x > space.low + near) & (x < space.high - near)
    inside[space.p :] = True
    parameters = space.parameters
    strengths = parameters.strengths & ~parameters.has_prior
    beyond = np.zeros(space.size)
    # A share of the strength, and so an error of its logarithm, of which x is a multiple.
    beyond[: space.p][strengths] = (data.strength_error / parameters.prior_std[strengths]) ** 2
    return System(data, derivative, space.prior[0], inside & space.free, beyond)


def augmented_residual(
    data: Data, space: Unknowns, prediction: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """The residual [W (y - f); P0 - P x], (k + r,)."""
    rows, constants = space.prior
    return np.concatenate([data.residual(prediction), constants - rows @ x])


def total_of(data: Data, space: Unknowns, prediction: np.ndarray, x: np.ndarray) -> float:
    """Sum of squares of the augmented residual; infinite where the run failed."""
    if not np.all(np.isfinite(prediction[data.fitted])):
        return float("inf")
    residual = augmented_residual(data, space, prediction, x)
    return float(residual @ residual)


#: A standard deviation of more than this share of the one before: not determined.
AS_WIDE = 0.9
#: Standard normal quantile of 95 % on one side.
ONE_SIDED_95 = 1.645


@dataclass(frozen=True)
class Posterior:
    """Uncertainty that the data leave, p parameters.

    Attributes:
        scaled: covariance in scaled parameters (p, p).
        std: in the parameters' own units (p,).
        correlation: (p, p).
        flat: directions of which the data say nothing, (q, p) in scaled parameters, unit length.
        remaining: standard deviation along each after the data / before, (q,).
    """

    scaled: np.ndarray
    std: np.ndarray
    correlation: np.ndarray
    flat: np.ndarray
    remaining: np.ndarray

    @property
    def determined(self) -> np.ndarray:
        """(p,) bool: the data say something about the parameter itself."""
        return np.sqrt(np.diag(self.scaled)) < AS_WIDE


def posterior(
    objective: Objective,
    derivative: np.ndarray,
    values: np.ndarray,
    errors: np.ndarray | None = None,
) -> Posterior:
    """Covariance and flat directions at an answer.

    Args:
        objective: what was fitted, with which weights, and how well it was surveyed.
        derivative: of all predictions (m, p), per outside unit.
        values: the answer (p,).
        errors: covariance (k, k) of those errors of the fitted numbers that are to count; None:
            all that the objective knows of. The weights of the search are the objective's.
    """
    parameters = objective.parameters
    errors = objective.covariance if errors is None else errors
    weights = objective.whitener
    scaled = weights @ objective.fitted_derivative(derivative, values)
    one = np.eye(scaled.shape[1])
    varied = scaled.T @ (weights @ errors @ weights.T) @ scaled + one
    known = np.linalg.inv(scaled.T @ scaled + one)
    covariance = known @ varied @ known
    covariance = 0.5 * (covariance + covariance.T)
    spread = np.sqrt(np.diag(covariance))
    share, directions = np.linalg.eigh(covariance)
    wide = np.sqrt(share) > AS_WIDE
    flat = simple_basis(directions[:, wide].T)
    remaining = np.sqrt(np.einsum("qi,ij,qj->q", flat, covariance, flat))
    return Posterior(
        scaled=covariance,
        std=spread * parameters.value_per_fitted(values),
        correlation=covariance / np.outer(spread, spread),
        flat=flat,
        remaining=remaining,
    )


def moved_by_noise(
    objective: Objective, derivative: np.ndarray, values: np.ndarray, noise: np.ndarray
) -> np.ndarray:
    """Standard deviations of the values (p,) that are fitted to numbers with a noise (k,).

    Arguments as of `posterior`; the noise of each fitted number is its own.
    """
    parameters, weights = objective.parameters, objective.whitener
    scaled = weights @ objective.fitted_derivative(derivative, values)
    known = np.linalg.inv(scaled.T @ scaled + np.eye(scaled.shape[1]))
    moved = known @ scaled.T @ (weights * noise[None, :])
    return np.linalg.norm(moved, axis=1) * parameters.value_per_fitted(values)


def simple_basis(directions: np.ndarray) -> np.ndarray:
    """Span the same space (q, p) by orthonormal directions that are as near to an axis as can be.

    Equal eigenvalues leave their eigenvectors arbitrary; what the data say nothing of is easier to
    name as `phi_7` than as a mixture.
    """
    space = np.array(directions, dtype=float)
    found = []
    while len(space):
        axis = largest_place(np.linalg.norm(space, axis=0))
        along = space.T @ space[:, axis]
        along /= np.linalg.norm(along)
        found.append(along * np.sign(along[largest_place(np.abs(along))]))
        # The remaining space: its part at right angles to the direction just found.
        rest = space - np.outer(space @ along, along)
        _, size, rows = np.linalg.svd(rest, full_matrices=False)
        space = rows[size > 0.5]
    return np.array(found).reshape(-1, np.shape(directions)[-1])


def direction_in_words(parameters: Parameters, direction: np.ndarray) -> str:
    """A flat direction (p,) as a sentence: which parameters may change together."""
    largest = np.max(np.abs(direction))
    named = [
        (spec.words, share)
        for spec, share in zip(parameters.specs, direction, strict=True)
        if abs(share) > 0.15 * largest
    ]
    named = ranked(named, lambda pair: abs(pair[1]))
    if len(named) == 1:
        return f"{named[0][0]}: the data say nothing of it"
    first = named[0][1]
    parts = [f"{named[0][0]} up"]
    parts += [f"{words} {'up' if share * first > 0 else 'down'}" for words, share in named[1:]]
    return f"{', '.join(parts)}: the data do not notice"


def interval(
    parameters: Parameters, values: np.ndarray, std: np.ndarray
) -> list[tuple[float, float]]:
    """95 % intervals of standard deviations (p,): of logarithms for strengths, cut at bounds."""
    relative = std / parameters.value_per_fitted(values)
    fitted = parameters.to_fitted(values)
    low = parameters.to_values(np.maximum(fitted - 1.96 * relative, parameters.fitted_low))
    high = parameters.to_values(np.minimum(fitted + 1.96 * relative, parameters.fitted_high))
    return [(float(a), float(b)) for a, b in zip(low, high, strict=True)]


def lower_bound(value: float, std: float) -> float:
    """One-sided 95 % lower bound of a strength whose limit of flow is known, in its unit.

    With the limit lognormal about `value`, at the bound something would have run with a probability
    of 95 %; at any smaller strength with more.
    """
    return float(value * np.exp(-ONE_SIDED_95 * std / value))


def root_mean_square(changes: Sequence[Mapping[str, float]], name: str) -> float:
    """Of one parameter's changes over the sides of a sensitivity."""
    return float(np.sqrt(np.mean([change[name] ** 2 for change in changes])))
