"""The whole back-analysis of a case, stage by stage, into a `Result`.

First the answer; then, side by side, other starts, equally good answers, jitter seeds, variants,
sensitivities, waterfall. Each stage is a method that leaves what it found; runs come from a store
that keeps them by content, so a killed back-analysis goes through the finished stages again in
seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from threading import Lock, local
from typing import Any

import numpy as np

import geometry
import mpm_taichi
from inversion import PHYSICS_VERSION
from inversion.back_analysis import result_builder
from inversion.back_analysis.asked import Asked, Sides
from inversion.back_analysis.case import InversionCase, WaterfallReading, of_waterfall
from inversion.back_analysis.changed_answers import (
    Here,
    Solved,
    largest,
    ratio_change,
    sensitivity_answer,
    variant_answer,
)
from inversion.back_analysis.hand_checks import ratio_check, stability_check
from inversion.back_analysis.in_small_cells import told
from inversion.back_analysis.perturbed_answers import (
    ROUNDS,
    EquivalentAnswer,
    Problem,
    resolve,
    walk,
)
from inversion.back_analysis.result import (
    HandCheck,
    Noise,
    Result,
    SeedAnswer,
    SensitivityAnswer,
    Start,
    VariantAnswer,
    WaterfallAnswer,
    WaterfallBar,
)
from inversion.back_analysis.result_builder import compared_relations
from inversion.classical.slices import WaterForm
from inversion.engines.registry import REFERENCE, Engine, engine_named
from inversion.engines.run_store import Store
from inversion.engines.small_cells import SmallCells, cells_by
from inversion.engines.two_spacings import KnownDerivative, Move, Moved
from inversion.engines.workers import Job
from inversion.estimation.calibrate import calibrate, far_off, further_starts, refine
from inversion.estimation.derivatives import FiniteSteps, measured_noise
from inversion.estimation.forward import Forward, Setup
from inversion.estimation.misfit import Objective, Posterior, moved_by_noise, posterior
from inversion.estimation.search import Evaluation, Search, SearchResult
from inversion.problem.question import Variant
from pipeline.cli import WorkFailed
from pipeline.manifest import manifest
from pipeline.progress import Watch
from pipeline.units import with_signs

AFTER = "what moves the answer"
"""The stages after the answer, in the progress and the timings."""

#: A linear step shorter than this, in standard deviations from the survey, is as good as a run.
SHORT = 1.0
#: Fitted numbers that are told one by one as the search goes on.
MOST_TOLD = 12


@dataclass
class BackAnalysis:
    """A case under back-analysis.

    Attributes:
        case: the case.
        store: where runs of the material point method are kept.
        say: called with a line on each step of the work.
        watch: called for each stage.
        found: the answer, once it is.
        spread: its uncertainty by the survey's errors.
        engine_name: of the engine that predicts, as in the registry.
        move: from coarse runs to those at the spacing of the answer.
        coarse_misled: coarse runs have no answer to the question: none are used.
    """

    case: Asked
    store: Store
    say: Callable[[str], None] = lambda line: None
    watch: Watch = field(default_factory=Watch)
    found: SearchResult = field(init=False)
    spread: Posterior = field(init=False)
    stops: list[EquivalentAnswer] = field(default_factory=list)
    starts: list[Start] = field(default_factory=list)
    variants: list[VariantAnswer] = field(default_factory=list)
    sensitivities: list[SensitivityAnswer] = field(default_factory=list)
    ratio_changes: dict[str, dict[str, float]] = field(default_factory=dict)
    noise: Noise | None = None
    cells: SmallCells | None = None
    hand_checks: list[HandCheck] = field(default_factory=list)
    waterfall: WaterfallAnswer | None = None
    more_sources: dict[str, dict[str, float]] = field(default_factory=dict)
    remarks: dict[str, list[str]] = field(default_factory=dict)  # by stage
    timings: dict[str, float] = field(default_factory=dict)
    runs: int = 0
    move: Move = field(default_factory=Move.none)
    coarse_misled: bool = False
    engine_name: str = REFERENCE

    def __post_init__(self) -> None:
        self._stage, self._counting = local(), Lock()
        self.engine = self.engine_of()
        self.objective = self.objective_of(self.case.setup)
        self.steps = self._steps(np.zeros(int(self.objective.targets.fitted.sum())), self.objective)

    def run(self, more: Sequence[Job] = ()) -> Result:
        """All stages; next to those after the answer `more` that needs the answer."""
        first = [*self.stages_to_answer(), ("cells", self.take_off_cells)]
        then = self.stages_after_answer()
        after = sum(self._expected_runs(name) for name, _ in then)
        self.watch.plan({**{name: self._expected_runs(name) for name, _ in first}, AFTER: after})
        self.remarks = {name: [] for name, _ in [*first, *then]}
        for name, stage in first:
            with self._timed(name), self.watch.stage(name):
                self._staged(name, stage)
        with self._timed(AFTER), self.watch.stage(AFTER):
            self.side_by_side([*more, *(partial(self._staged, *one) for one in then)])
        return self.result()

    def _staged(self, name: str, stage: Callable[[], None]) -> None:
        """Do a stage, to which remarks of this thread then belong."""
        self._stage.name = name
        stage()

    def side_by_side(self, jobs: Sequence[Job]) -> None:
        """Do what does not wait for each other."""
        self.store.side_by_side(jobs)

    def stages_after_answer(self) -> list[tuple[str, Callable[[], None]]]:
        """The stages that need the answer and do not wait for each other, by name."""
        settings = self.case.config.inversion
        stages: list[tuple[str, Callable[[], None]]] = [
            ("starts", self.search_from_elsewhere),
            ("equally good", self.find_equally_good),
            ("seeds", self.measure_noise),
            ("hand checks", self.check_by_hand),
        ]
        if settings.variants:
            stages.append(("variants", self.solve_variants))
        if settings.sensitivities:
            stages.append(("sensitivities", self.solve_sensitivities))
        if settings.waterfall and self._waterfall and self.described.waterfall:
            stages.append(("waterfall", self.solve_waterfall))
        return stages

    @property
    def _waterfall(self) -> list[WaterfallReading]:
        """The readings on the way to the question; empty: none asked for, as of a body."""
        return self.case.waterfall if isinstance(self.case, InversionCase) else []

    def _expected_runs(self, stage: str) -> int:
        """About how many simulations a stage takes, for the progress alone."""
        settings, question = self.case.config.inversion, self.case.question
        evaluation = 1 + len(self.case.parameters.names)
        changes = len(question.sensitivities)
        return {
            "answer": settings.step_seeds + 5 * evaluation,
            "cells": 7,
            "starts": (settings.starts - 1) * 4 * evaluation,
            "equally good": 4 * evaluation if evaluation > 2 else 0,
            "seeds": 2 * settings.noise_seeds,
            "variants": 3 * evaluation * len(question.variants),
            "sensitivities": 4 * changes,
            "waterfall": 6 * len(self._waterfall),
        }.get(stage, 2 * evaluation)

    # --- what an engine decides ---

    @property
    def described(self) -> Engine:
        """The engine, as the registry describes it."""
        return engine_named(self.engine_name)

    def engine_of(self) -> Forward:
        """The forward engine, with no runs counted."""
        return self.described.made(self.store)

    @property
    def coarse_spacing_m(self) -> float | None:
        """Spacing of the coarse runs [m]; None: there are none, or they are no guide."""
        if self.described.trained or self.coarse_misled:
            return None
        return self.case.coarse_spacing_m

    def engine_of_changes(self) -> Forward:
        """The engine that says how a reading of the question changes the answer.

        Where there are coarse runs: they, moved so that they agree with the fine run at the answer.
        A setup that has no coarse one keeps its own spacing.
        """
        if self.coarse_spacing_m is None:
            return self.engine_of()
        return Moved(self.engine_of(), self.move, self.case.coarsened)

    def objective_of(self, setup: Setup) -> Objective:
        """The objective to minimise for a reading of the question."""
        return self.case.objective(setup)

    def stages_to_answer(self) -> list[tuple[str, Callable[[], None]]]:
        """The stages that leave `found` and `spread`, by name."""
        return [("answer", self.search)]

    def known_variants(self) -> tuple[list[Variant], list[str]]:
        """The variants that the engine can evaluate, and lines about those left out."""
        return self.case.variants_of(self.store.refused)

    def known_sensitivities(self) -> tuple[Sides, list[str]]:
        """The sensitivities that the engine can evaluate, and lines about those left out."""
        return self.case.sensitivities_of(self.store.refused)

    # --- stages ---

    def search(self) -> None:
        """Find the answer from the question's first guess."""
        coarse = self.case.coarsened(self.case.setup) if self.coarse_spacing_m else None
        begun = None if coarse is None else self._search_coarse(coarse)
        if begun is None:
            self.found = self._searched(self.engine, self.case.setup)
        else:
            self.found = self._search_fine(begun)
            toes_alone = self.objective.loss == "runout" and not self.objective.limit
            if toes_alone and far_off(self.objective, self.found.best):
                self._search_without_coarse()
        self.runs += self.found.runs
        self.say(f"answer after {self.found.runs} simulations: {self.found.words}")
        self._learn_noise(self.found.values)
        self.spread = posterior(self.objective, self._resolved_derivative(), self.found.values)
        self.tell_doubts()

    def _search_without_coarse(self) -> None:
        """Search again where coarse runs have led away from a fit; the better of both is kept."""
        self.say(f"far from a fit: once more, by runs with points every {self.case.spacing_m:g} m")
        again = self._searched(self.engine, self.case.setup)
        self.runs += again.runs
        if again.best.loss < self.found.best.loss:
            self.found, self.coarse_misled = again, True

    def _rests_on_a_bound(self, found: SearchResult) -> bool:
        """A search of something else than a limit of flow ended at a bound, without a fit."""
        bounds = self.case.parameters.at_bound(found.values)
        return not self.objective.limit and not found.reached and any(bounds)

    def _learn_noise(self, values: np.ndarray) -> None:
        """The noise of a finite difference at the answer."""
        seeds = self._jittered(self.case.setup)
        if seeds:  # runs that the stage `seeds` asks for again: they cost nothing
            mask = self.objective.targets.fitted
            self.steps.noise = measured_noise(self.engine_of_changes(), seeds, values, mask)

    def _jittered(self, setup: Setup) -> list[Setup]:
        """The setups whose runs measure the noise of a finite difference."""
        seeds = range(1, self.case.config.inversion.step_seeds + 1)
        return [self.case.jittered(setup, seed) for seed in seeds]

    def _searched(self, engine: Forward, setup: Setup) -> SearchResult:
        """The whole search, from the question's first guess, by one engine."""
        search = self._search(engine, setup, self.steps, seeds=self._jittered(setup), tell=True)
        start, method = self.case.parameters.start, self.case.config.inversion.method
        return calibrate(search, start, method=method, least_m=setup.least_move_m)

    def _search_coarse(self, setup: Setup) -> SearchResult | None:
        """The same by coarse runs alone; None: they have no answer, and are no guide.

        They may lack what the slide is made of, as where a layer is two cells thick.
        """
        engine, spacing = self.engine_of(), self.coarse_spacing_m
        try:
            found = self._searched(engine, setup)
            why = "which rests on a bound" if self._rests_on_a_bound(found) else ""
            self.say(f"at {spacing:g} m: {self._described(found)}")
        except WorkFailed as error:
            why = f"at {spacing:g} m: {error}"
        if not why:
            return found
        self.say(f"{why}: all runs have points every {self.case.spacing_m:g} m")
        self._count(engine)
        self.coarse_misled = True
        return None

    def _search_fine(self, coarse: SearchResult) -> SearchResult:
        """Go on from the answer of coarse runs, with the derivative that is known there."""
        parameters, method = self.case.parameters, self.case.config.inversion.method

        def agreeing(evaluation: Evaluation) -> Forward:
            self.move = self._move(coarse.best, evaluation)
            return self.engine_of_changes()

        slope = coarse.best.derivative * parameters.value_per_fitted(coarse.values)[None, :]
        engine = KnownDerivative(self.engine, slope)
        search = self._search(
            engine, self.case.setup, self.steps, tell=True, runs_before=coarse.runs
        )
        found = refine(search, coarse.values, method=method, sampled=agreeing)
        self.move = self._move(coarse.best, found.best)
        return self._with_fine_derivative(found).after(coarse, method)

    def _with_fine_derivative(self, found: SearchResult) -> SearchResult:
        """With the derivative of fine runs: what the data leave undetermined depends on it.

        Its steps stand out of the noise of coarse runs, and so of that of fine ones.
        """
        before, best = self.engine.runs, found.best
        self._learn_noise(best.values)
        self.steps.learn(best.derivative[self.objective.targets.fitted], best.values)
        _, derivative, steps = self.engine.derivative(
            self.case.setup.at(best.values), self.steps.steps(best.values)
        )
        silent = self.objective.silent(best.prediction)[:, None]
        derivative = np.where(silent, 0.0, derivative)
        exact = replace(best, derivative=derivative, steps=steps)
        evaluations = [exact if one is best else one for one in found.evaluations]
        runs = found.runs + self.engine.runs - before
        return replace(found, best=exact, evaluations=evaluations, runs=runs)

    def _move(self, coarse: Evaluation, fine: Evaluation) -> Move:
        """From coarse to fine runs, which agree at these two evaluations."""
        to_fitted = self.case.parameters.to_fitted
        beyond = np.nan_to_num(fine.prediction.values - coarse.prediction.values)
        return Move(
            shift=to_fitted(coarse.values) - to_fitted(fine.values),
            numbers=dict(zip(self.objective.targets.names, map(float, beyond), strict=True)),
            sigma_v0_kpa=fine.prediction.sigma_v0_kpa - coarse.prediction.sigma_v0_kpa,
        )

    def tell_doubts(self) -> None:
        """Remarks on the answer."""
        prediction = self.found.best.prediction
        for line in (
            *result_builder.doubts(prediction, self.case.setup.settings),
            *result_builder.few_points(self.case.setup),
            *result_builder.simulated_with(self.case.setup),
            *prediction.remarks,
        ):
            self.remark(line)
        for line in result_builder.unknown_derivatives(
            self.case.parameters, self.found.best.derivative
        ):
            self.remark(line)

    def take_off_cells(self) -> None:
        """Find what the size of the cells makes of the strengths of the answer.

        A limit of flow stays as the runs have it: with smaller cells it lies higher, so the bound
        that is told is one.
        """
        if self.objective.limit or not self.case.parameters.strengths.any():
            return
        self.cells = self.cells_at(self.found.values)
        self.runs += self.cells.runs
        if not self.cells.known:
            self.say(self.cells.words)
            return
        parameters = self.case.parameters
        factors = self.cells.factors(parameters)
        listed = ", ".join(
            f"{name} {factor * value:.4g}"
            for name, factor, value in zip(
                parameters.names, factors, self.found.values, strict=True
            )
            if factor != 1.0
        )
        self.say(f"{self.cells.words}: in small cells {listed}")

    def cells_at(self, values: np.ndarray) -> SmallCells:
        """What the cells make of the strengths among values (p,)."""
        setup, engine = self.case.setup, self.engine_of_cells()
        if engine is None:
            why = f"{self.described.description} has none of its own"
            return SmallCells.unknown(setup.scene, why)
        return cells_by(engine, self.store, setup, values, self.case.other_cells(setup))

    def engine_of_cells(self) -> Engine | None:
        """The engine whose cells are in the answer; None: it has none."""
        return self.described

    def search_from_elsewhere(self) -> None:
        """Ask again from other first guesses; the answer should not depend on them."""
        self.starts = [result_builder.start_of(self.found, self.objective)]
        number = self.case.config.inversion.starts - 1
        for place, start in enumerate(further_starts(self.case.parameters, number)):
            found = self._calibrated(f"start {place + 2}", self.case.setup, start)
            if found is not None:
                self.starts.append(result_builder.start_of(found, self.objective))
                self.say(f"start {place + 2}: {self._described(found)}")

    def find_equally_good(self) -> None:
        """Walk along what the data do not determine."""
        if len(self.spread.flat):
            engine = self.engine_of_changes()
            self.stops = walk(
                engine,
                self.case.setup,
                self.objective,
                self.found.values,
                self.slope,
                self.spread.flat,
                self.found.best.loss,
            )
            self._count(engine)
            self.say(f"other answers that fit as well: {len(self.stops)}")

    def check_by_hand(self) -> None:
        """Limit equilibrium of the section before, with the strengths of the answer."""
        if not isinstance(self.case, InversionCase):
            return
        setup, targets = self.case.setup, self.objective.targets
        numbers = {targets.groups[place] for place in np.flatnonzero(targets.fitted)}
        fitted = [targets.entries[number] for number in sorted(numbers)]
        sides = dict.fromkeys(e.toe_side for e in fitted if e.toe_side and not e.censored)
        form: WaterForm = "pore_pressure" if setup.settings.water == "pore_pressure" else "buoyant"
        for side in sides:
            try:
                factors = 1.0 if self.cells is None else self.cells.factors(self.case.parameters)
                scene = setup.scene_at(factors * self.found.values)
                self.hand_checks.append(stability_check(scene, side, form))
            except WorkFailed as error:
                self.remark(f"factor of safety of the section before, to the {side}: {error}")

    def measure_noise(self) -> None:
        """Find the answer again on jittered points."""
        seeds = list(range(1, self.case.config.inversion.noise_seeds + 1))
        if not seeds:
            return
        problems = [self._problem(self.case.jittered(self.case.setup, seed)) for seed in seeds]
        self._resolve(problems)
        kept = [(s, p) for s, p in zip(seeds, problems, strict=True) if np.isfinite(p.loss)]
        if len(kept) < 2:
            self.remark("noise: fewer than two of the jittered runs finished; not measured")
            return
        targets, parameters = self.objective.targets, self.case.parameters
        before = np.array([problem.before.values for _, problem in kept])
        values = np.array([problem.refined for _, problem in kept])
        self.noise = Noise(
            jitter=self.case.config.inversion.noise_jitter,
            spacing_m=kept[0][1].prediction.spacing_m,
            seeds=[seed for seed, _ in kept],
            std=targets.named(before.std(axis=0, ddof=1)),
            mean=targets.named(before.mean(axis=0)),
            answers=[
                SeedAnswer(
                    seed=seed,
                    values=parameters.as_mapping(problem.refined),
                    predicted_before=targets.named(problem.before.values, targets.fitted),
                    loss=problem.loss,
                    reached=problem.reached,
                )
                for seed, problem in kept
            ],
            answer_std=parameters.as_mapping(values.std(axis=0, ddof=1)),
        )
        self.say(
            "answers on jittered points scatter by "
            + ", ".join(f"{name} {std:.2g}" for name, std in self.noise.answer_std.items())
        )

    def solve_variants(self) -> None:
        """Solve every other reading of the question, and again at the answer's spacing."""
        solved = self._solved_variants()
        # The limit of flow is no fit that a few steps could mend.
        again = [one for one in solved if not one.problem.objective.limit]
        self._again_fine(again)
        for one in again:
            if one.fine is not None:
                one.fine = self._stepped(one.fine)
        for one in solved:
            self.variants.append(variant_answer(one))
            self.say(f"{one.entry.name}: {self._listed(one.best.values)}: {one.words}")

    def _solved_variants(self) -> list[Solved]:
        """Variants with an answer: from that to the question, or else by a search of their own."""
        variants, left_out = self.known_variants()
        for line in left_out:
            self.remark(line)
        changed = {variant.name: self.case.variant(variant) for variant in variants}
        near = {
            name: self._problem(one.setup)
            for name, one in changed.items()
            if self.coarse_spacing_m
            and one.setup.targets.names == self.objective.targets.names
            and not self.objective_of(one.setup).limit
        }
        self._resolve(list(near.values()))
        solved = []
        for variant in variants:
            one, problem = changed[variant.name], near.get(variant.name)
            if problem is not None and problem.reached:
                solved.append(Solved(variant, one, problem))
                continue
            found = self._calibrated(variant.name, one.setup, self.found.values)
            if found is not None:
                solved.append(Solved(variant, one, self._problem(one.setup, found), found))
        return solved

    def solve_sensitivities(self) -> None:
        """Solve again under every changed assumption, all of them side by side."""
        entries, left_out = self.known_sensitivities()
        for line in left_out:
            self.remark(line)
        solved = [
            Solved(entry, changed, self._problem(changed.setup))
            for entry, changes in entries
            for changed in changes
        ]
        self._resolve([one.problem for one in solved], linear=True)
        for one in solved:
            one.problem = self._stepped(one.problem)
        here = Here(self._refined, self.found.best.prediction)
        answered = [one for one in solved if one.answered]
        if answered:
            share = self.case.config.inversion.check_share
            names = largest(answered, here, self.spread.std, share)
            self._again_fine([one for one in answered if one.entry.name in names])
        for entry, _ in entries:
            self._keep_sensitivity(
                entry.name, [one for one in answered if one.entry is entry], here
            )

    def _keep_sensitivity(self, name: str, own: Sequence[Solved], here: Here) -> None:
        if not own:
            self.remark(f"{name}: the simulation failed; not among the sensitivities")
            return
        found = sensitivity_answer(own, here)
        if not all(side.reached for side in found.sides):
            self.remark(f"{name}: not fitted to the tolerance; its change is a linear estimate")
        self.sensitivities.append(found)
        if found.kind != "target":
            self.ratio_changes[name] = ratio_change(found)
        spec = self.case.parameters.specs[0]
        first, places = spec.name, 2 if spec.unit else 4
        self.say(
            f"{name}: "
            + ", ".join(
                f"{side.words}: {first} {side.change[first]:+.{places}f}" for side in found.sides
            )
        )

    def solve_waterfall(self) -> None:
        """Solve the readings on the way to the question, each from the answer before it."""
        case, asked = self.case, self.case.question.waterfall
        if asked is None or not isinstance(case, InversionCase):
            return
        name = case.parameters.names[of_waterfall(case)]
        bars: list[WaterfallBar] = []
        start = slope = None
        for reading in case.waterfall:
            own = reading.case is case
            setup = reading.alone(self.found.values if own else reading.setup.parameters.start)
            begin = setup.parameters.start if start is None else setup.parameters.clipped(start)
            problem = self._solved_reading(reading, setup, begin, slope)
            if problem is None:
                continue
            start, slope = problem.values, problem.slope
            self.say(f"{reading.name}: {name} {start[0]:.4g}: {problem.words}")
            bars.append(result_builder.waterfall_bar(reading, setup, problem))
        bars.append(result_builder.last_bar(case, self.found, case.waterfall[-1]))
        self.waterfall = WaterfallAnswer(parameter=name, stated=asked.stated, bars=bars)

    def _solved_reading(
        self, reading: WaterfallReading, setup: Setup, begin: np.ndarray, slope: np.ndarray | None
    ) -> Problem | None:
        """From the answer and the derivative of the reading before; else by a search of its own."""
        objective = self.objective_of(setup)
        if slope is not None and not objective.limit:
            problem = Problem(setup, objective, begin, slope)
            self._resolve([problem], self.engine_of())
            if problem.reached:
                return problem
        found = self._calibrated(reading.name, setup, begin, self.engine_of())
        return None if found is None else self._problem(setup, found)

    def _noise_by_slope(self) -> dict[str, float]:
        """Scatter of the answer over the place of its points, where it was not found again.

        From the noise that the steps of the derivative were chosen by; empty: not known either.
        """
        if not np.any(self.steps.noise > 0) or self.objective.limit:
            return {}
        std = moved_by_noise(
            self.objective, self._resolved_derivative(), self.found.values, self.steps.noise
        )
        return self.case.parameters.as_mapping(std)

    def _resolved_derivative(self) -> np.ndarray:
        """The derivative at the answer without its noise, which carries no information."""
        evaluation, mask = self.found.best, self.objective.targets.fitted
        signal = self.steps.signal(evaluation.derivative[mask], evaluation.steps)
        return evaluation.derivative * signal[None, :]

    # --- the result ---

    def result(self) -> Result:
        """All that was found."""
        case, found = self.case, self.found
        mask = self.objective.targets.fitted
        resolved = self.steps.resolved(found.best.derivative[mask], found.best.steps)
        noise_std = dict(self.noise.answer_std) if self.noise else self._noise_by_slope()
        changes = dict(self.ratio_changes)
        if noise_std:
            stress = found.best.prediction.sigma_v0_kpa
            per = dict(zip(case.parameters.names, case.parameters.per_ratio(stress), strict=True))
            changes[result_builder.NOISE_SOURCE] = {
                name: noise_std[name] / per[name]
                for name in result_builder.ratios(
                    found.best.prediction, found.values, case.parameters
                )
            }
        answer = result_builder.answer(
            case,
            self.objective,
            found,
            self.spread,
            self.stops,
            resolved,
            self.sensitivities,
            changes,
            noise_std,
            self.more_sources,
        )
        result = Result(
            case=case.name,
            title=case.title,
            measurement_set=case.measurement_set,
            engine=self.engine_name,
            spacing_m=case.spacing_m,
            coarse_spacing_m=self.coarse_spacing_m,
            manifest=self._manifest(),
            question=case.question,
            answer=answer,
            iterations=result_builder.iterations(found.evaluations, self.objective),
            starts=self.starts,
            variants=self.variants,
            sensitivities=self.sensitivities,
            measurements=result_builder.measurements(self.objective, found.best.prediction),
            noise=self.noise,
            classical=[],
            waterfall=self.waterfall,
            relations=compared_relations(case) if isinstance(case, InversionCase) else [],
            hand_checks=self.hand_checks,
            remarks=[line for lines in self.remarks.values() for line in lines],
            published=case.measurements.strength_published_kpa,
            timings={name: round(seconds, 3) for name, seconds in self.timings.items()},
            runs=self.runs,
            runs_to_answer=found.runs,
        )
        if self.cells is not None:
            result = told(result, self.cells, case.parameters)
        asked = [p for p in result.answer.parameters if p.lower_bound_95 is None]
        checks = [*self.hand_checks, *filter(None, map(ratio_check, asked))]
        return result.model_copy(update={"hand_checks": checks})

    # --- what the stages share ---

    def remark(self, line: str) -> None:
        """Something a reader of the result should know: said, and kept."""
        self.remarks.setdefault(getattr(self._stage, "name", ""), []).append(line)
        self.say(line)

    def _count(self, engine: Forward) -> None:
        """Add the runs of an engine that is done."""
        with self._counting:
            self.runs += engine.runs

    @property
    def slope(self) -> np.ndarray:
        """Derivative of the fitted numbers by the scaled parameters at the answer, (k, p)."""
        return self.objective.fitted_derivative(self.found.best.derivative, self.found.values)

    @cached_property
    def _refined(self) -> np.ndarray:
        """The answer with the next linear step; changes are measured from it, (p,)."""
        own = self._problem(self.case.setup)
        own.ran = self.found.best.prediction
        return own.refined

    def _seeds(self) -> dict[str, int]:
        return {"jitter_of_the_answer": self.case.setup.seed}

    def _manifest(self) -> dict[str, Any]:
        made = manifest(self.case.config, self._seeds())
        versions = {
            "geometry": geometry.PHYSICS_VERSION,
            "mpm_taichi": mpm_taichi.PHYSICS_VERSION,
            "inversion": PHYSICS_VERSION,
        }
        return {**made, "physics_versions": versions}

    def _steps(self, noise: np.ndarray, objective: Objective) -> FiniteSteps:
        return FiniteSteps(
            objective.parameters,
            noise,
            self.case.config.inversion.step_to_noise,
            whitener=objective.survey_whitener if objective.loss == "misfit" else None,
            widest_log=self.case.setup.widest_log,
        )

    def _search(
        self,
        engine: Forward,
        setup: Setup,
        steps: FiniteSteps,
        *,
        seeds: Sequence[Setup] = (),
        tell: bool = False,
        runs_before: int = 0,
    ) -> Search:
        settings = self.case.config.inversion
        return Search(
            engine,
            setup,
            self.objective_of(setup),
            steps,
            seeds=seeds,
            max_iterations=settings.max_iterations,
            max_runs=settings.max_runs,
            on_evaluation=partial(self._tell_evaluation, runs_before) if tell else None,
        )

    def _calibrated(
        self, name: str, setup: Setup, start: np.ndarray, engine: Forward | None = None
    ) -> SearchResult | None:
        """Another search with the noise that is known; None, and a line, where there is none.

        `engine`: None: that of changes.
        """
        engine = self.engine_of_changes() if engine is None else engine
        noise = self.steps.noise
        if int(setup.targets.fitted.sum()) != len(noise):
            noise = np.full(int(setup.targets.fitted.sum()), float(np.max(noise)))
        search = self._search(engine, setup, self._steps(noise, self.objective_of(setup)))
        try:
            found = calibrate(
                search,
                start,
                method=self.case.config.inversion.method,
                least_m=setup.least_move_m,
            )
        except WorkFailed as error:
            self.remark(f"{name}: no answer: {error}")
            found = None
        self._count(engine)
        return found

    def _problem(self, setup: Setup, found: SearchResult | None = None) -> Problem:
        """A question close to the answer's; or what a search has found as its answer."""
        best = self.found.best if found is None else found.best
        objective = self.objective_of(setup)
        return Problem(
            setup,
            objective,
            best.values,
            objective.fitted_derivative(best.derivative, best.values),
            ran=None if found is None else best.prediction,
            began=None if found is None else found.evaluations[0].prediction,
        )

    def _again_fine(self, solved: Sequence[Solved]) -> None:
        """Solve what coarse runs have answered again at the spacing of the answer.

        Those without coarse runs, and those that fail now, stay as they are.
        """
        again = {
            number: Problem(
                one.changed.setup,
                one.problem.objective,
                one.problem.refined,
                one.problem.slope,
            )
            for number, one in enumerate(solved)
            if self.coarse_spacing_m and self.case.coarsened(one.changed.setup) is not None
        }
        self._resolve(list(again.values()), self.engine_of(), linear=True)
        for number, problem in again.items():
            if np.isfinite(problem.loss):
                solved[number].fine = problem

    def _stepped(self, problem: Problem) -> Problem:
        """With the short linear step that is left, by the derivative at the answer."""
        parameters, targets = problem.objective.parameters, problem.objective.targets
        known = targets.names == self.objective.targets.names and np.isfinite(problem.loss)
        if problem.reached or not known or not self._short(problem):
            return problem
        change = parameters.to_fitted(problem.refined) - parameters.to_fitted(problem.values)
        best = self.found.best
        slope = np.nan_to_num(best.derivative) * parameters.value_per_fitted(best.values)[None, :]
        slope[targets.fitted] = problem.slope
        prediction = problem.prediction
        there = replace(prediction, values=prediction.values + slope @ change)
        return replace(problem, values=problem.refined, ran=there, settled=True)

    def _short(self, problem: Problem) -> bool:
        """The linear step that is left is short against what the data know."""
        left = np.abs(problem.refined - problem.values)
        return bool(np.all(left < SHORT * self.spread.std))

    def _resolve(
        self, problems: list[Problem], engine: Forward | None = None, *, linear: bool = False
    ) -> None:
        """Solve by an engine; None: that of changes.

        `linear`: one run is enough where the linear step that is left is short.
        """
        engine = self.engine_of_changes() if engine is None else engine
        resolve(engine, problems, 0 if linear else ROUNDS)
        if linear:
            resolve(engine, [one for one in problems if not self._short(one)])
        self._count(engine)

    def _tell_evaluation(self, runs_before: int, evaluation: Evaluation) -> None:
        parameters, targets = self.case.parameters, self.objective.targets
        values = ", ".join(
            f"{spec.name} {value:.4g} {with_signs(spec.unit)}"
            for spec, value in zip(parameters.specs, evaluation.values, strict=True)
        )
        named = targets.named(evaluation.prediction.values, targets.fitted)
        units = {
            name: targets.entries[group].unit
            for name, group in zip(targets.names, targets.groups, strict=True)
        }
        predicted = (
            f"{len(named)} numbers"
            if len(named) > MOST_TOLD
            else ", ".join(f"{name} {value:.1f} {units[name]}" for name, value in named.items())
        )
        begins = evaluation.kind in ("scan", "start")
        name = evaluation.kind if begins else f"iteration {evaluation.iteration}"
        loss = (
            f"loss {evaluation.loss:.3g}"
            if np.isfinite(evaluation.loss)
            else evaluation.prediction.reason
        )
        runs = runs_before + evaluation.runs
        self.say(f"{name}: {values}: {predicted}: {loss} ({runs} simulations)")
        self.watch.evaluated(runs, parameters.as_mapping(evaluation.values), evaluation.loss)

    def _described(self, found: SearchResult) -> str:
        return f"{self._listed(found.values)}: {found.words} ({found.runs} simulations)"

    def _listed(self, values: np.ndarray) -> str:
        return ", ".join(
            f"{name} {value:.4g}" for name, value in self.case.parameters.as_mapping(values).items()
        )

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.timings[name] = time.perf_counter() - began
