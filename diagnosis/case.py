"""A case and the question of its diagnosis: what the statistics are given.

In: a `geometry.case.Case` with `measurements.yaml`, `inversion.yaml` and perhaps `diagnosis.yaml`;
perhaps a hypothesis. Out: a `DiagnosisCase`. Whatever is wrong with the questions is an
`InputError` of one line, before the first simulation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from diagnosis.hypotheses.engine_model import EngineModel, Numerics, RunModel
from diagnosis.hypotheses.hypothesis_file import Hypothesis
from diagnosis.hypotheses.registry import assumed_otherwise
from diagnosis.options import Options, seed_of
from diagnosis.question import FILE_NAME, DiagnosisQuestion, load_diagnosis_question
from geometry.case import SCENE_FILE, Case, load_case
from geometry.scenes.scene import scene_hash
from geometry.survey.blow_counts import FILE_NAME as BLOW_COUNTS_FILE
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import check_places
from geometry.survey.quantity import Quantity
from inversion.engines.registry import MPM, Engine
from inversion.engines.run_store import RunStore, Store
from inversion.estimation.data import Role, Targets, make_targets
from inversion.estimation.forward import SectionSetup, Setup
from inversion.estimation.hold_out import split
from inversion.estimation.unknowns import Parameters
from inversion.problem.layers import with_relation_priors
from inversion.problem.question import FILE_NAME as INVERSION_FILE
from inversion.problem.question import Question, check_zones, load_question
from mpm_taichi.effects import effect, effects, effects_on
from pipeline.cli import InputError
from pipeline.config import Config

#: Forward runs at the fits themselves, for the pictures: of the base model and of the answer.
FOR_PICTURES = 2


class Diagnosed(ABC):
    """A case, a section or a body, and what is asked of its diagnosis.

    Attributes:
        folder: of the case.
        config: settings in force.
        inversion: the calibrated parameters, as in `inversion.yaml`.
        question: as in `diagnosis.yaml`.
        setup: what slides, settings, parameters and measurements of the base model.
        validation_case: the case that judges the answer; None where `diagnosis.yaml` names none.
    """

    folder: Path
    config: Config
    inversion: Question
    question: DiagnosisQuestion
    setup: Setup
    validation_case: DiagnosisCase | None

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the folder."""

    @property
    @abstractmethod
    def title(self) -> str:
        """The name in words."""

    @property
    @abstractmethod
    def files(self) -> list[Path]:
        """Files the diagnosis was made from."""

    @property
    @abstractmethod
    def scene_hash(self) -> str:
        """Of what slides, at the spacing in force."""

    @abstractmethod
    def model(self, store: Store, engine: Engine = MPM) -> RunModel:
        """A forward engine as the model of this case.

        Raises:
            InputError: the question names an effect that does not exist.
        """

    @abstractmethod
    def again(self, spacing_m: float | None, hypothesis: Hypothesis | None) -> Diagnosed:
        """The same case with another hypothesis, None: its base model; spacing as first asked."""

    @property
    def source(self) -> str:
        """File of the question, for messages."""
        return str(self.folder / FILE_NAME)

    @property
    def priors(self) -> dict[str, tuple[float, float]]:
        """Effect -> mean and standard deviation of its amplitude."""
        return {name: (prior.mean, prior.std) for name, prior in self.question.priors.items()}

    @property
    def numerics(self) -> Numerics:
        """How the model's own error is measured."""
        settings = self.config.diagnosis
        return Numerics(settings.noise_jitter, settings.second_transfer, settings.finer)

    def options(self, model: RunModel) -> Options:
        """What the statistics know of the effects that can act here."""
        settings, question = self.config.diagnosis, self.question
        acting = {candidate.name for candidate in model.candidates}
        wanted = None
        if question.effects is not None:
            wanted = tuple(name for name in question.effects if name in acting)
        return Options(
            seed=seed_of(self.name),
            synthetic=question.synthetic,
            source=question.source_errors,
            source_strength=question.source_strength,
            source_effects=question.source_effects,
            hold_out=question.held_out,
            forbidden=tuple(name for name in question.forbid if name in acting),
            effects=wanted,
            priors={name: prior for name, prior in self.priors.items() if name in acting},
            allowance=settings.max_runs - FOR_PICTURES,
            replicates=question.replicates or settings.replicates,
            second_scheme=question.second_scheme,
            finer_share=_either(question.finer_share, settings.finer_share),
            finer_share_std=_either(question.finer_share_std, settings.finer_share_std),
            finer_runs=settings.finer_runs,
            draws=settings.draws,
            starts=settings.starts,
            rounds=settings.rounds,
            refitted=settings.refitted,
        )

    def left_out(self, model: RunModel) -> dict[str, str]:
        """Effects that are not tested, and why: they cannot act here, or an engineer knows better.

        Those that are merely not asked for are not among them.
        """
        ruled_out = {
            name: "ruled out by the engineer" + (f": {why}" if why else "")
            for name, why in self.question.forbid.items()
        }
        return {
            **{name: f"can do nothing here: {why}" for name, why in model.left_out.items()},
            **ruled_out,
        }


@dataclass(frozen=True)
class DiagnosisCase(Case, Diagnosed):
    """A section and what is asked of its diagnosis; attributes as of `Diagnosed`."""

    inversion: Question
    question: DiagnosisQuestion
    setup: SectionSetup
    validation_case: DiagnosisCase | None = None

    def model(self, store: Store, engine: Engine = MPM) -> EngineModel:
        """See `Diagnosed`."""
        assert isinstance(store, RunStore)
        model = EngineModel(
            self.setup,
            store,
            engine=engine,
            sensitivities=self.inversion.sensitivities,
            numbers=self.question.parameters,
            priors=self.priors,
            numerics=self.numerics,
            finite_width=self.config.diagnosis.finite_width,
        )
        known = [*(c.name for c in model.candidates), *model.left_out]
        for key, names in self.question.named_effects.items():
            for name in names:
                if name not in known and model.add_placed(name) is None:
                    raise InputError(
                        f"{self.source}: {key}: no effect {name!r}; there are "
                        f"{', '.join(sorted(known))}"
                    )
        return model

    @cached_property
    def files(self) -> list[Path]:
        """See `Diagnosed`."""
        names = (SCENE_FILE, MEASUREMENTS_FILE, BLOW_COUNTS_FILE, INVERSION_FILE, FILE_NAME)
        found = [self.folder / name for name in names]
        found += [self.folder / file for e in self.setup.targets.entries for file in e.files]
        return [path for path in dict.fromkeys(found) if path.is_file()]

    @property
    def scene_hash(self) -> str:
        """See `Diagnosed`."""
        return scene_hash(self.scene)

    def again(self, spacing_m: float | None, hypothesis: Hypothesis | None) -> DiagnosisCase:
        """See `Diagnosed`."""
        return diagnosis_case(self, spacing_m=spacing_m, hypothesis=hypothesis)


def diagnosis_case(
    case: Case,
    *,
    spacing_m: float | None = None,
    hypothesis: Hypothesis | None = None,
    hypothesis_source: str = "",
    with_validation: bool = True,
) -> DiagnosisCase:
    """A case with the question of its diagnosis.

    Args:
        case: with measurements.
        spacing_m: of material points; None: that of `diagnosis.yaml`, of `inversion.yaml` or of the
            scene, times `diagnosis.spacing_factor`.
        hypothesis: what replaces the base model: the scene changed, effects switched on.
        hypothesis_source: its file, for messages.
        with_validation: read the validation case as well.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    folder, measurements = case.folder, case.measurements
    inversion = load_question(folder, case.drawn)
    question = load_diagnosis_question(folder)
    factor = case.config.diagnosis.spacing_factor
    case = case.resolved(question, inversion, spacing_factor=factor, spacing_m=spacing_m)
    source = str(folder / SCENE_FILE)
    if hypothesis is not None:
        source = hypothesis_source or "hypothesis"
        scene = hypothesis.scene(case.scene, source)
        case = replace(case, scene=scene)
        # The changed section must also have everything that is measured or calibrated.
        at_least = scene.model_copy(update={"spacing": max(case.drawn.spacing, scene.spacing)})
        check_places(measurements, at_least, f"{source}: {folder / MEASUREMENTS_FILE}")
        check_zones(inversion, scene, f"{source}: {folder / INVERSION_FILE}")
    inversion = with_relation_priors(inversion, case, str(folder / INVERSION_FILE))
    effects_on(case.scene, source)
    targets = targets_of(measurements.chosen(), question, folder, folder / MEASUREMENTS_FILE)
    parameters = Parameters(inversion.parameters)
    check_freedom(targets, parameters, question, folder / MEASUREMENTS_FILE)
    setup = SectionSetup(case.scene, case.simulation, parameters, targets, case.feet)
    if hypothesis is not None:
        amplitudes = {name: one.amplitude for name, one in hypothesis.effects.items()}
        setup = assumed_otherwise(setup, inversion.sensitivities, amplitudes, source)
        case = replace(case, scene=setup.scene)
    asked = case.extended(
        DiagnosisCase,
        inversion=inversion,
        question=question,
        setup=setup,
        validation_case=_validation_case(question, case) if with_validation else None,
    )
    _check_numbers(asked)
    return asked


def _either(asked: float | None, configured: float) -> float:
    return configured if asked is None else asked


def _validation_case(question: DiagnosisQuestion, case: Case) -> DiagnosisCase | None:
    """The case that `validation_case` names: it is simulated last, and refused first."""
    if question.validation_case is None:
        return None
    place = case.folder / question.validation_case  # an absolute path stays as it is
    where = f"{case.folder / FILE_NAME}: validation_case"
    if place.resolve() == case.folder.resolve():
        raise InputError(f"{where}: {question.validation_case}: is this case; name another one")
    try:
        other = diagnosis_case(load_case(place, case.config), with_validation=False)
        other.model(RunStore(None))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return other


def targets_of(
    entries: Sequence[Quantity], question: DiagnosisQuestion, folder: Path, measured: Path
) -> Targets:
    """Measurements of a folder, from its file `measured`; constructed ones are not used."""
    source = str(folder / FILE_NAME)
    if question.held_out is not None:
        entries = [entry.without_hold_out() for entry in entries]
    targets = make_targets(entries, fit=None, loss="misfit", source=str(measured))
    try:
        fitted = split(targets, question.held_out).fitted
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    if not targets.censored[fitted].all():
        return targets
    # Which of all strengths above the limit it was, nobody knows: nothing can be held against one.
    roles: list[Role] = [
        "compared" if role in ("fitted", "held out") and not used else role
        for role, used in zip(targets.roles, fitted, strict=True)
    ]
    return replace(targets, roles=roles)


def check_freedom(
    targets: Targets, parameters: Parameters, question: DiagnosisQuestion, measured: Path
) -> None:
    """Something must be left to test the model by once the parameters are fitted."""
    found = split(targets, question.held_out)
    known = sum(spec.prior is not None for spec in parameters.specs)
    numbers, unknowns = int(found.fitted.sum()), len(parameters.specs)
    if numbers + known < unknowns and not found.held_out.any() and not targets.censored.any():
        raise InputError(
            f"{measured}: measured numbers: {numbers}, unknowns: {unknowns}; "
            "nothing is left to test the model by: add a measurement"
        )


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
