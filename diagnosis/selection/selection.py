"""Steps 7 and 8: what every search for missing effects does, whatever it chooses to try.

Models are refitted, the best are judged by fresh jitters and put on equal terms, one is adopted,
and what it does not need is dropped. Every model that was refitted is kept with its evidence.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.adequacy.adequacy import Test, assess, judged
from diagnosis.adequacy.compare import Comparison
from diagnosis.options import Options
from diagnosis.ranking import Ranking
from diagnosis.selection.effect_error import doubting, with_own_error
from diagnosis.selection.explain import Explanation
from diagnosis.selection.refit import (
    ANCHORED,
    FittedModel,
    judge,
    refit,
    refit_words,
    weighed,
    with_own_derivative,
)
from diagnosis.selection.tried_models import AdoptedModel, TriedModels, accepted_here, why_not
from diagnosis.signatures.signatures import Signature, score_all, take_signatures
from inversion.estimation.budget import Runs
from pipeline.ties import largest, ranked

#: Runs that the error of an adopted model takes (itself, the second scheme, finer cells); they are
#: kept for it.
ERROR_RUNS = 3
#: Refitted models of a step that get runs of their own, at most. The best by their misfit are
#: measured as the base model was: by its C the true model of a slide had chi2 203 on 21 numbers, by
#: its own 20. Those near the best, itself among them, are put on equal terms with it. By judgement:
#: each takes 10 to 20 runs; with two the true one may stand third.
CONTENDERS = 4
#: Models within so much ln evidence of the best are judged by fresh jitters, as it is: a derivative
#: of its own is worth 0.7 to 2.6 to a model.
NEAR_BEST = 3.0


@dataclass
class Selection:
    """A search for missing effects under way.

    Attributes:
        comparison: of the base model.
        explanation: candidates against its residual; grows by things whose place is sought.
        options: settings of the diagnosis.
        ranking: receives the results of refits.
        tried: models so far.
        signatures: by candidate, the last that were taken.
    """

    comparison: Comparison
    explanation: Explanation
    options: Options
    ranking: Ranking = field(default_factory=Ranking)
    tried: TriedModels = field(init=False)
    signatures: dict[str, Signature] = field(init=False)

    def __post_init__(self) -> None:
        signatures = self.explanation.signatures
        ladders = {name: signature.ladder for name, signature in signatures.items()}
        surface = self.comparison.base.surface.with_ladders(ladders)
        base = weighed(self.explanation.context, self.comparison.base.fit, surface)
        self.signatures = dict(signatures)
        self.tried = TriedModels({(): base})
        self.tried.way.append(
            AdoptedModel(
                base,
                self.explanation.adequacy,
                self.comparison.judged,
                self.explanation.scores,
                "base model",
            )
        )

    @property
    def runs(self) -> Runs:
        """Forward runs and what is left of them."""
        return self.comparison.base.runs

    @property
    def base(self) -> FittedModel:
        """The base model."""
        return self.tried.way[0].model

    @property
    def now(self) -> AdoptedModel:
        """The model adopted last."""
        return self.tried.current

    def leaves_spare(self, names: Sequence[str]) -> bool:
        """A model leaves degrees of freedom that could contradict it; a switch takes none."""
        fitted = [name for name in names if not self.explanation.context.amplitudes[name].held]
        return self.explanation.adequacy.dof - len(fitted) >= self.options.spare

    def refitted(self, names: Sequence[tuple[str, ...]]) -> list[FittedModel]:
        """Refit models that have not been tried yet; all of them that could be had.

        Models that extend the one adopted last start from it, the others from the base model.
        """
        found: list[FittedModel] = []
        for key in names:
            now = self.now.model
            extends = now.names and set(now.names) < set(key)
            rival = min((model.fit.total for model in found), default=np.inf)
            model = self.refit_on(now if extends else self.base, key, rival=rival)
            if model is not None:
                found.append(model)
        return found

    def refit_on(
        self, start: FittedModel, key: tuple[str, ...], *, rival: float = np.inf
    ) -> FittedModel | None:
        """Refit a model from the surface of another; as known where it was tried before.

        Args:
            start: a model with some of its effects.
            key: its effects.
            rival: sum of squares of the best that it competes with.
        """
        if key not in self.tried.models:
            surface, ladders = start.surface, self.base.surface.ladders
            surface = surface.with_ladders({n: ladders[n] for n in key if not surface.knows(n)})
            seeds = ANCHORED if surface.space.effects else self.comparison.base.seeds
            found = refit(self.explanation.context, surface, key, seeds=seeds, rival=rival)
            # A search that the allowance has cut short is half a rival: nothing is named beside it.
            if found is None or refit_words(key) in self.runs.cut_short:
                self.tried.untried.append(key)
            if found is None:
                return None
            self._keep(found)
        return self.tried.models[key]

    def judged_best(self, before: FittedModel, models: list[FittedModel]) -> list[FittedModel]:
        """Judge the best models, and those near them, by fresh jitters till the best is judged."""
        found = {model.names: model for model in models}
        for _ in range(len(found)):
            near = self.near_the_best(before, list(found.values()))
            waiting = [names for names in near if not found[names].judged]
            if not waiting:
                break
            names = waiting[0]
            found[names] = self.judged(names)
        return list(found.values())

    def judged(self, names: tuple[str, ...]) -> FittedModel:
        """A model that was tried, judged by fresh jitters; as it is where no runs are left."""
        found = judge(self.explanation.context, self.tried.models[names])
        return self._keep(replace(found, judged=True))

    def with_own_errors(self, before: FittedModel, models: list[FittedModel]) -> list[FittedModel]:
        """Measure the errors of the models that fit best, each at its own fit.

        By their misfit, not by their evidence: an effect that makes a slide noisy leaves much by
        the error of the calm base model.
        """
        least = self.options.least_drop / 2.0
        better = [m for m in models if before.fit.total - m.fit.total > least and not m.unread]
        for model in ranked(better, lambda model: -model.fit.total)[:CONTENDERS]:
            found = model if model.judged else self.judged(model.names)
            self._keep(self._measured(found))
        return [self.tried.models[model.names] for model in models]

    def _keep(self, model: FittedModel) -> FittedModel:
        """Keep a model, with whether it explains."""
        kept = self.tried.models[model.names] = replace(model, explains=self._explains(model))
        if not model.unread:
            fall = self.base.fit.total - kept.fit.total
            self.ranking.refit(kept.names, fall)
        return kept

    def _explains(self, model: FittedModel) -> bool:
        """A model with effects passes the tests of adequacy at its own fit."""
        if not model.names or model.unread:
            return False
        data = self.explanation.context.of(model).data
        found = judged(data, model.fit, draws=self.options.draws, seed=self.options.seed)
        return assess(found, self.comparison.places).p_combined >= self.options.still_failing

    def _measured(self, model: FittedModel) -> FittedModel:
        """A judged model with its own error."""
        return with_own_error(self.explanation.context, self.comparison.base, model, self.options)

    def on_equal_terms(self, before: FittedModel, models: list[FittedModel]) -> list[FittedModel]:
        """Give the best and what is near it derivatives of their own, the best first.

        A derivative of its own is worth some ln evidence: were one model alone given one, its
        rivals would drop out of the answer only because they lack one.
        """
        for names in self.near_the_best(before, models)[:CONTENDERS]:
            self.give_own_derivative(names)
        return [self.tried.models[model.names] for model in models]

    def give_own_derivative(self, names: tuple[str, ...]) -> FittedModel:
        """Give a model that was tried a derivative of its own."""
        return self._keep(with_own_derivative(self.explanation.context, self.tried.models[names]))

    def near_the_best(
        self, before: FittedModel, models: Sequence[FittedModel]
    ) -> list[tuple[str, ...]]:
        """Models near the best of some and not far below what is asked for, best first.

        By all of their evidence, of which acceptance asks, or without what they owe to misfits
        below noise, by which they are compared.
        """
        weighed = [self.tried.weighed(model) for model in models if not model.unread]
        bar = self.tried.weighed(before).ln_evidence + self.options.least_gain
        credit = {model.names: model.ln_credit for model in weighed}
        near: set[tuple[str, ...]] = set()
        for evidence in (credit, {model.names: model.ln_evidence for model in weighed}):
            least = max([*evidence.values(), bar]) - NEAR_BEST
            near |= {names for names in evidence if evidence[names] >= least}
        return ranked(sorted(near), credit.__getitem__)

    def accepted(self, before: FittedModel, models: Sequence[FittedModel]) -> FittedModel | None:
        """The model that is adopted in place of one before; None: none passes."""
        return accepted_here(self.tried, before, models, self.options)

    def adopt(self, chosen: FittedModel) -> None:
        """Make a model the current one: its own derivative, tests, and scores against it."""
        options, comparison = self.options, self.comparison
        model = self._keep(with_own_derivative(self.explanation.context, chosen))
        data = self.explanation.context.of(model).data
        found = judged(data, model.fit, draws=options.draws, seed=options.seed)
        others = [c for c in self.explanation.candidates if c.name not in model.names]
        known = {c.name: self.signatures[c.name] for c in others}
        scores = score_all(found, known, others, projection=options.projection)
        # Signatures were taken without the effects that are now there: the best are taken again, if
        # the measurements could contradict yet another effect.
        best = [n for n in scores.ranked if scores.best(n).drop > 0.0][: options.refitted]
        again = [c for c in others if c.name in best]
        test = Test("score", scores.largest, scores.p_largest) if known else None
        adequacy = assess(found, comparison.places, score=test)
        fitted = [effect for effect in model.fit.space.effects if not effect.held]
        spare = self.explanation.adequacy.dof - len(fitted) - 1 >= options.spare
        if adequacy.p_combined < options.suspect and again and spare:
            fresh = take_signatures(
                self.runs,
                model.surface,
                found.system,
                again,
                finite=options.finite_amplitudes,
                turns=1,
            )
            self.signatures.update(fresh)
            ladders = {name: signature.ladder for name, signature in fresh.items()}
            model = replace(model, surface=model.surface.with_ladders(ladders))
            self.tried.models[model.names] = model
            known |= fresh
            scores = score_all(found, known, others, projection=options.projection)
            test = Test("score", scores.largest, scores.p_largest)
            adequacy = assess(found, comparison.places, score=test)
        note = f"with {', '.join(model.names)}"
        self.tried.way.append(AdoptedModel(model, adequacy, found, scores, note))

    def drop_needless(self) -> None:
        """Take an effect that costs little to remove out of the model adopted last.

        What is left must be a model that could have been adopted: none that drives a parameter to a
        bound, where its evidence means nothing.
        """
        now = self.now.model
        if len(now.names) < 2:
            return
        smaller = [tuple(n for n in now.names if n != name) for name in now.names]
        for key in smaller:
            self._seek_near(key, now)
        models = self.tried.models
        known = [models[key] for key in smaller if key in models]
        before = self.tried.weighed(self.tried.way[0].model)
        found = [
            model
            for model in map(self.tried.weighed, known)
            if not why_not(before, model, self.options)
        ]
        if not found:
            return
        less = largest(found, lambda model: model.ln_evidence)
        if self.tried.weighed(now).ln_evidence - less.ln_evidence < self.options.drop_below:
            self.adopt(models[less.names])
            self.now.note = f"without what it does not need: {', '.join(less.names)}"

    def _seek_near(self, key: tuple[str, ...], whole: FittedModel) -> None:
        """Refit a smaller model from where a larger one fits; the better of the old and the new.

        Found from the base model, a large effect may have been stopped in a worse valley: what a
        second effect then mends is not missing.
        """
        context, space = self.explanation.context, self.explanation.context.space(key)
        own = dict(zip(whole.fit.names, whole.fit.x[whole.fit.space.p :], strict=True))
        near = np.concatenate([whole.fit.x[: space.p], [own[name] for name in space.names]])
        found = refit(context, self.base.surface, key, seeds=ANCHORED, near=space.clipped(near))
        if found is None:
            return
        found = self._measured(judge(context, found))
        if found.unread:
            return
        known = self.tried.models.get(key)
        if known is None or found.ln_evidence > known.ln_evidence:
            self._keep(found)

    def doubt(self) -> bool:
        """Find C' of the current model and its tests by it; False: the runs are not allowed."""
        now, tried, options = self.now, self.tried, self.options
        with self.spending(ERROR_RUNS):
            context = doubting(self.explanation.context, self.comparison.base, now.model, options)
        tried.doubted = tried.error = None
        if context is None:
            return False
        tried.context = context
        fit = tried.weighed(now.model).fit
        data = context.data_for(fit)
        found = judged(data, fit, draws=options.draws, seed=options.seed)
        tried.doubted = assess(found, self.comparison.places)
        tried.error = data.covariance - self.explanation.context.data.covariance
        return True

    @contextmanager
    def spending(self, count: int) -> Iterator[None]:
        """Use so many of the runs that are kept for later."""
        kept, self.runs.reserve = self.runs.reserve, max(self.runs.reserve - count, 0)
        try:
            yield
        finally:
            self.runs.reserve = kept
