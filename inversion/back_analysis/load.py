"""A case folder made into a problem: section, measurements, question, settings.

In: a folder with `scene.yaml`, `measurements.yaml` and `inversion.yaml`, and the configuration.
Out: a `LoadedCase`. Whatever is wrong with the folder is an `InputError` of one line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from geometry.scenes.scene import Scene, load_scene, scene_from_mapping
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import Measurements, load_measurements
from inversion.back_analysis.variants import Changed, sides, vary
from inversion.engines.mpm_engine import Setup
from inversion.estimation.objective import Objective
from inversion.problem.parameters import Parameters
from inversion.problem.predictions import Targets, make_targets
from inversion.problem.question import FILE_NAME, Question, Sensitivity, Variant, load_question
from pipeline.cli import InputError
from pipeline.config import Config
from pipeline.places import CASES, resolve

SCENE_FILE = "scene.yaml"


@dataclass(frozen=True)
class LoadedCase:
    """A case and the question asked of it.

    Attributes:
        folder: of the case.
        scene: the section before the slide, at the spacing asked for.
        measurements: all sets.
        measurement_set: name of the set in use.
        question: as in the file.
        setup: the question as the engine takes it.
        config: settings in force.
        use_constructed: constructed data may enter the fit.
        own_spacing_m: the spacing the case itself asks for.
    """

    folder: Path
    scene: Scene
    measurements: Measurements
    measurement_set: str
    question: Question
    setup: Setup
    config: Config
    use_constructed: bool
    own_spacing_m: float

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.resolve().name

    @property
    def title(self) -> str:
        """The name in words."""
        return self.scene.name.replace("_", " ").title()

    @property
    def source(self) -> str:
        """File of the question, for messages."""
        return str(self.folder / FILE_NAME)

    @property
    def parameters(self) -> Parameters:
        """What is sought."""
        return self.setup.parameters

    def objective(self, setup: Setup | None = None) -> Objective:
        """What is made small, for the question or another reading of it."""
        settings = self.config.inversion
        tolerance = settings.tolerance_m2
        if self.question.loss == "misfit":
            tolerance = settings.tolerance_misfit
        chosen = self.setup if setup is None else setup
        return Objective(chosen.parameters, chosen.targets, self.question.loss, tolerance)

    def variant(self, variant: Variant) -> Changed:
        """The setup of a variant."""
        targets = self.setup.targets
        if variant.measurements is not None or variant.fit is not None:
            name = variant.measurements or self.measurement_set
            fit = variant.fit
            if fit is None:
                fit = _fit_of(self.question, self.measurements, name)
            targets = self._targets(name, fit)
        return vary(self.setup, variant, targets, self.source)

    def sides(self, sensitivity: Sensitivity) -> list[Changed]:
        """The setups of a sensitivity."""
        return sides(self.setup, sensitivity, self.source)

    @cached_property
    def sensitivities(self) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
        """The sensitivities with their setups, and lines about those that cannot be had.

        At a coarser spacing than the case asks for, a change may leave a zone thinner than a
        spacing; that is no mistake in the question, so such a sensitivity is left out and told.
        """
        found, left_out = [], []
        for sensitivity in self.question.sensitivities:
            try:
                found.append((sensitivity, self.sides(sensitivity)))
            except InputError as error:
                if self.scene.spacing <= self.own_spacing_m:
                    raise
                reason = str(error).removeprefix(f"{self.source}: sensitivities: ")
                left_out.append(f"left out at {self.scene.spacing:g} m spacing: {reason}")
        return found, left_out

    def jittered(self, setup: Setup, seed: int) -> Setup:
        """The same setup with its points jittered by a seed."""
        jitter = self.config.inversion.noise_jitter
        return replace(setup, scene=setup.scene.changed(jitter=jitter, seed=seed))

    def _targets(self, measurement_set: str, fit: Sequence[str] | None) -> Targets:
        return make_targets(
            self.measurements.chosen(measurement_set),
            fit=fit,
            loss=self.question.loss,
            source=self.source,
            use_constructed=self.use_constructed,
        )


def case_folder(text: str) -> Path:
    """The folder of a case given by its path or by its name in `case_histories`."""
    return resolve(text, CASES)


def load_case(
    folder: str | Path,
    config: Config,
    *,
    measurement_set: str | None = None,
    spacing_m: float | None = None,
    use_constructed: bool = False,
) -> LoadedCase:
    """Read a case folder.

    Args:
        folder: of the case.
        config: settings; the question's duration wins over `simulation.duration_s`.
        measurement_set: name of a set; None: the file's default.
        spacing_m: of material points; None: the question's, or the scene's, times
            `inversion.spacing_factor`.
        use_constructed: let constructed data enter the fit.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; a case has {SCENE_FILE}, {MEASUREMENTS_FILE} and "
            f"{FILE_NAME}"
        )
    scene = load_scene(folder / SCENE_FILE)
    measurements = load_measurements(folder, scene)
    question = load_question(folder, scene)
    own = question.spacing_m or scene.spacing
    spacing = own * config.inversion.spacing_factor if spacing_m is None else spacing_m
    if spacing != scene.spacing:
        document = {**scene.model_dump(), "spacing": spacing}
        scene = scene_from_mapping(document, f"{folder / SCENE_FILE} at {spacing:g} m spacing")
    simulation = config.simulation
    if question.duration_s is not None:
        simulation = simulation.model_copy(update={"duration_s": question.duration_s})
    chosen = measurement_set or measurements.default_set
    foot = measurements.feet(scene)
    fit = _fit_of(question, measurements, chosen)
    source = str(folder / FILE_NAME)
    targets = make_targets(
        measurements.chosen(chosen),
        fit=fit,
        loss=question.loss,
        source=source,
        use_constructed=use_constructed,
    )
    setup = Setup(scene, simulation, Parameters(question.parameters), targets, foot)
    case = LoadedCase(
        folder, scene, measurements, chosen, question, setup, config, use_constructed, own
    )
    _check_all(case)
    return case


def _fit_of(question: Question, measurements: Measurements, chosen: str) -> list[str] | None:
    """`fit` speaks of the default set; another set is fitted by the same names if it has any."""
    if question.fit is None or chosen == measurements.default_set:
        return question.fit
    there = {entry.name for entry in measurements.chosen(chosen)}
    kept = [name for name in question.fit if name in there]
    return kept or None


def _check_all(case: LoadedCase) -> None:
    """Build every variant and sensitivity now: a mistake should not show after an hour."""
    for variant in case.question.variants:
        case.variant(variant)
    _ = case.sensitivities
