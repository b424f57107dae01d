"""A forward engine as the model of a diagnosis.

In: a case (`diagnosis.case`), an engine of the registry and a store of runs by content. Out:
`diagnosis.hypotheses.model.Model`. A state becomes a reading of the question of its own: a scene
(assumptions changed, parameters, effects switched on, points jittered) with settings (transfer
scheme). All of a batch are predicted together, so that every core works, and each distinct one
once. Errors of the survey move the prediction and need no run.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic

import numpy as np

from diagnosis.hypotheses.assumption import AnySetup, Found, possible, with_setting
from diagnosis.hypotheses.model import CURVE, Candidate, Curve, Proposal
from diagnosis.hypotheses.physics import acting_candidates
from diagnosis.hypotheses.possible_measurements import possible_measurements, proposal_of
from diagnosis.hypotheses.registry import assumptions_of, neighbours_of, placed_at, unseen_by
from diagnosis.hypotheses.strength import strength_curves
from diagnosis.hypotheses.survey import survey_errors
from geometry.scenes.scene import scene_from_mapping
from geometry.survey.measured import Measured
from inversion.engines.finite_width import FiniteWidth
from inversion.engines.registry import MPM, Engine
from inversion.engines.run_store import KeptRun, RunStore, Store
from inversion.estimation.data import Targets, make_targets
from inversion.estimation.forward import Forward, Prediction, Request, SectionSetup
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import Sensitivity
from inversion.problem.state import State, simulated
from mpm_taichi.effects import acting_scene, effects_on, liquefied_zones
from mpm_taichi.effects.strength_curve import entry as curve_entry
from pipeline.cli import InputError

#: Strengths that are tried at a time where a limit of flow is looked for, the second time between
#: two of the first: 14 runs find it to a 36th of the bounds' width, 8 would to a ninth.
LEVELS = 7


@dataclass(frozen=True)
class Numerics:
    """How the model's own error is measured.

    Attributes:
        jitter: points of other seeds move by up to this x spacing / 2.
        transfer: the second transfer scheme.
        finer: the finer cells are this much smaller.
    """

    jitter: float = 0.5
    transfer: str = "flip"
    finer: float = 2.0


class RunModel(ABC, Generic[AnySetup]):
    """`diagnosis.hypotheses.model.Model` by a forward engine, on a section or on a body.

    Args:
        setup: what slides, settings, parameters and measurements of the base model.
        store: of the runs.
        forward: what predicts; its runs are kept in the store.
        found: assumptions on trial, and why others and further effects are left out.
        physics: effects of its solver.
        further: measurements that could still be made.
        priors: candidate -> (mean, std) of its amplitude, in place of its own.
        numerics: how the model's own error is measured.
    """

    @property
    def curves(self) -> list[Curve]:
        """See `Model`."""
        return []

    @property
    def wide_runs(self) -> int:
        """Simulations in three dimensions so far, in addition."""
        return 0

    def __init__(
        self,
        setup: AnySetup,
        store: Store,
        forward: Forward,
        *,
        found: Found,
        physics: Sequence[Candidate] = (),
        further: Sequence[Measured] = (),
        priors: Mapping[str, tuple[float, float]] | None = None,
        numerics: Numerics | None = None,
    ) -> None:
        self.setup = setup
        self.store = store
        self.numerics = Numerics() if numerics is None else numerics
        self.failures: dict[State, str] = {}
        self._forward = forward
        self._errors = {error.candidate.name: error for error in survey_errors(setup.targets)}
        doubted, self.left_out = found
        self._assumptions = {one.candidate.name: one for one in doubted}
        every = [
            *physics,
            *(one.candidate for one in self._assumptions.values()),
            *(error.candidate for error in self._errors.values()),
        ]
        self._priors = dict(priors or {})
        self.candidates = [self._with_prior(one) for one in every]
        self._possible = (
            make_targets(further, fit=None, loss="misfit", source="what could be measured")
            if further
            else Targets([], [], np.zeros(0), np.zeros((0, 0)), [])
        )
        self._asked: set[State] = set()
        self._proposed: dict[State, np.ndarray] = {}
        self._computed_before = store.computed

    @abstractmethod
    def setup_of(self, state: State) -> AnySetup:
        """What a run of the state is made of and read with: scene, settings.

        Raises:
            InputError: there is no such scene, an effect is unknown or out of its range.
        """

    @abstractmethod
    def simulates(self, state: State) -> bool:
        """See `Model`."""

    # --- what the statistics see ---

    @cached_property
    def parameters(self) -> Parameters:
        """The calibrated parameters; of limits alone the first guess is near that of flow."""
        own = self.setup.parameters
        if self._limit is None:
            return own
        start = self._multiplied(self._limit[1])
        return Parameters(
            [
                spec.model_copy(update={"start": value})
                for spec, value in zip(own.specs, start.tolist(), strict=True)
            ]
        )

    @cached_property
    def targets(self) -> Targets:
        """The measurements; of limits alone that which is broken first counts as measured."""
        targets = self.setup.targets
        return targets if self._limit is None else replace(targets, met=self._limit[0])

    @cached_property
    def _limit(self) -> tuple[int, float] | None:
        """Of limits alone that which the strongest soil that runs breaks, and that strength.

        The strength is a multiple of the first guess. None: other things were measured as well, no
        strength is unknown, or nothing runs at any that is believed.
        """
        own = self.setup.parameters
        strengths = own.strengths
        if not self.setup.targets.limits_alone or not strengths.any():
            return None
        weak = float(np.min((own.low / own.start)[strengths]))
        strong = float(np.max((own.high / own.start)[strengths]))
        first = None
        for _ in range(2):  # all that is believed, then between two levels of that
            factors = np.geomspace(weak, strong, LEVELS)
            excess = self._excess([self._multiplied(factor) for factor in factors])
            runs = np.flatnonzero((excess > 0.0).any(axis=1))
            if not len(runs):
                return None
            last = int(runs[-1])
            first = int(np.argmax(excess[last])), float(factors[last])
            weak, strong = factors[last], factors[min(last + 1, LEVELS - 1)]
        return first

    def _multiplied(self, factor: float) -> np.ndarray:
        """The question's first guess (p,) with its strengths multiplied."""
        own = self.setup.parameters
        return own.clipped(own.start * np.where(own.strengths, factor, 1.0))

    def _excess(self, values: Sequence[np.ndarray]) -> np.ndarray:
        """Predictions over the fitted limits [std], (n, m), at values of the parameters.

        Minus infinity of what is no limit, and where a run failed.
        """
        targets = self.setup.targets
        states = [State(tuple(one.tolist())) for one in values]
        found = self._read_all(list(dict.fromkeys(states)), targets)
        rows = np.array([found[state] for state in states])
        excess = (rows - targets.measured) / np.sqrt(np.diag(targets.covariance))
        return np.where(targets.fitted & np.isfinite(excess), excess, -np.inf)

    @property
    def runs(self) -> int:
        """Distinct forward runs asked for, kept ones too."""
        return len(self._asked)

    @property
    def computed(self) -> int:
        """Of these, simulated now."""
        return self.store.computed - self._computed_before

    def predict(self, states: Sequence[State]) -> np.ndarray:
        """Predictions (n, m) of all states as one batch; a row of NaN where a run failed.

        A limit that is kept (`no_flow`) is predicted as the limit: it costs nothing, and a
        signature is what an effect moves beyond it.
        """
        rows = np.array([self._moved_by_survey(state) for state in states])
        behind = [self.run_behind(state) for state in states]
        found = self._read_all(list(dict.fromkeys(behind)), self.targets)
        rows = rows + np.array([found[state] for state in behind]).reshape(rows.shape)
        return self.targets.counted(rows)

    def error_std(self, state: State) -> np.ndarray:
        """See `Model`."""
        return self._forward.error_std(self._request(self.run_behind(state), self.targets))

    def _with_prior(self, candidate: Candidate) -> Candidate:
        """A candidate with the engineer's prior, where one is given."""
        if candidate.name not in self._priors:
            return candidate
        mean, std = self._priors[candidate.name]
        if candidate.decades and mean <= 0.0:
            raise InputError(
                f"priors: {candidate.name}: mean {mean:g}: it counts in decades and must be "
                "greater than 0"
            )
        return replace(candidate, prior_mean=mean, prior_std=std)

    # --- states and runs ---

    def _assumed(self, state: State) -> tuple[AnySetup, dict[str, float]]:
        """The setup with the assumptions of a state, and the amplitudes of all that is none."""
        acting = {name: simulated(amplitude) for name, amplitude in state.effects}
        setup = self.setup
        for name, one in self._assumptions.items():
            if name in acting:
                setup = one.change(setup, acting.pop(name))
        return setup, acting

    def run_behind(self, state: State) -> State:
        """The forward run of a state: itself without the survey's errors."""
        kept = tuple(pair for pair in state.effects if pair[0] not in self._errors)
        return replace(state, effects=kept)

    def _request(self, state: State, targets: Targets) -> Request:
        """A run of the scene of a state that predicts these numbers.

        Raises:
            InputError: there is no such scene.
        """
        return replace(self.setup_of(state), targets=targets).at(np.array(state.values))

    def _read_all(self, states: list[State], targets: Targets) -> dict[State, np.ndarray]:
        """Measurements or proposals on distinct runs, one vector each."""
        self._asked.update(states)
        nothing = np.full(len(targets.names), np.nan)
        found = {state: nothing for state in states}
        requests: dict[State, Request] = {}
        for state in states:
            try:
                requests[state] = self._request(state, targets)
            except InputError as error:
                self.failures[state] = str(error)
        for state, prediction in self._answered(requests).items():
            found[state] = prediction.values
            unread = not np.any(np.isfinite(prediction.values))
            if prediction.reason and (unread or targets is not self._possible):
                self.failures[state] = prediction.reason
        return found

    def _answered(self, requests: Mapping[State, Request]) -> dict[State, Prediction]:
        """Predictions as one batch; where the engine refuses one, of those that it does not refuse.

        Raises:
            InputError: it refuses the base model.
        """
        try:
            return dict(zip(requests, self._forward.predict(list(requests.values())), strict=True))
        except InputError as error:
            if len(requests) > 1:
                each = (self._answered({state: one}) for state, one in requests.items())
                return {state: found for answer in each for state, found in answer.items()}
            (state,) = requests
            if not state.effects:
                raise
            self.failures[state] = str(error)
            return {}

    def _moved_by_survey(self, state: State) -> np.ndarray:
        """What the survey's errors add to a prediction, (m,)."""
        moved = np.zeros(len(self.targets.names))
        for name, amplitude in state.effects:
            if name in self._errors:
                moved += amplitude * self._errors[name].direction
        return moved


class EngineModel(RunModel[SectionSetup]):
    """A forward engine that simulates sections.

    Args:
        setup: section, settings, parameters and measurements of the base model.
        store: of the runs.
        engine: what predicts; its runs are kept in the store.
        sensitivities: of the question: what is said to be uncertain, and by how much.
        numbers: effect -> further numbers of it, as in a scene.
        priors: candidate -> (mean, std) of its amplitude, in place of its own.
        numerics: how the model's own error is measured.
        finite_width: the width of the slide is on trial, by runs in three dimensions.
    """

    def __init__(
        self,
        setup: SectionSetup,
        store: RunStore,
        *,
        engine: Engine = MPM,
        sensitivities: Sequence[Sensitivity] = (),
        numbers: Mapping[str, Mapping[str, float]] | None = None,
        priors: Mapping[str, tuple[float, float]] | None = None,
        numerics: Numerics | None = None,
        finite_width: bool = False,
    ) -> None:
        self.engine = engine
        self.numbers = {name: dict(given) for name, given in (numbers or {}).items()}
        doubted, certain = assumptions_of(setup, sensitivities, engine, dear=finite_width)
        # Effects must see that a strength is asked for as a ratio.
        base = setup.scene_at(setup.parameters.start) if setup.has_strength_ratio else setup.scene
        physics, idle = acting_candidates(base, self.numbers, duration=setup.settings.duration_s)
        if not engine.effects:
            known = engine.learned_effects() if engine.learned_effects else {}
            for one in physics:
                if one.name not in known:
                    idle[one.name] = f"{engine.description} has no such effect"
                elif one.name in self.numbers:
                    idle[one.name] = f"{engine.description} knows its default numbers alone"
            physics = [
                replace(one, low=max(one.low, -most), high=min(one.high, most))
                for one in physics
                if one.name not in idle and (most := known[one.name])
            ]
        self._wide = FiniteWidth(engine.made(store), store)
        super().__init__(
            setup,
            store,
            self._wide,
            physics=physics,
            found=(doubted, {**idle, **certain}),
            further=[one for one in possible_measurements(setup) if engine.reads(one)],
            priors=priors,
            numerics=numerics,
        )

    @property
    def wide_runs(self) -> int:
        """Simulations in three dimensions so far, in addition."""
        return self._wide.wide_runs

    def simulates(self, state: State) -> bool:
        """See `Model`."""
        unseen, own = self.engine.unseen, replace(state, numerics="own")
        return unseen is None or not unseen(self.setup_of(own), self.setup_of(state))

    @cached_property
    def curves(self) -> list[Curve]:
        """Strength of the liquefied soil as a function of what it might depend on."""
        zones = liquefied_zones(self.setup.scene)
        if not zones or not self.engine.effects or not self.keeps_runs:
            return []
        return strength_curves(self.setup, self.points(self._first), zones)

    @property
    def keeps_runs(self) -> bool:
        """The engine has whole runs, for pictures and for the stress before failure."""
        return self._wide.keeps_runs

    @property
    def _first(self) -> State:
        """The question's first guess, which every calibration begins with."""
        return State(tuple(float(value) for value in self.setup.parameters.start))

    @cached_property
    def proposals(self) -> list[Proposal]:
        """Measurements that could still be made."""
        found, first = [], 0
        for entry in self._possible.entries:
            found.append(proposal_of(entry, first))
            first += len(entry.values)
        return found

    def propose(self, states: Sequence[State]) -> np.ndarray:
        """Readings of all proposals (n, q); runs that were made before are read, not made again."""
        if not self._possible.names:
            return np.zeros((len(states), 0))
        behind = [self.run_behind(state) for state in states]
        new = [state for state in dict.fromkeys(behind) if state not in self._proposed]
        self._proposed |= self._read_all(new, self._possible)
        nothing = np.zeros((0, len(self._possible.names)))
        return np.array([self._proposed[state] for state in behind]) if behind else nothing

    # --- what is called after its place ---

    def neighbours(self, name: str) -> list[str]:
        """See `Seeking`."""
        return neighbours_of(self.setup.scene, name)

    def add_placed(self, name: str, *, choices: int = 1) -> Candidate | None:
        """Put a thing that is called after its place on trial.

        Args:
            name: as `neighbours` gives it, or as a hypothesis names it.
            choices: places among which it was sought.

        Returns:
            its candidate; None where it is no such name, or there is no such section.
        """
        one = placed_at(self.setup.scene, name)
        if one is None or not possible(one, self.setup, one.candidate.ladder[-1]):
            return None
        if unseen_by(self.engine, one, self.setup):
            return None
        self._assumptions[name] = one
        candidate = self._with_prior(replace(one.candidate, choices=choices))
        self.candidates = [*(c for c in self.candidates if c.name != name), candidate]
        return candidate

    def drop_placed(self, names: Iterable[str]) -> None:
        """See `Seeking`."""
        gone = set(names)
        self.candidates = [c for c in self.candidates if c.name not in gone]
        for name in gone & set(self._assumptions):
            del self._assumptions[name]

    # --- states and runs ---

    def setup_of(self, state: State) -> SectionSetup:
        """What a run of the state is made of and read with: section, settings, its foot.

        Raises:
            InputError: there is no such section, an effect is unknown or out of its range.
        """
        setup, acting = self._assumed(state)
        scene = self.setup.parameters.scene(setup.scene, np.array(state.values))
        changes: dict = {}
        if acting:
            changes["effects"] = {**scene.effects, **self._entries(acting)}
        if state.seed:
            changes |= {"jitter": self.numerics.jitter, "seed": state.seed}
        if state.numerics == "fine":
            changes["spacing"] = scene.spacing / self.numerics.finer
        if changes:
            scene = scene_from_mapping({**scene.model_dump(), **changes}, scene.name)
        acting_scene(scene, effects_on(scene))  # an effect may ask for what there is no section for
        if state.numerics == "transfer":
            setup = with_setting(setup, transfer=self.numerics.transfer)
        return replace(setup, scene=scene)

    def points(self, state: State) -> KeptRun:
        """The kept run of a state, for pictures."""
        run = self.run_behind(state)
        self._asked.add(run)
        return self._wide.kept_run(self._request(run, self.targets))

    def _entries(self, acting: Mapping[str, float]) -> dict[str, float | dict[str, float]]:
        """Amplitudes as a scene has them; the coefficients of a curve as one entry."""
        entries: dict[str, float | dict[str, float]] = {}
        for name, amplitude in acting.items():
            if name.startswith(f"{CURVE}:"):
                entries[CURVE] = self._curve_entry(name.split(":")[1], acting)
            elif name in self.numbers:
                entries[name] = {"amplitude": amplitude, **self.numbers[name]}
            else:
                entries[name] = amplitude
        return entries

    def _curve_entry(self, variable: str, acting: Mapping[str, float]) -> dict[str, float]:
        (curve,) = [one for one in self.curves if one.variable == variable]
        return curve_entry(variable, curve.knots, [acting.get(name, 0.0) for name in curve.names])

    def _request(self, state: State, targets: Targets) -> Request:
        """A run of the section of a state that predicts these numbers.

        Measurements and proposals are both read as a run ends, whichever of them is asked for.

        Raises:
            InputError: there is no such section.
        """
        both = (*self.setup.targets.entries, *self._possible.entries)
        setup = replace(self.setup_of(state), targets=targets, also_read=both)
        return setup.at(np.array(state.values))
