"""A case folder made into a question for the statistics: section, measurements, options.

In: a folder with `scene.yaml`, `measurements.yaml`, `inversion.yaml` and perhaps `diagnosis.yaml`;
the configuration, perhaps a model file. Out: a `DiagnosisCase`. Whatever is wrong with the folder
is an `InputError` of one line, before the first simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from diagnosis.fitting.hold_out import split
from diagnosis.hypotheses.hypothesis_file import ModelFile
from diagnosis.hypotheses.mpm_model import MPMModel, Numerics
from diagnosis.options import Options, seed_of
from diagnosis.question import FILE_NAME, DiagnosisQuestion, load_diagnosis_question
from geometry.scenes.scene import Scene, load_scene, scene_from_mapping
from geometry.survey.measured import Measured
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import Measurements, check_places, load_measurements
from inversion.back_analysis.load import SCENE_FILE
from inversion.engines.mpm_engine import Setup
from inversion.engines.run_store import RunStore
from inversion.problem.parameters import Parameters
from inversion.problem.predictions import Targets, make_targets
from inversion.problem.question import FILE_NAME as INVERSION_FILE
from inversion.problem.question import Question, ZoneBoundary, check_zones, load_question
from mpm_taichi.effects import effect, effects, effects_on
from pipeline.cli import InputError
from pipeline.config import Config

#: Forward runs at the fits themselves, for the pictures.
FOR_PICTURES = 2


@dataclass(frozen=True)
class DiagnosisCase:
    """A case and what is asked of its diagnosis.

    Attributes:
        folder: of the case.
        measurements: all sets.
        inversion: what is calibrated, as in `inversion.yaml`.
        question: as in `diagnosis.yaml`.
        setup: section, settings, parameters and measurements of the base model.
        config: settings in force.
        transfer: the case that judges the answer; None where `diagnosis.yaml` names none.
    """

    folder: Path
    measurements: Measurements
    inversion: Question
    question: DiagnosisQuestion
    setup: Setup
    config: Config
    transfer: DiagnosisCase | None = None

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.resolve().name

    @property
    def title(self) -> str:
        """The name in words."""
        return self.name.replace("_", " ").title()

    @property
    def source(self) -> str:
        """File of the question, for messages."""
        return str(self.folder / FILE_NAME)

    @property
    def scene(self) -> Scene:
        """The section of the base model."""
        return self.setup.scene

    @property
    def priors(self) -> dict[str, tuple[float, float]]:
        """Effect -> mean and standard deviation of its amplitude."""
        return {name: (prior.mean, prior.std) for name, prior in self.question.priors.items()}

    def model(self, store: RunStore) -> MPMModel:
        """The material point method as the model of this case.

        Raises:
            InputError: the question names an effect that does not exist.
        """
        settings = self.config.diagnosis
        model = MPMModel(
            self.setup,
            store,
            sensitivities=[s for s in self.inversion.sensitivities if isinstance(s, ZoneBoundary)],
            numbers=self.question.parameters,
            priors=self.priors,
            numerics=Numerics(settings.noise_jitter, settings.second_transfer, settings.finer),
        )
        known = [*(c.name for c in model.candidates), *model.left_out]
        for key, names in self.question.named_effects.items():
            for name in names:
                if name not in known:
                    raise InputError(
                        f"{self.source}: {key}: no effect {name!r}; there are "
                        f"{', '.join(sorted(known))}"
                    )
        return model

    def options(self, model: MPMModel) -> Options:
        """What the statistics are told, of effects that can act here alone."""
        settings, question = self.config.diagnosis, self.question
        acting = {candidate.name for candidate in model.candidates}
        wanted = None
        if question.effects is not None:
            wanted = tuple(name for name in question.effects if name in acting)
        return Options(
            seed=seed_of(self.name),
            synthetic=question.synthetic,
            hold_out=question.held_out,
            forbidden=tuple(name for name in question.forbid if name in acting),
            effects=wanted,
            priors={name: prior for name, prior in self.priors.items() if name in acting},
            allowance=settings.max_runs - FOR_PICTURES,
            replicates=question.replicates or settings.replicates,
            transfer=question.transfer,
            resolution_factor=(
                settings.resolution_factor
                if question.resolution_factor is None
                else question.resolution_factor
            ),
            draws=settings.draws,
            starts=settings.starts,
            rounds=settings.rounds,
            refitted=settings.refitted,
        )

    def left_out(self, model: MPMModel) -> dict[str, str]:
        """Effects that are not tested, and why: they cannot act here, or an engineer knows better.

        Those that are merely not asked for are not among them.
        """
        told = {
            name: "ruled out by the engineer" + (f": {why}" if why else "")
            for name, why in self.question.forbid.items()
        }
        return {**{name: f"can do nothing here: {why}" for name, why in model.left_out.items()},
                **told}  # fmt: skip

    @cached_property
    def files(self) -> list[Path]:
        """Files the diagnosis was made from."""
        names = (SCENE_FILE, MEASUREMENTS_FILE, INVERSION_FILE, FILE_NAME)
        found = [self.folder / name for name in names]
        found += [self.folder / file for e in self.setup.targets.entries for file in e.files]
        return [path for path in dict.fromkeys(found) if path.is_file()]


def load_diagnosis(
    folder: str | Path,
    config: Config,
    *,
    spacing_m: float | None = None,
    model: ModelFile | None = None,
    model_source: str = "",
    with_transfer: bool = True,
) -> DiagnosisCase:
    """Read a case folder.

    Args:
        folder: of the case.
        config: settings.
        spacing_m: of material points; None: that of `diagnosis.yaml`, of `inversion.yaml` or of the
            scene, times `diagnosis.spacing_factor`.
        model: what stands in place of the base model: the scene changed, effects switched on.
        model_source: its file, for messages.
        with_transfer: read the case that `transfer_check` names as well.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; a case has {SCENE_FILE}, {MEASUREMENTS_FILE} and "
            f"{INVERSION_FILE}"
        )
    scene = load_scene(folder / SCENE_FILE)
    measurements = load_measurements(folder, scene)
    inversion = load_question(folder, scene)
    question = load_diagnosis_question(folder)
    own = question.spacing_m or inversion.spacing_m or scene.spacing
    spacing = own * config.diagnosis.spacing_factor if spacing_m is None else spacing_m
    surveyed = scene.spacing
    if spacing != surveyed:
        document = {**scene.model_dump(), "spacing": spacing}
        scene = scene_from_mapping(document, f"{folder / SCENE_FILE} at {spacing:g} m spacing")
    source = str(folder / SCENE_FILE)
    if model is not None:
        source = model_source or "model"
        scene = model.scene(scene, source)
        # What was measured and what is sought must be in the changed section as well.
        at_least = scene.model_copy(update={"spacing": max(surveyed, scene.spacing)})
        check_places(measurements, at_least, f"{source}: {folder / MEASUREMENTS_FILE}")
        check_zones(inversion, scene, f"{source}: {folder / INVERSION_FILE}")
    effects_on(scene, source)
    simulation = config.simulation
    duration = question.duration_s or inversion.duration_s
    if duration is not None:
        simulation = simulation.model_copy(update={"duration_s": duration})
    foot = measurements.feet(scene)
    targets = _targets(measurements, question, folder)
    setup = Setup(scene, simulation, Parameters(inversion.parameters), targets, foot)
    other = _transfer(question, folder, config) if with_transfer else None
    case = DiagnosisCase(folder, measurements, inversion, question, setup, config, other)
    _check_numbers(case)
    return case


def _transfer(question: DiagnosisQuestion, folder: Path, config: Config) -> DiagnosisCase | None:
    """The case that `transfer_check` names, read whole: it is simulated last, and refused first."""
    if question.transfer_check is None:
        return None
    place = folder / question.transfer_check  # an absolute path stays as it is
    where = f"{folder / FILE_NAME}: transfer_check"
    if place.resolve() == folder.resolve():
        raise InputError(f"{where}: {question.transfer_check}: is this case; name another one")
    try:
        other = load_diagnosis(place, config, with_transfer=False)
        other.model(RunStore(None))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return other


def _targets(measurements: Measurements, question: DiagnosisQuestion, folder: Path) -> Targets:
    """All measurements of the default set; what was constructed enters nothing."""
    source = str(folder / FILE_NAME)
    entries: Sequence[Measured] = measurements.chosen()
    if question.held_out is not None:
        entries = [entry.without_hold_out() for entry in entries]
    targets = make_targets(entries, fit=None, loss="misfit", source=str(folder / MEASUREMENTS_FILE))
    try:
        split(targets, question.held_out)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    return targets


def _check_numbers(case: DiagnosisCase) -> None:
    """Further numbers of effects must be ones that the effects have."""
    for name, numbers in case.question.parameters.items():
        if name not in effects():
            raise InputError(
                f"{case.source}: parameters: no effect {name!r}; there are {', '.join(effects())}"
            )
        one = effect(name)
        if not one.applies(case.scene):
            tried = {"amplitude": one.amplitude.ladder[0], **numbers}
            effects_on(
                case.scene.model_copy(update={"effects": {name: tried}}),
                f"{case.source}: parameters",
            )
