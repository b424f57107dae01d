"""What the statistics see of a model: states in, predicted measurements out.

A `State` says everything about one forward run. A `Model` runs many of them at once and keeps what
it has run, so that asking twice costs nothing. The material point method is one model, formulas in
the tests are others; nothing above this file knows which of them answers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from inversion.problem.parameters import Parameters
from inversion.problem.predictions import Targets

Kind = Literal["physics", "survey"]
Numerics = Literal["own", "transfer", "fine"]

#: Coefficients of an unknown strength curve stand in `State.effects` under this name.
CURVE = "strength_curve"


@dataclass(frozen=True)
class State:
    """One forward run.

    Attributes:
        values: parameters in outside units, in the order of `Model.parameters`, (p,).
        effects: (name, amplitude), sorted by name; physics and survey nuisances alike. None is the
            base model. Coefficient j of an unknown strength curve over the variable u is
            (`strength_curve:u:j`, c_j): the logarithm of the strength's multiplier at knot j.
        seed: 0: the model's own points; k > 0: the k-th other jitter of the points.
        numerics: own; transfer: the second transfer scheme; fine: spacing / 1.5.
    """

    values: tuple[float, ...]
    effects: tuple[tuple[str, float], ...] = ()
    seed: int = 0
    numerics: Numerics = "own"

    def with_effects(self, amplitudes: Mapping[str, float]) -> State:
        """The same run with these effects in addition; an amplitude of 0 takes an effect out."""
        joined = {**dict(self.effects), **amplitudes}
        kept = sorted((name, float(a)) for name, a in joined.items() if a != 0.0)
        return replace(self, effects=tuple(kept))


def state(
    values: Sequence[float], effects: Mapping[str, float] | None = None, *, seed: int = 0
) -> State:
    """A state of plain numbers: values (p,) in outside units, amplitudes by name."""
    return State(tuple(float(v) for v in values), seed=seed).with_effects(effects or {})


@dataclass(frozen=True)
class Candidate:
    """An effect that the base model may lack.

    Attributes:
        name: of the effect.
        kind: physics, or survey: an error of the survey (datum, tilt, a boundary between zones),
            which competes with physics. It acts on the prediction; where it can, without a run.
        words: what it is, as part of a sentence.
        unit: of the amplitude; empty where it is a pure number.
        low: lower bound of the amplitude; 0 where it has one sign.
        high: upper bound of the amplitude.
        ladder: signed amplitudes, none 0, at which its signature is taken: three of each sign.
        prior_mean: most likely amplitude beforehand; None: nothing is known but the bounds.
        prior_std: its standard deviation; None with `prior_mean`.
        free: its runs cost nothing (an error of the survey that only moves the prediction).
        by_chance: one pattern of many that are random, and nobody has said that it is the one: what
            it explains is not explained, but varies from place to place.
    """

    name: str
    kind: Kind
    words: str
    unit: str
    low: float
    high: float
    ladder: tuple[float, ...]
    prior_mean: float | None = None
    prior_std: float | None = None
    free: bool = False
    by_chance: bool = False

    @property
    def two_signed(self) -> bool:
        """The amplitude may be of either sign."""
        return self.low < 0.0 < self.high


@dataclass(frozen=True)
class Curve:
    """An unknown strength as a function of one variable: multiplier exp(sum_j c_j phi_j(u)).

    phi_j are hat functions on the knots, constant beyond the ends.

    Attributes:
        variable: u: strain_rate, strain, time, overburden, position.
        words: what u is.
        unit: of u.
        knots: places of the hats, ascending, 4 to 7 of them, in `unit`.
        limit: largest |c_j| that is tried.
        step: |c_j| of the runs that take the first derivative.
    """

    variable: str
    words: str
    unit: str
    knots: tuple[float, ...]
    limit: float = 1.5
    step: float = 0.3

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients in `State.effects`."""
        return tuple(f"{CURVE}:{self.variable}:{j}" for j in range(len(self.knots)))


@dataclass(frozen=True)
class Proposal:
    """A measurement that could still be made.

    Attributes:
        name: of it.
        words: what, where or when, how well.
        index: places of its numbers in the answer of `Proposing.propose`.
        covariance: of the survey's errors, (n, n) for its n numbers.
    """

    name: str
    words: str
    index: tuple[int, ...]
    covariance: np.ndarray


@runtime_checkable
class Model(Protocol):
    """A model whose missing physics is sought.

    Attributes:
        parameters: what is calibrated.
        targets: what was measured: m numbers with the covariance of the survey.
        candidates: effects that may be missing; those that can do nothing here are not among them.
        curves: unknown strength curves that may be tried where no candidate explains the misfit.
        runs: forward runs asked for, those found in the cache too; `free` candidates cost none.
        computed: forward runs that were really simulated.
    """

    parameters: Parameters
    targets: Targets
    candidates: list[Candidate]
    curves: list[Curve]
    runs: int
    computed: int

    def predict(self, states: Sequence[State]) -> np.ndarray:
        """Predictions of all states, (n, m), in one batch; a row of NaN where a run failed.

        All m numbers of `targets` are predicted, held-out and compared ones included. Errors of the
        survey act on the prediction. Two equal states give equal rows.
        """
        ...


@runtime_checkable
class Proposing(Model, Protocol):
    """A model that can also say what other measurements would have read.

    Attributes:
        proposals: measurements that could still be made.
    """

    proposals: list[Proposal]

    def propose(self, states: Sequence[State]) -> np.ndarray:
        """Readings of all proposals, (n, their numbers); of runs made before it costs nothing."""
        ...
