"""Step 9: the verdict.

- *adequate*: the base model passes its tests (combined p at least 0.20). Effects may still hide.
- *identified*: an explanation was accepted, and alone it has 90 % of the probability.
- *ambiguous*: an explanation was accepted, but it takes several to reach 90 %, or the runs that
  were allowed did not suffice to try its rivals.
- *unknown_effect*: the base model fails its tests and nothing passes, or what passes still fails
  and leaves much of the misfit, more than the error of its own effects; or a random pattern passes
  that is one of many (`Candidate.by_chance`). It fits by chance, and is a clue, not a name.
- *suspect*: p between 0.05 and 0.20, and nothing passes.

Probabilities are those of ln Z among all models that were tried. A model that adds to another an
effect which was not accepted is counted with the smaller one: what it has beyond it was not needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from diagnosis.adequacy.adequacy import Adequacy
from diagnosis.options import Options
from diagnosis.selection.evidence import credible_set, probabilities
from diagnosis.selection.forward_selection import AdoptedModel, TriedModels, why_not

Verdicts = Literal["adequate", "suspect", "identified", "ambiguous", "unknown_effect"]


@dataclass(frozen=True)
class Decision:
    """The decision.

    Attributes:
        verdict: one of five.
        final: the model of the answer; the base model where there is none.
        sets: explanations that together reach the wanted probability, most probable first.
        probability: of every explanation that was tried.
        untried: rivals of the answer that were wanted and could not be had.
        by_chance: random patterns that were accepted and name nothing; the final model is without.
    """

    verdict: Verdicts
    final: AdoptedModel
    sets: dict[tuple[str, ...], float]
    probability: dict[tuple[str, ...], float]
    untried: tuple[tuple[str, ...], ...] = ()
    by_chance: tuple[str, ...] = ()


def decide(tried_models: TriedModels, by_chance: frozenset[str], options: Options) -> Decision:
    """The verdict on a finished selection.

    Args:
        tried_models: all models that were tried.
        by_chance: candidates that are one random pattern of many.
        options: settings of the diagnosis.
    """
    final = tried_models.current
    p_base = tried_models.way[0].adequacy.p_combined
    probability = probabilities(explanations(tried_models, options))
    if not final.model.names:
        if p_base >= options.suspect:
            verdict: Verdicts = "adequate"
        else:
            verdict = "unknown_effect" if p_base < options.alarm else "suspect"
        alone = {(): probability.get((), 0.0)}
        return Decision(verdict, final, alone if verdict == "adequate" else {}, probability)
    sets = credible_set(probability, options.credible)
    if drawn := by_chance.intersection(final.model.names):
        named = [one for one in tried_models.way if by_chance.isdisjoint(one.model.names)]
        return Decision(
            "unknown_effect", named[-1], sets, probability, by_chance=tuple(sorted(drawn))
        )
    failing = still_failing(tried_models.way[0].adequacy, final.adequacy, options)
    if failing and not tried_models.within_error:
        return Decision("unknown_effect", final, sets, probability)
    # A model that extends the answer does not compete with it.
    own = set(final.model.names)
    untried = tuple(dict.fromkeys(key for key in tried_models.untried if not own <= set(key)))
    one = len(sets) == 1 and next(iter(sets)) == final.model.names and not untried
    return Decision("identified" if one else "ambiguous", final, sets, probability, untried)


def still_failing(base: Adequacy, final: Adequacy, options: Options) -> bool:
    """The accepted model is inadequate: it fails the tests and leaves much of the misfit.

    An effect that takes nearly all of a large misfit away is not doubted for what is left of it:
    the larger an effect, the more is left by what no model has exactly.
    """
    if final.p_combined >= options.still_failing:
        return False
    return excess(final) > options.left_over * excess(base)


def excess(found: Adequacy) -> float:
    """Sum of squares beyond that of noise, of fitted and held-out numbers."""
    held_out = found.held_out
    return max(found.chi2 - found.dof, 0.0) + max(held_out.chi2 - held_out.n, 0.0)


def explanations(tried_models: TriedModels, options: Options) -> dict[tuple[str, ...], float]:
    """Ln Z of the models that count as explanations of their own."""
    kept = {}
    weighed = {names: tried_models.weighed(model) for names, model in tried_models.models.items()}
    for names, model in tried_models.models.items():
        smaller = [
            key
            for key in weighed
            if key and set(key) < set(names) and names != tried_models.current.model.names
        ]
        if all(
            model.ln_evidence > tried_models.models[less].ln_evidence
            and not why_not(weighed[less], weighed[names], options)
            for less in smaller
        ):
            kept[names] = model.ln_evidence
    return kept
