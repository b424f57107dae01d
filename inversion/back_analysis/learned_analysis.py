"""What back-analyses by learned engines share.

They have no solver whose settings could change, and the material point method may run next to them
at a few states around an answer: the mean difference then corrects every prediction, and what it
varies by enters the covariance of the measurements (`inversion.engines.model_error`). Where the
material point method does not confirm the corrected answer, its difference there corrects the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from inversion.back_analysis.asked import Sides
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import WaterfallReading
from inversion.back_analysis.perturbed_answers import Problem
from inversion.engines.model_error import (
    Corrected,
    Pairs,
    Settling,
    paired,
    states_around,
    with_error,
)
from inversion.engines.registry import REFERENCE, Engine, engine_named
from inversion.engines.workers import Job
from inversion.estimation.forward import Forward, Setup
from inversion.estimation.misfit import Objective, posterior
from inversion.estimation.search import SearchResult
from inversion.problem.question import STRENGTH_RATIO, Variant
from pipeline.cli import InputError

Found = TypeVar("Found")

#: A corrected answer is confirmed where the material point method is off by at most this [standard
#: deviations of the survey]; most times that it is corrected by the difference there.
CONFIRMED, MOST_MOVES = 0.15, 4
#: Kinds of sensitivities of which a learned engine knows nothing.
UNKNOWN_TO_IT = {
    "time_step": "no time step",
    "simulation": "no settings of the solver",
    STRENGTH_RATIO: "never seen strength that grows with depth",
}


@dataclass(kw_only=True)
class LearnedAnalysis(BackAnalysis):
    """A case under back-analysis by an engine that has learned.

    Attributes:
        pairs: it and the material point method around an answer; None: not run.
    """

    pairs: Pairs | None = None

    @property
    def paired(self) -> Pairs:
        """The pairs, once they were run."""
        assert self.pairs is not None
        return self.pairs

    def uncorrected(self) -> Forward:
        """The engine as it has learned."""
        raise NotImplementedError

    def engine_of(self) -> Forward:
        """The engine, corrected as soon as its error is known."""
        engine = self.uncorrected()
        if self.pairs is None:
            return engine
        return Corrected(engine, dict(zip(self.pairs.names, self.pairs.correction, strict=True)))

    def engine_of_cells(self) -> Engine | None:
        """The solver, where its runs have corrected the answer."""
        return None if self.pairs is None else engine_named(REFERENCE)

    def objective_of(self, setup: Setup) -> Objective:
        """With the engine's error in the covariance as soon as it is known."""
        if self.pairs is not None:
            setup = replace(setup, targets=with_error(setup.targets, self.pairs))
        return self.case.objective(setup)

    def run_pairs(self, truth: Forward, count: int) -> Forward:
        """Run the material point method next to it around the present answer.

        Args:
            truth: the material point method.
            count: states, the answer among them.

        Returns:
            the engine without correction, with its runs.
        """
        parameters, values = self.case.parameters, self.found.values
        around = posterior(self.objective, self.found.best.derivative, values)
        states, width = states_around(parameters, values, np.sqrt(np.diag(around.scaled)), count)
        learned = self.uncorrected()
        pairs, _ = paired(learned, truth, self.case.setup, states, width)
        self._correct_by(pairs)
        return learned

    def search_again(self) -> None:
        """Search with the engine and the objective that are known by now."""
        raise NotImplementedError

    def answer_by_pairs(self, truth: Forward, run_pairs: Callable[[], None]) -> None:
        """The answer with the correction by the pairs that are there, as the solver confirms it.

        Args:
            truth: the material point method.
            run_pairs: runs them around the present answer, for where it has left them.
        """
        self.search_again()
        if not self._within_pairs:
            self.say("the answer has left the states of the paired runs: they are repeated")
            run_pairs()
            self.search_again()
        self.settle(truth)
        if not self._within_pairs:
            self.remark(
                "the answer lies outside the states at which the material point method ran next to "
                "the learned engine: the correction there is extrapolated"
            )

    @property
    def _within_pairs(self) -> bool:
        return self.paired.holds(self.case.parameters, self.found.values)

    def settle(self, truth: Forward) -> None:
        """Let the solver judge the answer, and correct by what it says there until it agrees.

        Of the answers on the way that is kept which it is nearest to.

        Args:
            truth: the material point method.
        """
        judged, here = self._judged_by(truth)
        first, kept = here, (here.off, self.found, self.paired)
        before: Settling | None = None
        for _ in range(MOST_MOVES):
            if here.off <= CONFIRMED or not np.isfinite(here.off):
                break
            own = self.found.best.prediction.values - here.correction
            following = here.following(before)
            self._correct_by(self.paired.moved(self.found.values, judged, own, following))
            self.search_again()
            before, (judged, here) = here, self._judged_by(truth)
            if here.off < kept[0]:
                kept = here.off, self.found, self.paired
        off, self.found, pairs = kept
        self._correct_by(pairs)
        if off < first.off:
            self.say(
                f"the material point method was off by {first.off:.1f} standard deviations of the "
                f"survey at the corrected answer; now, with more runs at such answers, by {off:.1f}"
            )

    def _judged_by(self, truth: Forward) -> tuple[np.ndarray, Settling]:
        """What it predicts at the answer (m,), and what that says of the correction."""
        targets = self.case.setup.targets
        (judged,) = truth.predict([self.case.setup.at(self.found.values)])
        left = judged.values - self.found.best.prediction.values
        weight = np.where(targets.fitted, 1.0 / np.sqrt(np.diag(targets.covariance)), 0.0)
        off = float(np.max(np.abs(left * weight)[targets.fitted]))
        known = np.where(np.isfinite(left), left, 0.0)
        return judged.values, Settling(self.paired.correction, known, off, weight)

    def _correct_by(self, pairs: Pairs) -> None:
        self.pairs = pairs
        self.engine = self.engine_of()
        self.objective = self.objective_of(self.case.setup)

    def share_of_engine(self, source: str) -> np.ndarray:
        """Take the engine's error out of the spread; it becomes a source of its own.

        Of strengths as well as of their ratios to the stress before failure.

        Args:
            source: its name among the sources of uncertainty.

        Returns:
            standard deviation of the parameters by it alone (p,).
        """
        derivative, values = self.found.best.derivative, self.found.values
        whole = posterior(self.objective, derivative, values)
        survey = self.case.objective().covariance
        self.spread = posterior(self.objective, derivative, values, errors=survey)
        std = np.sqrt(np.maximum(whole.std**2 - self.spread.std**2, 0.0))
        names, stress = self.case.parameters.names, self.found.best.prediction.sigma_v0_kpa
        self.more_sources[source] = dict(zip(names, map(float, std), strict=True))
        self.ratio_changes[source] = {
            name: float(one / vertical)
            for name, one, vertical in zip(names, std, stress, strict=True)
            if np.isfinite(vertical)
        }
        return std

    def differences(self) -> list[str]:
        """Correction of each fitted number and its standard deviation, in words."""
        targets, std = self.objective.targets, np.sqrt(np.diag(self.paired.covariance))
        units = [targets.entries[group].unit for group in targets.groups]
        added = self.paired.correction
        each = zip(self.paired.names, added, std, units, targets.fitted, strict=True)
        return [
            f"{name} {mean:+.2f} +- {own:.2f} {unit}"
            for name, mean, own, unit, used in each
            if used
        ]

    def side_by_side(self, jobs: Sequence[Job]) -> None:
        """One after the other: a forecast leaves no core idle."""
        for job in jobs:
            job()

    def known_variants(self) -> tuple[list[Variant], list[str]]:
        """Without those that change what a learned engine has not seen.

        These are settings of the simulation, and strength that grows with depth.
        """
        variants = self.case.question.variants
        unknown = {
            variant.name: "simulation" if variant.simulation else STRENGTH_RATIO
            for variant in variants
            if variant.simulation or variant.property == STRENGTH_RATIO
        }
        reasons = [_left_out(name, what) for name, what in unknown.items()]
        return [variant for variant in variants if variant.name not in unknown], reasons

    def known_sensitivities(self) -> tuple[Sides, list[str]]:
        """Without those that change nothing for a learned engine."""
        entries, left_out = self.case.sensitivities
        kept = [pair for pair in entries if pair[0].kind not in UNKNOWN_TO_IT]
        reasons = [
            _left_out(entry.name, entry.kind) for entry, _ in entries if entry.kind in UNKNOWN_TO_IT
        ]
        return kept, [*left_out, *reasons]

    def _calibrated(
        self, name: str, setup: Setup, start: np.ndarray, engine: Forward | None = None
    ) -> SearchResult | None:
        """Another search; None, and a line, also where the engine does not know the reading."""
        search = super()._calibrated
        return self._if_known(name, lambda: search(name, setup, start, engine))

    def _solved_reading(
        self, reading: WaterfallReading, setup: Setup, begin: np.ndarray, slope: np.ndarray | None
    ) -> Problem | None:
        """A reading of the waterfall; None, and a line, where the engine does not know it."""
        solve = super()._solved_reading
        return self._if_known(reading.name, lambda: solve(reading, setup, begin, slope))

    def _if_known(self, name: str, solve: Callable[[], Found | None]) -> Found | None:
        """What was solved; None, and a line, where the engine refuses it."""
        try:
            return solve()
        except InputError as error:
            self.remark(f"{name}: no answer: {error}")
            return None


def _left_out(name: str, kind: str) -> str:
    """Why a variant or a sensitivity is not solved."""
    return f"{name}: left out: a learned engine has {UNKNOWN_TO_IT[kind]}; ask the engine mpm"
