"""Forward runs, each asked for once, within an allowance.

A diagnosis asks for the same run many times over; it is counted once. States that differ only by
effects that are `free` (errors of the survey that move the prediction) are one run. What the
allowance no longer covers is left out and reported, never silently replaced.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np

from inversion.problem.state import State


class Predictor(Protocol):
    """What answers states."""

    @property
    def computed(self) -> int:
        """Forward runs that were really simulated."""
        ...

    def predict(self, states: Sequence[State]) -> np.ndarray:
        """Predictions of all states, (n, m), in one batch; a row of NaN where a run failed.

        All m numbers of the measurements are predicted, held-out and compared ones included. Errors
        of the survey act on the prediction. Two equal states give equal rows.
        """
        ...

    def error_std(self, state: State) -> np.ndarray:
        """Standard deviation of the engine's own error of each number, (m,); 0: none is known."""
        ...


Asked = TypeVar("Asked", bound=Predictor)


@dataclass
class Runs(Generic[Asked]):
    """A model with a memory and an allowance.

    Attributes:
        model: what answers.
        allowance: distinct forward runs that may be asked for.
        free: effects whose runs cost nothing (errors of the survey that move the prediction).
        reserve: runs of the allowance that are kept for later.
        cut_short: what was left out because the allowance did not cover it.
        corrected: what the prediction (m,) of a state becomes for who asks, such as moved by what
            its cells are known to do; may be set at any time, and holds for runs made before as
            well.
    """

    model: Asked
    allowance: int
    free: Collection[str] = ()
    reserve: int = 0
    cut_short: list[str] = field(default_factory=list)
    corrected: Callable[[State, np.ndarray], np.ndarray] = lambda state, row: row
    _known: dict[State, np.ndarray] = field(default_factory=dict)
    _counted: set[State] = field(default_factory=set)
    _computed_before: int = field(init=False)

    def __post_init__(self) -> None:
        self._computed_before = self.model.computed

    @property
    def asked(self) -> int:
        """Distinct forward runs so far."""
        return len(self._counted)

    @property
    def computed(self) -> int:
        """Of these, simulated now and not found in the model's cache."""
        return self.model.computed - self._computed_before

    @property
    def left(self) -> int:
        """Runs that the allowance still covers, the reserve not counted."""
        return max(self.allowance - self.reserve - self.asked, 0)

    def cost(self, states: Sequence[State]) -> int:
        """Runs that asking for these states would add."""
        return len({self._run(state) for state in states} - self._counted)

    def affords(self, states: Sequence[State], what: str) -> bool:
        """Whether the allowance covers these states; if not, `what` is noted as left out."""
        if self.cost(states) <= self.left:
            return True
        if what not in self.cut_short:
            self.cut_short.append(what)
        return False

    def predict(self, states: Sequence[State]) -> np.ndarray:
        """Predictions (n, m), NaN where a run failed; new states go to the model in one batch."""
        new = list(dict.fromkeys(state for state in states if state not in self._known))
        if new:
            self._counted |= {self._run(state) for state in new}
            for state, row in zip(new, self.model.predict(new), strict=True):
                self._known[state] = np.asarray(row, dtype=float)
        return np.array([self.corrected(state, self._known[state]) for state in states])

    @property
    def every(self) -> list[tuple[State, np.ndarray]]:
        """All states asked for so far with their predictions (m,), in their order."""
        return [(state, self.corrected(state, row)) for state, row in self._known.items()]

    def _run(self, state: State) -> State:
        """The forward run behind a state: itself without what costs nothing."""
        if not self.free:
            return state
        kept = tuple(pair for pair in state.effects if pair[0] not in self.free)
        return State(state.values, kept, state.seed, state.numerics)
