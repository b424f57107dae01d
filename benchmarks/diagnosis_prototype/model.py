"""The prototype slide as the diagnosis sees any model: `diagnosis.model.Model`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.diagnosis_prototype import slide
from benchmarks.diagnosis_prototype.slide import Numerics
from diagnosis.hypotheses.model import CURVE, Candidate, Curve, Proposal, State
from geometry.survey.crest_settlement import CrestSettlement
from geometry.survey.marker_displacement import MarkerDisplacement
from geometry.survey.measured import Measured
from geometry.survey.profiles import Profile
from geometry.survey.surface_profile import SurfaceProfile
from geometry.survey.toe_history import ToeHistory
from geometry.survey.toe_runout import ToeRunout
from inversion.problem.parameters import Parameters
from inversion.problem.predictions import Targets, make_targets
from inversion.problem.question import ParameterSpec

#: Standard deviations of the survey [m].
STD = {"toe": 1.0, "crest": 0.5, "profile": 0.5, "marker": 0.3, "history": 1.0}
CORRELATION_LENGTH, CORRELATION_TIME = 6.0, 2.0
SURVEYS = ("profile", "markers", "history", "full")


def library() -> list[Candidate]:
    """Effects that may be tested."""
    rows = [
        ("strain_softening", "physics", 0.0, 3.0, (0.3, 0.9, 2.0)),
        ("rate_strengthening", "physics", 0.0, 0.8, (0.08, 0.25, 0.6)),
        ("bingham", "physics", 0.0, 25.0, (2.0, 7.0, 18.0)),
        ("overburden_strength", "physics", 0.0, 1.0, (0.15, 0.4, 0.9)),
        ("pore_pressure", "physics", 0.0, 0.9, (0.1, 0.3, 0.7)),
        ("pool_level", "physics", -4.0, 4.0, (0.7, 1.7, 3.5, -0.7, -1.7, -3.5)),
        ("water_drag", "physics", 0.0, 3.0, (0.2, 0.7, 2.0)),
        ("shaking", "physics", -0.5, 0.5, (0.1, 0.22, 0.4, -0.1, -0.22, -0.4)),
        ("weak_base", "physics", 0.0, 1.0, (0.1, 0.3, 0.8)),
        ("hydroplaning", "physics", 0.0, 1.0, (0.1, 0.3, 0.8)),
        ("cracking", "physics", 0.0, 3.0, (0.2, 0.7, 2.0)),
        ("side_shear", "physics", 0.0, 12.0, (1.0, 3.5, 9.0)),
        ("dilatancy", "physics", 0.0, 2.0, (0.15, 0.5, 1.4)),
    ]
    found = [
        Candidate(name, kind, name.replace("_", " "), "", low, high, ladder)
        for name, kind, low, high, ladder in rows
    ]
    found.append(
        Candidate(
            "datum_shift", "survey", "the survey's datum is shifted", "m", -2.0, 2.0,
            (0.2, 0.5, 1.2, -0.2, -0.5, -1.2), prior_mean=0.0, prior_std=0.5, free=True,
        )
    )  # fmt: skip
    return found


OUTSIDE = ("outside_speed", "outside_healing", "outside_ridge")


@dataclass(frozen=True)
class Survey:
    """What was measured, as places in the slide's whole observation."""

    targets: Targets
    index: np.ndarray


def survey(kind: str, readings: np.ndarray) -> Survey:
    """Measurements of a kind of survey with these readings of everything, (SIZE,)."""
    common = {"confidence": "published", "source": "prototype"}
    entries: list[Measured] = []
    index: list[int] = []
    entries.append(
        ToeRunout(type="toe_runout", name="toe", side="right", value_m=readings[slide.TOE],
                  std_m=STD["toe"], **common)
    )  # fmt: skip
    index.append(slide.TOE)
    if kind != "sparse":
        profile = SurfaceProfile(
            type="surface_profile", name="profile", file="profile.csv", std_m=STD["profile"],
            correlation_length_m=CORRELATION_LENGTH, **common,
        )  # fmt: skip
        heights = readings[slide.PROFILE]
        profile.attach(Profile(slide.PROFILE_X, heights, np.array([""] * len(heights))))
        entries.append(profile)
        index += range(slide.PROFILE.start, slide.PROFILE.stop)
    if kind in ("sparse", "full"):
        entries.append(
            CrestSettlement(type="crest_settlement", name="crest", at="crest_points",
                            value_m=readings[slide.CREST], std_m=STD["crest"], **common)
        )  # fmt: skip
        index.append(slide.CREST)
    if kind in ("markers", "full"):
        for number in range(0, len(slide.MARKERS), 2):
            at = slide.MARKER.start + 2 * number
            entries.append(
                MarkerDisplacement(
                    type="marker_displacement", name=f"marker {number}",
                    x_m=-slide.LENGTH * (1 - slide.MARKERS[number]), y_m=1.0,
                    dx_m=readings[at], dy_m=readings[at + 1], std_m=STD["marker"], **common,
                )
            )  # fmt: skip
            index += [at, at + 1]
    if kind in ("history", "full"):
        entries.append(
            ToeHistory(
                type="toe_history", name="history", side="right", times_s=list(slide.TIMES),
                values_m=list(readings[slide.HISTORY]), std_m=STD["history"],
                correlation_time_s=CORRELATION_TIME, **common,
            )
        )  # fmt: skip
        index += range(slide.HISTORY.start, slide.HISTORY.stop)
    return Survey(
        make_targets(entries, fit=None, loss="misfit", source="prototype"), np.array(index)
    )


def parameters() -> Parameters:
    """S_r of the liquefied body and the friction angle of its shell."""
    return Parameters(
        [
            ParameterSpec(name="S_r", zones=["body"], property="cohesion_kpa", start=20.0,
                          low=4.0, high=60.0),
            ParameterSpec(name="phi", zones=["shell"], property="friction_deg", start=32.0,
                          low=27.0, high=37.0),
        ]
    )  # fmt: skip


def jolts(states: Sequence[tuple[float, ...]], seeds: Sequence[int], rough: float) -> np.ndarray:
    """Disturbances (n, 12): partly smooth in the state, partly without any memory of it.

    Args:
        states: numbers that say which slide it is, scaled to order 1.
        seeds: jitter of the points.
        rough: share of the variance without memory.
    """
    found = np.empty((len(states), 12))
    for row, (state, seed) in enumerate(zip(states, seeds, strict=True)):
        smooth = np.random.default_rng([seed, 7])
        waves = smooth.standard_normal((12, 6, len(state))) / 0.6
        phases = smooth.uniform(0.0, 2.0 * np.pi, (12, 6))
        field_ = np.sqrt(2.0 / 6.0) * np.cos(waves @ np.array(state) + phases).sum(axis=1)
        bits = np.frombuffer(np.round(np.array(state), 9).tobytes(), np.uint32)
        free = np.random.default_rng([seed, *bits.tolist()]).standard_normal(12)
        found[row] = np.sqrt(1.0 - rough) * field_ + np.sqrt(rough) * free
    return found


@dataclass
class Prototype:
    """The slide as a `diagnosis.model.Model`.

    Attributes:
        observed: the survey.
        noise: size of the disturbance by the points' positions, 1: as the material point method's.
        rough: share of it without memory of the state.
        numerics: of the diagnosing model.
    """

    observed: Survey
    noise: float = 1.0
    rough: float = 0.5
    numerics: Numerics = field(default_factory=Numerics)
    candidates: list[Candidate] = field(default_factory=library)
    runs: int = 0
    computed: int = 0

    def __post_init__(self) -> None:
        self.parameters = parameters()
        self.targets = self.observed.targets
        self.curves = [
            Curve(name, name.replace("_", " "), "", knots) for name, knots in slide.CURVES.items()
        ]
        self.proposals, self._proposed = proposals(self.observed.index)
        self._known: dict[State, np.ndarray] = {}

    def predict(self, states: Sequence[State]) -> np.ndarray:
        """Predictions (n, m)."""
        found = self.everything(states)[:, self.observed.index]
        shift = np.array([dict(s.effects).get("datum_shift", 0.0) for s in states])
        levels = np.isin(self.observed.index, np.arange(slide.PROFILE.start, slide.PROFILE.stop))
        return found + shift[:, None] * levels[None, :]

    def propose(self, states: Sequence[State]) -> np.ndarray:
        """Readings of the proposals, (n, their numbers)."""
        return self.everything(states)[:, self._proposed]

    def everything(self, states: Sequence[State]) -> np.ndarray:
        """All that could be observed, (n, SIZE), without errors of the survey."""
        self.runs += len(states)
        plain = [
            State(s.values, tuple(e for e in s.effects if e[0] != "datum_shift"), s.seed,
                  s.numerics)
            for s in states
        ]  # fmt: skip
        new = list(dict.fromkeys(s for s in plain if s not in self._known))
        for scheme in ("own", "transfer", "fine"):
            some = [s for s in new if s.numerics == scheme]
            if some:
                for s, row in zip(some, self._compute(some, scheme), strict=True):
                    self._known[s] = row
        self.computed += len(new)
        return np.array([self._known[s] for s in plain])

    def _compute(self, states: Sequence[State], scheme: str) -> np.ndarray:
        numerics = {
            "own": self.numerics,
            "transfer": Numerics(self.numerics.cell, 0.01),
            "fine": Numerics(self.numerics.cell / 1.5, self.numerics.damping),
        }[scheme]
        return simulate(
            self.candidates, states, numerics, [s.seed for s in states], self.noise, self.rough
        )


def simulate(
    candidates: Sequence[Candidate],
    states: Sequence[State],
    numerics: Numerics,
    seeds: Sequence[int],
    noise: float,
    rough: float,
) -> np.ndarray:
    """Observations (n, SIZE) of states."""
    effects: dict[str, np.ndarray] = {}
    curves: dict[str, np.ndarray] = {}
    units = {c.name: sorted(map(abs, c.ladder))[1] for c in candidates}
    for row, state in enumerate(states):
        for name, amplitude in state.effects:
            if name.startswith(f"{CURVE}:"):
                _, variable, knot = name.split(":")
                at = curves.setdefault(
                    variable, np.zeros((len(states), len(slide.CURVES[variable])))
                )
                at[row, int(knot)] = amplitude
            else:
                effects.setdefault(name, np.zeros(len(states)))[row] = amplitude
    values = np.array([state.values for state in states])
    labels = []
    names = sorted(units)
    for state in states:
        amplitudes = dict(state.effects)
        extra = sum(a * (3.0 + i) for i, (n, a) in enumerate(state.effects) if n not in units)
        labels.append(
            (
                float(np.log(state.values[0])) * 3.0,
                state.values[1] / 3.0,
                *(amplitudes.get(name, 0.0) / units[name] for name in names),
                extra,
            )
        )
    jolt = noise * jolts(labels, seeds, rough) if noise else None
    return slide.observe(values[:, 0], values[:, 1], effects, numerics, curves, jolt)


def proposals(had: np.ndarray) -> tuple[list[Proposal], np.ndarray]:
    """What has not been measured yet, with its place in the observation.

    Args:
        had: places of what has been measured.
    """
    every = []
    for number, share in enumerate(slide.MARKERS):
        at = slide.MARKER.start + 2 * number
        every.append((f"marker at {share:g} of the section", [at, at + 1], STD["marker"]))
    for number, time in enumerate(slide.TIMES):
        every.append((f"toe at {time:g} s", [slide.HISTORY.start + number], STD["history"]))
    for number, x in enumerate(slide.PROFILE_X):
        every.append((f"surface at x {x:g} m", [slide.PROFILE.start + number], STD["profile"]))
    found, index = [], []
    for name, places, std in every:
        if not set(places) & set(had):
            own = tuple(range(len(index), len(index) + len(places)))
            found.append(Proposal(name, f"{name}, +- {std:g} m", own, std**2 * np.eye(len(places))))
            index += places
    return found, np.array(index, dtype=int)
