"""First-order second-moment method: mean and standard deviation by the derivative at the mean.

mean = f(m), variance = g' C g + noise^2, with the means m of the strengths, their covariance C and
the derivative g of a number f. As Duncan (2000) has it, g is the central difference over one
standard deviation to either side. Where a number bends over that range, the samples say more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inversion.prediction.known_strength import DrawnStrength, KnownStrength
from inversion.prediction.response import FARTHEST, Response

#: Scores among which a strength is looked for.
SCORES = np.linspace(-FARTHEST, FARTHEST, 1201)


@dataclass(frozen=True)
class FirstOrder:
    """Mean and standard deviation of m numbers to first order, (m,) each."""

    mean: np.ndarray
    std: np.ndarray


def first_order(
    strengths: Sequence[KnownStrength], response: Response, noise: np.ndarray
) -> FirstOrder:
    """The moments of the numbers of a response.

    Args:
        strengths: p of them.
        response: of the numbers, at scores.
        noise: standard deviation of the numbers at given strengths, (m,).
    """
    scores = mean_scores(strengths)
    middle = response(scores[None])[0]
    slopes = []
    for place, one in enumerate(strengths):
        ends = np.tile(scores, (2, 1))
        ends[:, place] = [_score(one, one.mean - one.std), _score(one, one.mean + one.std)]
        low, high = response(ends)
        apart = np.diff(one.at(ends[:, place]))[0]
        slopes.append((high - low) / apart)
    slope = np.array(slopes)
    variance = np.einsum("pm,pq,qm->m", slope, covariance(strengths), slope)
    return FirstOrder(middle, np.sqrt(variance + noise**2))


def mean_scores(strengths: Sequence[KnownStrength]) -> np.ndarray:
    """Scores of the means of the strengths, (p,)."""
    return np.array([_score(one, one.mean) for one in strengths])


def covariance(strengths: Sequence[KnownStrength]) -> np.ndarray:
    """Of the strengths, (p, p); draws of a posterior vary together, others independently."""
    drawn = [one.draws for one in strengths if isinstance(one, DrawnStrength)]
    if len(drawn) == len(strengths):
        return np.atleast_2d(np.cov(np.array(drawn), bias=True))
    return np.diag([one.std**2 for one in strengths])


def _score(strength: KnownStrength, value: float) -> float:
    """Score of a value, the nearest within `FARTHEST`."""
    return float(np.interp(value, strength.at(SCORES), SCORES))
