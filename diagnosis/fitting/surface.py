"""What is known of a model near a fit without running it: a local response surface.

Around an anchor (x0, f0) of a model with some effects,

    f(x) = f0 + J (x - x0) + sum_k D_k(a_k),

J from central differences, and D_k the change by an effect the anchor does not have, interpolated
between its signatures of finite amplitude: shaking grows with the square of its amplitude,
softening and water bend, so a slope at zero would not do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from diagnosis.fitting.space import Space


@dataclass(frozen=True)
class Ladder:
    """Changes of all predictions by one effect, at the anchor.

    Attributes:
        amplitudes: of the runs, ascending, with 0 among them, (n,).
        changes: of all predictions, (n, m); nothing at 0.
    """

    amplitudes: np.ndarray
    changes: np.ndarray

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator(self.amplitudes, self.changes, axis=0)

    def change(self, amplitude: float) -> np.ndarray:
        """Change of all predictions (m,); beyond the ladder in proportion to its last rung."""
        first, last = self.amplitudes[0], self.amplitudes[-1]
        if amplitude > last > 0.0:
            return self.changes[-1] * (amplitude / last)
        if amplitude < first < 0.0:
            return self.changes[0] * (amplitude / first)
        if not first <= amplitude <= last:
            # Only one sign was run: the other is taken as its mirror image.
            return -self.change(-amplitude)
        return self._curve(amplitude)

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

    space: Space
    x: np.ndarray
    prediction: np.ndarray
    derivative: np.ndarray
    ladders: Mapping[str, Ladder] = field(default_factory=dict)

    def predict(self, space: Space, x: np.ndarray) -> np.ndarray:
        """Prediction (m,) of a model with any of the effects that the surface knows."""
        own, other = self._sorted(space, x)
        found = self.prediction + self.derivative @ (own - self.x)
        for name, amplitude in other.items():
            found = found + self.ladders[name].change(amplitude)
        return found

    def slope(self, space: Space, x: np.ndarray) -> np.ndarray:
        """Derivative of the prediction by the unknowns of `space`, (m, its size)."""
        own, other = self._sorted(space, x)
        columns = [self.derivative[:, place] for place in range(space.p)]
        for effect in space.effects:
            if effect.name in other:
                ladder, here = self.ladders[effect.name], other[effect.name]
                step = 0.05 * effect.unit
                change = ladder.change(here + step) - ladder.change(here - step)
                columns.append(change * (effect.unit / (2.0 * step)))
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

    def _sorted(self, space: Space, x: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
        """The anchor's own unknowns at x, and amplitudes of effects that it does not have.

        An effect of the anchor that the other model lacks has amplitude 0 there.
        """
        amplitudes = space.amplitudes(x)
        own = [amplitudes.pop(effect.name, 0.0) / effect.unit for effect in self.space.effects]
        return np.concatenate([x[: space.p], own]), amplitudes
