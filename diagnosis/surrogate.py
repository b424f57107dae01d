"""A response surface that learns: what a few noisy runs say beyond it.

The surface is right at its anchor and along its ladders. Away from them it is wrong by what bends
and by what effects do to each other, and everywhere by the noise of the runs it was made from:

    f(x) = surface(x) + sum_j phi_j(x) b_j,    phi: 1, u_i, u_i u_j

with u = x - anchor. The b_j are found from all runs together (Bayesian linear regression), each run
a value with noise, each b_j with a spread known beforehand in units of that noise: what the runs of
the surface leave open for the constant and the slopes; for the products, a change of a slope by its
own size over the range of its unknown. So one lucky run moves the answer only as far as one noisy
run may, and runs with different jitters of the points average by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from diagnosis.runs import Runs
from diagnosis.space import Space
from diagnosis.surface import Surface
from diagnosis.whitened import Data, augmented_residual

#: Change of a slope over the range of one unknown, as a share of the slope.
BEND = 0.7
#: Noise of a slope taken from two runs about this far apart, in units of the noise of a run.
SLOPE_STEP = 0.25
#: Runs whose parameters are farther from the anchor than this follow other bends.
NEAR = 0.6


@dataclass(frozen=True)
class Spreads:
    """Spreads of the corrections, in units of the noise of one run.

    Attributes:
        mean: of the constant: 1 / root of the runs behind the anchor.
        slope: of one run against another, per unit of a parameter or amplitude, (q,).
        product: of u_i u_j, (q, q).
    """

    mean: float
    slope: np.ndarray
    product: np.ndarray


def spreads(
    data: Data, surface: Surface, space: Space, jitter: np.ndarray, *, anchored_by: int
) -> Spreads:
    """Spreads for a model on a surface.

    Args:
        data: weighs the numbers.
        surface: what is corrected.
        space: unknowns of the model.
        jitter: covariance of one run's noise, (m, m).
        anchored_by: runs whose mean the anchor is.
    """
    fitted = jitter[np.ix_(data.fitted, data.fitted)]
    noise = np.sqrt(max(float(np.trace(data.whitener @ fitted @ data.whitener.T)), 0.01))
    change = np.linalg.norm(data.whitened(surface.slope(space, anchor_of(surface, space))), axis=0)
    for place, effect in enumerate(space.effects):
        if effect.name in surface.ladders:
            change[space.p + place] = np.linalg.norm(
                data.whitened(surface.ladders[effect.name].change(effect.unit))
            )
    new = np.array([effect.name in surface.ladders for effect in space.effects], dtype=bool)
    slope = np.full(space.size, 1.0 / (np.sqrt(2.0) * SLOPE_STEP))
    slope[space.p :][new] = np.sqrt(2.0)
    product = BEND * np.sqrt(np.outer(change, change)) / noise
    # What an effect does at a second amplitude the ladder knows already.
    own = np.arange(space.p, space.size)[new]
    product[own, own] = np.sqrt(2.0)
    return Spreads(1.0 / np.sqrt(max(anchored_by, 1)), slope, product)


def anchor_of(surface: Surface, space: Space) -> np.ndarray:
    """The surface's anchor among the unknowns of another model, (q,)."""
    own = surface.space.amplitudes(surface.x)
    amplitudes = [own.get(effect.name, 0.0) / effect.unit for effect in space.effects]
    return np.concatenate([surface.x[: space.p], amplitudes])


@dataclass
class Surrogate:
    """A surface for one model, with what its runs have taught.

    Attributes:
        surface: what is corrected.
        space: unknowns of the model, (q,).
        spread: of the corrections.
        points: where it was run, (q,) each.
        surprises: what the runs found beyond the surface, (m,) each.
    """

    surface: Surface
    space: Space
    spread: Spreads
    points: list[np.ndarray] = field(default_factory=list)
    surprises: list[np.ndarray] = field(default_factory=list)
    _learnt: np.ndarray | None = None

    def __post_init__(self) -> None:
        self.anchor = anchor_of(self.surface, self.space)
        self._own = [
            self.space.p + place
            for place, effect in enumerate(self.space.effects)
            if effect.name not in self.surface.ladders
        ]
        self._pairs = np.triu_indices(self.space.size)
        halves = np.where(self._pairs[0] == self._pairs[1], 0.5, 1.0)
        self._sizes = np.concatenate(
            [[self.spread.mean], self.spread.slope, halves * self.spread.product[self._pairs]]
        )

    def learn(self, x: np.ndarray, prediction: np.ndarray) -> None:
        """Take in a run; one that failed teaches nothing."""
        if np.all(np.isfinite(prediction)):
            self.points.append(np.array(x))
            self.surprises.append(prediction - self.surface.predict(self.space, x))
            self._learnt = None

    def recall(self, runs: Runs) -> None:
        """Take in every run known so far of this model, or of one with fewer effects, nearby.

        Runs at the anchor itself have made the surface: they teach nothing new.
        """
        place = {effect.name: effect for effect in self.space.effects}
        for state, row in runs.every:
            if state.numerics != "own" or not {name for name, _ in state.effects} <= set(place):
                continue
            amplitudes = dict(state.effects)
            x = np.concatenate(
                [
                    self.space.parameters.to_fitted(np.array(state.values)),
                    [amplitudes.get(name, 0.0) / effect.unit for name, effect in place.items()],
                ]
            )
            own = np.concatenate([np.arange(self.space.p), self._own])
            away = np.max(np.abs((x - self.anchor)[own.astype(int)]))
            if 1e-9 < away and np.max(np.abs((x - self.anchor)[: self.space.p])) <= NEAR:
                self.learn(x, row)

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Prediction of all numbers, (m,)."""
        return self.surface.predict(self.space, x) + self._features(x) @ self.corrections

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Its derivative by x, (m, q)."""
        u, q = x - self.anchor, self.space.size
        change = np.zeros((q, len(self._sizes)))
        change[:, 1 : 1 + q] = np.eye(q)
        for column, (i, j) in enumerate(zip(*self._pairs, strict=True)):
            change[i, 1 + q + column] += u[j]
            change[j, 1 + q + column] += u[i]
        scaled = change * self._sizes
        return self.surface.slope(self.space, x) + (scaled @ self.corrections).T

    @property
    def corrections(self) -> np.ndarray:
        """Most probable b_j, each in units of its spread, (features, m)."""
        if self._learnt is None:
            if not self.points:
                return np.zeros((len(self._sizes), len(self.surface.prediction)))
            features = np.array([self._features(x) for x in self.points])
            gram = features @ features.T + np.eye(len(features))
            self._learnt = features.T @ np.linalg.solve(gram, np.array(self.surprises))
        return self._learnt

    def _features(self, x: np.ndarray) -> np.ndarray:
        """phi_j times their spreads, (features,)."""
        u = x - self.anchor
        return self._sizes * np.concatenate([[1.0], u, u[self._pairs[0]] * u[self._pairs[1]]])

    def total(self, data: Data, x: np.ndarray) -> float:
        """Sum of squares of the augmented residual at x."""
        residual = augmented_residual(data, self.space, self.predict(x), x)
        return float(residual @ residual)
