"""A bounded Gauss-Newton search that asks for few forward runs (step 2, and every refit).

A surrogate proposes where the sum of squares is least, within the bounds; runs with two jitters of
the points correct it there; and so on until it proposes what it has seen. The answer is the least
of the surrogate, not of the runs: the least of several noisy runs is a lucky one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inversion.estimation.budget import Runs
from inversion.estimation.data import Data
from inversion.estimation.gauss_newton import bounded_step
from inversion.estimation.misfit import augmented_residual
from inversion.estimation.response_surface import Surrogate
from inversion.estimation.unknowns import Unknowns
from pipeline.ties import ranked

#: Jitters of the points of the runs that correct a surrogate, two at a time, in turn.
JITTERS = ((1, 2), (3, 4), (5, 6), (7, 8))
#: A proposal this near to a run, in every unknown, is not worth another. By judgement: 16 % of a
#: strength, over which the surrogate knows more than a noisy run tells.
SEEN = 0.15
#: A hair of ridge: no step along what nothing is known of, and none of the others shorter by it.
RIDGE = 1e-6
#: Two first guesses are different where some unknown differs by this much: twice `SEEN`, so that no
#: run is near to both.
APART = 0.3


@dataclass(frozen=True)
class Fit:
    """A model brought to the measurements.

    Attributes:
        space: its unknowns.
        x: where its sum of squares is least, (q,).
        prediction: there, of all numbers, (m,), noise averaged.
        derivative: there, by x, (m, q).
        total: sum of squares of the augmented residual.
    """

    space: Unknowns
    x: np.ndarray
    prediction: np.ndarray
    derivative: np.ndarray
    total: float

    @property
    def names(self) -> tuple[str, ...]:
        """Effects of the model."""
        return self.space.names


def least(
    data: Data,
    surrogate: Surrogate,
    start: np.ndarray,
    *,
    held: Sequence[int] = (),
) -> tuple[np.ndarray, float]:
    """Where a surrogate's sum of squares is least, and that sum.

    Parameters stay where the surrogate may be believed; amplitudes have their bounds alone.

    Args:
        data: what is fitted.
        surrogate: proposes.
        start: first guess, (q,).
        held: unknowns that stay where the first guess has them.
    """
    space = surrogate.space
    low, high = surrogate.believed
    free = space.free.copy()
    free[list(held)] = False
    x = np.clip(start, low, high)
    best = surrogate.total(data, x)
    for _ in range(30):
        residual = augmented_residual(data, space, surrogate.predict(x), x)
        matrix = np.vstack([data.whitened(surrogate.slope(x)), space.prior[0]])
        step = np.zeros(len(x))
        step[free] = bounded_step(
            matrix[:, free], residual, (low - x)[free], (high - x)[free], ridge=RIDGE
        )
        for share in (1.0, 0.4, 0.16, 0.06):
            trial = np.clip(x + share * step, low, high)
            total = surrogate.total(data, trial)
            if total < best:
                break
        else:
            break
        gained, x, best = best - total, trial, total
        if gained < 1e-4:
            break
    return x, best


def best_of(
    data: Data, surrogate: Surrogate, starts: Sequence[np.ndarray], count: int
) -> list[tuple[np.ndarray, float]]:
    """Different valleys of a surrogate that several first guesses lead to, deepest first."""
    found = ranked((least(data, surrogate, x) for x in starts), lambda pair: -pair[1])
    kept: list[tuple[np.ndarray, float]] = []
    for x, total in found:
        if all(np.max(np.abs(x - other)) > APART for other, _ in kept):
            kept.append((x, total))
        if len(kept) == count:
            break
    return kept


def search(
    runs: Runs,
    data: Data,
    surrogate: Surrogate,
    starts: Sequence[np.ndarray],
    *,
    first: Sequence[np.ndarray],
    turns: int,
    what: str,
) -> Fit | None:
    """Run where the surrogate proposes, correct it, and propose again.

    Args:
        runs: the model.
        data: what is fitted.
        surrogate: of the model; learns.
        starts: first guesses on the surrogate, which cost nothing.
        first: points that are run before any proposal, one jitter each.
        turns: proposals that are run at most, with two jitters each.
        what: words for what is left out where the allowance ends.

    Returns:
        the least of the surrogate; None where no run succeeded or none was allowed.
    """
    seen = run_points(
        runs, surrogate, [(x, JITTERS[n % 4][n // 4 % 2]) for n, x in enumerate(first)], what
    )
    settling = False
    for turn in range(turns):
        x = best_of(data, surrogate, [*seen, *starts], 1)[0][0]
        near = [other for other in seen[len(first) :] if np.max(np.abs(x - other)) < SEEN]
        if settling and near:
            break
        # Seen once, it is run once more with two other jitters; that settles it.
        settling = bool(near)
        found = run_points(
            runs, surrogate, [(x, seed) for seed in JITTERS[turn % len(JITTERS)]], what
        )
        if not found:
            break
        seen += found
    if not surrogate.points:
        return None
    return settled(data, surrogate, [*seen, *starts])


def run_points(
    runs: Runs, surrogate: Surrogate, wanted: Sequence[tuple[np.ndarray, int]], what: str
) -> list[np.ndarray]:
    """Run points with a jitter each and teach the surrogate; those that were run."""
    states = [surrogate.space.state(x, seed=seed) for x, seed in wanted]
    if not states or not runs.affords(states, what):
        return []
    for (x, _), row in zip(wanted, runs.predict(states), strict=True):
        surrogate.learn(x, row)
    return [x for x, _ in wanted]


def settled(data: Data, surrogate: Surrogate, starts: Sequence[np.ndarray]) -> Fit:
    """The least of a surrogate as a fit."""
    x, total = best_of(data, surrogate, starts, 1)[0]
    return Fit(surrogate.space, x, surrogate.predict(x), surrogate.slope(x), total)
