"""How the answer changes with the question: variants and sensitivities, solved, as documents.

In: a changed question that was solved, by coarse runs where there are any, and perhaps again at the
spacing of the answer. Out: `VariantAnswer`, `SensitivityAnswer`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inversion.back_analysis.perturbed_answers import Problem
from inversion.back_analysis.result import SensitivityAnswer, Side, VariantAnswer
from inversion.back_analysis.result_builder import bounded, ratios
from inversion.back_analysis.variants import Changed
from inversion.estimation.forward import Prediction
from inversion.estimation.misfit import root_mean_square
from inversion.estimation.search import SearchResult
from inversion.problem.question import Sensitivity, Variant
from pipeline.ties import ranked


@dataclass
class Solved:
    """A changed question with its answer.

    Attributes:
        entry: of the question.
        changed: the change; a sensitivity may have one to either side.
        problem: solved, by coarse runs where there are any.
        search: that found the answer of `problem`; None: it was found from that to the question.
        fine: solved again at the spacing of the answer; None: not asked.
    """

    entry: Variant | Sensitivity
    changed: Changed
    problem: Problem
    search: SearchResult | None = None
    fine: Problem | None = None

    @property
    def best(self) -> Problem:
        """At the finest spacing at which it was solved."""
        return self.problem if self.fine is None else self.fine

    @property
    def reached(self) -> bool:
        """The fit is as good as asked for."""
        return self._ended.reached

    @property
    def words(self) -> str:
        """How good the fit is."""
        return self._ended.words

    @property
    def _ended(self) -> Problem | SearchResult:
        return self.best if self.search is None or self.fine is not None else self.search

    @property
    def answered(self) -> bool:
        """A run came through."""
        return self.problem.began is not None and bool(np.isfinite(self.problem.loss))


@dataclass(frozen=True)
class Here:
    """The answer from which changes are measured.

    Attributes:
        values: with the linear step that would be next, as those of the changed questions (p,).
        prediction: at the answer.
    """

    values: np.ndarray
    prediction: Prediction


def variant_answer(solved: Solved) -> VariantAnswer:
    """The answer under another reading of the question."""
    best, targets = solved.best, solved.changed.setup.targets
    parameters, prediction = best.objective.parameters, best.prediction
    return VariantAnswer(
        name=solved.entry.name,
        words=solved.changed.words,
        spacing_m=prediction.spacing_m,
        values=parameters.as_mapping(best.values),
        coarse_values=None if solved.fine is None else parameters.as_mapping(solved.problem.values),
        ratios=ratios(prediction, best.values, parameters),
        loss=best.loss,
        reached=solved.reached,
        predicted=targets.named(prediction.values),
        measured=targets.named(targets.measured, targets.fitted),
        at_bound=bounded(parameters.names, parameters.at_bound(best.values)),
        words_end=solved.words,
    )


def sensitivity_answer(solved: Sequence[Solved], here: Here) -> SensitivityAnswer:
    """The effect of one assumption, from each of its changes."""
    entry, parameters = solved[0].entry, solved[0].problem.objective.parameters
    assert not isinstance(entry, Variant)
    answered = [_side(one, here) for one in solved]
    changes = [side.change for side in answered]
    worst = ranked(answered, lambda side: abs(side.change[parameters.names[0]]))[0]
    std = {name: root_mean_square(changes, name) for name in parameters.names}
    return SensitivityAnswer(
        name=entry.name,
        kind=entry.kind,
        words="; ".join(side.words for side in answered),
        change=worst.change,
        std=std,
        sides=answered,
    )


def ratio_change(answer: SensitivityAnswer) -> dict[str, float]:
    """What an assumption adds to the standard deviation of strength / sigma'_v0, by parameter."""
    moved = [side.ratio_change for side in answer.sides]
    return {name: root_mean_square(moved, name) for name in moved[0]}


def largest(solved: Sequence[Solved], here: Here, std: np.ndarray, share: float) -> set[str]:
    """Names of the sensitivities that make a share of each parameter's variance.

    Args:
        solved: all of them.
        here: the answer.
        std: of the parameters from the survey's errors, which count as known, (p,).
        share: what is left out has less than 1 - share of the variance.
    """
    changes: dict[str, list[np.ndarray]] = {}
    for one in solved:
        changes.setdefault(one.entry.name, []).append(one.problem.refined - here.values)
    variances = {name: np.mean(np.square(own), axis=0) for name, own in changes.items()}
    whole = std**2 + sum(variances.values())
    kept: set[str] = set()
    for place, total in enumerate(whole):
        rest = total - std[place] ** 2
        own = {name: variance[place] for name, variance in variances.items()}
        for name in ranked(own, own.__getitem__):
            if rest <= (1.0 - share) * total:
                break
            kept.add(name)
            rest -= own[name]
    return kept


def _side(solved: Solved, here: Here) -> Side:
    best, targets = solved.best, solved.changed.setup.targets
    parameters, there = best.objective.parameters, best.refined
    sigma, new_sigma = here.prediction.sigma_v0_kpa, best.prediction.sigma_v0_kpa
    new_sigma = np.where(np.isnan(new_sigma), sigma, new_sigma)  # the engine does not know it
    with np.errstate(invalid="ignore"):
        before = here.values / parameters.per_ratio(sigma)
        change = there / parameters.per_ratio(new_sigma) - before
    coarse = None if solved.fine is None else solved.problem.refined - here.values
    return Side(
        words=solved.changed.words,
        spacing_m=best.prediction.spacing_m,
        values=parameters.as_mapping(there),
        change=parameters.as_mapping(there - here.values),
        coarse_change=None if coarse is None else parameters.as_mapping(coarse),
        ratio_change={
            name: float(one)
            for name, one in zip(parameters.names, change, strict=True)
            if np.isfinite(one)
        },
        predicted_before=targets.named(solved.problem.before.values, targets.fitted),
        predicted=targets.named(best.prediction.values, targets.fitted),
        loss=best.loss,
        # One fine run checks a change; what its fit lacks is taken into account (`refined`).
        reached=solved.problem.reached,
    )
