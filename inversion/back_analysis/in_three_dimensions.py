"""A back-analysis whose simulations are three-dimensional: sections over a width.

The stages, the estimator and the measurements are those of two dimensions; the measurements are
read on the middle section. What the solver does not have in three dimensions is left out and said.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from geometry.scenes3d.scene3d import FILE_NAME, Section, read_document
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import InversionCase
from inversion.back_analysis.variants import Changed
from inversion.engines.run_store import RunStore
from inversion.engines.run_store_3d import RunStore3d
from inversion.engines.setup import Setup
from inversion.problem.question import Sensitivity, Variant
from pipeline.cli import InputError
from pipeline.progress import Watch


@dataclass(kw_only=True)
class AnalysisIn3d(BackAnalysis):
    """A case under back-analysis by simulations in three dimensions."""

    engine_name: str = "mpm3d"

    def known_variants(self) -> tuple[list[Variant], list[str]]:
        """Without those that the solver refuses."""
        kept, reasons = [], []
        for variant in self.case.question.variants:
            reason = _refused(self.store, self.case.variant(variant).setup)
            if reason:
                reasons.append(f"{variant.name}: left out: {reason}")
            else:
                kept.append(variant)
        return kept, reasons

    def known_sensitivities(self) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
        """Without those that the solver refuses."""
        entries, left_out = self.case.sensitivities
        kept, reasons = [], list(left_out)
        for entry, sides in entries:
            reason = next(filter(None, (_refused(self.store, side.setup) for side in sides)), "")
            if reason:
                reasons.append(f"{entry.name}: left out: {reason}")
            else:
                kept.append((entry, sides))
        return kept, reasons


def _refused(store: RunStore, setup: Setup) -> str:
    """Why the solver does not simulate a setup, or ""."""
    from mpm_taichi.simulate3d import refuse_problem
    from mpm_taichi.solver3d.problem import extruded

    assert isinstance(store, RunStore3d)
    try:
        narrow = 3.0 * setup.scene.spacing
        refuse_problem(extruded(store.walled(setup.scene), narrow), setup.settings)
    except InputError as error:
        return str(error)
    return ""


def in_three_dimensions(case: InversionCase, store: RunStore, watch: Watch) -> AnalysisIn3d:
    """The back-analysis of a case over the width that the `scene3d.yaml` of its folder says.

    Raises:
        InputError: no such file, one without a section, or a case that the solver refuses.
    """
    document = read_document(case.folder / FILE_NAME)
    section: Section | None = document.section
    if section is None:
        raise InputError(f"{case.folder / FILE_NAME}: a back-analysis needs a section")
    solid = RunStore3d(
        section,
        document.flanks,
        store.folder,
        device=store.device,
        threads=store.threads,
        on_run=store.on_run,
    )
    reason = _refused(solid, case.setup)
    if reason:
        raise InputError(f"{case.folder / Path(FILE_NAME)}: {reason}")
    settings = case.config.inversion.model_copy(update={"waterfall": False})
    known = replace(case, config=case.config.model_copy(update={"inversion": settings}))
    return AnalysisIn3d(case=known, store=solid, say=watch.say, watch=watch)
