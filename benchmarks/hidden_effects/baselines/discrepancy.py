"""A discrepancy of the base model as a Gaussian process (Kennedy and O'Hagan 2001).

    y - f(x) = delta + e,   delta ~ GP(0, K),   e ~ N(0, C)

about the fit of the base model, linear in its parameters, which have no prior beyond what the case
states. Every measurement has a discrepancy of its own, independent of the others: along a series
K_ij = a^2 exp(-(s_i - s_j)^2 / (2 l^2)), of numbers that lie along nothing a^2 on the diagonal. a
and l are those of the largest marginal likelihood, the parameters integrated out (Rasmussen and
Williams 2006, eq. 2.45). It names nothing. Something is missing if twice the rise of ln of the
likelihood by the discrepancy has p below 0.05 as a chi2 of as many degrees as there are a and l.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.stats import chi2

from benchmarks.hidden_effects.baselines.answers import Answer, answer_of
from benchmarks.hidden_effects.baselines.slide import Series, Slide
from benchmarks.hidden_effects.scoring.score import ALARM_P

#: Numbers along a series from which its discrepancy has a length.
LONG = 3
#: First guesses: size in standard deviations of the measurement, length as a share of the series.
SIZES, LENGTHS = (0.3, 3.0), (0.1, 0.4)
#: Bounds of the same.
SIZE_WITHIN, LENGTH_WITHIN = (1e-3, 1e3), (0.03, 2.0)


@dataclass(frozen=True)
class Marginal:
    """The marginal likelihood at one choice of sizes and lengths.

    Attributes:
        ln_likelihood: less a constant.
        step: of the parameters that move, (p,).
        covariance: of it, (p, p).
    """

    ln_likelihood: float
    step: np.ndarray
    covariance: np.ndarray


def has_length(series: Series) -> bool:
    """The discrepancy of a measurement runs along it."""
    return len(series.place) >= LONG


def kernel(slide: Slide, ln: np.ndarray) -> np.ndarray:
    """K (k, k).

    Args:
        slide: with its measurements.
        ln: logarithms of each size, and after it of the length where there is one, (h,).
    """
    found = np.zeros((len(slide.residual), len(slide.residual)))
    std, place = np.sqrt(np.diag(slide.covariance)), 0
    for one in slide.series:
        if not one.rows:
            continue
        block = np.eye(len(one.rows))
        variance = math.exp(2.0 * ln[place]) * float(np.mean(std[one.rows] ** 2))
        place += 1
        if has_length(one):
            where = np.array(one.place)
            apart = (where[:, None] - where) / (math.exp(ln[place]) * np.ptp(where))
            block, place = np.exp(-0.5 * apart**2), place + 1
        found[np.ix_(one.rows, one.rows)] = variance * block
    return found


def marginal(slide: Slide, discrepancy: np.ndarray) -> Marginal:
    """The parameters by generalised least squares, and the likelihood without them.

    Args:
        slide: linear about its fit.
        discrepancy: K, (k, k).
    """
    moving = np.array(slide.moving)
    rows = np.array(slide.prior_rows).reshape(-1, len(moving))
    design = np.vstack([np.array(slide.derivative), rows])[:, moving]
    left = np.concatenate([slide.residual, slide.prior_residual])
    whole = block_diag(np.array(slide.covariance) + discrepancy, np.eye(len(rows)))
    factor = cho_factor(whole, lower=True)
    information = design.T @ cho_solve(factor, design)
    covariance = np.linalg.inv(information)
    step = covariance @ (design.T @ cho_solve(factor, left))
    rest = left - design @ step
    ln_det = 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
    ln_det += float(np.linalg.slogdet(information)[1])
    return Marginal(-0.5 * (ln_det + float(rest @ cho_solve(factor, rest))), step, covariance)


def discrepancy(slide: Slide) -> Answer:
    """S_r with the discrepancy, and whether there is one."""
    kinds = [kind for one in slide.series if one.rows
             for kind in ("size", "length")[: 1 + has_length(one)]]  # fmt: skip
    within = {"size": SIZE_WITHIN, "length": LENGTH_WITHIN}
    bounds = [tuple(np.log(within[kind])) for kind in kinds]
    starts = [
        np.log([size if kind == "size" else length for kind in kinds])
        for size in SIZES
        for length in LENGTHS
    ]

    def loss(ln: np.ndarray) -> float:
        return -marginal(slide, kernel(slide, ln)).ln_likelihood

    tried = [minimize(loss, start, bounds=bounds, method="L-BFGS-B") for start in starts]
    best = min(tried, key=lambda one: float(one.fun))
    found = marginal(slide, kernel(slide, best.x))
    none = marginal(slide, np.zeros((len(slide.residual), len(slide.residual))))
    gain = found.ln_likelihood - none.ln_likelihood
    first = slide.moving[0]  # a strength at its bound stays there
    step, variance = (found.step[0], found.covariance[0, 0]) if first else (0.0, 0.0)
    answer = answer_of(slide, [], gain, slide.strength(float(step), float(variance)))
    alarm = float(chi2.sf(2.0 * gain, len(kinds))) < ALARM_P
    return answer.model_copy(update={"alarm": alarm})
