"""A case to predict for: what would be measured on its slides, and what has been, if anything.

A dam that has not failed has a `scene.yaml` and nothing else. Where `measurements.yaml` and
`inversion.yaml` exist, measured lengths are reported with the predicted ones, and zones, spacing
and duration are those of the back-analysis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.case import Case
from geometry.scenes.fill import point_count
from geometry.scenes.scene import Scene
from geometry.sides import SIDES
from geometry.survey.measured import Measured, single_lengths
from geometry.survey.toe_runout import ToeRunout
from inversion.engines.registry import Engine
from inversion.engines.run_store import Store
from inversion.engines.small_cells import SmallCells, cells_by, other_spacings
from inversion.estimation.data import Targets
from inversion.estimation.forward import SectionSetup
from inversion.prediction.known_strength import KnownStrength, strength_parameters
from inversion.problem.question import FILE_NAME as QUESTION_FILE
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO, load_question
from pipeline.cli import InputError

#: How often the cells are asked; ln of a strength from which on the second time is worth its runs.
TIMES, WORTH = 2, 0.05


@dataclass(frozen=True)
class PredictionCase(Case):
    """A case and the measurements read on its slides.

    Attributes:
        entries: measurements to read; those in `known` have measured values.
        known: names of the entries that have been measured.
        calibrated: zones whose strength is back-analysed; empty: no back-analysis.
    """

    entries: list[Measured]
    known: list[str]
    calibrated: list[str]

    @property
    def ground(self) -> np.ndarray:
        """The rigid base (P, 2) [m]."""
        return np.asarray(self.scene.ground.points, dtype=float)

    @property
    def default_zones(self) -> list[str]:
        """Zones whose strength is meant unless others are named."""
        liquefied = [
            zone.name for zone in self.scene.zones if self.scene.materials[zone.material].liquefied
        ]
        return self.calibrated or liquefied

    def setup(
        self, strengths: Sequence[KnownStrength], jitter_seed: int | None = None
    ) -> SectionSetup:
        """The section as the engine takes it, its parameters the strengths.

        Args:
            strengths: with their zones.
            jitter_seed: None: the scene's own points, else jittered ones.
        """
        scene = self.scene
        if jitter_seed is not None:
            scene = scene.changed(jitter=self.config.inversion.noise_jitter, seed=jitter_seed)
        return SectionSetup(
            scene, self.simulation, strength_parameters(strengths), self._targets(), self.feet
        )

    def cells_by(self, engine: Engine, store: Store, setup: SectionSetup) -> SmallCells:
        """What the cells make of the strengths of a setup, in the middle of what is known of them.

        Args:
            engine: predicts.
            store: of its runs.
            setup: with the strengths as its first guesses.
        """
        values = setup.parameters.start
        for _ in range(TIMES):
            others = other_spacings(setup, point_count(self.scene), 2, str(self.folder))
            found = cells_by(engine, store, setup, values, others)
            if abs(np.log(found.factor)) < WORTH:
                break
            # What is known is a strength in small cells; the runs are of weaker soil.
            values = setup.parameters.start / found.factors(setup.parameters)
        return found

    def _targets(self) -> Targets:
        """All entries as one vector; nothing is fitted, so failure is judged by every number."""
        count = len(self.entries)
        return Targets(
            entries=list(self.entries),
            names=[entry.name for entry in self.entries],
            measured=np.array([float(entry.values[0]) for entry in self.entries]),
            covariance=np.eye(count),
            roles=["fitted"] * count,
        )


def prediction_case(case: Case, *, spacing_m: float | None = None) -> PredictionCase:
    """A case with the measurements read on its slides.

    Args:
        case: with a section, at least.
        spacing_m: of material points; None: the back-analysis's, or the scene's, times
            `inversion.spacing_factor`.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    question = None
    if (case.folder / QUESTION_FILE).is_file():
        question = load_question(case.folder, case.drawn)
    factor = case.config.inversion.spacing_factor
    case = case.resolved(question, spacing_factor=factor, spacing_m=spacing_m)
    stood = [entry for entry in case.measured if entry.censored]
    entries: list[Measured] = [
        entry for entry in (*single_lengths(case.measured), *stood) if not entry.constructed
    ]
    read = [*entries, *_other_toes(entries, case.scene)]
    if not read:
        raise InputError(
            f"{case.folder}: nothing to predict: the ground goes on on both sides and no soil that "
            "stands on it has a toe; where soil can run out of the section: domain: {left: free}"
        )
    return case.extended(
        PredictionCase,
        entries=read,
        known=[entry.name for entry in entries],
        calibrated=[
            zone
            for spec in (question.parameters if question else [])
            if spec.property in (RESIDUAL_STRENGTH, STRENGTH_RATIO)
            for zone in spec.zones
        ],
    )


def _other_toes(entries: Sequence[Measured], scene: Scene) -> list[ToeRunout]:
    """Runouts of the sides that nobody measured and that have room to run."""
    taken = {entry.toe_side for entry in entries}
    found = []
    for side in SIDES:
        room = abs(scene.domain.wall(side) - scene.foot(side)) > 2.0 * scene.spacing
        if side not in taken and (room or scene.domain.is_open(side)):
            found.append(
                ToeRunout(
                    type="toe_runout",
                    name=f"{side} toe",
                    side=side,
                    value_m=0.0,
                    std_m=1.0,
                    confidence="assumed",
                    source="not measured: predicted alone",
                )
            )
    return found
