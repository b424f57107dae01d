"""A case to predict for: its section, what would be measured on it, and what has been, if anything.

A dam that has not failed has a `scene.yaml` and nothing else. Where `measurements.yaml` and
`inversion.yaml` exist, the measured lengths stand beside the predicted ones, and zones, spacing and
duration are those of the back-analysis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.scenes.scene import Scene, load_scene, scene_from_mapping
from geometry.survey.measured import Measured
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import load_measurements
from geometry.survey.toe import Side
from geometry.survey.toe_runout import ToeRunout
from inversion.back_analysis.load import SCENE_FILE
from inversion.engines.mpm_engine import Setup
from inversion.prediction.known_strength import KnownStrength
from inversion.problem.parameters import Parameters
from inversion.problem.predictions import Targets
from inversion.problem.question import FILE_NAME as QUESTION_FILE
from inversion.problem.question import ParameterSpec, load_question
from pipeline.cli import InputError
from pipeline.config import Config, SimulationSettings

SIDES: tuple[Side, Side] = ("left", "right")


@dataclass(frozen=True)
class PredictionCase:
    """A section and what is read on its slides.

    Attributes:
        name: of the folder.
        scene: the section, at the spacing asked for.
        settings: of the simulation.
        entries: what is read; the values of those in `measured` are measured ones.
        measured: names of the entries that have been measured.
        foot: where the section ends before the slide, x [m] by side.
        sought: zones whose strength the back-analysis seeks; empty: there is none.
        noise_jitter: of the seeds that measure the noise.
    """

    name: str
    scene: Scene
    settings: SimulationSettings
    entries: list[Measured]
    measured: list[str]
    foot: dict[Side, float]
    sought: list[str]
    noise_jitter: float

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
        return self.sought or liquefied

    def setup(self, strengths: Sequence[KnownStrength], jitter_seed: int | None = None) -> Setup:
        """The section as the engine takes it, its parameters the strengths.

        Args:
            strengths: with their zones.
            jitter_seed: None: the scene's own points, else jittered ones.
        """
        scene = self.scene
        if jitter_seed is not None:
            scene = scene.changed(jitter=self.noise_jitter, seed=jitter_seed)
        specs = [
            ParameterSpec(
                name=f"residual_strength_{place}", zones=list(s.zones), property="cohesion_kpa",
                start=s.mean_kpa, low=1e-6 * s.mean_kpa, high=1e6 * s.mean_kpa,
            )
            for place, s in enumerate(strengths, start=1)
        ]  # fmt: skip
        return Setup(scene, self.settings, Parameters(specs), self._targets(), self.foot)

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


def load_prediction_case(
    folder: str | Path, config: Config, spacing_m: float | None = None
) -> PredictionCase:
    """Read a case folder, of which only `scene.yaml` must exist.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; a case has at least {SCENE_FILE}")
    scene = load_scene(folder / SCENE_FILE)
    question = None
    if (folder / QUESTION_FILE).is_file():
        question = load_question(folder, scene)
    spacing = spacing_m or (question.spacing_m if question else None) or scene.spacing
    if spacing_m is None:
        spacing *= config.inversion.spacing_factor
    measurements = None
    if (folder / MEASUREMENTS_FILE).is_file():
        measurements = load_measurements(folder, scene)
    if spacing != scene.spacing:
        where = f"{folder / SCENE_FILE} at {spacing:g} m spacing"
        scene = scene_from_mapping({**scene.model_dump(), "spacing": spacing}, where)
    settings = config.simulation
    if question is not None and question.duration_s is not None:
        settings = settings.model_copy(update={"duration_s": question.duration_s})
    entries: list[Measured] = []
    surveyed: dict[Side, float | None] = dict.fromkeys(SIDES)
    if measurements is not None:
        surveyed = {side: measurements.foot(side) for side in SIDES}
        entries = [entry for entry in measurements.numbers if not entry.constructed]
    return PredictionCase(
        name=folder.resolve().name,
        scene=scene,
        settings=settings,
        entries=entries + _other_toes(entries, scene),
        measured=[entry.name for entry in entries],
        foot={side: scene.foot(side) if x is None else x for side, x in surveyed.items()},
        sought=[
            zone
            for spec in (question.parameters if question else [])
            if spec.property == "cohesion_kpa"
            for zone in spec.zones
        ],
        noise_jitter=config.inversion.noise_jitter,
    )


def _other_toes(entries: Sequence[Measured], scene: Scene) -> list[ToeRunout]:
    """Runouts of the sides that nobody measured and that have room to run."""
    taken = {entry.toe_side for entry in entries}
    found = []
    for side in SIDES:
        wall = scene.domain.x_min if side == "left" else scene.domain.x_max
        room = abs(wall - scene.foot(side)) > 2.0 * scene.spacing
        if side not in taken and (room or scene.domain.walls == "open"):
            found.append(
                ToeRunout(
                    type="toe_runout", name=f"{side} toe", side=side, value_m=0.0, std_m=1.0,
                    confidence="assumed", source="not measured: predicted alone",
                )
            )  # fmt: skip
    return found
