"""The way from another reading to the question, change by change.

In: `waterfall` of `inversion.yaml`. Out: a `Reading` for each step, with one unknown; solved, the
bars of a `WaterfallAnswer`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from inversion.back_analysis.variants import apply_changes
from inversion.estimation.setup import Setup
from inversion.estimation.unknowns import Parameters
from inversion.problem.changes import Changes, StatedValue, on_top
from pipeline.cli import InputError
from pipeline.documents import StrictDocument

if TYPE_CHECKING:
    from inversion.back_analysis.case import InversionCase


class WaterfallBar(StrictDocument):
    """The parameter under one reading."""

    name: str = Field(description="what was changed, in words")
    words: str = Field(description="all that differs from the case as it is")
    case: str = Field(description="name of the folder with the section")
    spacing_m: float = Field(description="between material points, m")
    value: float = Field(description="with the linear step that would be next")
    predicted: dict[str, float] = Field(description="measured quantities by name")
    loss: float = Field(description="at `value`")
    reached: bool = Field(description="the loss is below the tolerance")
    at_bound: str | None = Field(description="the bound it rests on: low or high")


class WaterfallAnswer(StrictDocument):
    """How one parameter gets from another reading to the answer."""

    parameter: str = Field(description="name in the question")
    stated: StatedValue | None = Field(description="found by somebody else: the first bar")
    bars: list[WaterfallBar] = Field(description="in order, the answer's last")


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
    wanted = case.parameters.specs[names.index(name)]
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
        place = names.index(name) if here is case else places[0]
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
