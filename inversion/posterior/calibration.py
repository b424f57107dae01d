"""Is a posterior calibrated? Ranks of the truth among its draws, and coverage of its intervals.

Where truths are drawn from the prior, data from the truths and posteriors from the data, the rank
of a truth among the draws of its posterior is uniform, and a 95 % interval covers 95 % of the
truths (simulation-based calibration; Talts et al. 2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import bdtr

#: Probability of the band within which a calibrated coverage or a histogram's bar lies.
BAND = 0.95


@dataclass(frozen=True)
class Coverage:
    """How often intervals cover the truth.

    Attributes:
        nominal: probability of the interval.
        covered: share of the truths within it.
        low: of the binomial band that a calibrated posterior stays in.
        high: of it.
    """

    nominal: float
    covered: float
    low: float
    high: float

    @property
    def inside(self) -> bool:
        """The share lies within the band."""
        return self.low <= self.covered <= self.high


def rank_of(truth: float, draws: np.ndarray) -> float:
    """Share of draws (s,) below the truth, strictly between 0 and 1."""
    return (float(np.sum(draws < truth)) + 0.5) / (len(draws) + 1.0)


def coverage(ranks: np.ndarray, nominal: Sequence[float]) -> list[Coverage]:
    """Coverage of central intervals by ranks of n truths, (n,)."""
    found = []
    for probability in nominal:
        inside = np.abs(ranks - 0.5) <= 0.5 * probability
        low, high = band(len(ranks), probability)
        found.append(
            Coverage(probability, float(inside.mean()), low / len(ranks), high / len(ranks))
        )
    return found


def band(trials: int, probability: float) -> tuple[int, int]:
    """Counts between which a binomial count lies with a probability of at least `BAND`."""
    below = np.array([bdtr(k, trials, probability) for k in range(trials + 1)])
    low = int(np.argmax(below > 0.5 * (1.0 - BAND)))
    return low, int(np.argmax(below >= 1.0 - 0.5 * (1.0 - BAND)))
