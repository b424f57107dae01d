"""How well a hidden effect can be seen at all: lambda, and the amplitude that gives it.

lambda is chi2 of the noise-free residual after the base model has been refitted: what a diagnosis
with perfect luck has to go by. The covariance is the judge's own, model error included
(`diagnosis.covariance`). With C = L L', W = L^-1, A = [W J; priors] = Q R,

    lambda = |(I - Q Q') [W d; 0]|^2,    d = f(theta, a) - f(theta, 0).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

#: Ends of the bins of lambda; no case above the last counts.
BINS = (3.0, 10.0, 25.0, 60.0, 200.0)
#: An amplitude is good enough where ln lambda is this near the ln of what was wanted.
NEAR = 0.3
#: Amplitudes that are tried after the first.
TRIES = 5


def detectability(
    change: np.ndarray, derivative: np.ndarray, covariance: np.ndarray, rows: np.ndarray
) -> float:
    """The detectability of a change.

    Args:
        change: d, of all measurements, (m,).
        derivative: of the measurements by the fitted parameters, (m, p).
        covariance: C, (m, m).
        rows: of the priors of the fitted parameters, (r, p).
    """
    lower = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(lower, np.column_stack([change, derivative]))
    matrix = np.vstack([whitened[:, 1:], rows])
    residual = np.concatenate([whitened[:, 0], np.zeros(len(rows))])
    basis, _ = np.linalg.qr(matrix)
    left = residual - basis @ (basis.T @ residual)
    return float(left @ left)


def bin_of(value: float) -> int | None:
    """The bin of a lambda, from 0; None below the first or above the last."""
    if not BINS[0] <= value < BINS[-1]:
        return None
    return int(np.searchsorted(BINS, value, side="right")) - 1


def middle_of(number: int) -> float:
    """The geometric middle of a bin."""
    return math.sqrt(BINS[number] * BINS[number + 1])


def find_amplitude(
    lambdas: Callable[[list[float]], list[float]],
    ladder: tuple[float, ...],
    highest: float,
    wanted: float,
) -> tuple[float, float]:
    """An amplitude whose lambda is near `wanted`, and that lambda.

    The middle rung of the ladder is tried first; then ln lambda is interpolated over ln a, or drawn
    out as the square of the amplitude, up to `highest`. What comes nearest is returned, also where
    it is not near.

    Args:
        lambdas: lambda of each amplitude (magnitudes); NaN where a run failed.
        ladder: magnitudes small to large.
        highest: largest magnitude allowed.
        wanted: lambda.
    """
    known: dict[float, float] = {}

    def look(amplitudes: list[float]) -> None:
        known.update(zip(amplitudes, lambdas(amplitudes), strict=True))

    look([ladder[1]])
    for _ in range(TRIES):
        best = _nearest(known, wanted)
        if best is not None and abs(math.log(known[best] / wanted)) <= NEAR:
            break
        guess = _next(known, wanted, highest)
        if guess is None:
            break
        look([guess])
    best = _nearest(known, wanted)
    return (0.0, 0.0) if best is None else (best, known[best])


def _nearest(known: dict[float, float], wanted: float) -> float | None:
    usable = {a: value for a, value in known.items() if np.isfinite(value) and value > 0.0}
    return min(usable, key=lambda a: abs(math.log(usable[a] / wanted))) if usable else None


def _next(known: dict[float, float], wanted: float, highest: float) -> float | None:
    """The next amplitude to try; None where there is nothing new to try."""
    usable = sorted((a, value) for a, value in known.items() if np.isfinite(value) and value > 0)
    failed = min((a for a, value in known.items() if not np.isfinite(value)), default=math.inf)
    if not usable:
        return failed / 3.0 if math.isfinite(failed) else None
    below = [pair for pair in usable if pair[1] < wanted]
    above = [pair for pair in usable if pair[1] >= wanted]
    if below and above:
        (a, low), (b, high) = max(below), min(above)
        if b < a:  # not monotonous: between the two that lie nearest in lambda
            (a, low), (b, high) = max(below, key=lambda p: p[1]), min(above, key=lambda p: p[1])
        share = math.log(wanted / low) / math.log(high / low)
        guess = a * (b / a) ** min(max(share, 0.1), 0.9)
    elif above:
        a, value = min(above)
        guess = a * max(math.sqrt(wanted / value), 0.1)
    else:
        a, value = max(below)
        guess = min(a * min(math.sqrt(wanted / value), 4.0), highest, math.sqrt(a * failed))
    return None if any(math.isclose(guess, a, rel_tol=0.02) for a in known) else guess
