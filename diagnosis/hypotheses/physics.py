"""Physical effects of the library, or of a user, as candidates: they act in the solver."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from diagnosis.hypotheses.model import FAMILIES, HALF_A_DECADE, Candidate, Family
from geometry.scenes.scene import Scene
from mpm_taichi.effects import BY_THE_CLOCK, PORE_WATER, Active, Effect, effects, effects_on
from pipeline.cli import InputError

#: Share of the duration of a run within which an effect must have ended: the slide has to rest,
#: for which, by judgement, a fifth of it is left.
LATEST = 0.8


def acting_candidates(
    scene: Scene,
    numbers: Mapping[str, Mapping[str, float]] | None = None,
    *,
    duration: float = math.inf,
) -> tuple[list[Candidate], dict[str, str]]:
    """Effects that can act on a section, and why the others cannot.

    Args:
        scene: the section.
        numbers: effect -> further numbers of it that are known.
        duration: of a run [s].
    """
    found, left_out = [], {}
    on = {one.effect.name for one in effects_on(scene)}
    for name, effect in effects().items():
        reason = effect.applies(scene)
        if name in on:
            reason = "the base model has it already"
            if name == PORE_WATER:
                reason += "; `effects: {pore_water: 0}` in the scene puts it on trial"
        elif name in BY_THE_CLOCK and PORE_WATER in on:
            reason = "pore water flows in the base model, which gives what this states"
        elif effect.place and not set(effect.place) & set((numbers or {}).get(name, ())):
            reason = f"no place is stated: {' or '.join(effect.place)}"
        if reason:
            left_out[name] = reason
            continue
        candidate = candidate_of(effect, (numbers or {}).get(name, {}))
        ends = _within(effect, scene, candidate, (numbers or {}).get(name, {}), LATEST * duration)
        if ends is None:
            left_out[name] = f"it goes on for longer than the run of {duration:g} s"
        else:
            found.append(replace(ends, asked=name in scene.effects))
    return found, left_out


def _within(
    effect: Effect, scene: Scene, candidate: Candidate, numbers: Mapping[str, float], time: float
) -> Candidate | None:
    """The candidate with the amplitudes that have ended by a time [s]; None where none has."""
    if effect.until is None or math.isinf(time):
        return candidate
    parameters = {**{one.name: one.default for one in effect.parameters}, **numbers}

    def ended(amplitude: float) -> bool:
        return Active(effect, amplitude, parameters).until(scene) <= time

    ladder = tuple(rung for rung in candidate.ladder if ended(rung))
    if not ladder:
        return None
    bounds = []
    for within, bound in ((ladder[0], candidate.low), (ladder[-1], candidate.high)):
        for _ in range(30 if bound and not ended(bound) else 0):
            middle = 0.5 * (within + bound)
            within, bound = (middle, bound) if ended(middle) else (within, middle)
        bounds.append(bound if not bound or ended(bound) else within)
    return replace(candidate, ladder=ladder, low=bounds[0], high=bounds[1])


def family_of(effect: Effect) -> Family:
    """The family of an effect.

    Raises:
        InputError: there is no such family.
    """
    for family in FAMILIES:
        if family == effect.family:
            return family
    raise InputError(
        f"effect {effect.name}: family {effect.family!r}: there are {', '.join(FAMILIES)}"
    )


def candidate_of(effect: Effect, numbers: Mapping[str, float]) -> Candidate:
    """An effect of the library, or of a user, as a candidate; `numbers` are known of it."""
    amplitude = effect.amplitude
    ladder = [*amplitude.ladder]
    if amplitude.two_signed:
        ladder += [-rung for rung in ladder]
    found = Candidate(
        name=effect.name,
        family=family_of(effect),
        words=effect.words,
        unit=amplitude.unit,
        low=amplitude.low,
        high=amplitude.high,
        ladder=tuple(sorted(ladder)),
        by_chance=bool(effect.realisation) and effect.realisation not in numbers,
    )
    if not amplitude.decades:
        return found
    lowest, middle, top = amplitude.ladder
    beyond = 10.0**HALF_A_DECADE
    return replace(
        found,
        decades=True,
        low=max(amplitude.low, lowest / beyond),
        high=min(amplitude.high, top * beyond),
        prior_mean=middle,
        prior_std=HALF_A_DECADE * math.log(10.0) * middle,
    )
