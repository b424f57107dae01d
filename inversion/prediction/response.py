"""A smooth response from few runs: predicted numbers as a function of standard normal scores.

One strength: runs at evenly spaced scores; a number that only rises or falls is made monotone (a
stronger soil runs no farther; what goes against that is noise) and interpolated by a monotone
cubic. All others, elevations among them, and all numbers of several strengths, whose runs are a
star and a Sobol set: a Gaussian process; what it misses of runs left out is added to the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import ndtri

from inversion.estimation.gaussian_process import fit
from pipeline.ties import smallest

#: Scores beyond this are taken as this: one in 740 strengths on either side.
FARTHEST = 3.0
#: Runs of one strength, and how many a star and a Sobol set add for each of several.
ALONG, STAR, SPREAD = 15, (-2.6, -1.2, 1.2, 2.6), 8
#: A score of this is 1 to a Gaussian process, whose lengths are for points from about -1 to 1.
SCALE = 2.0
#: Runs within this distance tell what is missed of runs left out: those at the rim are beyond all
#: others where they are left out.
INNER = 2.0
#: Fewer runs of one strength say nothing of a number that falls and rises.
LEAST_RUNS = 5
#: A number is monotone where levelling changes it by at most so many times the noise of its
#: process, or this share of its spread: isotonic regression takes as much noise away as is there.
MOST_LEVELLED, LEVELLED = 2.0, 0.01


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


def response(scores: np.ndarray, values: np.ndarray, groups: np.ndarray | None = None) -> Response:
    """The response of runs at scores (n, p) with numbers (n, m), all finite.

    Args:
        scores: of the runs.
        values: their numbers.
        groups: (m,) numbers of one group have one unit and bend alike; None: each for itself.
    """
    groups = np.arange(values.shape[1]) if groups is None else groups
    if scores.shape[1] == 1 and len(scores) < LEAST_RUNS:
        return Monotone(scores[:, 0], values)
    smooth = ProcessSurface(scores, values, groups)
    if scores.shape[1] > 1:
        return smooth
    curve = Monotone(scores[:, 0], values)
    # What falls and rises again, an elevation for instance, is not made to fall.
    bends = curve.missed > np.hypot(MOST_LEVELLED * smooth.noise, LEVELLED * values.std(axis=0))
    return Chosen(bends, smooth, curve)


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


class ProcessSurface:
    """One or several strengths: a Gaussian process, kept within the range of the runs."""

    def __init__(self, scores: np.ndarray, values: np.ndarray, groups: np.ndarray) -> None:
        self._places = [np.flatnonzero(groups == group) for group in np.unique(groups)]
        self._processes = [fit(scores / SCALE, values[:, place]) for place in self._places]
        self._range = values.min(axis=0), values.max(axis=0)
        self._far = np.abs(scores).max(axis=0)
        inner = np.linalg.norm(scores, axis=1) < INNER
        self.noise, self.missed = np.zeros((2, values.shape[1]))
        for place, process in zip(self._places, self._processes, strict=True):
            self.noise[place] = process.noise
            self.missed[place] = np.sqrt(np.mean(process.left_out[inner] ** 2, axis=0))

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """See `Response`."""
        found = np.empty((len(scores), len(self.noise)))
        points = np.clip(scores, -self._far, self._far) / SCALE
        for place, process in zip(self._places, self._processes, strict=True):
            found[:, place] = process.mean(points)
        return np.clip(found, *self._range)


class Chosen:
    """Of two responses the first for some numbers, (m,) bool, the second for the others."""

    def __init__(self, first: np.ndarray, one: Response, other: Response) -> None:
        self._first, self._both = first, (one, other)
        self.missed = np.where(first, one.missed, other.missed)

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """See `Response`."""
        one, other = (response(scores) for response in self._both)
        return np.where(self._first, one, other)


@dataclass(frozen=True)
class JoinedSurfaces:
    """Final surfaces of the runs, joined linearly: elevations (n, x) at scores (n, p)."""

    scores: np.ndarray
    surfaces: np.ndarray

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """Surfaces (s, x) at scores (s, p)."""
        if self.scores.shape[1] > 1:
            together = np.zeros(self.surfaces.shape[1], dtype=int)
            return ProcessSurface(self.scores, self.surfaces, together)(scores)
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
