"""Where a model fails: the contiguous window of a series with the worst disagreement.

Every stretch of every series is a window. Long ones hold larger sums of squares by nature, so sums
are standardised before they are compared; and since the worst of many is looked for, its p is the
share of simulated noises whose own worst window, anywhere, is as bad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.adequacy.adequacy import ProjectedFit, exceedance, fitted_rows, standardised_sum
from inversion.estimation.data import Axis, Places

#: Fewest numbers of a window, since one alone is the test of the largest residual, and its largest
#: share of the series, by judgement: all of it is a group.
LEAST, LARGEST = 2, 0.6


@dataclass(frozen=True)
class WorstWindow:
    """The window farthest off.

    Attributes:
        measurement: its series.
        axis: of the series.
        index: of its numbers in the vector of all, (n,).
        begin: place of the first number.
        end: place of the last.
        chi2: sum of squares of its whitened residuals.
        p: that noise has a window as bad anywhere.
    """

    measurement: str
    axis: Axis
    index: np.ndarray
    begin: float
    end: float
    chi2: float
    p: float


def worst_window(found: ProjectedFit, places: list[Places]) -> WorstWindow | None:
    """The window of any series that is farthest off; None where no series is long enough."""
    data, basis = found.system.data, found.system.basis
    best, best_z, null = None, -np.inf, None
    for place in places:
        rows = fitted_rows(data, place) if place.series else np.zeros(0, dtype=int)
        longest = int(LARGEST * len(rows))
        own = _sums(found.residual[rows, None])
        noise = _sums(found.noise[rows])
        for first in range(len(rows)):
            for last in range(first + LEAST, min(first + longest, len(rows)) + 1):
                inside = rows[first:last]
                rest = np.eye(len(inside)) - basis[inside] @ basis[inside].T
                z = standardised_sum(own[last] - own[first], rest)[0]
                drawn = standardised_sum(noise[last] - noise[first], rest)
                null = drawn if null is None else np.maximum(null, drawn)
                if z > best_z:
                    best_z, best = z, (place, inside, float((own[last] - own[first])[0]))
    if best is None or null is None:
        return None
    place, inside, chi2 = best
    index = data.fitted[inside]
    where = place.place[np.isin(place.index, index)]
    return WorstWindow(
        measurement=place.name,
        axis=place.axis,
        index=index,
        begin=float(where[0]),
        end=float(where[-1]),
        chi2=chi2,
        p=exceedance(null, best_z),
    )


def _sums(residuals: np.ndarray) -> np.ndarray:
    """Running sums of squares with a zero in front, (n + 1, draws)."""
    return np.vstack([np.zeros((1, residuals.shape[1])), np.cumsum(residuals**2, axis=0)])
