"""Residuals made independent, and what the unknowns cannot imitate: whitened least squares.

W with W' W = C^-1 turns residuals into independent numbers of variance 1. Priors join as rows:

    A = [W J; P],    r = [W (y - f); P0 - P x],    A = Q R,

so that (I - Q Q') r is what no change of the unknowns can take away, and V = (R' R)^-1 their
covariance. W is the symmetric root C^-1/2: of all choices it moves the numbers least, so that a
whitened residual still belongs to the place it comes from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.fitting.space import Space

#: Singular values of A below this share of 1 (the prior's scale) count as no knowledge at all.
NO_KNOWLEDGE = 1e-6


@dataclass(frozen=True)
class Data:
    """What was measured, how well, and which of it is fitted.

    Attributes:
        measured: (m,).
        covariance: C, (m, m).
        fitted: places of the fitted numbers, (k,).
        held_out: places of the held-out numbers, (h,).
    """

    measured: np.ndarray
    covariance: np.ndarray
    fitted: np.ndarray
    held_out: np.ndarray

    @cached_property
    def whitener(self) -> np.ndarray:
        """W = C^-1/2 of the fitted numbers, (k, k)."""
        return symmetric_whitener(self.covariance[np.ix_(self.fitted, self.fitted)])

    def residual(self, prediction: np.ndarray) -> np.ndarray:
        """W (y - f) of the fitted numbers, (k,); predictions are of all numbers, (m,)."""
        return self.whitener @ (self.measured - prediction)[self.fitted]

    def whitened(self, change: np.ndarray) -> np.ndarray:
        """W times changes of all predictions, (m, ...) -> (k, ...)."""
        return self.whitener @ change[self.fitted]

    @cached_property
    def conditional(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the held-out numbers given the fitted ones: gain (h, k) and covariance (h, h)."""
        own = self.covariance[np.ix_(self.held_out, self.held_out)]
        cross = self.covariance[np.ix_(self.held_out, self.fitted)]
        gain = cross @ self.whitener.T @ self.whitener
        return gain, own - gain @ cross.T


def symmetric_whitener(matrix: np.ndarray) -> np.ndarray:
    """C^-1/2 of a positive definite C (n, n)."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors / np.sqrt(np.maximum(values, 1e-12 * values.max()))) @ vectors.T


@dataclass(frozen=True)
class System:
    """The augmented linear system at a fit.

    Attributes:
        data: the measurements.
        derivative: of all predictions by x, (m, q).
        rows: P of the priors, (r, q).
        moving: (q,) bool: unknowns that the fit could still change; not those held at a bound.
    """

    data: Data
    derivative: np.ndarray
    rows: np.ndarray
    moving: np.ndarray

    @cached_property
    def matrix(self) -> np.ndarray:
        """A = [W J; P] of the moving unknowns, (k + r, number moving)."""
        return np.vstack([self.data.whitened(self.derivative), self.rows])[:, self.moving]

    @cached_property
    def _parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Singular value decomposition of A without directions of which nothing is known."""
        left, size, right = np.linalg.svd(self.matrix, full_matrices=False)
        kept = size > NO_KNOWLEDGE
        return left[:, kept], size[kept], right[kept]

    @property
    def basis(self) -> np.ndarray:
        """Q: orthonormal columns that span what the unknowns can imitate, (k + r, rank)."""
        return self._parts[0]

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


def system(data: Data, space: Space, derivative: np.ndarray, x: np.ndarray) -> System:
    """The augmented system at x (q,).

    Parameters that rest on a bound or are fixed do not move. Amplitudes do: what they may be beyond
    their bound is no knowledge of the parameters.
    """
    near = 1e-6 * (space.high - space.low)
    inside = (x > space.low + near) & (x < space.high - near)
    inside[space.p :] = True
    return System(data, derivative, space.prior[0], inside & space.free)


def augmented_residual(
    data: Data, space: Space, prediction: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """The residual [W (y - f); P0 - P x], (k + r,)."""
    rows, constants = space.prior
    return np.concatenate([data.residual(prediction), constants - rows @ x])
