"""A case and the question of its back-analysis: `inversion.yaml` made into a problem.

In: a `geometry.case.Case`. Out: an `InversionCase`, with a `WaterfallReading` for each step of a
waterfall: the way from another reading to the question. Whatever is wrong with the question is an
`InputError` of one line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from geometry.case import SCENE_FILE, Case, load_case
from geometry.dimensions.family import SectionFamily
from geometry.dimensions.stated import FILE_NAME as DIMENSIONS_FILE
from geometry.dimensions.stated import load_dimensions
from geometry.scenes.fill import point_count
from inversion.back_analysis.asked import Asked, fit_of
from inversion.back_analysis.variants import apply_changes
from inversion.engines.registry import engine_named
from inversion.estimation.data import make_targets
from inversion.estimation.forward import SectionSetup
from inversion.estimation.unknowns import Parameters
from inversion.problem.changes import Changes, on_top
from inversion.problem.layers import with_relation_priors
from inversion.problem.question import FILE_NAME, Question, UnknownDimension, load_question
from pipeline.cli import InputError


@dataclass(frozen=True)
class InversionCase(Case, Asked):
    """A case and the question asked of it.

    Attributes:
        question: as in the file.
        setup: the question as the engine takes it.
        use_constructed: constructed data may enter the fit.
    """

    question: Question
    setup: SectionSetup
    use_constructed: bool

    dimensions = 2

    @property
    def point_count(self) -> int:
        """See `Asked`."""
        return point_count(self.scene)

    @cached_property
    def waterfall(self) -> list[WaterfallReading]:
        """The readings on the way to the question, in order; empty: none asked for."""
        known: dict[str, InversionCase] = {}

        def load(name: str) -> InversionCase:
            if name not in known:
                place = self.folder / name
                case = load_case(place if place.is_dir() else name, self.config)
                known[name] = inversion_case(case, spacing_m=self.scene.spacing, checked=False)
            return known[name]

        return readings(self, load)


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
    setup = SectionSetup(
        case.scene,
        case.simulation,
        Parameters(question.parameters),
        targets,
        case.feet,
        family=_family(case, question),
    )
    asked = case.extended(
        InversionCase, question=question, setup=setup, use_constructed=use_constructed
    )
    if checked:
        for variant in question.variants:
            asked.variant(variant)
        _ = asked.sensitivities, asked.waterfall
    return asked


def _family(case: Case, question: Question) -> SectionFamily | None:
    """The family of the section where some of its dimensions are unknown; None: it was drawn.

    Raises:
        InputError: a dimension that the family does not have, or a `scene.yaml` that is not its
            median section; one line.
    """
    unknown = [one for one in question.sensitivities if isinstance(one, UnknownDimension)]
    if not unknown:
        return None
    family = SectionFamily(load_dimensions(case.folder))
    where = f"{case.folder / FILE_NAME}: sensitivities"
    for one in unknown:
        if one.dimension not in family.keys:
            raise InputError(
                f"{where}: {one.name}: dimension: no {one.dimension!r}; {DIMENSIONS_FILE} has "
                f"{', '.join(family.keys)}"
            )
    if not family.has_median(case.drawn):
        raise InputError(
            f"{case.folder / SCENE_FILE}: is not the median section of {DIMENSIONS_FILE}; make the "
            "case again with flowslide new --dimensions, or take the sensitivities of kind "
            "dimension out"
        )
    return family


@dataclass(frozen=True)
class WaterfallReading:
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
    setup: SectionSetup
    place: int

    def alone(self, values: np.ndarray) -> SectionSetup:
        """The setup with one unknown left, the others put in with their values (p,)."""
        specs = self.setup.parameters.specs
        others = [place for place in range(len(specs)) if place != self.place]
        fixed = Parameters([specs[place] for place in others])
        scene = fixed.scene(self.setup.scene, np.asarray(values)[others])
        return replace(self.setup, scene=scene, parameters=Parameters([specs[self.place]]))


def of_waterfall(case: InversionCase) -> int:
    """Place, among the unknowns of a case with a waterfall, of the one that its bars are of."""
    asked = case.question.waterfall
    wanted = None if asked is None else asked.parameter
    return 0 if wanted is None else case.parameters.names.index(wanted)


def readings(case: InversionCase, load: Callable[[str], InversionCase]) -> list[WaterfallReading]:
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
        found.append(WaterfallReading(step.name, changed.words, here, setup, place))
    return found


def _same_targets(
    case: InversionCase, here: InversionCase, setup: SectionSetup, where: str
) -> SectionSetup:
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
