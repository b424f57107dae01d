"""Draws from a posterior: a nested sampler for the answer, weighted prior draws on the way to it.

The nested sampler (Skilling 2006; dynesty, Speagle 2020) holds a set of live points within
ellipsoids, several of them where the posterior has several valleys, and raises the likelihood that
they must exceed. It needs the prior as a map of the unit cube alone, so bounds and priors that are
no Gaussians are exact, and it gives the evidence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.ties import largest_place

#: The sampler stops when what is left could add so much to ln Z.
EVIDENCE_LEFT = 0.05
#: Power of the likelihood that places further runs: wider than the posterior, whose tails are
#: only as good as the emulator there.
WIDENED = 0.4
#: Effective number of prior draws that a tempered posterior keeps.
LEAST_EFFECTIVE = 300


@dataclass(frozen=True)
class Sampled:
    """A sampled posterior.

    Attributes:
        shares: draws of equal weight in the unit cube of the prior, (s, q).
        log_evidence: ln Z.
        log_evidence_std: its standard deviation.
        information: of the data, from prior to posterior [nats].
        calls: of the likelihood.
    """

    shares: np.ndarray
    log_evidence: float
    log_evidence_std: float
    information: float
    calls: int


def nested(
    log_likelihood: Callable[[np.ndarray], float],
    unknowns: int,
    *,
    draws: int,
    live_points: int,
    seed: int,
) -> Sampled:
    """Draws by nested sampling.

    Args:
        log_likelihood: of a point of the unit cube (q,).
        unknowns: q.
        draws: s.
        live_points: more are slower and more accurate.
        seed: of everything random.
    """
    import dynesty

    sampler = dynesty.NestedSampler(
        log_likelihood,
        lambda share: share,
        unknowns,
        nlive=live_points,
        bound="multi",
        sample="rwalk",
        rstate=np.random.default_rng(seed),
    )
    sampler.run_nested(dlogz=EVIDENCE_LEFT, print_progress=False)
    found = sampler.results
    weights = found.importance_weights()
    chosen = resampled(weights, draws, np.random.default_rng(seed + 1))
    return Sampled(
        shares=np.asarray(found.samples)[chosen],
        log_evidence=float(found.logz[-1]),
        log_evidence_std=float(found.logzerr[-1]),
        information=float(found.information[-1]),
        calls=int(np.sum(found.ncall)),
    )


def resampled(weights: np.ndarray, draws: int, random: np.random.Generator) -> np.ndarray:
    """Places (s,) of equally weighted draws, systematic, in random order."""
    steps = (np.arange(draws) + random.random()) / draws
    ends = np.cumsum(weights / weights.sum())
    chosen = np.minimum(np.searchsorted(ends, steps), len(weights) - 1)
    return random.permutation(chosen)


def tempered(log_likelihoods: np.ndarray, draws: int, random: np.random.Generator) -> np.ndarray:
    """Places (s,) of prior draws (n,) by a power of their likelihood: so many that enough count."""
    finite = np.where(np.isfinite(log_likelihoods), log_likelihoods, -np.inf)
    above = finite - finite.max()
    power = WIDENED
    while True:
        weights = np.exp(power * above)
        if weights.sum() ** 2 / np.sum(weights**2) >= LEAST_EFFECTIVE or power < 1e-3:
            return resampled(weights, draws, random)
        power *= 0.8


def spread_out(points: np.ndarray, number: int) -> np.ndarray:
    """Places of points (s, q) that lie far from each other, the first nearest to their mean."""
    chosen = [largest_place(-np.sum((points - points.mean(axis=0)) ** 2, axis=1))]
    distance = np.sum((points - points[chosen[0]]) ** 2, axis=1)
    while len(chosen) < min(number, len(points)):
        chosen.append(largest_place(distance))
        distance = np.minimum(distance, np.sum((points - points[chosen[-1]]) ** 2, axis=1))
    return np.array(chosen)
