"""Step 8: evidence of a model, and when an effect is accepted.

Laplace's integral over all unknowns of a model, linear around its fit:

    ln Z = -r'r / 2 + ln det(2 pi V) / 2 - ln(prior volume of the amplitudes) + ln P(within bounds)
           + ln prior odds,

the odds 1/C(K, n) for n effects out of K candidates. r'r is taken where the sum of squares would be
least without the amplitudes' bounds; P is the share of that Gaussian which lies within them. A
parameter that rests on a bound has one flank of a Gaussian, from the bound inwards.
What all models share (priors of the parameters, the data's own constant) is left out, so only
differences mean anything.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import log_ndtr, ndtr

from inversion.estimation.data import Data
from inversion.estimation.misfit import System, augmented_residual, system
from inversion.estimation.surface_search import Fit
from pipeline.ties import ranked

#: Least share of a Gaussian that can lie within the bounds, so that its logarithm exists: -28,
#: after which nothing is accepted; below, the fit is at its bound anyway.
LEAST_SHARE = 1e-12


def ln_evidence(data: Data, fit: Fit, candidates: int) -> float:
    """Ln Z of a fit, prior odds of its effects among `candidates` included."""
    space = fit.space
    linear = system(data, space, fit.derivative, fit.x)
    residual = augmented_residual(data, space, fit.prediction, fit.x)
    step = linear.imitating(residual)
    # A step of a parameter is none: its bounds and the search have settled it.
    centre = fit.x + step
    left = linear.project(residual)
    sizes = np.linalg.svd(linear.matrix, compute_uv=False)
    sizes = np.where(sizes > 1e-6, sizes, 1.0)
    volume = 0.5 * len(sizes) * math.log(2.0 * math.pi) - float(np.sum(np.log(sizes)))
    fitted = space.p + np.flatnonzero(space.free[space.p :])  # a switch is where it is
    share = share_within(
        centre[fitted],
        linear.posterior[np.ix_(fitted, fitted)],
        space.low[fitted],
        space.high[fitted],
    )
    odds = -ln_choices(candidates, len(space.effects))
    flanks = _at_bounds(data, fit, linear, left)
    return float(
        -0.5 * left @ left
        + volume
        + flanks
        - space.ln_prior_width
        + math.log(max(share, LEAST_SHARE))
        + odds
    )


def _at_bounds(data: Data, fit: Fit, linear: System, left: np.ndarray) -> float:
    """Ln of the integrals over the parameters that rest on a bound, each by itself.

    With t the way inwards and what moves at its best for each t, half the sum of squares grows by
    g t + h t^2 / 2.

    Args:
        data: the measurements.
        fit: with parameters at their bounds or not.
        linear: of what moves.
        left: residual that it leaves.
    """
    space, total = fit.space, 0.0
    rows, _ = space.prior
    for k in np.flatnonzero(space.free[: space.p] & ~linear.moving[: space.p]):
        column = np.concatenate([data.whitened(fit.derivative[:, k]), rows[:, k]])
        is_low = fit.x[k] - space.low[k] < space.high[k] - fit.x[k]
        inwards = linear.project(column if is_low else -column)
        g, h, width = -inwards @ left, inwards @ inwards, space.high[k] - space.low[k]
        root = math.sqrt(max(h, 1e-12))
        near, far = log_ndtr(-g / root), log_ndtr(-(g + h * width) / root)
        within = near + math.log1p(-math.exp(min(far - near, -1e-12)))
        total += 0.5 * (g / root) ** 2 + 0.5 * math.log(2.0 * math.pi) - math.log(root) + within
    return total


def ln_choices(candidates: int, effects: int) -> float:
    """Ln of the number of models with this many effects out of this many candidates."""
    return math.log(math.comb(max(candidates, effects), effects))


def share_within(
    mean: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray
) -> float:
    """Share of a Gaussian (n,) within a box; exact for one and two, beyond that of marginals."""
    n = len(mean)
    if n == 0:
        return 1.0
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    if n != 2:
        shares = ndtr((high - mean) / std) - ndtr((low - mean) / std)
        return float(np.prod(np.maximum(shares, 0.0)))
    return _share_of_two(mean, covariance, std, low, high)


def _share_of_two(
    mean: np.ndarray, covariance: np.ndarray, std: np.ndarray, low: np.ndarray, high: np.ndarray
) -> float:
    """By quadrature over the first, the second given the first in closed form."""
    begin = max(low[0], mean[0] - 8.0 * std[0])
    end = min(high[0], mean[0] + 8.0 * std[0])
    if end <= begin:
        return 0.0
    nodes, weights = np.polynomial.legendre.leggauss(80)
    first = 0.5 * (end + begin) + 0.5 * (end - begin) * nodes
    slope = covariance[0, 1] / covariance[0, 0]
    rest = math.sqrt(max(covariance[1, 1] - slope * covariance[0, 1], 1e-300))
    centre = mean[1] + slope * (first - mean[0])
    inside = ndtr((high[1] - centre) / rest) - ndtr((low[1] - centre) / rest)
    density = np.exp(-(((first - mean[0]) / std[0]) ** 2) / 2.0) / math.sqrt(2.0 * math.pi) / std[0]
    return float(0.5 * (end - begin) * np.sum(weights * density * inside))


def probabilities(evidence: dict[tuple[str, ...], float]) -> dict[tuple[str, ...], float]:
    """Probabilities of models from their ln Z, largest first."""
    top = max(evidence.values())
    weights = {names: math.exp(value - top) for names, value in evidence.items()}
    total = sum(weights.values())
    order = ranked(sorted(weights), weights.__getitem__)
    return {names: weights[names] / total for names in order}


def credible_set(
    probability: dict[tuple[str, ...], float], wanted: float
) -> dict[tuple[str, ...], float]:
    """Most probable models that together reach a probability."""
    chosen: dict[tuple[str, ...], float] = {}
    for names, share in probability.items():
        chosen[names] = share
        if sum(chosen.values()) >= wanted:
            break
    return chosen
