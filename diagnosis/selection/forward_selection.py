"""Steps 7 to 9: effects are added one after another, rivals are kept, needless ones are dropped.

A round refits the candidates with the best scores and all that the data cannot distinguish from the
best of them; from the second round on also the best pairs, since one effect may have stood for two.
The best is adopted if it is accepted.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from diagnosis.adequacy.compare import Comparison
from diagnosis.options import Options
from diagnosis.selection.decide import explains
from diagnosis.selection.evidence import credible_set, probabilities
from diagnosis.selection.explain import Explanation
from diagnosis.selection.places import seek_places
from diagnosis.selection.refit import FittedModel
from diagnosis.selection.selection import ERROR_RUNS, Selection
from diagnosis.selection.tried_models import AdoptedModel, TriedModels, compared, why_not
from diagnosis.selection.unknown_curve import runs_wanted
from pipeline.ties import ranked

#: Share of the drop that is asked for which a further effect has to promise before it is refitted:
#: next to a first, promises are good to a fifth or 3, while a refit takes ten runs.
PROMISING = 0.5
#: Share of the best promise that a look-alike must promise itself to be refitted for that alone:
#: what promises less looks alike with the wrong sign, or cannot be as large. A cosine of 0.8 alone
#: promises 0.64.
RIVAL = 0.02
#: Pairs that are refitted in a round. By judgement: a promise is linear, so that the second may be
#: the best; each takes ten runs, and the search of pairs follows.
PAIRS = 2
#: Pairs that are ranked, of which some are too many for the data: all of 141 candidates.
MOST_PAIRS = 10_000


def run_rounds(selection: Selection) -> None:
    """Add effects until the model is adequate, nothing passes, or the rounds are over."""
    options, tried_models, runs = selection.options, selection.tried, selection.runs
    # What fails in the end is to be shown as a curve, and that takes runs, too. They are kept while
    # a first effect is searched for; deciding on it, or on a second one, may use them.
    kept = kept_for_a_curve(selection)
    for number in range(options.rounds):
        now = selection.now
        if now.adequacy.p_combined >= options.suspect:
            break
        runs.reserve = ERROR_RUNS + (kept if number == 0 else 0)
        # What the cells make of a large effect asks for a second one: without its error none is
        # added, nor where with it the effects so far explain.
        if now.model.names and (not selection.doubt() or explains(tried_models, options)):
            break
        names = wanted_models(
            selection.comparison, selection.explanation, now, options, first=number == 0
        )
        tried = selection.refitted([key for key in names if selection.leaves_spare(key)])
        runs.reserve = ERROR_RUNS
        tried = selection.with_own_errors(now.model, selection.judged_best(now.model, tried))
        if number == 0:
            tried = selection.with_own_errors(now.model, seek_places(selection, tried))
        best = selection.accepted(now.model, tried)
        # A first effect has to pass by the slope that its search has learnt: its own comes on top,
        # so that what is faint stays unnamed. A further one is compared with a model that has one.
        if best is not None and number == 0:
            best, tried = before_its_doubles(selection, now.model, best, tried)
        elif now.model.names:
            tried = selection.on_equal_terms(now.model, tried)
            best = selection.accepted(now.model, tried)
        if number == 0:
            for after in (tried_models.models[model.names] for model in tried):
                reason = None if after is best else why_not(now.model, after, options)
                tried_models.first[after.names[0]] = (after, reason)
        if best is None and number == 0:
            best = _best_pair(selection)
        if best is None:
            break
        selection.adopt(best)
        selection.drop_needless()
    if selection.now.model.names:
        selection.doubt()
    runs.reserve = 0


def before_its_doubles(
    selection: Selection, before: FittedModel, best: FittedModel, tried: list[FittedModel]
) -> tuple[FittedModel | None, list[FittedModel]]:
    """The effect that is adopted once all that looks like it was refitted, and what was refitted.

    A double may take the lead, and it has doubles of its own: they are asked until the leader has
    none left, or shares the lead with others so that no name is given anyway.

    Args:
        selection: under way.
        before: the model without it.
        best: the effect that leads so far.
        tried: all that was refitted with it.
    """
    while True:
        doubles = untried_doubles(selection.tried, selection.explanation, best, selection.options)
        if doubles:
            tried = tried + selection.refitted(doubles)
            tried = selection.with_own_errors(before, selection.judged_best(before, tried))
        tried = selection.on_equal_terms(before, tried)
        leader = selection.accepted(before, tried)
        settled = not doubles and leader is not None and leader.names == best.names
        if leader is None or settled or not would_be_named(selection, tried):
            return leader, tried
        best = leader


def would_be_named(selection: Selection, tried: Sequence[FittedModel]) -> bool:
    """One of the models has the probability of an answer, or several of one family have it."""
    evidence = compared([model for model in tried if not model.unread])
    known = selection.explanation.known
    leading = credible_set(probabilities(evidence), selection.options.credible)
    return len({tuple(known[name].family for name in names) for names in leading}) == 1


def kept_for_a_curve(selection: Selection) -> int:
    """Runs that are kept for an unknown strength curve."""
    return runs_wanted(selection.runs.model.curves)


def _best_pair(selection: Selection) -> FittedModel | None:
    """Two effects that explain together what neither does alone, where one hides the other."""
    now = selection.now.model
    every = best_pairs(selection.comparison, selection.explanation, MOST_PAIRS)
    pairs = [key for key in every if selection.leaves_spare(key)]
    tried = selection.judged_best(now, selection.refitted(pairs[:PAIRS]))
    tried = selection.with_own_errors(now, tried)
    if selection.accepted(now, tried) is None:
        return None
    return selection.accepted(now, selection.on_equal_terms(now, tried))


def wanted_models(
    comparison: Comparison,
    explanation: Explanation,
    now: AdoptedModel,
    options: Options,
    *,
    first: bool,
) -> list[tuple[str, ...]]:
    """Models worth a refit: best scores, what looks like the best, and from round two on pairs."""
    least = 0.0 if first else PROMISING * options.least_drop
    ranked = [name for name in now.scores.ranked if now.scores.best(name).drop > least]
    chosen = ranked[: options.refitted]
    if ranked:
        alike = explanation.alike(ranked[0], options.inseparable)
        chosen += representatives(explanation, [n for n in ranked if n in alike], chosen)
    if first:
        # A score is a tangent at the base model; what the case itself asks for is fitted anyway.
        chosen += [c.name for c in explanation.candidates if c.asked and c.name not in chosen]
    models = [tuple(sorted((*now.model.names, name))) for name in chosen]
    if not first:
        models += best_pairs(comparison, explanation, PAIRS)
    return models


def untried_doubles(
    tried_models: TriedModels, explanation: Explanation, best: FittedModel, options: Options
) -> list[tuple[str, ...]]:
    """Effects that are hard to tell from the one that is about to be named, and were not refitted.

    A score is linear: of two effects that look alike the wrong one may promise more. Several
    effects together have no doubles.
    """
    if len(best.names) != 1:
        return []
    (name,) = best.names
    alike = explanation.alike(name, options.hardly_separable)
    # A member of a family that was refitted and looks otherwise says nothing of those that do not.
    asked = [*tried_models.models, *tried_models.untried]
    tried = [key[0] for key in asked if len(key) == 1 and {*key} & {name, *alike}]
    return [(other,) for other in representatives(explanation, alike, tried)]


def representatives(
    explanation: Explanation, names: Sequence[str], tried: Sequence[str]
) -> list[str]:
    """Of candidates that look alike those worth a refit, best score first.

    All but those that are screened, and of these the best of each family: its members differ by
    place or by property, and where the data cannot separate them a refit of each would say the
    same.
    """
    promised = {name: explanation.scores.best(name).drop for name in names}
    least = RIVAL * explanation.scores.largest**2
    names = [name for name in names if promised[name] >= least]
    family = {one.name: one.family for one in explanation.candidates if one.screened}
    there = {family[name] for name in tried if name in family}
    found = []
    for name in names:
        if name in tried or family.get(name) in there:
            continue
        found.append(name)
        if name in family:
            there.add(family[name])
    return found


def best_pairs(
    comparison: Comparison, explanation: Explanation, count: int
) -> list[tuple[str, ...]]:
    """Pairs of candidates whose signatures together take most off the base model's residual.

    Linear in both amplitudes, within their bounds, at all pairs of ladder amplitudes.
    """
    residual = comparison.judged.residual
    scores = explanation.scores
    every = [(name, score) for name in scores.every for score in scores.every[name]]
    bounds = {candidate.name: candidate for candidate in explanation.candidates}
    drops: dict[tuple[str, ...], float] = {}
    for (first, one), (second, two) in combinations(every, 2):
        if first == second:
            continue
        columns = np.stack([one.projected, two.projected], axis=1)
        gram = columns.T @ columns
        if np.linalg.cond(gram) > 1e8:
            continue
        most = [bounds[n].most_of(s.rung) for n, s in ((first, one), (second, two))]
        share = np.clip(np.linalg.solve(gram, columns.T @ residual), 0.0, most)
        drop = float(2.0 * share @ (columns.T @ residual) - share @ gram @ share)
        key = tuple(sorted((first, second)))
        drops[key] = max(drops.get(key, 0.0), drop)
    return ranked(sorted(drops), drops.__getitem__)[:count]
