"""How sure the answer is: covariance, flat directions in words, the rest of the assumptions.

The covariance of the answer follows from the survey's covariance C, the derivative J at the answer,
the weights W of the search and what was known before, all in scaled parameters, in which what was
known before has variance 1:

    V = H^-1 (J' W' (W C W') W J + 1) H^-1,   H = J' W' W J + 1,

the spread of what the search finds when survey and prior vary. With the loss `misfit` W is that of
the survey, W C W' = 1, and V = (J' C^-1 J + 1)^-1. With `runout` the data come first whatever the
prior says, so the prior must not narrow the answer either. An eigenvector of V with an eigenvalue
near 1 is a direction of which the data say nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inversion.estimation.misfit import Objective
from inversion.estimation.unknowns import Parameters

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


def simple_basis(directions: np.ndarray) -> np.ndarray:
    """Span the same space (q, p) by orthonormal directions that are as near to an axis as can be.

    Equal eigenvalues leave their eigenvectors arbitrary; what the data say nothing of is easier to
    name as `phi_7` than as a mixture.
    """
    space = np.array(directions, dtype=float)
    found = []
    while len(space):
        axis = int(np.argmax(np.linalg.norm(space, axis=0)))
        along = space.T @ space[:, axis]
        along /= np.linalg.norm(along)
        found.append(along * np.sign(along[np.argmax(np.abs(along))]))
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
    named.sort(key=lambda pair: -abs(pair[1]))
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
