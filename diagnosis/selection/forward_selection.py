"""Steps 7 to 9: effects are added one after another, rivals are kept, needless ones are dropped.

Every model that was refitted is kept with its evidence. A round refits the candidates with the
best scores and all that the data cannot distinguish from the best of them; from the second round on
also the best pairs, since one effect may have stood for two. The best is adopted if it is accepted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from diagnosis.adequacy.adequacy import Adequacy, ProjectedFit, Test, assess, judged
from diagnosis.adequacy.compare import Comparison
from diagnosis.options import Options
from diagnosis.selection.effect_error import doubting, weighed_again
from diagnosis.selection.explain import Explanation
from diagnosis.selection.refit import (
    ANCHORED,
    FittedModel,
    RefitContext,
    judge,
    refit,
    weighed,
    with_own_derivative,
)
from diagnosis.selection.unknown_curve import runs_wanted
from diagnosis.signatures.signatures import Scores, Signature, score_all, take_signatures
from inversion.estimation.response_surface import Surface

#: Share of the drop that is asked for which a further effect has to promise before it is refitted:
#: next to a first, promises are good to a fifth or 3, while a refit takes ten runs.
PROMISING = 0.5
#: Share of the best promise that a look-alike must promise itself to be refitted for that alone.
RIVAL = 0.02
#: Pairs that are refitted in a round.
PAIRS = 2
#: Pairs that are ranked, of which some are too many for the data.
MOST_PAIRS = 10_000
#: Runs that are kept for an unknown strength curve, at most.
LARGEST_RESERVE = 50
#: Runs that the error of an adopted model takes; they are kept for it.
ERROR_RUNS = 3
#: Models within so much ln evidence of the best are judged by fresh jitters, as it is.
NEAR_BEST = 3.0
#: Models within that of the best that are put on equal terms with it, itself among them.
CONTENDERS = 4


@dataclass
class AdoptedModel:
    """A model on the way, with what was found of it.

    Attributes:
        model: the fit.
        adequacy: its tests.
        judged: its residual and noise.
        scores: of the candidates against it.
        note: how it came about.
    """

    model: FittedModel
    adequacy: Adequacy
    judged: ProjectedFit
    scores: Scores
    note: str


@dataclass
class TriedModels:
    """All models that were tried.

    Attributes:
        models: by their effects.
        way: adopted models in order, the base model first.
        first: refits of the first round, by candidate, with the condition each failed.
        untried: requested models that were not fitted: no runs were left, or all failed.
        context: at which models are compared; once effects were adopted, with the error they bring.
        doubted: combined p of the current model with the error that its effects bring, C'; None:
            it has no effects, or the runs for it were not allowed.
        error: what these effects add to C, C' - C (m, m); None as above.
    """

    models: dict[tuple[str, ...], FittedModel] = field(default_factory=dict)
    way: list[AdoptedModel] = field(default_factory=list)
    first: dict[str, tuple[FittedModel, str]] = field(default_factory=dict)
    untried: list[tuple[str, ...]] = field(default_factory=list)
    context: RefitContext | None = None
    doubted: float | None = None
    error: np.ndarray | None = None

    @property
    def current(self) -> AdoptedModel:
        """The model adopted last."""
        return self.way[-1]

    def weighed(self, model: FittedModel) -> FittedModel:
        """A model with its evidence at the context at which models are compared now."""
        return model if self.context is None else weighed_again(self.context, model)


def why_not(
    before: FittedModel, after: FittedModel, options: Options, *, together: float | None = None
) -> str:
    """The condition for acceptance that fails; empty if none does.

    Args:
        before: the model so far.
        after: the one with an effect more.
        options: settings of the diagnosis.
        together: ln evidence of all that were tried, in place of that of this model alone.
    """
    if after.unread:
        return "none of its runs could be read"
    gain = after.ln_evidence - before.ln_evidence
    drop = before.fit.total - after.fit.total
    if drop <= options.least_drop:
        return f"chi2 falls by {drop:.1f} only; {options.least_drop:g} are asked for"
    if (gain if together is None else together - before.ln_evidence) <= options.least_gain:
        return f"ln evidence rises by {gain:.1f} only; {options.least_gain:g} are asked for"
    if parameter := at_new_bound(before, after):
        return f"{parameter} is at its bound, where the evidence means nothing"
    held_out = after.held_out
    worse = before.held_out.ln_density - held_out.ln_density
    failing = held_out.p is not None and held_out.p < options.suspect
    if failing and worse > options.worse_held_out * gain:
        return f"held-out misfit rises from {before.held_out.chi2:.1f} to {held_out.chi2:.1f}"
    return ""


def at_new_bound(before: FittedModel, after: FittedModel) -> str:
    """A parameter that an effect drives to a bound of what is believed; empty: none."""
    bounds = [
        model.fit.space.parameters.at_bound(model.fit.space.values(model.fit.x))
        for model in (before, after)
    ]
    names = after.fit.space.parameters.names
    new = [n for n, old, end in zip(names, *bounds, strict=True) if end is not None and not old]
    return new[0] if new else ""


def accepted(
    now: FittedModel, tried: Sequence[FittedModel], options: Options
) -> FittedModel | None:
    """The model that is adopted: the best by itself, or the best for all that were tried.

    Explanations that look alike share the evidence among them: each by itself may have too little
    although together they leave no doubt that something is missing. Then the question "is there
    anything?" is put to their sum, and "what is it?" has several answers.
    """
    order = sorted((m for m in tried if not m.unread), key=lambda after: -after.ln_evidence)
    for after in order:
        if not why_not(now, after, options):
            return after
    if not order:
        return None
    together = float(np.logaddexp.reduce([after.ln_evidence for after in order]))
    return None if why_not(now, order[0], options, together=together) else order[0]


def _accepted(
    tried_models: TriedModels, now: FittedModel, tried: Sequence[FittedModel], options: Options
) -> FittedModel | None:
    """The model that is adopted, by the context at which models are compared now.

    It must be worth having without the error of the effects so far, too: where they err much, that
    error forgives everything.
    """
    left = list(tried)
    while True:
        best = accepted(
            tried_models.weighed(now), [tried_models.weighed(model) for model in left], options
        )
        if best is None:
            return None
        model = tried_models.models[best.names]
        if model.ln_evidence > now.ln_evidence:
            return model
        left = [other for other in left if other.names != best.names]


def _doubt(
    tried_models: TriedModels, comparison: Comparison, explanation: Explanation, options: Options
) -> bool:
    """Find C' of the current model and its combined p there; False: the runs are not allowed."""
    now = tried_models.current
    runs = comparison.base.runs
    kept, runs.reserve = runs.reserve, max(runs.reserve - ERROR_RUNS, 0)
    context = doubting(explanation.context, comparison.base, now.model, options)
    runs.reserve = kept
    tried_models.doubted = tried_models.error = None
    if context is None:
        return False
    tried_models.context = context
    fit = tried_models.weighed(now.model).fit
    data = context.data_for(fit)
    found = judged(data, fit, draws=options.draws, seed=options.seed)
    tried_models.doubted = assess(found, comparison.places).p_combined
    tried_models.error = data.covariance - explanation.context.data.covariance
    return True


def run_rounds(comparison: Comparison, explanation: Explanation, options: Options) -> TriedModels:
    """Add effects until the model is adequate, nothing passes, or the rounds are over."""
    context = explanation.context
    ladders = {name: signature.ladder for name, signature in explanation.signatures.items()}
    ground = comparison.base.surface.with_ladders(ladders)
    base = weighed(context, comparison.base.fit, ground)
    tried_models = TriedModels({(): base})
    tried_models.way.append(
        AdoptedModel(
            base, explanation.adequacy, comparison.judged, explanation.scores, "base model"
        )
    )
    signatures = dict(explanation.signatures)
    runs = comparison.base.runs
    # What fails in the end is to be shown as a curve, and that takes runs, too. They are kept while
    # a first effect is searched for; deciding on it, or on a second one, may use them.
    kept = min(runs_wanted(runs.model.curves), LARGEST_RESERVE)
    for number in range(options.rounds):
        now = tried_models.current
        if now.adequacy.p_combined >= options.suspect:
            break
        runs.reserve = ERROR_RUNS + (kept if number == 0 else 0)
        # What the cells make of a large effect asks for a second one: without C' none is added.
        if now.model.names and not _doubt(tried_models, comparison, explanation, options):
            break
        names = wanted_models(comparison, explanation, now, options, first=number == 0)
        names = [key for key in names if _leaves_spare(explanation, key, options)]
        tried = _try(tried_models, comparison, explanation, ground, now, names)
        runs.reserve = ERROR_RUNS
        tried = _judge_best(tried_models, explanation, now.model, tried, options)
        best = _accepted(tried_models, now.model, tried, options)
        if best is not None and number == 0:
            tried += _try(
                tried_models, comparison, explanation, ground, now,
                untried_doubles(tried_models, explanation, best, options),
            )  # fmt: skip
            tried = _judge_best(tried_models, explanation, now.model, tried, options)
        # A first effect has to pass by the slope that its search has learnt: its own comes on top,
        # so that what is faint stays unnamed. A further one is compared with a model that has one.
        if best is not None or now.model.names:
            tried = _on_equal_terms(tried_models, explanation, now.model, tried, options)
            best = _accepted(tried_models, now.model, tried, options)
        if number == 0:
            for after in (tried_models.models[model.names] for model in tried):
                reason = "" if after is best else why_not(now.model, after, options)
                tried_models.first[after.names[0]] = (after, reason)
        if best is None and number == 0:
            best = _best_pair(tried_models, comparison, explanation, ground, now, options)
        if best is None:
            break
        _adopt(tried_models, comparison, explanation, best, signatures, options)
        _drop(tried_models, comparison, explanation, ground, signatures, options)
    if tried_models.current.model.names:
        _doubt(tried_models, comparison, explanation, options)
    runs.reserve = 0
    return tried_models


def _leaves_spare(explanation: Explanation, names: Sequence[str], options: Options) -> bool:
    """A model leaves degrees of freedom that could contradict it; a switch takes none."""
    fitted = [name for name in names if not explanation.context.amplitudes[name].held]
    return explanation.adequacy.dof - len(fitted) >= options.spare


def _best_pair(
    tried_models: TriedModels,
    comparison: Comparison,
    explanation: Explanation,
    ground: Surface,
    now: AdoptedModel,
    options: Options,
) -> FittedModel | None:
    """Two effects that explain together what neither does alone, where one hides the other."""
    every = best_pairs(comparison, explanation, MOST_PAIRS)
    pairs = [key for key in every if _leaves_spare(explanation, key, options)]
    tried = _try(tried_models, comparison, explanation, ground, now, pairs[:PAIRS])
    tried = _judge_best(tried_models, explanation, now.model, tried, options)
    if _accepted(tried_models, now.model, tried, options) is None:
        return None
    tried = _on_equal_terms(tried_models, explanation, now.model, tried, options)
    return _accepted(tried_models, now.model, tried, options)


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
    models = [tuple(sorted((*now.model.names, name))) for name in chosen]
    if not first:
        models += best_pairs(comparison, explanation, PAIRS)
    return models


def untried_doubles(
    tried_models: TriedModels, explanation: Explanation, best: FittedModel, options: Options
) -> list[tuple[str, ...]]:
    """Effects that are hard to tell from the one that is about to be named, and were not refitted.

    A score is linear: of two effects that look alike the wrong one may promise more.
    """
    (name,) = best.names
    alike = explanation.alike(name, options.hardly_separable)
    tried = [key[0] for key in tried_models.models if len(key) == 1]
    return [(other,) for other in representatives(explanation, alike, tried)]


def representatives(
    explanation: Explanation, names: Sequence[str], tried: Sequence[str]
) -> list[str]:
    """Of candidates that look alike those worth a refit, best score first.

    All but those that are screened, and of these the best of each family: its members differ by
    place or by property, and where the data cannot separate them a refit of each would say the
    same. What promises next to nothing looks alike with the wrong sign, or cannot be as large.
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
        most = [
            (bounds[n].high if s.rung > 0 else bounds[n].low) / s.rung
            for n, s in ((first, one), (second, two))
        ]
        share = np.clip(np.linalg.solve(gram, columns.T @ residual), 0.0, most)
        drop = float(2.0 * share @ (columns.T @ residual) - share @ gram @ share)
        key = tuple(sorted((first, second)))
        drops[key] = max(drops.get(key, 0.0), drop)
    return sorted(drops, key=lambda key: -drops[key])[:count]


def _try(
    tried_models: TriedModels,
    comparison: Comparison,
    explanation: Explanation,
    ground: Surface,
    now: AdoptedModel,
    names: list[tuple[str, ...]],
) -> list[FittedModel]:
    """Refit models that have not been tried yet; all of them that could be had."""
    tried = []
    for key in names:
        if key not in tried_models.models:
            within = set(now.model.names) < set(key)
            surface = now.model.surface if within and now.model.names else ground
            surface = surface.with_ladders(
                {n: ground.ladders[n] for n in key if not surface.knows(n)}
            )
            seeds = ANCHORED if surface.space.effects else comparison.base.seeds
            rival = min((model.fit.total for model in tried), default=np.inf)
            found = refit(explanation.context, surface, key, seeds=seeds, rival=rival)
            if found is None:
                tried_models.untried.append(key)
                continue
            tried_models.models[key] = found
        tried.append(tried_models.models[key])
    return tried


def _near_the_best(
    tried_models: TriedModels, now: FittedModel, tried: Sequence[FittedModel], options: Options
) -> list[tuple[str, ...]]:
    """Models near the best of those tried and not far below what is asked for, best first."""
    evidence = {m.names: tried_models.weighed(m).ln_evidence for m in tried if not m.unread}
    bar = tried_models.weighed(now).ln_evidence + options.least_gain
    least = max([*evidence.values(), bar]) - NEAR_BEST
    near = [names for names in evidence if evidence[names] >= least]
    return sorted(near, key=lambda names: -evidence[names])


def _judge_best(
    tried_models: TriedModels,
    explanation: Explanation,
    now: FittedModel,
    tried: list[FittedModel],
    options: Options,
) -> list[FittedModel]:
    """Judge the best models, and those near them, by fresh jitters, until the best is judged."""
    found = {model.names: model for model in tried}
    for _ in range(len(found)):
        near = _near_the_best(tried_models, now, list(found.values()), options)
        waiting = [names for names in near if not found[names].judged]
        if not waiting:
            break
        names = waiting[0]
        # Where the allowance is over it counts as it is.
        found[names] = replace(judge(explanation.context, found[names]), judged=True)
        tried_models.models[names] = found[names]
    return list(found.values())


def _on_equal_terms(
    tried_models: TriedModels,
    explanation: Explanation,
    now: FittedModel,
    tried: list[FittedModel],
    options: Options,
) -> list[FittedModel]:
    """Give the best and what is near it derivatives of their own, the best first.

    A derivative of its own is worth some ln evidence: were one model alone given one, its rivals
    would drop out of the answer only because they lack one.
    """
    for names in _near_the_best(tried_models, now, tried, options)[:CONTENDERS]:
        tried_models.models[names] = with_own_derivative(
            explanation.context, tried_models.models[names]
        )
    return [tried_models.models[model.names] for model in tried]


def _adopt(
    tried_models: TriedModels,
    comparison: Comparison,
    explanation: Explanation,
    chosen: FittedModel,
    signatures: dict[str, Signature],
    options: Options,
) -> None:
    """Make a model the current one: its own derivative, tests, and scores against it."""
    context = explanation.context
    model = with_own_derivative(context, chosen)
    tried_models.models[model.names] = model
    data = comparison.base.data
    found = judged(data, model.fit, draws=options.draws, seed=options.seed)
    others = [c for c in explanation.candidates if c.name not in model.names]
    known = {c.name: signatures[c.name] for c in others}
    scores = score_all(found, known, others, projection=options.projection)
    # Signatures were taken without the effects that are now there: the best are taken again, if the
    # measurements could contradict yet another effect.
    best = [name for name in scores.ranked if scores.best(name).drop > 0.0][: options.refitted]
    again = [c for c in others if c.name in best]
    test = Test("score", scores.largest, scores.p_largest) if known else None
    adequacy = assess(found, comparison.places, score=test)
    fitted = [effect for effect in model.fit.space.effects if not effect.held]
    spare = explanation.adequacy.dof - len(fitted) - 1 >= options.spare
    if adequacy.p_combined < options.suspect and again and spare:
        fresh = take_signatures(
            context.runs, model.surface, found.system, again,
            finite=options.finite_amplitudes, turns=1,
        )  # fmt: skip
        signatures.update(fresh)
        ladders = {name: signature.ladder for name, signature in fresh.items()}
        model = replace(model, surface=model.surface.with_ladders(ladders))
        tried_models.models[model.names] = model
        known |= fresh
        scores = score_all(found, known, others, projection=options.projection)
        test = Test("score", scores.largest, scores.p_largest)
        adequacy = assess(found, comparison.places, score=test)
    note = f"with {', '.join(model.names)}"
    tried_models.way.append(AdoptedModel(model, adequacy, found, scores, note))


def _drop(
    tried_models: TriedModels,
    comparison: Comparison,
    explanation: Explanation,
    ground: Surface,
    signatures: dict[str, Signature],
    options: Options,
) -> None:
    """Take out an effect that costs little to remove."""
    now = tried_models.current
    if len(now.model.names) < 2:
        return
    smaller = [tuple(n for n in now.model.names if n != name) for name in now.model.names]
    for key in smaller:
        _seek_near(tried_models, explanation, ground, key, now.model)
    found = [
        tried_models.weighed(tried_models.models[key])
        for key in smaller
        if key in tried_models.models
    ]
    less = max(found, key=lambda model: model.ln_evidence, default=None)
    if less is None:
        return
    if tried_models.weighed(now.model).ln_evidence - less.ln_evidence < options.drop_below:
        less = tried_models.models[less.names]
        _adopt(tried_models, comparison, explanation, less, signatures, options)
        tried_models.current.note = f"without what it does not need: {', '.join(less.names)}"


def _seek_near(
    tried_models: TriedModels,
    explanation: Explanation,
    ground: Surface,
    key: tuple[str, ...],
    whole: FittedModel,
) -> None:
    """Refit a smaller model from where a larger one fits; the better of the old fit and the new.

    Found from the base model, a large effect may have been stopped in a worse valley: what a second
    effect then mends is not missing.
    """
    context, space = explanation.context, explanation.context.space(key)
    own = dict(zip(whole.fit.names, whole.fit.x[whole.fit.space.p :], strict=True))
    near = np.concatenate([whole.fit.x[: space.p], [own[name] for name in space.names]])
    found = refit(context, ground, key, seeds=ANCHORED, near=space.clipped(near))
    known = tried_models.models.get(key)
    if found is not None and (known is None or found.ln_evidence > known.ln_evidence):
        tried_models.models[key] = judge(context, found)
