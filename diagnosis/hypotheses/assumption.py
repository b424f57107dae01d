"""An assumption of the model on trial: what it is called, and how the model reads otherwise.

Physical effects act in the solver (`diagnosis.hypotheses.physics`), errors of the survey on the
prediction (`diagnosis.hypotheses.survey`). All else that was assumed, the water, the soils that are
not calibrated, the section, the ground, is another setup of the same run. Each family of them is
one module with

    assumptions(setup, sensitivities) -> (list of Assumption, {name: why it is left out})

which `diagnosis.hypotheses.registry` lists.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from diagnosis.hypotheses.model import Candidate
from inversion.estimation.forward import Setup
from inversion.problem.question import Sensitivity
from pipeline.cli import InputError

AnySetup = TypeVar("AnySetup", bound=Setup)
Sensitivities = Sequence[Sensitivity]

#: A surface that was drawn through few borings, the base or the top of a layer: one standard
#: deviation of its level where nothing is known, as a share of the section's height, and at most
#: [m], since borings locate one that well however high the section. By judgement: with half of it
#: what a wrong drawing did is looked for in the strength, with twice of it a drawing explains
#: anything.
LEVEL_STD, WORST_KNOWN_M = 0.08, 2.0
#: Amplitudes of such surfaces that are tried, in standard deviations; the last is the largest that
#: is believed, as a 95 % interval has it.
RUNGS = (0.5, 1.0, 2.0)


@dataclass(frozen=True)
class Assumption(Generic[AnySetup]):
    """One assumption, of a section or of a body.

    Attributes:
        candidate: its name, words, bounds and ladder.
        change: the setup with an amplitude of it; an `InputError` where there is no such scene.
    """

    candidate: Candidate
    change: Callable[[AnySetup, float], AnySetup]


Found = tuple[list[Assumption], dict[str, str]]
"""Assumptions of a family, and why others can do nothing here."""


def with_setting(setup: AnySetup, **changes: object) -> AnySetup:
    """The setup with other settings of the simulation."""
    return replace(setup, settings=setup.settings.model_copy(update=changes))


def possible(assumption: Assumption, setup: Setup, amplitude: float) -> bool:
    """There is a section, or a body, with it."""
    try:
        assumption.change(setup, amplitude)
    except InputError:
        return False
    return True


def slug(text: str) -> str:
    """A name that can be a key."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
