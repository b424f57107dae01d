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

from dataclasses import dataclass, replace

import numpy as np

from inversion.problem.forward import Forward, Prediction, WrappedEngine


@dataclass
class KnownDerivative(WrappedEngine):
    """`inversion.problem.forward.Forward`: an engine whose derivative is taken as known.

    A search on it ends where the predictions fit. A derivative that is a little off makes the way
    there longer, not the answer wrong.

    Attributes:
        engine: predicts.
        slope: derivative of its numbers by the scaled parameters, (m, p); NaN: not known.
    """

    engine: Forward
    slope: np.ndarray

    def derivative(
        self, values: np.ndarray, steps: np.ndarray
    ) -> tuple[Prediction, np.ndarray, np.ndarray]:
        """Prediction, and the derivative by the values that the known one is there."""
        (prediction,) = self.engine.predict([values])
        per_fitted = self.setup.parameters.value_per_fitted(values)
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
        """For an engine that is used as it is."""
        return cls(np.zeros(1), {}, 0.0)


@dataclass
class Moved(WrappedEngine):
    """`inversion.problem.forward.Forward`: coarse runs that agree with fine ones at the answer.

    Attributes:
        engine: of the coarse runs.
        move: see above.
    """

    engine: Forward
    move: Move

    def inner_values(self, values: np.ndarray) -> np.ndarray:
        """Values of the coarse run for values of a fine one."""
        parameters = self.setup.parameters
        return parameters.to_values(parameters.to_fitted(values) + self.move.shift)

    def outer(self, prediction: Prediction) -> Prediction:
        """What a fine run would predict."""
        numbers = np.array([self.move.numbers.get(name, 0.0) for name in self.names])
        return replace(
            prediction,
            values=prediction.values + numbers,
            sigma_v0_kpa=prediction.sigma_v0_kpa + self.move.sigma_v0_kpa,
        )
