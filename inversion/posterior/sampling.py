"""Nested sampling of a posterior (dynesty), so that several valleys and hard bounds are right.

Skilling (2006); dynamic ellipsoids and random walks as in Speagle (2020), MNRAS 493(3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import gaussian_kde

LEFT_EVIDENCE = 0.05
"""The sampler ends when less than this is left in the logarithm of the evidence."""

DEPTH = 0.2
"""A valley of its own is separated by a dip of at least this share of the lower of two peaks."""


@dataclass(frozen=True)
class Samples:
    """A sampled posterior.

    Attributes:
        x: (s, d) equally weighted draws.
        ln_likelihood: (s,).
        ln_evidence: of the data, with its standard error.
        ln_evidence_std: the same.
        evaluations: of the likelihood.
        effective: effective number of draws before they were weighted equally.
    """

    x: np.ndarray
    ln_likelihood: np.ndarray
    ln_evidence: float
    ln_evidence_std: float
    evaluations: int
    effective: float


def sample(
    ln_likelihood: Callable[[np.ndarray], np.ndarray],
    from_shares: Callable[[np.ndarray], np.ndarray],
    dimensions: int,
    *,
    live: int,
    draws: int,
    seed: int,
    on_iteration: Callable[[int], None] | None = None,
) -> Samples:
    """Sample a posterior.

    Args:
        ln_likelihood: of points (1, d).
        from_shares: the prior: points of shares (d,) of its probability.
        dimensions: d.
        live: live points.
        draws: equally weighted draws that are returned.
        seed: the draws depend on nothing else.
        on_iteration: called now and then with the iterations so far.
    """
    from dynesty import NestedSampler

    sampler = NestedSampler(
        lambda x: float(ln_likelihood(x[None])[0]),
        from_shares,
        dimensions,
        nlive=live,
        bound="multi",
        sample="rwalk" if dimensions > 3 else "unif",
        rstate=np.random.default_rng(seed),
    )
    for number, _ in enumerate(sampler.sample(dlogz=LEFT_EVIDENCE)):
        if on_iteration is not None and number % 200 == 0:
            on_iteration(number)
    for _ in sampler.add_live_points():
        pass
    result = sampler.results
    weights = np.exp(result.logwt - result.logz[-1])
    weights /= weights.sum()
    places = _resampled(weights, draws, np.random.default_rng(seed + 1))
    return Samples(
        x=result.samples[places],
        ln_likelihood=result.logl[places],
        ln_evidence=float(result.logz[-1]),
        ln_evidence_std=float(result.logzerr[-1]),
        evaluations=int(np.sum(result.ncall)),
        effective=float(1.0 / np.sum(weights**2)),
    )


def _resampled(weights: np.ndarray, draws: int, generator: np.random.Generator) -> np.ndarray:
    """Places of equally weighted draws: systematic resampling, in random order."""
    edges = (np.arange(draws) + generator.uniform()) / draws
    places = np.searchsorted(np.cumsum(weights), edges).clip(0, len(weights) - 1)
    return generator.permutation(places)


def valleys(values: np.ndarray, places: int = 400) -> list[tuple[float, float]]:
    """Separate peaks of a density, as (value, share of the draws), most likely first.

    Args:
        values: (s,) draws.
        places: where the smoothed density is looked at.
    """
    if np.ptp(values) < 1e-12 * max(abs(values).max(), 1.0):
        return [(float(values[0]), 1.0)]
    at = np.linspace(values.min(), values.max(), places)
    density = np.concatenate([[0.0], gaussian_kde(values)(at), [0.0]])
    peaks, _ = find_peaks(density)
    kept = [peaks[0]]
    for peak in peaks[1:]:
        dip = density[kept[-1] : peak + 1].min()
        if dip < (1.0 - DEPTH) * min(density[kept[-1]], density[peak]):
            kept.append(peak)
        elif density[peak] > density[kept[-1]]:
            kept[-1] = peak
    dips = [at[a + int(np.argmin(density[a : b + 1])) - 1]
            for a, b in zip(kept[:-1], kept[1:], strict=True)]  # fmt: skip
    edges = np.array([-np.inf, *dips, np.inf])
    shares = np.histogram(values, edges)[0] / len(values)
    found = [(float(at[peak - 1]), float(s)) for peak, s in zip(kept, shares, strict=True)]
    return sorted(found, key=lambda pair: -pair[1])
