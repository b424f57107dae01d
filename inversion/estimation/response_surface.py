"""Predict a model without running it: a local response surface, and one that learns.

Around an anchor (x0, f0) of a model with some effects (`Surface`),

    f(x) = f0 + J (x - x0) + sum_k D_k(a_k),

J from central differences, and D_k the change by an effect the anchor does not have, interpolated
between its signatures of finite amplitude: shaking grows with the square of its amplitude,
softening and water bend, so a slope at zero would not do.

The surface is right at its anchor and along its ladders. Away from them it is wrong by what bends
and by what effects do to each other, and everywhere by the noise of the runs it was made
from (`Surrogate`):

    f(x) = surface(x) + sum_j phi_j(x) b_j + e(x),    phi: 1, u_i, u_i u_j,    u = x - anchor

e is smooth with a length of its own: what products do not describe, right where runs are. All of it
is found from all runs together (Gaussian process regression; Rasmussen and Williams 2006, eq.
2.25), each run a value with noise, each b_j and e with a spread known beforehand in units of that
noise: what the runs of the surface leave open for the constant and the slopes; a share of the
slopes for the products; less for e. So one lucky run moves the answer only as far as one noisy run
may, and runs with different jitters of the points average by themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from inversion.estimation.budget import Runs
from inversion.estimation.data import Data
from inversion.estimation.misfit import augmented_residual
from inversion.estimation.unknowns import Unknowns
from inversion.problem.state import State
from inversion.problem.unknown import Scale

#: Change of a slope over the range of one unknown, as a share of the slope. By judgement: less, and
#: a run far off is taken for noise; more, and noise is taken for a bend.
BEND = 0.5
#: Size of what products do not describe, as a share of the slopes, and its length in x. By
#: judgement: small beside `BEND`, so that a run is first read as slope and bend.
LOCAL, LENGTH = 0.06, 0.5
#: Step to either side by which slopes are taken, about: between `derivatives.FIRST` and `WIDEST`.
SLOPE_STEP = 0.25
#: Counts of an amplitude on either side between which the slope of a ladder is taken: little of the
#: way to a rung; the curve has no noise.
STEP = 0.05
#: Half-width in the parameters within which a surrogate may be believed at all. By judgement: a
#: factor of 20 in a strength; a search that ends there is anchored anew.
REACH = 3.0
#: Runs whose parameters are farther from the anchor than this follow other bends. By judgement: a
#: factor of 7 in a strength.
NEAR = 2.0


@dataclass(frozen=True)
class Ladder:
    """Changes of all predictions by one effect, at the anchor.

    Attributes:
        amplitudes: of the runs, ascending, with 0 among them, (n,).
        changes: of all predictions, (n, m); nothing at 0.
        scale: on which a change lies between those of its neighbours.
    """

    amplitudes: np.ndarray
    changes: np.ndarray
    scale: Scale = Scale()

    @cached_property
    def _curve(self) -> PchipInterpolator:
        counts = [self.scale.count(amplitude) for amplitude in self.amplitudes]
        return PchipInterpolator(counts, self.changes, axis=0)

    def change(self, amplitude: float) -> np.ndarray:
        """Change of all predictions (m,); beyond the ladder in proportion to its last rung."""
        first, last = self.amplitudes[0], self.amplitudes[-1]
        if amplitude > last > 0.0:
            return self.changes[-1] * (self.scale.count(amplitude) / self.scale.count(last))
        if amplitude < first < 0.0:
            return self.changes[0] * (self.scale.count(amplitude) / self.scale.count(first))
        if not first <= amplitude <= last:
            # Only one sign was run: the other is taken as its mirror image.
            return -self.change(-amplitude)
        return self._curve(self.scale.count(amplitude))

    @property
    def rungs(self) -> np.ndarray:
        """Amplitudes other than 0."""
        return self.amplitudes[self.amplitudes != 0.0]


@dataclass(frozen=True)
class Surface:
    """A local response surface of all m predictions.

    Attributes:
        space: unknowns of the model at the anchor.
        x: of the anchor, (q,).
        prediction: there, (m,).
        derivative: there, by x, (m, q).
        ladders: of effects that the anchor does not have, by name.
    """

    space: Unknowns
    x: np.ndarray
    prediction: np.ndarray
    derivative: np.ndarray
    ladders: Mapping[str, Ladder] = field(default_factory=dict)

    def predict(self, space: Unknowns, x: np.ndarray) -> np.ndarray:
        """Prediction (m,) of a model with any of the effects that the surface knows."""
        own, other = self._sorted(space, x)
        found = self.prediction + self.derivative @ (own - self.x)
        for name, amplitude in other.items():
            found = found + self.ladders[name].change(amplitude)
        return found

    def slope(self, space: Unknowns, x: np.ndarray) -> np.ndarray:
        """Derivative of the prediction by the unknowns of `space`, (m, its size)."""
        own, other = self._sorted(space, x)
        columns = [self.derivative[:, place] for place in range(space.p)]
        for effect in space.effects:
            if effect.name in other:
                ladder, scale = self.ladders[effect.name], effect.scale
                here = scale.count(other[effect.name])
                ahead, behind = (scale.value(here + step) for step in (STEP, -STEP))
                columns.append((ladder.change(ahead) - ladder.change(behind)) / (2.0 * STEP))
            else:
                place = self.space.p + self.space.names.index(effect.name)
                columns.append(self.derivative[:, place])
        return np.stack(columns, axis=1)

    def knows(self, name: str) -> bool:
        """True for effects that the surface can predict."""
        return name in self.ladders or name in self.space.names

    def with_ladders(self, ladders: Mapping[str, Ladder]) -> Surface:
        """The same with more ladders, which replace those of the same name."""
        return replace(self, ladders={**self.ladders, **ladders})

    def _sorted(self, space: Unknowns, x: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
        """The anchor's own unknowns at x, and amplitudes of effects that it does not have.

        An effect of the anchor that the other model lacks has amplitude 0 there.
        """
        amplitudes = space.amplitudes(x)
        own = [
            effect.scale.count(amplitudes.pop(effect.name, 0.0)) for effect in self.space.effects
        ]
        return np.concatenate([x[: space.p], own]), amplitudes


@dataclass(frozen=True)
class Spreads:
    """Spreads of the corrections, in units of the noise of one run.

    Attributes:
        mean: of the constant: 1 / root of the runs behind the anchor.
        slope: of one run against another, per unit of a parameter or amplitude, (q,).
        product: of u_i u_j, (q, q).
        local: of e, at a distance of 1 or more from the anchor; in proportion nearer to it.
    """

    mean: float
    slope: np.ndarray
    product: np.ndarray
    local: float


def spreads(
    data: Data, surface: Surface, space: Unknowns, jitter: np.ndarray, *, anchored_by: int
) -> Spreads:
    """Spreads for a model on a surface.

    Args:
        data: weighs the numbers.
        surface: what is corrected.
        space: unknowns of the model.
        jitter: covariance of one run's noise, (m, m).
        anchored_by: runs whose mean the anchor is.
    """
    noise = data.noise(jitter, least=0.01)
    change = np.linalg.norm(data.whitened(surface.slope(space, anchor_of(surface, space))), axis=0)
    for place, effect in enumerate(space.effects):
        if effect.name in surface.ladders:
            change[space.p + place] = np.linalg.norm(
                data.whitened(surface.ladders[effect.name].change(effect.scale.value(1.0)))
            )
    new = np.array([effect.name in surface.ladders for effect in space.effects], dtype=bool)
    slope = np.full(space.size, 1.0 / (np.sqrt(2.0) * SLOPE_STEP))
    slope[space.p :][new] = np.sqrt(2.0)
    product = BEND * np.sqrt(np.outer(change, change)) / noise
    # The response at a second amplitude is known from the ladder already.
    own = np.arange(space.p, space.size)[new]
    product[own, own] = np.sqrt(2.0)
    local = LOCAL * float(np.linalg.norm(change)) / noise
    return Spreads(1.0 / np.sqrt(max(anchored_by, 1)), slope, product, local)


def anchor_of(surface: Surface, space: Unknowns) -> np.ndarray:
    """The surface's anchor among the unknowns of another model, (q,)."""
    own = surface.space.amplitudes(surface.x)
    amplitudes = [effect.scale.count(own.get(effect.name, 0.0)) for effect in space.effects]
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
    space: Unknowns
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
        self.recall_from(runs.every, also_here=False)

    def recall_from(self, every: Sequence[tuple[State, np.ndarray]], *, also_here: bool) -> None:
        """Take in runs of this model, or of one with fewer effects, nearby.

        Args:
            every: states with their numbers (m,).
            also_here: those at the anchor too.
        """
        place = {effect.name: effect for effect in self.space.effects}
        for state, row in every:
            if state.numerics != "own" or not {name for name, _ in state.effects} <= set(place):
                continue
            amplitudes = dict(state.effects)
            x = np.concatenate(
                [
                    self.space.parameters.to_fitted(np.array(state.values)),
                    [one.scale.count(amplitudes.get(name, 0.0)) for name, one in place.items()],
                ]
            )
            own = np.concatenate([np.arange(self.space.p), self._own])
            away = np.max(np.abs((x - self.anchor)[own.astype(int)]))
            near = np.max(np.abs((x - self.anchor)[: self.space.p])) <= NEAR
            if near and (also_here or away > 1e-9):
                self.learn(x, row)

    @property
    def believed(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds (q,) within which it may be believed at all; of amplitudes their own."""
        low, high, p = self.space.low.copy(), self.space.high.copy(), self.space.p
        low[:p] = np.maximum(low[:p], self.anchor[:p] - REACH)
        high[:p] = np.minimum(high[:p], self.anchor[:p] + REACH)
        return low, high

    def ends_at(self, x: np.ndarray) -> bool:
        """Whether parameters of x (q,) are where it ends, and not at bounds of their own."""
        low, high = self.believed
        ended = (x <= low) & (low > self.space.low) | (x >= high) & (high < self.space.high)
        return bool(np.any(ended))

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Prediction of all numbers, (m,)."""
        found = self.surface.predict(self.space, x)
        if not self.points:
            return found
        weights = self._weights()
        u = x - self.anchor
        local, _ = self._local(u)
        return found + (self._known_features @ self._features(u) + local) @ weights

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Its derivative by x, (m, q)."""
        found = self.surface.slope(self.space, x)
        if not self.points:
            return found
        weights = self._weights()
        u, q = x - self.anchor, self.space.size
        change = np.zeros((len(self._sizes), q))
        change[1 : 1 + q] = np.eye(q)
        columns = 1 + q + np.arange(len(self._pairs[0]))
        np.add.at(change, (columns, self._pairs[0]), u[self._pairs[1]])
        np.add.at(change, (columns, self._pairs[1]), u[self._pairs[0]])
        _, local = self._local(u)
        by_run = self._known_features @ (self._sizes[:, None] * change) + local
        return found + weights.T @ by_run

    def total(self, data: Data, x: np.ndarray) -> float:
        """Sum of squares of the augmented residual at x."""
        residual = augmented_residual(data, self.space, self.predict(x), x)
        return float(residual @ residual)

    def _weights(self) -> np.ndarray:
        """(K + 1)^-1 times what the runs found, (runs, m)."""
        if self._learnt is None:
            self._away = np.array(self.points) - self.anchor
            self._known_features = np.array([self._features(u) for u in self._away])
            gram = self._known_features @ self._known_features.T + np.eye(len(self._away))
            gram += np.array([self._local(u)[0] for u in self._away])
            self._learnt = np.linalg.solve(gram, np.array(self.surprises))
        return self._learnt

    def _features(self, u: np.ndarray) -> np.ndarray:
        """phi_j times their spreads, (features,)."""
        return self._sizes * np.concatenate([[1.0], u, u[self._pairs[0]] * u[self._pairs[1]]])

    def _local(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Covariance of e at u with e at the runs, (runs,), and its derivative by u (runs, q)."""
        apart = u - self._away
        size, fading = _fading(float(np.linalg.norm(u))), u / max(float(np.linalg.norm(u)), 1e-12)
        there = np.array([_fading(d)[0] for d in np.linalg.norm(self._away, axis=1)])
        near = np.exp(-0.5 * np.sum(apart**2, axis=1) / LENGTH**2)
        scale = self.spread.local**2 * there * near
        slope = -size[0] * apart / LENGTH**2 + size[1] * fading
        return scale * size[0], scale[:, None] * slope


def _fading(distance: float) -> tuple[float, float]:
    """Share of e at a distance from the anchor, and its slope: none there, all from 1 on."""
    return (float(distance), 1.0) if distance < 1.0 else (1.0, 0.0)
