"""A case and the question of its back-analysis: `inversion.yaml` made into a problem.

In: a `geometry.case.Case`. Out: an `InversionCase`, with a `Reading` for each step of a waterfall:
the way from another reading to the question. Whatever is wrong with the question is an `InputError`
of one line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from geometry.case import Case, load_case
from geometry.scenes.fill import fill
from geometry.scenes.scene import scene_from_mapping
from geometry.survey.measurements import Measurements
from inversion.back_analysis.variants import Changed, apply_changes, sides, vary
from inversion.engines.registry import engine_named
from inversion.estimation.data import Targets, make_targets
from inversion.estimation.forward import Setup
from inversion.estimation.misfit import Objective
from inversion.estimation.unknowns import Parameters
from inversion.problem.changes import Changes, on_top
from inversion.problem.layers import with_relation_priors
from inversion.problem.question import FILE_NAME, Question, Sensitivity, Variant, load_question
from pipeline.cli import InputError

if TYPE_CHECKING:
    from geometry.survey3d.survey import Survey3d


@dataclass(frozen=True)
class InversionCase(Case):
    """A case and the question asked of it.

    Attributes:
        question: as in the file.
        setup: the question as the engine takes it.
        use_constructed: constructed data may enter the fit.
    """

    question: Question
    setup: Setup
    use_constructed: bool

    @property
    def source(self) -> str:
        """File of the question, for messages."""
        return str(self.folder / FILE_NAME)

    @property
    def parameters(self) -> Parameters:
        """The unknown parameters."""
        return self.setup.parameters

    def objective(self, setup: Setup | None = None) -> Objective:
        """The objective to minimise, for the question or another reading of it."""
        settings, loss = self.config.inversion, self.question.loss
        chosen = self.setup if setup is None else setup
        targets = chosen.targets
        if limit := targets.limits_alone:
            loss = "runout"  # the limit is to be met, however well the movement is known
        tolerance = settings.tolerance_misfit if loss == "misfit" else settings.tolerance_m2
        return Objective(chosen.parameters, targets, loss, tolerance, limit=limit)

    def variant(self, variant: Variant) -> Changed:
        """The setup of a variant."""
        targets = self.setup.targets
        if variant.measurements is not None or variant.fit is not None:
            name = variant.measurements or self.measurement_set
            fit = variant.fit
            if fit is None:
                fit = fit_of(self.question, self.measurements, name)
            targets = self._targets(name, fit)
        return vary(self.setup, variant, targets, self.source)

    def sides(self, sensitivity: Sensitivity) -> list[Changed]:
        """The setups of a sensitivity."""
        return sides(self.setup, sensitivity, self.source)

    @cached_property
    def sensitivities(self) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
        """The sensitivities with their setups, and lines about those that are not available.

        At a coarser spacing than the case asks for, a change may leave a zone thinner than a
        spacing; that is not a mistake in the question, so the sensitivity is left out and reported.
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

    def sensitivities_of(
        self, refused: Callable[[Setup], str]
    ) -> tuple[list[tuple[Sensitivity, list[Changed]]], list[str]]:
        """The sensitivities without those that are refused, and lines about what is left out.

        Args:
            refused: why a setup cannot be simulated; empty: it can.
        """
        entries, left_out = self.sensitivities
        kept, reasons = [], list(left_out)
        for entry, changed in entries:
            reason = next(filter(None, (refused(side.setup) for side in changed)), "")
            if reason:
                reasons.append(f"{entry.name}: left out: {reason}")
            else:
                kept.append((entry, changed))
        return kept, reasons

    @cached_property
    def coarse_spacing_m(self) -> float | None:
        """Spacing of coarse runs [m]; None: every run is at the spacing in force.

        So it is where the settings ask for no coarser spacing, where the section would have few
        points at it, or a zone that is too thin.
        """
        settings = self.config.inversion
        spacing = settings.coarse_factor * self.own_spacing_m
        points = len(fill(self.scene)) * (self.scene.spacing / spacing) ** 2
        if spacing <= self.scene.spacing or points < settings.coarse_points:
            return None
        return spacing if self.at_spacing(spacing, self.setup) is not None else None

    def coarsened(self, setup: Setup) -> Setup | None:
        """The same setup at the coarse spacing.

        None: there is no such spacing, the setup asks for a spacing of its own, or one of its zones
        would be too thin.
        """
        if self.coarse_spacing_m is None or setup.scene.spacing != self.scene.spacing:
            return None
        return self.at_spacing(self.coarse_spacing_m, setup)

    def at_spacing(self, spacing: float, setup: Setup) -> Setup | None:
        """The same setup at another spacing [m]; None: one of its zones would be too thin."""
        document = {**setup.scene.model_dump(), "spacing": spacing}
        try:
            return replace(setup, scene=scene_from_mapping(document, self.source))
        except InputError:
            return None

    @cached_property
    def waterfall(self) -> list[Reading]:
        """The readings on the way to the question, in order; empty: none asked for."""
        known: dict[str, InversionCase] = {}

        def load(name: str) -> InversionCase:
            if name not in known:
                place = self.folder / name
                case = load_case(place if place.is_dir() else name, self.config)
                known[name] = inversion_case(case, spacing_m=self.scene.spacing, checked=False)
            return known[name]

        return readings(self, load)

    def fitted_to(self, names: Sequence[str]) -> Targets:
        """The measurements in use, with others fitted, by name."""
        return self._targets(self.measurement_set, names)

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


def inversion_case(
    case: Case,
    *,
    measurement_set: str | None = None,
    spacing_m: float | None = None,
    use_constructed: bool = False,
    checked: bool = True,
) -> InversionCase:
    """A case with the question of its `inversion.yaml`.

    Args:
        case: with measurements.
        measurement_set: name of a set; None: the one in use.
        spacing_m: of material points; None: the question's, or the scene's, times
            `inversion.spacing_factor`.
        use_constructed: let constructed data enter the fit.
        checked: build every other reading, too: a mistake should not show after an hour.

    Raises:
        InputError: one line with file, field, value and what is allowed.
    """
    measurements = case.measurements
    question = load_question(case.folder, case.drawn)
    if question.engine is not None:
        engine_named(question.engine, str(case.folder / FILE_NAME))
    factor = case.config.inversion.spacing_factor
    case = case.resolved(question, spacing_factor=factor, spacing_m=spacing_m)
    case = case.with_set(measurement_set)
    question = with_relation_priors(question, case, str(case.folder / FILE_NAME))
    targets = make_targets(
        case.measured,
        fit=fit_of(question, measurements, case.measurement_set),
        loss=question.loss,
        source=str(case.folder / FILE_NAME),
        use_constructed=use_constructed,
    )
    setup = Setup(case.scene, case.simulation, Parameters(question.parameters), targets, case.feet)
    asked = case.extended(
        InversionCase, question=question, setup=setup, use_constructed=use_constructed
    )
    if checked:
        for variant in question.variants:
            asked.variant(variant)
        _ = asked.sensitivities, asked.waterfall
    return asked


def fit_of(
    question: Question, measurements: Measurements | Survey3d, chosen: str
) -> list[str] | None:
    """`fit` speaks of the default set; another set is fitted by the same names if it has any."""
    if question.fit is None or chosen == measurements.default_set:
        return question.fit
    there = {entry.name for entry in measurements.chosen(chosen)}
    kept = [name for name in question.fit if name in there]
    return kept or None


@dataclass(frozen=True)
class Reading:
    """One step.

    Attributes:
        name: of the step.
        words: all that differs from the case as it is.
        case: with the section.
        setup: with all unknowns of that case.
        place: of the one that is solved for; the others keep the values they are given.
    """

    name: str
    words: str
    case: InversionCase
    setup: Setup
    place: int

    def alone(self, values: np.ndarray) -> Setup:
        """The setup with one unknown left, the others put in with their values (p,)."""
        specs = self.setup.parameters.specs
        others = [place for place in range(len(specs)) if place != self.place]
        fixed = Parameters([specs[place] for place in others])
        scene = fixed.scene(self.setup.scene, np.asarray(values)[others])
        return replace(self.setup, scene=scene, parameters=Parameters([specs[self.place]]))


def of_waterfall(case: InversionCase) -> int:
    """Place, among the unknowns of a case with a waterfall, of the one that its bars are of."""
    wanted = case.question.waterfall.parameter
    return 0 if wanted is None else case.parameters.names.index(wanted)


def readings(case: InversionCase, load: Callable[[str], InversionCase]) -> list[Reading]:
    """The steps of a case's waterfall, at the coarse spacing where there is one; empty: none asked.

    Args:
        case: with the question.
        load: the case with the section that a step names.

    Raises:
        InputError: a step that cannot be made, or whose case has no such unknown or measurement.
    """
    asked = case.question.waterfall
    if asked is None:
        return []
    names = case.parameters.names
    name = names[0] if asked.parameter is None else asked.parameter
    if name not in names:
        raise InputError(f"{case.source}: waterfall: no parameter {name!r} in the question")
    own = of_waterfall(case)
    wanted = case.parameters.specs[own]
    found, here, changes = [], case, Changes()
    for step in asked.steps:
        where = f"{case.source}: waterfall: {step.name}"
        if step.case is not None:
            here = case if step.case == "." else load(step.case)
        changes = on_top(changes, step)
        specs = here.parameters.specs
        places = [number for number, spec in enumerate(specs) if spec.property == wanted.property]
        if not places:
            raise InputError(f"{where}: {here.name} has no unknown {wanted.property}")
        changed = apply_changes(here.setup, changes, where)
        place = own if here is case else places[0]
        setup = _same_targets(case, here, changed.setup, where)
        found.append(Reading(step.name, changed.words, here, setup, place))
    return found


def _same_targets(case: InversionCase, here: InversionCase, setup: Setup, where: str) -> Setup:
    """The setup fitted to what the question fits, at the coarse spacing where there is one."""
    spacing = case.coarse_spacing_m or case.scene.spacing
    coarse = here.at_spacing(spacing, setup)
    if coarse is None:
        raise InputError(f"{where}: the section is not available at {spacing:g} m spacing")
    if here is case:
        return coarse
    own = case.setup.targets
    fitted = own.named(own.measured, own.fitted)
    try:
        targets = here.fitted_to(list(fitted)).with_values(fitted)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return replace(coarse, targets=targets)
