"""A model that is linear in all its unknowns, so that every statistic has a known answer.

Twenty-four heights along a profile with correlated errors, four times of a toe, and a toe. The
parameters are a strength and an angle; effects add a bend, a step, a slope in time, or what a
parameter does too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.hypotheses.model import Candidate
from geometry.survey.profiles import Profile
from geometry.survey.surface_profile import SurfaceProfile
from geometry.survey.toe_history import ToeHistory
from geometry.survey.toe_runout import ToeRunout
from inversion.estimation.data import Data, make_targets
from inversion.estimation.hold_out import HoldOut, split
from inversion.estimation.unknowns import Parameters, Unknowns
from inversion.problem.question import ParameterSpec, Prior
from inversion.problem.state import State
from inversion.problem.unknown import Unknown

X = np.linspace(0.0, 46.0, 24)
TIMES = [2.0, 4.0, 6.0, 9.0]
SIZE = 1 + len(X) + len(TIMES)


def signatures() -> dict[str, np.ndarray]:
    """What each effect of amplitude 1 changes, (SIZE,)."""
    nothing = np.zeros(SIZE)
    found = {}
    for name in ("bend", "step", "late", "like_bend", "like_strength"):
        found[name] = nothing.copy()
    found["bend"][1:25] = np.sin(X / 7.0)
    found["step"][1:25] = 0.8 * (X > 30.0)
    found["late"][25:] = [0.0, 1.0, 2.0, 3.0]
    found["like_bend"][1:25] = np.sin(X / 7.0 + 0.15)
    found["like_strength"] = 0.4 * slopes()[:, 0]
    return found


def slopes() -> np.ndarray:
    """Derivative of the prediction by the fitted parameters, (SIZE, 2)."""
    strength = np.concatenate([[-6.0], 1.5 - X / 20.0, [-1.0, -2.0, -3.0, -5.0]])
    angle = np.concatenate([[-0.4], 0.3 * np.cos(X / 15.0), np.zeros(4)])
    return np.stack([strength, angle], axis=1)


def measured(values: np.ndarray, *, correlation: float | None = 5.0):
    """Targets with these values, (SIZE,)."""
    common = {"confidence": "published", "source": "test"}
    toe = ToeRunout(type="toe_runout", name="toe", side="right", value_m=values[0], std_m=1.0,
                    **common)  # fmt: skip
    profile = SurfaceProfile(type="surface_profile", name="profile", file="p.csv", std_m=0.5,
                             correlation_length_m=correlation, **common)  # fmt: skip
    profile.attach(Profile(X, values[1:25], np.array([""] * 24)))
    history = ToeHistory(type="toe_history", name="history", side="right", times_s=TIMES,
                         values_m=list(values[25:]), std_m=0.7, **common)  # fmt: skip
    return make_targets([toe, profile, history], fit=None, loss="misfit", source="test")


def parameters() -> Parameters:
    return Parameters(
        [
            ParameterSpec(name="S_r", zones=["a"], property="residual_strength_kpa",
                          start=20.0, low=2.0, high=200.0),
            ParameterSpec(name="phi", zones=["b"], property="friction_deg", start=32.0, low=4.0,
                          high=60.0, prior=Prior(mean=32.0, std=4.0)),
        ]
    )  # fmt: skip


@dataclass
class Straight:
    """`diagnosis.hypotheses.model.Model`, linear.

    Attributes:
        readings: measured values, (SIZE,).
        noise: standard deviation of a run's own noise, the same for all numbers [m].
        bent: effects that go with the square of their amplitude.
        decades: effects that go with the decades of their amplitude from 0.01 on; the case asks for
            them.
        broken: amplitudes from which runs with an effect fail.
        skewed: effect -> (another, share): with finer cells it does so much of the other, too.
        cells: what finer cells change in every run [m], (SIZE,); None: nothing.
        ridge: what a unit of an effect does to the strength, in units of the fitted strength, and
            how much of `bend` their product does: parameters must give way as the effect grows.
        engine_std: standard deviation of the engine's own error [m].
    """

    readings: np.ndarray
    noise: float = 0.0
    bent: tuple[str, ...] = ()
    decades: tuple[str, ...] = ()
    broken: Mapping[str, float] = field(default_factory=dict)
    skewed: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    cells: np.ndarray | None = None
    ridge: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    engine_std: float = 0.0
    hold_out: HoldOut | None = None
    runs: int = 0
    computed: int = 0

    def __post_init__(self) -> None:
        self.parameters = parameters()
        self.targets = measured(self.readings)
        self.candidates = [
            Candidate(name, "physics", name, "m", -3.0, 3.0, (-2.0, -1.0, -0.4, 0.4, 1.0, 2.0))
            for name in signatures()
            if name not in self.decades
        ] + [
            Candidate(
                name,
                "physics",
                name,
                "m",
                0.01,
                100.0,
                (0.1, 1.0, 10.0),
                1.0,
                1.15,
                decades=True,
                asked=True,
            )  # fmt: skip
            for name in self.decades
        ]
        self.curves = []
        self._kept: dict[State, np.ndarray] = {}

    @property
    def level(self) -> np.ndarray:
        """Prediction at fitted parameters 0, (SIZE,)."""
        return 20.0 + slopes() @ -self.parameters.to_fitted(self.parameters.start)

    @property
    def data(self) -> Data:
        """All measurements by the survey's error alone, split as the model says."""
        parts = split(self.targets, self.hold_out or HoldOut(groups=()))
        return self.targets.data(split=parts)

    def space(self, effects: Sequence[Unknown]) -> Unknowns:
        return Unknowns(self.parameters, tuple(effects))

    def slope(self, space: Unknowns) -> np.ndarray:
        """Derivative by the unknowns of a space, (SIZE, q)."""
        columns = [signatures()[effect.name] * effect.scale.unit for effect in space.effects]
        return np.column_stack([slopes(), *columns])

    def error_std(self, state: State) -> np.ndarray:
        return np.full(SIZE, self.engine_std)

    def simulates(self, state: State) -> bool:
        return True

    def predict(self, states: Sequence[State]) -> np.ndarray:
        self.runs += len(states)
        new = [state for state in dict.fromkeys(states) if state not in self._kept]
        self.computed += len(new)
        for state in new:
            self._kept[state] = self._run(state)
        return np.array([self._kept[state] for state in states])

    def _run(self, state: State) -> np.ndarray:
        found = self.level + slopes() @ self.parameters.to_fitted(np.array(state.values))
        if self.cells is not None and state.numerics == "fine":
            found = found + self.cells
        for name, amplitude in state.effects:
            if abs(amplitude) >= self.broken.get(name, np.inf):
                return np.full(SIZE, np.nan)
            power = amplitude * abs(amplitude) if name in self.bent else amplitude
            if name in self.decades:
                power = 2.0 + np.log10(amplitude)
            found = found + power * signatures()[name]
            if name in self.skewed and state.numerics == "fine":
                other, share = self.skewed[name]
                found = found + share * amplitude * signatures()[other]
            if name in self.ridge:
                shift, product = self.ridge[name]
                fitted = self.parameters.to_fitted(np.array(state.values))
                start = self.parameters.to_fitted(self.parameters.start)
                found = found + shift * amplitude * slopes()[:, 0]
                found = found + product * amplitude * (fitted - start)[0] * signatures()["bend"]
        if self.noise:
            found = found + self.noise * noise_of(state).standard_normal(SIZE)
        return found


def noise_of(state: State, *more: int) -> np.random.Generator:
    """Draws that belong to a run, the same on every processor.

    Estimates differ in their last digits between processors; all of a draw would differ with them,
    and with it what a test at the edge of its bound finds. Five digits are the same everywhere.
    """
    values = [f"{number:.5g}" for number in state.values]
    effects = [f"{name} {amplitude:.5g}" for name, amplitude in state.effects]
    text = repr((values, effects, state.seed, state.numerics))
    return np.random.default_rng([*more, *text.encode()])


def truth(effects: Mapping[str, float], strength: float = 15.0) -> np.ndarray:
    """What a slide with these effects reads without any error, (SIZE,)."""
    quiet = Straight(np.ones(SIZE))
    return quiet.predict([State((strength, 32.0)).with_effects(dict(effects))])[0]


def errors(seed: int) -> np.ndarray:
    """A draw of the survey's errors, (SIZE,)."""
    draw = np.random.default_rng(seed)
    factor = np.linalg.cholesky(measured(np.zeros(SIZE)).covariance)
    return factor @ draw.standard_normal(SIZE)


def straight(seed: int, effects: Mapping[str, float], **more) -> Straight:
    """A model whose data hold these effects and a draw of the survey's errors."""
    return Straight(truth(effects) + errors(seed), **more)
