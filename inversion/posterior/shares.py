"""What moves a strength: shares of its posterior variance, after Sobol.

With Y the logarithm of the strength (of another parameter: its value) and X_i the other unknowns
and the errors of the fitted measurements, all of them posterior draws,

    first order  S_i = Var(E[Y | X_i]) / Var(Y),
    total        T_i = 1 - Var(E[Y | all but X_i]) / Var(Y):

the share of the variance that would go if X_i became known, and the share that would stay if
everything else did (Sobol 1993; for inputs that depend on each other Kucherenko et al. 2012). The
conditional means are polynomials fitted to the draws: cubic in one input, quadratic in all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Share:
    """Of one input: see above."""

    name: str
    first: float
    total: float


def shares(output: np.ndarray, inputs: np.ndarray, names: list[str]) -> list[Share]:
    """Shares of the variance of an output (s,) by inputs (s, i), the largest total first."""
    spread = inputs.std(axis=0)
    moving = spread > 1e-12
    x = (inputs[:, moving] - inputs[:, moving].mean(axis=0)) / spread[moving]
    found, everything = [], explained(output, _quadratic(x))
    for place, name in enumerate(np.array(names)[moving]):
        alone = explained(output, x[:, [place]] ** np.arange(4))
        others = explained(output, _quadratic(np.delete(x, place, axis=1)))
        # What no input explains is nobody's: the total is what this one adds to the others.
        found.append(Share(str(name), alone, max(everything - others, 0.0)))
    return sorted(found, key=lambda share: -share.total)


def explained(output: np.ndarray, features: np.ndarray) -> float:
    """Share of the variance of an output (s,) that a linear function of features (s, f) has.

    Less what as many features without a meaning would explain by chance.
    """
    count, rank = features.shape[0], features.shape[1]
    coefficients, *_ = np.linalg.lstsq(features, output, rcond=None)
    left = np.var(output - features @ coefficients) / max(np.var(output), 1e-300)
    return float(np.clip(1.0 - left * (count - 1) / max(count - rank, 1), 0.0, 1.0))


def _quadratic(x: np.ndarray) -> np.ndarray:
    """1, x_i, x_i x_j of inputs (s, i)."""
    rows, columns = np.triu_indices(x.shape[1])
    return np.hstack([np.ones((len(x), 1)), x, x[:, rows] * x[:, columns]])
