"""Physical effects of the library, or of a user, as candidates: they act in the solver."""

from __future__ import annotations

from collections.abc import Mapping

from diagnosis.hypotheses.model import Candidate
from geometry.scenes.scene import Scene
from mpm_taichi.effects import Effect, effects


def acting_candidates(
    scene: Scene, numbers: Mapping[str, Mapping[str, float]] | None = None
) -> tuple[list[Candidate], dict[str, str]]:
    """Effects that can act on a section, and why the others cannot.

    Args:
        scene: the section.
        numbers: effect -> further numbers of it that are known.
    """
    found, left_out = [], {}
    for name, effect in effects().items():
        reason = effect.applies(scene)
        if scene.effects.get(name):
            reason = "the base model has it already"
        elif effect.place and not set(effect.place) & set((numbers or {}).get(name, ())):
            reason = f"no place is stated: {' or '.join(effect.place)}"
        if reason:
            left_out[name] = reason
        else:
            found.append(candidate_of(effect, (numbers or {}).get(name, {})))
    return found, left_out


def candidate_of(effect: Effect, numbers: Mapping[str, float]) -> Candidate:
    """An effect of the library, or of a user, as a candidate; `numbers` are known of it."""
    amplitude = effect.amplitude
    ladder = [*amplitude.ladder]
    if amplitude.two_signed:
        ladder += [-rung for rung in ladder]
    return Candidate(
        name=effect.name,
        family=effect.family,
        words=effect.words,
        unit=amplitude.unit,
        low=amplitude.low,
        high=amplitude.high,
        ladder=tuple(sorted(ladder)),
        by_chance=bool(effect.realisation) and effect.realisation not in numbers,
    )
