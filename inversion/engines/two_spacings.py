"""One question at two spacings: few fine runs for the answer, many coarse ones for its changes.

Halving the distance between the material points makes a run about seven times as expensive. What
changes an answer changes it much alike at both spacings. So the question is answered by coarse runs
first; the fine answer is found from there with the derivative that is known (`KnownDerivative`);
and questions close to it are answered by coarse runs that are moved so that they agree with the
fine one at the answer (`Moved`):

    f_fine(x) = f_coarse(x + x_coarse - x_fine) + [f_fine(x_fine) - f_coarse(x_coarse)]

with the scaled parameters x, strengths as logarithms, and both answers x_coarse and x_fine. What
was fitted has no difference in brackets, so that changes of the answer are carried over as they are
at the coarse spacing, strengths in proportion; at the answers the deposits look alike, which they
would not with equal parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inversion.estimation.forward import Forward, Prediction, Request, Setup, WrappedEngine


@dataclass
class KnownDerivative(WrappedEngine):
    """`inversion.estimation.forward.Forward`: an engine whose derivative is taken as known.

    A search on it ends where the predictions fit. A derivative that is a little off makes the way
    there longer, not the answer wrong.

    Attributes:
        engine: predicts.
        slope: derivative of its numbers by the scaled parameters, (m, p); NaN: not known.
    """

    engine: Forward
    slope: np.ndarray

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Those of the engine inside."""
        return self.engine.predict(requests)

    def derivative(
        self, request: Request, steps: np.ndarray
    ) -> tuple[Prediction, np.ndarray, np.ndarray]:
        """Prediction, and the derivative by the values that the known one is there."""
        (prediction,) = self.predict([request])
        per_fitted = request.setup.parameters.value_per_fitted(request.values)
        return prediction, self.slope / per_fitted[None, :], np.array(steps, dtype=float)


@dataclass(frozen=True)
class Move:
    """From coarse runs to fine ones, at the answers of both.

    Attributes:
        shift: coarse answer less the fine one, in scaled parameters, (p,).
        numbers: fine less coarse predictions at their answers, by name; 0 where either is unread.
        sigma_v0_kpa: the same of the vertical effective stress before failure, (p,) [kPa].
    """

    shift: np.ndarray
    numbers: dict[str, float]
    sigma_v0_kpa: np.ndarray | float

    @classmethod
    def none(cls) -> Move:
        """For runs that are used as they are."""
        return cls(np.zeros(1), {}, 0.0)

    def inner(self, setup: Setup, values: np.ndarray) -> Request:
        """The coarse run of a setup for values of a fine one."""
        parameters = setup.parameters
        return setup.at(parameters.to_values(parameters.to_fitted(values) + self.shift))

    def outer(self, request: Request, prediction: Prediction) -> Prediction:
        """What a fine run would predict."""
        names = request.setup.targets.names
        numbers = np.array([self.numbers.get(name, 0.0) for name in names])
        return replace(
            prediction,
            values=prediction.values + numbers,
            sigma_v0_kpa=prediction.sigma_v0_kpa + self.sigma_v0_kpa,
        )


@dataclass
class Moved(WrappedEngine):
    """`inversion.estimation.forward.Forward`: coarse runs that agree with fine ones at the answer.

    Attributes:
        engine: of the runs.
        move: see above.
        coarsened: a setup at the coarse spacing; None: it has none and is run as it is.
    """

    engine: Forward
    move: Move
    coarsened: Callable[[Setup], Setup | None]

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """What fine runs would predict, by coarse ones where there are any."""
        moves, inner = [], []
        for request in requests:
            coarse = self.coarsened(request.setup)
            moves.append(Move.none() if coarse is None else self.move)
            inner.append(moves[-1].inner(coarse or request.setup, request.values))
        found = self.engine.predict(inner)
        return [
            move.outer(request, prediction)
            for move, request, prediction in zip(moves, inner, found, strict=True)
        ]
