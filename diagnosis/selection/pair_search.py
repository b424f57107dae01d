"""Step 10: where what was found is not enough, what the rounds miss is refitted, pairs above all.

The rounds start at the base model and add one effect at a time, by what each changes there. So they
miss

- what the parameters imitate nearly whole: a pool acts at first as a lower strength does, and what
  else it does shows only with the strength that goes with it;
- two effects of which each alone mends one number and spoils another: the thrust of a pool holds up
  what it left standing, and the crest with it.

Here the candidates that the parameters imitate most are refitted, and every switch, whatever they
promise. Then all others are tried on top of the best single effects so far, by one run each where
*these* fit, and what promises most is refitted. Nothing is accepted more easily than in the rounds:
a pair has the odds of two effects out of all, and has to leave the same degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from diagnosis.adequacy.adequacy import judged
from diagnosis.selection.decide import explains
from diagnosis.selection.forward_selection import before_its_doubles, kept_for_a_curve
from diagnosis.selection.refit import FittedModel
from diagnosis.selection.selection import ERROR_RUNS, Selection
from diagnosis.selection.tried_models import why_not
from diagnosis.signatures.confounding import representative
from diagnosis.signatures.signatures import LEAST_FALL, score_all, take_signatures
from pipeline.ties import ranked

#: Candidates other than switches that are refitted because the parameters imitate them: as many as
#: a round refits by their score (`Options.refitted`).
IMITATED = 4
#: Switches and other single effects on top of which all others are tried. By judgement: each takes
#: a derivative and one run of every other candidate; of one alone the other of a pair may be
#: missed.
FORMS, EFFECTS = 2, 3
#: Pairs that are refitted, ten runs each. By judgement: one more than in a round, since their
#: promises are by runs where one of the two fits.
PAIRS = 3


@dataclass(frozen=True)
class Promise:
    """A pair of effects before its refit.

    Attributes:
        names: of the two, sorted.
        total: sum of squares that is expected of it.
        start: the model with one of them, whose surface knows the other.
    """

    names: tuple[str, ...]
    total: float
    start: FittedModel


def search_pairs(selection: Selection) -> None:
    """Refit what the rounds miss, unless the model adopted last explains the measurements."""
    tried, options = selection.tried, selection.options
    if explains(tried, options) or not selection.explanation.names:
        return
    base, before = selection.base, selection.now.model
    selection.runs.reserve = ERROR_RUNS + kept_for_a_curve(selection)
    # All start equal again: the error that the effects so far bring is theirs alone.
    tried.context = None
    found = selection.refitted([(name,) for name in overlooked(selection)])
    rival = min(model.fit.total for model in tried.models.values())
    for pair in built_on(selection):
        model = selection.refit_on(pair.start, pair.names, rival=rival)
        if model is not None:
            found.append(model)
    found = [tried.models[model.names] for model in found]
    found = selection.with_own_errors(base, selection.judged_best(base, found))
    found = selection.on_equal_terms(base, found)
    best = selection.accepted(base, found)
    if best is not None:
        best, found = before_its_doubles(selection, base, best, found)
    for after in found:
        if len(after.names) == 1:
            tried.first[after.names[0]] = (after, why_not(base, after, options))
    selection.runs.reserve = ERROR_RUNS
    if best is not None and best.ln_evidence > before.ln_evidence:
        selection.adopt(best)
        selection.drop_needless()
    if selection.now.model.names:
        selection.doubt()
    selection.runs.reserve = 0


def overlooked(selection: Selection) -> list[str]:
    """Candidates that were not refitted: every switch, and what the parameters imitate most.

    Of those that are screened one of each family, none where one was refitted.
    """
    explanation = selection.explanation
    known = explanation.known
    there = {key[0] for key in selection.tried.models if len(key) == 1}
    families = {known[name].family for name in there if known[name].screened}
    imitated = {}
    for name in explanation.names:
        score = representative(explanation.scores, name)
        imitated[name] = score.whole**2 - score.visible**2
    switches, others = [], []
    for name in ranked(sorted(set(imitated) - there), imitated.__getitem__):
        one = known[name]
        if one.switch:
            switches.append(name)
        elif not (one.free or one.by_chance or (one.screened and one.family in families)):
            others.append(name)
            families |= {one.family} if one.screened else set()
    return switches + others[:IMITATED]


def built_on(selection: Selection) -> list[Promise]:
    """Pairs worth a refit: on the best single effects, what promises more than was found so far."""
    promised: dict[tuple[str, ...], Promise] = {}
    for names in starts(selection):
        selection.judged(names)
        for one in promises(selection, selection.give_own_derivative(names)):
            known = promised.get(one.names)
            if known is None or one.total < known.total:
                promised[one.names] = one
    wanted = selection.now.model.fit.total - selection.options.least_drop
    new = [
        one
        for one in promised.values()
        if one.names not in selection.tried.models
        and one.total < wanted
        and selection.leaves_spare(one.names)
    ]
    in_order = sorted(new, key=lambda one: one.names)
    return ranked(in_order, lambda one: -one.total)[:PAIRS]


def starts(selection: Selection) -> list[tuple[str, ...]]:
    """The best switches and other single effects that were refitted, by their sum of squares."""
    known = selection.explanation.known
    models = selection.tried.models
    totals: dict[tuple[str, ...], float] = {
        key: models[key].fit.total
        for key in models
        if len(key) == 1
        and not models[key].unread
        and not known[key[0]].by_chance
        and selection.base.fit.total - models[key].fit.total > LEAST_FALL
    }
    best_first = ranked(sorted(totals), lambda key: -totals[key])
    forms = [key for key in best_first if known[key[0]].switch]
    return forms[:FORMS] + [key for key in best_first if key not in forms][:EFFECTS]


def promises(selection: Selection, start: FittedModel) -> list[Promise]:
    """What every other candidate promises on top of a model, by one run of each at its fit."""
    explanation, options = selection.explanation, selection.options
    data = explanation.context.of(start).data
    found = judged(data, start.fit, draws=1, seed=options.seed)
    others = [
        one for one in explanation.candidates if one.name not in start.names and not one.by_chance
    ]
    taken = take_signatures(selection.runs, start.surface, found.system, others, turns=0)
    others = [one for one in others if one.name in taken]
    scores = score_all(found, taken, others, projection=options.projection)
    surface = start.surface.with_ladders({name: taken[name].ladder for name in taken})
    start = replace(start, surface=surface)
    return [
        Promise(
            tuple(sorted((*start.names, name))), start.fit.total - scores.best(name).drop, start
        )
        for name in scores.every
    ]
