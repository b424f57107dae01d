"""A slide in three dimensions and the question of its back-analysis.

In: a folder with `scene3d.yaml`, `measurements3d.yaml` and `inversion.yaml`. Out: a `GroundCase`,
which offers a `BackAnalysis` what an `InversionCase` does. Whatever is wrong with the question is
an `InputError` of one line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from geometry.scenes.scene import scene_from_mapping
from geometry.scenes3d.scene3d import FILE_NAME as SCENE_FILE
from geometry.scenes3d.scene3d import Scene3d, load_scene_3d
from geometry.survey.blow_counts import BlowCount
from geometry.survey3d.survey import Survey3d, load_survey
from inversion.back_analysis.case import Reading, fit_of
from inversion.back_analysis.deviations import property_changes, with_changes
from inversion.back_analysis.variants import Changed, sides, vary
from inversion.engines.measured_ground import MeasuredGround
from inversion.estimation.data import Targets, make_targets
from inversion.estimation.misfit import Objective
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import (
    FILE_NAME,
    CellSize,
    FixedProperty,
    Question,
    Sensitivity,
    Variant,
    WaterLevel,
    ZoneBoundary,
    load_question,
    material_key,
)
from pipeline.cli import InputError
from pipeline.config import Config, SimulationSettings

ENGINE = "mpm3d"
LEFT_OUT = "not available in three dimensions"


@dataclass(frozen=True)
class GroundCase:
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
    setup: MeasuredGround
    own_spacing_m: float
    use_constructed: bool

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.resolve().name

    @property
    def title(self) -> str:
        """The name of the scene in words."""
        return self.scene.name.replace("_", " ").title()

    @property
    def source(self) -> str:
        """File of the question, for messages."""
        return str(self.folder / FILE_NAME)

    @property
    def scene(self) -> Scene3d:
        """Before the slide, at the spacing in force."""
        return self.setup.scene

    @property
    def simulation(self) -> SimulationSettings:
        """Settings of the simulation, with the duration in force."""
        return self.setup.settings

    @property
    def parameters(self) -> Parameters:
        """The unknown parameters."""
        return self.setup.parameters

    @property
    def measurements(self) -> Survey3d:
        """All sets of measurements."""
        return self.survey

    @property
    def blow_counts(self) -> dict[str, BlowCount]:
        """None: they belong to a section."""
        return {}

    @property
    def waterfall(self) -> list[Reading]:
        """None: a waterfall leads from one section to another."""
        return []

    def objective(self, setup: MeasuredGround | None = None) -> Objective:
        """The objective to minimise, for the question or another reading of it."""
        settings, loss = self.config.inversion, self.question.loss
        chosen = self.setup if setup is None else setup
        tolerance = settings.tolerance_misfit if loss == "misfit" else settings.tolerance_m2
        return Objective(chosen.parameters, chosen.targets, loss, tolerance)

    def jittered(self, setup: MeasuredGround, seed: int) -> MeasuredGround:
        """The same setup with its points jittered by a seed."""
        return replace(setup, jitter=self.config.inversion.noise_jitter, seed=seed)

    # --- two spacings ---

    @cached_property
    def coarse_spacing_m(self) -> float | None:
        """Spacing of coarse runs [m]; None: every run is at the spacing in force.

        `inversion.coarse_points` are of a section; a body has as many along each of its edges.
        """
        settings = self.config.inversion
        spacing = settings.coarse_factor * self.own_spacing_m
        points = len(self.setup.problem.position) * (self.scene.spacing / spacing) ** 3
        if spacing <= self.scene.spacing or points < settings.coarse_points**1.5:
            return None
        return spacing if self.at_spacing(spacing, self.setup) is not None else None

    def coarsened(self, setup: MeasuredGround) -> MeasuredGround | None:
        """The same setup at the coarse spacing; None: there is no such spacing for it."""
        if self.coarse_spacing_m is None or setup.scene.spacing != self.scene.spacing:
            return None
        return self.at_spacing(self.coarse_spacing_m, setup)

    def at_spacing(self, spacing: float, setup: MeasuredGround) -> MeasuredGround | None:
        """The same setup at another spacing [m]; None: one of its zones would be too thin."""
        try:
            changed = replace(setup, scene=_at_spacing(setup.scene, spacing, self.source))
            _ = changed.problem
        except InputError:
            return None
        return changed

    # --- other readings ---

    def variant(self, variant: Variant) -> Changed:
        """The setup of a variant that changes no more than measurements and simulation."""
        targets = self.setup.targets
        if variant.measurements is not None or variant.fit is not None:
            name = variant.measurements or self.measurement_set
            fit = fit_of(self.question, self.survey, name) if variant.fit is None else variant.fit
            targets = self._targets(name, fit)
        return vary(self.setup, variant, targets, self.source)

    @cached_property
    def variants(self) -> tuple[list[Variant], list[str]]:
        """The variants that are available, and lines about the others."""
        lacking = ("zones", "pool_level_m", "water", "contact", "properties")
        kept, left_out = [], []
        for one in self.question.variants:
            asked = [name for name in lacking if getattr(one, name)]
            if asked:
                left_out.append(f"{one.name}: {', '.join(asked)}: {LEFT_OUT}")
            else:
                kept.append(one)
        return kept, left_out

    @cached_property
    def sensitivities(self) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
        """The sensitivities with their setups, and lines about those that are not available."""
        found, left_out = [], []
        for entry in self.question.sensitivities:
            if isinstance(entry, ZoneBoundary):
                left_out.append(f"{entry.name}: kind {entry.kind}: {LEFT_OUT}")
            else:
                found.append((entry, self._sides(entry)))
        return found, left_out

    def _sides(self, entry: Sensitivity) -> list[Changed]:
        where = f"{self.source}: sensitivities: {entry.name}"
        if isinstance(entry, FixedProperty):
            return [self._other_property(entry, sense, where) for sense in (1.0, -1.0)]
        if isinstance(entry, WaterLevel):
            return [self._other_level(entry, sense, where) for sense in (1.0, -1.0)]
        if isinstance(entry, CellSize):
            spacing = self.scene.spacing * entry.factor
            changed = self.at_spacing(spacing, self.setup)
            if changed is None:
                raise InputError(f"{where}: at {spacing:.3g} m a zone holds no point")
            return [Changed(changed, f"spacing {spacing:.3g} m")]
        return sides(self.setup, entry, self.source)

    def _other_property(self, entry: FixedProperty, sense: float, where: str) -> Changed:
        key = material_key(entry.property)
        for spec in self.parameters.specs:
            if material_key(spec.property) == key and set(spec.zones) & set(entry.zones):
                raise InputError(f"{where}: {entry.property} there is calibrated by {spec.name!r}")
        soil = self.scene.soil
        changes = property_changes(soil, entry.zones, key, sense * entry.std)
        scene = self.scene.with_soil(with_changes(soil, changes, where))
        words = f"{entry.property} {sense * entry.std:+g} in zones {', '.join(entry.zones)}"
        return Changed(replace(self.setup, scene=scene), words)

    def _other_level(self, entry: WaterLevel, sense: float, where: str) -> Changed:
        level = self.scene.soil.water_level
        if level is None or self.scene.section is not None:
            raise InputError(f"{where}: only of a terrain with a water_level")
        level += sense * entry.std_m
        soil = self.scene.soil.model_copy(update={"water_level": level})
        changed = replace(self.setup, scene=self.scene.with_soil(soil))
        return Changed(changed, f"pool at {level:g} m")

    def _targets(self, measurement_set: str, fit: Sequence[str] | None) -> Targets:
        return make_targets(
            self.survey.chosen(measurement_set),
            fit=fit,
            loss=self.question.loss,
            source=self.source,
            use_constructed=self.use_constructed,
        )


def ground_case(
    path: str | Path,
    config: Config,
    *,
    measurement_set: str | None = None,
    spacing_m: float | None = None,
    use_constructed: bool = False,
) -> GroundCase:
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
    scene = _at_spacing(drawn, spacing_m or own, source)
    survey = load_survey(folder, scene)
    chosen = measurement_set or survey.default_set
    fit = fit_of(question, survey, chosen)
    targets = make_targets(
        survey.chosen(chosen), fit=fit, loss=question.loss, source=source,
        use_constructed=use_constructed,
    )  # fmt: skip
    duration = question.duration_s or drawn.document.duration_s
    settings = config.simulation
    if duration is not None:
        settings = settings.model_copy(update={"duration_s": duration})
    setup = MeasuredGround(scene, settings, Parameters(question.parameters), targets)
    case = GroundCase(folder, config, survey, chosen, question, setup, own, use_constructed)
    _ = setup.problem, case.sensitivities
    for variant in case.variants[0]:  # a mistake should not show after an hour
        case.variant(variant)
    return case


def _at_spacing(scene: Scene3d, spacing: float, source: str) -> Scene3d:
    if spacing == scene.spacing:
        return scene
    if not (np.isfinite(spacing) and spacing > 0.0):
        raise InputError(f"{source}: a spacing of {spacing:g} m: must be greater than 0")
    section = scene.section
    if section is not None:
        document = {**section.model_dump(), "spacing": spacing}
        section = scene_from_mapping(document, f"{source} at {spacing:g} m spacing")
    return replace(scene, spacing=spacing, section=section)


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
