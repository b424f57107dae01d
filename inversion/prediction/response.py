"""A smooth response from few runs: predicted numbers as a function of standard normal scores.

One strength: runs at evenly spaced scores; each number is made monotone (a stronger soil runs no
farther; what goes against that is noise) and interpolated by a monotone cubic. Several strengths: a
star and a Sobol set of runs, joined by a thin-plate spline whose smoothing is the one that predicts
left-out runs best; what it misses of them is added to the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.special import ndtri

from pipeline.ties import smallest

if TYPE_CHECKING:
    from scipy.interpolate import RBFInterpolator

#: Scores beyond this are taken as this: one in 740 strengths on either side.
FARTHEST = 3.0
#: Runs of one strength, and how many a star and a Sobol set add for each of several.
ALONG, STAR, SPREAD = 15, (-2.6, -1.2, 1.2, 2.6), 8
SMOOTHINGS = (1e-6, 0.03, 0.3, 3.0)


def design(strengths: int) -> np.ndarray:
    """Scores of the runs, (n, p)."""
    if strengths == 1:
        return np.linspace(-FARTHEST, FARTHEST, ALONG)[:, None]
    from scipy.stats import qmc  # takes half a second to import

    star = [np.zeros(strengths)]
    star += [value * axis for axis in np.eye(strengths) for value in STAR]
    number = SPREAD * strengths
    sobol = qmc.Sobol(strengths, seed=0).random_base2(int(np.ceil(np.log2(number))))[:number]
    return np.concatenate([star, np.clip(1.3 * ndtri(sobol), -FARTHEST, FARTHEST)])


class Response(Protocol):
    """Numbers (m,) at any scores."""

    missed: np.ndarray
    """Standard deviation of what the response does not explain of the runs, (m,)."""

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """Numbers (s, m) at scores (s, p)."""
        ...


def response(scores: np.ndarray, values: np.ndarray) -> Response:
    """The response of runs at scores (n, p) with numbers (n, m), all finite."""
    if scores.shape[1] == 1:
        return Monotone(scores[:, 0], values)
    return SplineSurface(scores, values)


class Monotone:
    """One strength: monotone, and without overshoot between the runs."""

    def __init__(self, scores: np.ndarray, values: np.ndarray) -> None:
        order = np.argsort(scores)
        levelled = np.stack([monotone(column) for column in values[order].T], axis=1)
        from scipy.interpolate import PchipInterpolator  # a quarter of a second of every start

        self._curve = PchipInterpolator(scores[order], levelled, axis=0)
        self._ends = scores[order][[0, -1]]
        self.missed = np.sqrt(np.mean((levelled - values[order]) ** 2, axis=0))

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """See `Response`; beyond the runs the last of them."""
        return self._curve(np.clip(scores[:, 0], *self._ends))


class SplineSurface:
    """Several strengths: a thin-plate spline, kept within the range of the runs."""

    def __init__(self, scores: np.ndarray, values: np.ndarray) -> None:
        errors = [_left_out(scores, values, smoothing) for smoothing in SMOOTHINGS]
        scale = np.maximum(values.std(axis=0), 1e-9)
        best = smallest(range(len(errors)), lambda k: float(np.sum((errors[k] / scale) ** 2)))
        self._spline = _spline(scores, values, SMOOTHINGS[best])
        self._range = values.min(axis=0), values.max(axis=0)
        self._far = np.abs(scores).max(axis=0)
        self.missed = np.sqrt(np.mean(errors[best] ** 2, axis=0))

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """See `Response`."""
        return np.clip(self._spline(np.clip(scores, -self._far, self._far)), *self._range)


@dataclass(frozen=True)
class JoinedSurfaces:
    """Final surfaces of the runs, joined linearly: elevations (n, x) at scores (n, p)."""

    scores: np.ndarray
    surfaces: np.ndarray

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """Surfaces (s, x) at scores (s, p)."""
        if self.scores.shape[1] > 1:
            return SplineSurface(self.scores, self.surfaces)(scores)
        order = np.argsort(self.scores[:, 0])
        known = self.scores[order, 0]
        place = np.clip(np.searchsorted(known, scores[:, 0]), 1, len(known) - 1)
        share = (scores[:, 0] - known[place - 1]) / (known[place] - known[place - 1])
        share = np.clip(share, 0.0, 1.0)[:, None]
        surfaces = self.surfaces[order]
        return (1.0 - share) * surfaces[place - 1] + share * surfaces[place]


def monotone(values: np.ndarray) -> np.ndarray:
    """The nearest rising or falling series to values (n,), whichever is nearer."""
    from scipy.optimize import isotonic_regression

    both = [isotonic_regression(values, increasing=rising).x for rising in (True, False)]
    return smallest(both, lambda series: float(np.sum((series - values) ** 2)))


def _spline(scores: np.ndarray, values: np.ndarray, smoothing: float) -> RBFInterpolator:
    from scipy.interpolate import RBFInterpolator

    return RBFInterpolator(scores, values, kernel="thin_plate_spline", smoothing=smoothing)


def _left_out(scores: np.ndarray, values: np.ndarray, smoothing: float) -> np.ndarray:
    """Error at each run of the spline through the others, runs at the rim left out, (k, m)."""
    errors = []
    for number in np.flatnonzero(np.linalg.norm(scores, axis=1) < 2.0):
        others = np.arange(len(scores)) != number
        spline = _spline(scores[others], values[others], smoothing)
        errors.append(spline(scores[number][None])[0] - values[number])
    return np.array(errors)
