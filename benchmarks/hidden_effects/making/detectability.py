"""How well a hidden effect can be seen at all: lambda, and the amplitude that gives it.

lambda is chi2 of the noise-free residual after the base model has been refitted: what a diagnosis
with perfect luck has to go by. The covariance C = L L' is the judge's own at the refitted state,
model error included (`inversion.estimation.covariance`). With the effect's reading y, the base
model's f and the true parameters theta_0 (a prior counts as one more number that reads the truth),

    lambda = min over theta of |L^-1 (y - f(theta))|^2 + |R (theta - theta_0)|^2.

The refit is real: f is known along the whole range of the strength, so that a large effect, which
the base model imitates by a distant strength, is not taken for one that it cannot imitate at all,
as a projection on f's derivative at theta_0 would. y and f are means of runs with other jitters,
in two halves: the product of the halves' residuals is free of the runs' own noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

#: Ends of the bins of lambda; no case above the last counts.
BINS = (3.0, 10.0, 25.0, 60.0, 200.0)
#: An amplitude is good enough where ln lambda is this near the ln of what was wanted.
NEAR = 0.3
#: Amplitudes that are tried after the first.
TRIES = 5
#: Lambda below which nothing was seen: a larger amplitude is tried.
UNSEEN = 0.3
#: Strengths looked at from one level of the curve to the next; refits, each with the covariance of
#: the one before.
BETWEEN, REFITS = 12, 3


@dataclass(frozen=True)
class Curve:
    """The base model's reading along the range of its strength.

    Attributes:
        u: fitted strength at n levels, ascending, (n,).
        halves: readings there in two halves of the runs, (2, n, m); other parameters at their
            prior means.
        slopes: derivative by the q other parameters, which are held by priors, (n, m, q), fitted
            units.
        model_error: covariance C_num of the model's own error, (n, m, m).
        survey: covariance of the survey, (m, m).
        missing: what the judge adds to its readings for their cells, (n, m).
    """

    u: np.ndarray
    halves: np.ndarray
    slopes: np.ndarray
    model_error: np.ndarray
    survey: np.ndarray
    missing: np.ndarray

    @property
    def corrected(self) -> Curve:
        """The curve of a judge of slides that have no cells of its own."""
        return replace(self, halves=self.halves + self.missing)

    def covariance(self, u: float) -> np.ndarray:
        """C of a judge whose base model has the strength u, (m, m)."""
        above = int(np.clip(np.searchsorted(self.u, u), 1, len(self.u) - 1))
        low, high = self.u[above - 1 : above + 1]
        share = float(np.clip((u - low) / (high - low), 0.0, 1.0))
        error = (1.0 - share) * self.model_error[above - 1] + share * self.model_error[above]
        return self.survey + error

    def between(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Strengths (k,), halves (2, k, m) and slopes (k, m, q) between the levels too."""
        places = np.arange(BETWEEN * (len(self.u) - 1) + 1) / BETWEEN
        u = np.interp(places, np.arange(len(self.u)), self.u)
        return (
            u,
            CubicSpline(self.u, self.halves, axis=1)(u),
            CubicSpline(self.u, self.slopes, axis=0)(u),
        )


@dataclass(frozen=True)
class Refit:
    """The base model that comes nearest to a slide with an effect.

    Attributes:
        u: its fitted strength.
        held: its other parameters less their prior means, fitted units, (q,).
        seen: lambda.
        left: what it leaves of each number, in standard deviations of the judge, (m,).
    """

    u: float
    held: np.ndarray
    seen: float
    left: np.ndarray


def refit(slide: np.ndarray, curve: Curve, u: float, held: np.ndarray) -> Refit:
    """Refit the base model to what a slide with an effect reads.

    Args:
        slide: readings in two halves of its runs, (2, m).
        curve: of the base model.
        u: true fitted strength; its covariance begins.
        held: true other parameters less their prior means, fitted units, (q,).
    """
    fine = curve.between()
    found = _nearest_base(slide, fine, curve.covariance(u), held)
    for _ in range(REFITS - 1):
        again = _nearest_base(slide, fine, curve.covariance(found.u), held)
        settled = again.u == found.u
        found = again
        if settled:
            break
    return found


def _nearest_base(
    slide: np.ndarray,
    fine: tuple[np.ndarray, np.ndarray, np.ndarray],
    covariance: np.ndarray,
    held: np.ndarray,
) -> Refit:
    """The best of all strengths; at each the held parameters follow from linear least squares."""
    u, halves, slopes = fine
    lower = np.linalg.cholesky(covariance)
    whiten = np.linalg.inv(lower)
    left = (slide[:, None] - halves) @ whiten.T  # (2, k, m)
    slopes = whiten @ slopes  # (k, m, q)
    across = slopes.transpose(0, 2, 1)
    normal = across @ slopes + np.eye(len(held))
    right = (across @ left.mean(axis=0)[..., None])[..., 0] + held
    best = np.linalg.solve(normal, right[..., None])  # (k, q, 1)
    left = left - (slopes @ best)[None, ..., 0]
    prior = np.sum((best[..., 0] - held) ** 2, axis=1)
    chi2 = np.sum(left.mean(axis=0) ** 2, axis=1) + prior
    k = int(np.argmin(chi2))
    seen = float(left[0, k] @ left[1, k] + prior[k])
    each = lower @ left[:, k].mean(axis=0) / np.sqrt(np.diag(covariance))
    return Refit(float(u[k]), best[k, :, 0], max(seen, 0.0), each)


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
    it is not near; (0, 0) where every run failed.

    Args:
        lambdas: lambda of each amplitude (magnitudes); NaN where a run failed.
        ladder: magnitudes small to large.
        highest: largest magnitude allowed.
        wanted: lambda.
    """
    known: dict[float, float] = {}

    def look(amplitudes: list[float]) -> None:
        found = lambdas(amplitudes)
        known.update((a, max(value, UNSEEN)) for a, value in zip(amplitudes, found, strict=True))

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
    usable = {a: value for a, value in known.items() if np.isfinite(value)}
    return min(usable, key=lambda a: abs(math.log(usable[a] / wanted))) if usable else None


def _next(known: dict[float, float], wanted: float, highest: float) -> float | None:
    """The next amplitude to try; None where there is nothing new to try."""
    usable = sorted((a, value) for a, value in known.items() if np.isfinite(value))
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
