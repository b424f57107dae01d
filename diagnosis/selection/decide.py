"""Step 9: the verdict.

- *adequate*: the base model passes its tests (combined p at least 0.20). Effects may still hide.
- *identified*: an explanation was accepted, and alone it has 90 % of the probability; or all that
  share the 90 % are members of one family, which is then the answer.
- *ambiguous*: a single effect was accepted, but it takes several explanations to reach 90 %, or
  the runs that were allowed did not suffice to try its rivals.
- *unknown_effect*: the base model fails its tests and nothing passes, or what passes is not enough:
  a test still fails, the error of its own effects granted, or held-out data stay as bad as they
  were or get worse (`not_enough`); or several effects pass together where others would do:
  together they imitate nearly everything, also what is on no list; or a random pattern passes that
  is one of many (`Candidate.by_chance`). It fits by chance, and is a clue, not a name.
- *suspect*: p between 0.05 and 0.20, and nothing passes.

Probabilities are those of ln Z among all models that were tried, without what is below noise
(`tried_models.compared`). A model that adds to another an
effect which was not accepted is counted with the smaller one: what it has beyond it was not needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from diagnosis.adequacy.adequacy import Adequacy
from diagnosis.hypotheses.model import Family
from diagnosis.options import Options
from diagnosis.reason import Reason
from diagnosis.selection.evidence import credible_set, probabilities
from diagnosis.selection.explain import Explanation
from diagnosis.selection.tried_models import (
    AdoptedModel,
    TriedModels,
    at_new_bound,
    compared,
    why_not,
)
from diagnosis.track_record import Figures, Verdicts, name_record

#: Tests of how large the misfit is; the others are of its pattern, or of one measurement. Of 37
#: verdicts `identified` two wrong ones stood by such a test that failed, and no right one.
SIZES = ("chi2", "held_out")


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
        not_enough: why what was accepted is not the answer; None: it is.
        families: of the answer, where its members cannot be told apart.
        members: of these families, candidates that would do as well, the answer's own first.
        chance: that what is given is right, by what such explanations were worth where the truth
            is known (`diagnosis.track_record`); None: nothing explains.
    """

    verdict: Verdicts
    final: AdoptedModel
    sets: dict[tuple[str, ...], float]
    probability: dict[tuple[str, ...], float]
    untried: tuple[tuple[str, ...], ...] = ()
    by_chance: tuple[str, ...] = ()
    not_enough: Reason | None = None
    families: tuple[Family, ...] = ()
    members: tuple[str, ...] = ()
    chance: float | None = None


def decide(tried_models: TriedModels, explanation: Explanation, options: Options) -> Decision:
    """The verdict on a finished selection.

    Args:
        tried_models: all models that were tried.
        explanation: the candidates, and which of them look alike.
        options: settings of the diagnosis.
    """
    by_chance = explanation.by_chance
    final = tried_models.current
    p_base = tried_models.way[0].adequacy.p_combined
    probability = probabilities(explanations(tried_models, options))
    if not final.model.names:
        if p_base >= options.suspect:
            verdict: Verdicts = "adequate"
        else:
            verdict = "unknown_effect" if p_base < options.alarm else "suspect"
        alone: dict[tuple[str, ...], float] = {(): probability.get((), 0.0)}
        return Decision(verdict, final, alone if verdict == "adequate" else {}, probability)
    sets = credible_set(probability, options.credible)
    if drawn := by_chance.intersection(final.model.names):
        certain = [one for one in tried_models.way if by_chance.isdisjoint(one.model.names)]
        return Decision(
            "unknown_effect", certain[-1], sets, probability, by_chance=tuple(sorted(drawn))
        )
    if reason := not_enough(
        tried_models.way[0].adequacy,
        final.adequacy,
        tried_models.doubted,
        options,
        effects=len(final.model.names),
    ):
        return Decision("unknown_effect", final, sets, probability, not_enough=reason)
    # A model that extends the answer does not compete with it.
    own = set(final.model.names)
    untried = tuple(dict.fromkeys(key for key in tried_models.untried if not own <= set(key)))
    families, members = family_of(sets, final.model.names, explanation, options)
    one = len(sets) == 1 and next(iter(sets)) == final.model.names
    named = bool(one or families) and not untried
    if len(final.model.names) > 1 and not named:
        return Decision(
            "unknown_effect",
            final,
            sets,
            probability,
            untried,
            not_enough=Reason(kind="others_would_do"),
        )
    figures = Figures.of(
        (explanation.nearest(name, final.model.names) for name in final.model.names),
        final.adequacy.p_combined,
        list(sets.values()),
        together=bool(families),
    )
    chance = name_record().chance(figures)
    if named and chance < options.deserved:
        return Decision(
            "unknown_effect",
            final,
            sets,
            probability,
            not_enough=Reason(kind="too_often_wrong"),
            chance=chance,
        )
    return Decision(
        "identified" if named else "ambiguous",
        final,
        sets,
        probability,
        untried,
        families=families,
        members=members,
        chance=chance,
    )


def not_enough(
    base: Adequacy,
    final: Adequacy,
    doubted: Adequacy | None,
    options: Options,
    *,
    effects: int = 1,
) -> Reason | None:
    """Why an accepted model does not explain the measurements; None: it does.

    What is named must explain, not only improve.

    Args:
        base: the base model.
        final: the accepted model.
        doubted: the same with the error that its effects bring (the larger an effect, the more is
            left by what no model has exactly); None: that error is not known.
        options: settings of the diagnosis.
        effects: of the accepted model.
    """
    granted = final if doubted is None or doubted.p_combined < final.p_combined else doubted
    p = granted.p_combined
    left = excess(final) / max(excess(base), 1e-9)
    # No law is exact, and of a large misfit a little shows: what is left of it counts, not that it
    # shows. So much for its size: a pattern, or one measurement that is off, is no small rest of
    # it. Of several effects together, which fit nearly everything, more is asked.
    other = [test.p for test in granted.tests if test.name not in SIZES]
    of_size = min(1.0, len(granted.tests) * min(other, default=1.0)) >= options.still_failing
    nearly = effects == 1 and left <= options.nearly_all and p >= options.nearly_failing
    # They also have a large error together, which would forgive nearly everything.
    several = effects > 1 and final.p_combined < options.several_failing
    if several or (p < options.still_failing and not (nearly and of_size)):
        failing = final if several else granted
        return Reason(kind="tests_fail", of=failing.worst.name, numbers=[failing.p_combined])
    # A large false effect would forgive itself, since its error grows with it.
    if final.p_combined < options.still_failing and left > options.left_over:
        return Reason(kind="misfit_left", numbers=[left])
    before, after = base.held_out, final.held_out
    rise = after.chi2 - before.chi2
    if after.p is not None and after.p < options.still_failing and rise > options.held_out_rise:
        return Reason(kind="held_out_rises", numbers=[before.chi2, after.chi2])
    if after.p is not None and after.p < options.held_out_failing:
        left = (after.chi2 - after.n) / max(before.chi2 - before.n, 1e-9)
        if left > options.held_out_left:
            return Reason(kind="held_out_left", numbers=[left])
    return None


def explains(tried_models: TriedModels, options: Options) -> bool:
    """Whether the model adopted last explains the measurements, as far as it has to."""
    base, final = tried_models.way[0].adequacy, tried_models.current
    if not final.model.names:
        return base.p_combined >= options.alarm
    effects = len(final.model.names)
    return not not_enough(base, final.adequacy, tried_models.doubted, options, effects=effects)


def excess(found: Adequacy) -> float:
    """Sum of squares beyond that of noise, of fitted and held-out numbers."""
    held_out = found.held_out
    return max(found.chi2 - found.dof, 0.0) + max(held_out.chi2 - held_out.n, 0.0)


def family_of(
    sets: Mapping[tuple[str, ...], float],
    answer: tuple[str, ...],
    explanation: Explanation,
    options: Options,
) -> tuple[tuple[Family, ...], tuple[str, ...]]:
    """The families of an answer whose members cannot be told apart, and these members.

    That is so where all explanations of the 90 % are of the same families, or where a part of the
    answer has doubles in its family that were not refitted because the data cannot separate them.

    Returns:
        families and members; nothing where the answer is a name, or has rivals of other families.
    """
    family = {one.name: one.family for one in explanation.candidates}
    screened = {one.name for one in explanation.candidates if one.screened}

    def of(names: tuple[str, ...]) -> tuple[Family, ...]:
        return tuple(sorted(family[name] for name in names))

    # That some physical effect is missing is no answer: effects are named, or left open.
    if "physics" in of(answer) or any(of(names) != of(answer) for names in sets):
        return (), ()
    members = [*answer, *(name for names in sets for name in names)]
    for name in answer:
        doubles = explanation.alike(name, options.inseparable) if name in screened else []
        members += [n for n in doubles if n in screened and family[n] == family[name]]
    members = list(dict.fromkeys(members))
    if set(members) == set(answer):
        return (), ()
    return of(answer), tuple(members)


def explanations(tried_models: TriedModels, options: Options) -> dict[tuple[str, ...], float]:
    """Ln Z of the models that count as explanations of their own.

    One whose amplitude rests on a bound is not named, and is a rival all the same: its evidence has
    the bound in it (`evidence.share_within`).
    """
    kept = []
    weighed = {names: tried_models.weighed(model) for names, model in tried_models.models.items()}
    for names, model in tried_models.models.items():
        parameters = set(model.fit.space.parameters.names)
        if model.unread or at_new_bound(tried_models.models[()], model) in parameters:
            continue
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
            kept.append(model)
    return compared(kept)
