"""Calibration: from a first guess to the answer, by the method asked for.

In: a `Search` and first guesses. Out: `Found`. A start at which nothing moves goes through the
geometric scan first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from inversion.gauss_newton import gauss_newton
from inversion.geometric_scan import moves, scan
from inversion.lbfgsb import lbfgsb
from inversion.parameters import Parameters
from inversion.search import Found, Search

Method = Literal["gauss_newton", "lbfgsb"]
METHODS = {"gauss_newton": gauss_newton, "lbfgsb": lbfgsb}

#: Further starts: strengths times this, and friction angles at this share of their bounds.
OTHER_STARTS = ((0.65, 0.25), (1.6, 0.75), (0.45, 0.6), (2.2, 0.4))


def calibrate(search: Search, start: np.ndarray, *, method: Method, least_m: float) -> Found:
    """Search from one first guess.

    Args:
        search: the problem.
        start: values (p,).
        method: gauss_newton or lbfgsb.
        least_m: what must move at the start, else the strengths are scanned first [m].

    Raises:
        WorkFailed: nothing moves at all, or the first run failed.
    """
    first = search.look(start, "start", 0)
    stands = np.isfinite(first.loss) and not moves(search, first, least_m)
    if stands and first.loss >= search.objective.tolerance:
        weaker = scan(search, start, least_m).values
        search.measure_noise(None, weaker)
        first = search.look(weaker, "scan", 0)
    else:
        search.measure_noise(first, start)
    return METHODS[method](search, first)


def further_starts(parameters: Parameters, number: int) -> Sequence[np.ndarray]:
    """First guesses beside the question's own, (p,) each: weaker, stronger, other angles."""
    found = []
    for factor, share in OTHER_STARTS[:number]:
        inside = parameters.low + share * (parameters.high - parameters.low)
        scaled = np.where(parameters.strengths, parameters.start * factor, parameters.start)
        values = np.where(parameters.logarithmic, scaled, inside)
        found.append(parameters.clipped(values))
    return found
