"""A body in three dimensions and the question of its diagnosis.

In: an `inversion.back_analysis.body_case.BodyCase` whose folder perhaps has a `diagnosis.yaml`;
perhaps a hypothesis. Out: a `BodyDiagnosis`. What the solver of bodies does not have is refused in
one line where it is named, and left out with a line where it is not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from diagnosis.case import Diagnosed, DiagnosisCase, check_freedom, targets_of
from diagnosis.hypotheses.body import assumptions
from diagnosis.hypotheses.body_model import BodyModel
from diagnosis.hypotheses.hypothesis_file import Hypothesis
from diagnosis.hypotheses.registry import assumed_otherwise
from diagnosis.hypotheses.survey import survey_errors
from diagnosis.question import FILE_NAME, DiagnosisQuestion, load_diagnosis_question
from geometry.scenes3d.scene3d import FILE_NAME as SCENE_FILE
from geometry.survey3d.survey import FILE_NAME as MEASUREMENTS_FILE
from inversion.back_analysis.body_case import BodyCase
from inversion.back_analysis.deviations import LEFT_OUT
from inversion.engines.body_setup import BodySetup
from inversion.engines.registry import MPM, Engine
from inversion.engines.run_store import Store
from inversion.problem.question import FILE_NAME as INVERSION_FILE
from inversion.problem.question import Question
from pipeline.cli import InputError
from pipeline.config import Config
from pipeline.files import content_hash

#: Keys of `diagnosis.yaml` that speak of effects or of sections.
OF_SECTIONS = ("parameters", "source", "validation_case")


@dataclass(frozen=True)
class BodyDiagnosis(Diagnosed):
    """A body and what is asked of its diagnosis; attributes as of `Diagnosed`."""

    body: BodyCase
    folder: Path
    config: Config
    inversion: Question
    question: DiagnosisQuestion
    setup: BodySetup
    validation_case: DiagnosisCase | None = None

    @property
    def name(self) -> str:
        """See `Diagnosed`."""
        return self.body.name

    @property
    def title(self) -> str:
        """See `Diagnosed`."""
        return self.body.title

    @cached_property
    def files(self) -> list[Path]:
        """See `Diagnosed`."""
        document = self.setup.scene.document
        names: list[object] = [SCENE_FILE, MEASUREMENTS_FILE, INVERSION_FILE, FILE_NAME]
        if document.section is not None:
            names.append(document.section.file)
        if (terrain := document.terrain) is not None:
            names += [terrain.surface, terrain.base, terrain.after]
            names += [end for zone in terrain.zones for end in (zone.bottom, zone.top)]
        names += [getattr(entry, "file", None) for entry in self.setup.targets.entries]
        found = [self.folder / name for name in dict.fromkeys(names) if isinstance(name, str)]
        return [path for path in found if path.is_file()]

    @property
    def scene_hash(self) -> str:
        """See `Diagnosed`."""
        scene = self.setup.scene
        return content_hash([scene.document, scene.section, scene.spacing])

    def model(self, store: Store, engine: Engine = MPM) -> BodyModel:
        """See `Diagnosed`."""
        return BodyModel(
            self.setup,
            store,
            engine=engine,
            sensitivities=self.inversion.sensitivities,
            priors=self.priors,
            numerics=self.numerics,
        )

    def again(self, spacing_m: float | None, hypothesis: Hypothesis | None) -> BodyDiagnosis:
        """See `Diagnosed`."""
        return body_diagnosis(self.body, spacing_m=spacing_m, hypothesis=hypothesis)


def body_diagnosis(
    body: BodyCase,
    *,
    spacing_m: float | None = None,
    hypothesis: Hypothesis | None = None,
    source: str = "",
) -> BodyDiagnosis:
    """A body with the question of its diagnosis.

    Args:
        body: with measurements and the question of its back-analysis.
        spacing_m: of material points; None: that of `diagnosis.yaml`, of `inversion.yaml` or of the
            scene, times `diagnosis.spacing_factor`.
        hypothesis: what replaces the base model: assumptions changed.
        source: its file, for messages.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    folder, config, setup = body.folder, body.config, body.setup
    question, asked = load_diagnosis_question(folder), str(folder / FILE_NAME)
    for key in OF_SECTIONS:
        if getattr(question, key):
            raise InputError(f"{asked}: {key}: {LEFT_OUT}")
    if config.diagnosis.finite_width:
        raise InputError(f"diagnosis.finite_width: {LEFT_OUT}; a body has its width")
    own = body.own_spacing_m / config.inversion.spacing_factor
    if question.spacing_m is not None:
        own = question.spacing_m
    setup = setup.at_spacing(spacing_m or own * config.diagnosis.spacing_factor, asked)
    if question.duration_s is not None:
        changes = {"duration_s": question.duration_s}
        setup = replace(setup, settings=setup.settings.model_copy(update=changes))
    measured = folder / MEASUREMENTS_FILE
    targets = targets_of(body.survey.chosen(), question, folder, measured)
    check_freedom(targets, setup.parameters, question, measured)
    setup = replace(setup, targets=targets)
    _check_names(setup, body.question, question, asked)
    if hypothesis is not None:
        where = source or "hypothesis"
        if hypothesis.scene_changes:
            raise InputError(f"{where}: scene_changes: {LEFT_OUT}")
        for name, one in hypothesis.effects.items():
            if one.parameters:
                raise InputError(f"{where}: effects: {name}: parameters: {LEFT_OUT}")
        amplitudes = {name: one.amplitude for name, one in hypothesis.effects.items()}
        setup = assumed_otherwise(setup, body.question.sensitivities, amplitudes, where)
    return BodyDiagnosis(body, folder, config, body.question, question, setup)


def _check_names(
    setup: BodySetup, inversion: Question, question: DiagnosisQuestion, source: str
) -> None:
    """Refuse hypotheses that a body does not have, in one line."""
    named = [(key, name) for key, names in question.named_effects.items() for name in names]
    if not named:
        return
    known = {one.candidate.name for one in assumptions(setup, inversion.sensitivities)[0]}
    known |= {error.candidate.name for error in survey_errors(setup.targets)}
    for key, name in named:
        if name not in known:
            raise InputError(
                f"{source}: {key}: no effect {name!r} in three dimensions; there are "
                f"{', '.join(sorted(known))}"
            )
