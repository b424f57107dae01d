"""What back-analyses by learned engines share: these have no solver whose settings could change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import Reading
from inversion.back_analysis.perturbed_answers import Problem
from inversion.back_analysis.variants import Changed
from inversion.engines.workers import Job
from inversion.estimation.forward import Forward, Setup
from inversion.estimation.search import SearchResult
from inversion.problem.question import Sensitivity, Variant
from pipeline.cli import InputError

#: Kinds of sensitivities of which a learned engine knows nothing.
UNKNOWN_TO_IT = {"time_step": "no time step", "simulation": "no settings of the solver"}


@dataclass(kw_only=True)
class LearnedAnalysis(BackAnalysis):
    """A case under back-analysis by an engine that has learned."""

    def side_by_side(self, jobs: Sequence[Job]) -> None:
        """One after the other: a forecast leaves no core idle."""
        for job in jobs:
            job()

    def known_variants(self) -> tuple[list[Variant], list[str]]:
        """Without those that change settings, of which a learned engine has none."""
        variants = self.case.question.variants
        reasons = [
            _left_out(variant.name, "simulation") for variant in variants if variant.simulation
        ]
        return [variant for variant in variants if not variant.simulation], reasons

    def known_sensitivities(self) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
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
        try:
            return super()._calibrated(name, setup, start, engine)
        except InputError as error:
            self.remark(f"{name}: no answer: {error}")
            return None

    def _solved_reading(
        self, reading: Reading, setup: Setup, begin: np.ndarray, slope: np.ndarray | None
    ) -> Problem | None:
        """A reading of the waterfall; None, and a line, where the engine does not know it."""
        try:
            return super()._solved_reading(reading, setup, begin, slope)
        except InputError as error:
            self.remark(f"{reading.name}: no answer: {error}")
            return None


def _left_out(name: str, kind: str) -> str:
    """Why a variant or a sensitivity is not solved."""
    return f"{name}: left out: a learned engine has {UNKNOWN_TO_IT[kind]}; ask the engine mpm"
