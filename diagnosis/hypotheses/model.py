"""What the statistics see of a model: states in, predicted measurements out.

A `State` says everything about one forward run. A `Model` runs many of them at once and keeps what
it has run, so that asking twice costs nothing. The material point method is one model, formulas in
the tests are others; nothing above this file knows which of them answers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, get_args, runtime_checkable

import numpy as np

from geometry.survey.measured import Measured
from inversion.estimation.budget import Predictor
from inversion.estimation.data import Targets
from inversion.estimation.unknowns import Parameters
from inversion.problem.state import State
from inversion.problem.unknown import Scale, Unknown

Family = Literal[
    "physics", "water", "soil", "strength", "ground", "section", "survey", "start", "dimension"
]
"""What is put on trial: a physical effect, or one of the things that a model assumes."""
FAMILIES: tuple[Family, ...] = get_args(Family)
FAMILY_WORDS: dict[Family, str] = {
    "physics": "a physical effect",
    "water": "another water",
    "soil": "another soil where it is not calibrated",
    "strength": "strength that differs within the liquefied soil",
    "ground": "another ground below",
    "section": "another section than was drawn",
    "survey": "an error of the survey",
    "start": "another start of the slide",
    "dimension": "flanks that hold the slide back",
}

#: Coefficients of an unknown strength curve stand in `State.effects` under this name.
CURVE = "strength_curve"
#: Standard deviation of an amplitude of which nothing else is known, in top rungs of its ladder. By
#: judgement: with half of it a top rung is itself doubted (1/2 in ln evidence), and with twice of
#: it every effect pays ln 2 more of the 2.3 that are asked for.
WIDE = 2.0
#: The same of one that is counted in decades, around its middle rung: a factor of 3, so that the
#: rungs beside it, tenfold each, lie at two standard deviations.
HALF_A_DECADE = 0.5


@dataclass(frozen=True)
class Candidate:
    """A hypothesis: an effect that the base model may lack, or another assumption than its own.

    Attributes:
        name: of the effect.
        family: what it doubts.
        words: what it is, as part of a sentence.
        unit: of the amplitude; empty where it is a pure number.
        low: lower bound of the amplitude; 0 where it has one sign.
        high: upper bound of the amplitude.
        ladder: signed amplitudes, none 0, at which its signature is taken: three of each sign.
        prior_mean: most likely amplitude beforehand; None: nothing is known but the bounds.
        prior_std: its standard deviation; None with `prior_mean`.
        free: its runs cost nothing (an error of the survey that only moves the prediction).
        by_chance: one realisation of a random pattern, which the case does not name: what it fits
            is not explained, but varies from place to place.
        screened: nearly linear: its ladder is run beyond the first amplitude only if that promises
            something.
        decades: its rungs are tenfold each, and it is most likely near the middle one.
        asked: the case names it as what may be missing: it is refitted whatever its score.
        switch: on or off, amplitude 1 or 0: another form of the model, which has no size.
        placed: number of equally likely places to which it may be moved; 0: it has no place.
        choices: places among which its own was sought.
    """

    name: str
    family: Family
    words: str
    unit: str
    low: float
    high: float
    ladder: tuple[float, ...]
    prior_mean: float | None = None
    prior_std: float | None = None
    free: bool = False
    by_chance: bool = False
    screened: bool = False
    decades: bool = False
    asked: bool = False
    switch: bool = False
    placed: int = 0
    choices: int = 1

    @property
    def two_signed(self) -> bool:
        """The amplitude may be of either sign."""
        return self.low < 0.0 < self.high

    @property
    def scale(self) -> Scale:
        """How its amplitudes are compared: as they are, or in decades from the lowest rung on."""
        return Scale(min(self.ladder), "decades") if self.decades else Scale()

    @property
    def counted_prior(self) -> tuple[float, float] | None:
        """Mean and standard deviation beforehand on that scale; None: nothing is known."""
        if self.prior_std is None:
            return None
        mean = self.prior_mean or 0.0
        return self.scale.count(mean), self.scale.spread(mean, self.prior_std)

    def most_of(self, rung: float) -> float:
        """The largest amplitude of a rung's sign, as a share of that rung on that scale."""
        bound = self.high if rung > 0.0 else self.low
        return self.scale.count(bound) / self.scale.count(rung)


def switch_of(name: str, family: Family, words: str) -> Candidate:
    """Another form of the model, on or off."""
    return Candidate(
        name=name,
        family=family,
        words=words,
        unit="",
        low=0.0,
        high=1.0,
        ladder=(1.0,),
        switch=True,
    )


def amplitude_of(candidate: Candidate, prior: tuple[float, float] | None = None) -> Unknown:
    """The amplitude of a candidate; `prior` (mean, std) replaces its own.

    Without a prior the ladder defines what is small and what is large: a Gaussian about 0 whose
    standard deviation is `WIDE` times the top rung, cut off at the bounds. The bounds alone would
    not do: they are the limits of the solver, and the evidence would depend on them.
    """
    if candidate.switch:
        return Unknown(candidate.name, 1.0, 1.0, Scale())
    mean, std = prior if prior is not None else (candidate.prior_mean, candidate.prior_std)
    rungs = sorted(abs(rung) for rung in candidate.ladder)
    scale = candidate.scale if candidate.decades else Scale(rungs[len(rungs) // 2])
    if std is None:
        mean, std = 0.0, WIDE * rungs[-1]
    mean = mean or 0.0
    known = (scale.count(mean), scale.spread(mean, std))
    return Unknown(candidate.name, candidate.low, candidate.high, scale, known, candidate.choices)


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
        parts: names of its numbers, (n,); empty where it has one.
        unit: of its numbers.
    """

    name: str
    words: str
    index: tuple[int, ...]
    covariance: np.ndarray
    parts: tuple[str, ...] = ()
    unit: str = ""


@runtime_checkable
class Model(Predictor, Protocol):
    """A model whose missing physics is searched for."""

    @property
    def parameters(self) -> Parameters:
        """The calibrated parameters."""
        ...

    @property
    def targets(self) -> Targets[Measured]:
        """The measurements: m numbers with the covariance of the survey."""
        ...

    @property
    def candidates(self) -> list[Candidate]:
        """Effects that may be missing; those that can do nothing here are not among them."""
        ...

    @property
    def curves(self) -> list[Curve]:
        """Unknown strength curves that may be tried where no candidate explains the misfit."""
        ...

    @property
    def runs(self) -> int:
        """Forward runs asked for, those found in the cache too; `free` candidates cost none."""
        ...

    def error_std(self, state: State) -> np.ndarray:
        """Standard deviation of the engine's own error of each number, (m,)."""
        ...

    def simulates(self, state: State) -> bool:
        """Whether it can predict a state with other numerics, and does not ignore them."""
        ...


class Proposes(Protocol):
    """Something that can say what other measurements would have read."""

    @property
    def proposals(self) -> list[Proposal]:
        """Measurements that could still be made."""
        ...

    def propose(self, states: Sequence[State]) -> np.ndarray:
        """Readings of all proposals, (n, their numbers); of runs made before it costs nothing."""
        ...


@runtime_checkable
class Proposing(Model, Proposes, Protocol):
    """A model that can also say what other measurements would have read."""


@runtime_checkable
class Seeking(Model, Protocol):
    """A model whose hypotheses have places that can be sought; a name says which place it is."""

    def neighbours(self, name: str) -> Sequence[str]:
        """The same thing at places nearby; none where it has no place."""
        ...

    def add_placed(self, name: str, *, choices: int = 1) -> Candidate | None:
        """Put a thing that is called after its place on trial; None: it is no such name."""
        ...

    def drop_placed(self, names: Iterable[str]) -> None:
        """Take such things off trial; what they changed has been read."""
        ...
