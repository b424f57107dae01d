"""The families of assumptions that a diagnosis puts on trial, in the order in which they act.

A family is a module with `assumptions(setup, sensitivities)` (`diagnosis.hypotheses.assumption`)
and a line in `FAMILIES`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import ModuleType

from diagnosis.hypotheses import body, ground, section, soil, start, strength, water, width
from diagnosis.hypotheses.assumption import AnySetup, Assumption, Found, Sensitivities
from diagnosis.hypotheses.model import Candidate
from diagnosis.hypotheses.survey import survey_errors
from geometry.scenes.scene import Scene
from inversion.engines.body_setup import BodySetup
from inversion.engines.registry import Engine
from inversion.estimation.forward import SectionSetup, Setup
from mpm_taichi.effects import effects
from pipeline.cli import InputError


@dataclass(frozen=True)
class FamilyModule:
    """A family of assumptions.

    Attributes:
        module: that has them.
        solver: an engine that simulates water, soil and effects says what they do; another one
            only of those that it sees.
        dear: its runs cost so much that it is on trial only where that is asked for.
    """

    module: ModuleType
    solver: bool = True
    dear: bool = False


FAMILIES = (
    FamilyModule(section, solver=False),
    FamilyModule(ground),
    FamilyModule(water),
    FamilyModule(soil),
    FamilyModule(strength),
    FamilyModule(start),
    FamilyModule(width, dear=True),
)


def assumptions_of(
    setup: SectionSetup, sensitivities: Sensitivities, engine: Engine, *, dear: bool = False
) -> Found:
    """All assumptions that can be otherwise, and why others cannot; `dear` ones if asked for."""
    found: list[Assumption] = []
    left_out: dict[str, str] = {}
    for family in FAMILIES:
        if family.dear and not dear:
            continue
        own, idle = family.module.assumptions(setup, sensitivities)
        if family.solver:
            unseen = {one.candidate.name: unseen_by(engine, one, setup) for one in own}
            idle |= {name: why for name, why in unseen.items() if why}
            own = [one for one in own if not unseen[one.candidate.name]]
        found += own
        left_out |= idle
    return found, left_out


def unseen_by(engine: Engine, assumption: Assumption, setup: SectionSetup) -> str:
    """Why an engine cannot say what an assumption does; empty: it can."""
    if engine.effects:
        return ""
    if engine.unseen is None:
        return f"{engine.description} knows no other"
    try:
        changed = assumption.change(setup, assumption.candidate.ladder[-1])
    except InputError as error:
        return str(error)
    return engine.unseen(setup, changed)


def neighbours_of(scene: Scene, name: str) -> list[str]:
    """The same thing at places nearby; none where it has no place."""
    return strength.neighbours(scene, name) or ground.neighbours(scene, name)


def placed_at(scene: Scene, name: str) -> Assumption | None:
    """The thing that a name with a place in it gives; None: it is no such name."""
    return strength.part_at(name) or ground.bump_at(scene, name)


def assumed_otherwise(
    setup: AnySetup, sensitivities: Sensitivities, amplitudes: Mapping[str, float], source: str
) -> AnySetup:
    """The setup of a hypothesis that doubts assumptions; effects of the solver are in its scene.

    Raises:
        InputError: beginning with `source`: there is no such assumption, none of that size, one
            that another one replaces, or no such section.
    """
    if isinstance(setup, BodySetup):
        own, solver, where = [body.assumptions(setup, sensitivities)[0]], [], " in three dimensions"
    else:
        own = [family.module.assumptions(setup, sensitivities)[0] for family in FAMILIES]
        solver, where = [*effects()], ""
    known = {one.candidate.name: one for found in own for one in found}
    if isinstance(setup, SectionSetup):
        scene = setup.scene
        known |= {name: one for name in amplitudes if (one := placed_at(scene, name)) is not None}
    errors = {error.candidate.name: error for error in survey_errors(setup.targets)}
    for name in amplitudes:
        if name not in {*known, *errors, *solver}:
            raise InputError(
                f"{source}: effects: no effect {name!r}{where}; there are "
                f"{', '.join([*solver, *known, *errors])}"
            )
    # A switch is off at 0.
    acting = [
        one
        for name, one in known.items()
        if name in amplitudes and _checked(one.candidate, amplitudes[name], source)
    ]
    try:
        before, setup = setup, _changed(setup, acting, amplitudes)
    except InputError as refused:
        raise InputError(f"{source}: effects: {refused}") from None
    for one in acting if len(acting) > 1 else ():
        others = [other for other in acting if other is not one]
        try:
            without = _changed(before, others, amplitudes)
        except InputError:  # they need it
            continue
        if _reading(without) == _reading(setup):
            raise InputError(
                f"{source}: effects: {one.candidate.name}: does nothing beside "
                f"{', '.join(other.candidate.name for other in others)}: of two that set the same "
                "thing give one"
            )
    for name, error in errors.items():
        if name in amplitudes:  # what is measured too high is predicted as it was measured
            targets = setup.targets
            size = _checked(error.candidate, amplitudes[name], source)
            measured = targets.measured - size * error.direction
            setup = replace(setup, targets=replace(targets, measured=measured))
    return setup


def _changed(
    setup: AnySetup, acting: Iterable[Assumption], amplitudes: Mapping[str, float]
) -> AnySetup:
    for one in acting:
        setup = one.change(setup, amplitudes[one.candidate.name])
    return setup


def _reading(setup: Setup) -> tuple[object, ...]:
    """What a run of a setup follows from, its measurements left out."""
    scene = setup.scene
    slides = (scene,) if isinstance(scene, Scene) else (scene.document, scene.section)
    own = (getattr(setup, name, None) for name in ("height_over_width", "factors"))
    return (*slides, setup.settings, *own)


def _checked(candidate: Candidate, size: float, source: str) -> float:
    """A size that a fit could find; what it has found at a bound may have been rounded."""
    low, high = candidate.low, candidate.high
    slack = 1e-3 * (high - low)
    if candidate.switch and size not in (0.0, 1.0):
        raise InputError(f"{source}: effects: {candidate.name}: {size:g}: 0 (off) or 1 (on)")
    if not low - slack <= size <= high + slack:
        unit = f" {candidate.unit}" if candidate.unit else ""
        raise InputError(
            f"{source}: effects: {candidate.name}: {size:g}{unit}: from {low:g} to {high:g}{unit} "
            "is allowed"
        )
    return size
