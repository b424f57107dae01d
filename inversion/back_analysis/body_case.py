"""A body in three dimensions and the question of its back-analysis.

In: a folder with `scene3d.yaml`, `measurements3d.yaml` and `inversion.yaml`. Out: a `BodyCase`.
Whatever is wrong with the question is an `InputError` of one line.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from geometry.scenes3d.scene3d import FILE_NAME as SCENE_FILE
from geometry.scenes3d.scene3d import load_scene_3d
from geometry.survey3d.survey import Survey3d, load_survey
from inversion.back_analysis.asked import Asked, fit_of
from inversion.back_analysis.deviations import LEFT_OUT
from inversion.back_analysis.variants import OF_SECTIONS
from inversion.engines.body_setup import BodySetup, body_at_spacing
from inversion.estimation.data import make_targets
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import (
    FILE_NAME,
    Question,
    Sensitivity,
    UnknownDimension,
    Variant,
    ZoneBoundary,
    load_question,
)
from pipeline.cli import InputError
from pipeline.config import Config

ENGINE = "mpm3d"


@dataclass(frozen=True)
class BodyCase(Asked):
    """A three-dimensional scene, what was measured on it, and what is asked.

    Attributes:
        folder: of the case.
        config: settings in force.
        survey: all sets of measurements.
        measurement_set: name of the set in use.
        question: as in the file.
        setup: the question as the engine takes it.
        own_spacing_m: that the folder asks for.
        use_constructed: constructed data may enter the fit.
    """

    folder: Path
    config: Config
    survey: Survey3d
    measurement_set: str
    question: Question
    setup: BodySetup
    own_spacing_m: float
    use_constructed: bool

    dimensions = 3

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.resolve().name

    @property
    def title(self) -> str:
        """The name of the scene in words."""
        return self.setup.scene.name.replace("_", " ").title()

    @property
    def measurements(self) -> Survey3d:
        """All sets of measurements."""
        return self.survey

    @property
    def point_count(self) -> int:
        """See `Asked`."""
        return len(self.setup.problem.position)

    def lacks(self, entry: Variant | Sensitivity) -> str:
        """See `Asked`."""
        if isinstance(entry, ZoneBoundary | UnknownDimension):
            return f"kind {entry.kind}: {LEFT_OUT}"
        if isinstance(entry, Variant) and (
            changed := [name for name in OF_SECTIONS if getattr(entry, name)]
        ):
            return f"{', '.join(changed)}: {LEFT_OUT}"
        return ""


def body_case(
    path: str | Path,
    config: Config,
    *,
    measurement_set: str | None = None,
    spacing_m: float | None = None,
    use_constructed: bool = False,
) -> BodyCase:
    """A three-dimensional scene with the question of the `inversion.yaml` next to it.

    Args:
        path: `scene3d.yaml` or its folder.
        config: settings in force.
        measurement_set: name of a set; None: the default one.
        spacing_m: of material points; None: the question's, or the scene's.
        use_constructed: let constructed data enter the fit.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    folder = Path(path).parent if Path(path).is_file() else Path(path)
    drawn = load_scene_3d(folder / SCENE_FILE)
    question, source = load_question(folder, drawn.soil), str(folder / FILE_NAME)
    _check_question(question, source)
    own = (question.spacing_m or drawn.spacing) * config.inversion.spacing_factor
    scene = body_at_spacing(drawn, spacing_m or own, source)
    survey = load_survey(folder, scene)
    chosen = measurement_set or survey.default_set
    fit = fit_of(question, survey, chosen)
    targets = make_targets(
        survey.chosen(chosen),
        fit=fit,
        loss=question.loss,
        source=source,
        use_constructed=use_constructed,
    )
    duration = question.duration_s or drawn.document.duration_s
    settings = config.simulation
    if duration is not None:
        settings = settings.model_copy(update={"duration_s": duration})
    setup = BodySetup(scene, settings, Parameters(question.parameters), targets)
    case = BodyCase(folder, config, survey, chosen, question, setup, own, use_constructed)
    _ = setup.problem, case.sensitivities
    case.variants_of(lambda setup: "")  # a mistake should not show after an hour
    return case


def _check_question(question: Question, source: str) -> None:
    """Refuse what three dimensions do not have.

    Raises:
        InputError: the first of them.
    """
    if question.engine not in (None, ENGINE):
        raise InputError(
            f"{source}: engine: {question.engine}: not in three dimensions; only {ENGINE}"
        )
    for spec in question.parameters:
        if spec.property == "water_level":
            raise InputError(
                f"{source}: parameters: {spec.name}: property: water_level: {LEFT_OUT}"
            )
        if spec.prior is not None and spec.prior.relation is not None:
            raise InputError(
                f"{source}: parameters: {spec.name}: prior.relation: {LEFT_OUT}; give mean and std"
            )
