"""A back-analysis whose simulations are three-dimensional: sections over a width.

The stages, the estimator and the measurements are those of two dimensions; the measurements are
read on the middle section. What the solver does not have in three dimensions is left out and said.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.variants import Changed
from inversion.engines.run_store import RunStore
from inversion.engines.run_store_3d import store_over_width
from inversion.problem.question import Sensitivity, Variant
from pipeline.progress import Watch


@dataclass(kw_only=True)
class AnalysisIn3d(BackAnalysis):
    """A case under back-analysis by simulations in three dimensions."""

    engine_name: str = "mpm3d"

    def known_variants(self) -> tuple[list[Variant], list[str]]:
        """Without those that the solver refuses."""
        kept, reasons = [], []
        for variant in self.case.question.variants:
            reason = self.store.refused(self.case.variant(variant).setup)
            if reason:
                reasons.append(f"{variant.name}: left out: {reason}")
            else:
                kept.append(variant)
        return kept, reasons

    def known_sensitivities(self) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
        """Without those that the solver refuses."""
        return self.case.sensitivities_of(self.store.refused)


def in_three_dimensions(case: InversionCase, store: RunStore, watch: Watch) -> AnalysisIn3d:
    """The back-analysis of a case over the width that the `scene3d.yaml` of its folder says.

    Raises:
        InputError: no such file, one without a section, or a case that the solver refuses.
    """
    solid = store_over_width(case.folder, case.setup, store)
    settings = case.config.inversion.model_copy(update={"waterfall": False})
    known = replace(case, config=case.config.model_copy(update={"inversion": settings}))
    return AnalysisIn3d(case=known, store=solid, say=watch.say, watch=watch)
