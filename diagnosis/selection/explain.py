"""Explain: which effects would explain the misfit, which look alike, and what could hide?

    explanation = explain(model, comparison, options)

runs the ladder of every candidate at the base model's fit, three amplitudes of each sign, and those
that score best once more with another jitter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.adequacy.adequacy import Adequacy, Test, assess
from diagnosis.adequacy.compare import Comparison
from diagnosis.hypotheses.model import Candidate, Model, amplitude_of
from diagnosis.options import Options
from diagnosis.ranking import Ranking
from diagnosis.selection.refit import RefitContext
from diagnosis.signatures.confounding import (
    Visibility,
    cosines,
    look_alike,
    representative,
    visibility,
)
from diagnosis.signatures.signatures import (
    Scores,
    Signature,
    check_by_second_seed,
    score_all,
    take_signatures,
)
from pipeline.cli import InputError


@dataclass(frozen=True)
class Explanation:
    """Candidates against the residual of the base model.

    Attributes:
        candidates: those that were tested.
        left_out: candidate -> why it was not tested.
        signatures: by candidate.
        scores: of the round.
        names: candidates in the order of `cosine`, best score first.
        cosine: of projected signatures, (n, n).
        visible: how well each could be seen.
        adequacy: of the base model, the largest score among its tests.
        context: for refits.
    """

    candidates: list[Candidate]
    left_out: dict[str, str]
    signatures: dict[str, Signature]
    scores: Scores
    names: list[str]
    cosine: np.ndarray
    visible: dict[str, Visibility]
    adequacy: Adequacy
    context: RefitContext

    @property
    def known(self) -> dict[str, Candidate]:
        """Candidates by name."""
        return {one.name: one for one in self.candidates}

    @property
    def by_chance(self) -> frozenset[str]:
        """Candidates that are one random pattern of many."""
        return frozenset(one.name for one in self.candidates if one.by_chance)

    def nearest(self, name: str, together: Sequence[str] = ()) -> float:
        """Largest |cosine| of a candidate to another one; 0 where there is no other.

        To one whose place was sought, the places on the way there are no others; nor is what it
        explains together with.
        """
        known = self.known
        own, row = known[name], np.abs(self.cosine[self.names.index(name)])
        others = [
            float(cosine)
            for other, cosine in zip(self.names, row, strict=True)
            if other != name
            and other not in together
            and not (own.choices > 1 and known[other].placed and known[other].family == own.family)
        ]
        return max(others, default=0.0)

    def alike(self, name: str, least: float) -> list[str]:
        """Candidates that these data cannot tell from one."""
        return look_alike(self.names, self.cosine, name, least)


def tested_candidates(model: Model, options: Options) -> tuple[list[Candidate], dict[str, str]]:
    """Candidates to test, and why the others are not.

    Raises:
        InputError: options name an effect that the model does not know.
    """
    known = [candidate.name for candidate in model.candidates]
    for key, names in (
        ("forbid", options.forbidden),
        ("effects", options.effects or ()),
        ("priors", tuple(options.priors)),
    ):
        for name in names:
            if name not in known:
                raise InputError(f"{key}: no effect {name!r} here; there are {', '.join(known)}")
    left_out = {}
    for name in known:
        if name in options.forbidden:
            left_out[name] = "ruled out by the engineer"
        elif options.effects is not None and name not in options.effects:
            left_out[name] = "not asked for"
    return [c for c in model.candidates if c.name not in left_out], left_out


def explain(
    model: Model, comparison: Comparison, options: Options, ranking: Ranking | None = None
) -> Explanation:
    """Score every candidate against the residual of the base model.

    Args:
        model: the model to diagnose.
        comparison: of `compare` with the same model and options.
        options: vetoes, priors.
        ranking: receives the scores as they become known; None: they are not reported.

    Raises:
        InputError: an effect is named that the model does not know.
    """
    ranking = ranking or Ranking()
    base = comparison.base
    candidates, left_out = tested_candidates(model, options)
    amplitudes = {c.name: amplitude_of(c, options.priors.get(c.name)) for c in candidates}
    context = RefitContext(
        base.runs,
        base.data,
        base.fit.space,
        amplitudes,
        base.jitter,
        max(len(candidates), 1),
        share=options.source_effects,
        exact=frozenset(c.name for c in candidates if c.free),
    )
    linear = comparison.judged.system
    ranking.named(candidates)

    def watch(so_far: Mapping[str, Signature]) -> None:
        scores = score_all(comparison.judged, so_far, candidates, projection=options.projection)
        ranking.promise({name: scores.best(name).drop for name in scores.every})

    taken = take_signatures(
        base.runs,
        base.surface,
        linear,
        candidates,
        finite=options.finite_amplitudes,
        found=comparison.judged,
        watch=watch if ranking.is_watched else None,
    )
    for candidate in candidates:
        if candidate.name not in taken:
            left_out[candidate.name] = "none of its runs could be read"
    candidates = [c for c in candidates if c.name in taken]
    first = score_all(comparison.judged, taken, candidates, projection=options.projection)
    taken = check_by_second_seed(
        base.runs, base.surface, linear, taken, worth_checking(first, options)
    )
    found = _assembled(context, comparison, options, candidates, left_out, taken)
    ranking.promise({name: found.scores.best(name).drop for name in found.names})
    return found


def with_candidate(
    found: Explanation,
    comparison: Comparison,
    options: Options,
    candidate: Candidate,
    signature: Signature,
) -> Explanation:
    """The same with a candidate that was thought of later; the base model is tested as it was.

    Args:
        found: what was found without it.
        comparison: as it was for that.
        options: likewise.
        candidate: a further one.
        signature: of it, at the base model's fit.
    """
    context = replace(found.context, count=len(found.candidates) + 1)
    context.amplitudes[candidate.name] = amplitude_of(candidate, options.priors.get(candidate.name))
    grown = _assembled(
        context,
        comparison,
        options,
        [*found.candidates, candidate],
        found.left_out,
        {**found.signatures, candidate.name: signature},
    )
    return replace(grown, adequacy=found.adequacy)


def _assembled(
    context: RefitContext,
    comparison: Comparison,
    options: Options,
    candidates: list[Candidate],
    left_out: dict[str, str],
    taken: dict[str, Signature],
) -> Explanation:
    """Scores of signatures, which look alike, and what could hide."""
    base, linear = comparison.base, comparison.judged.system
    scores = score_all(comparison.judged, taken, candidates, projection=options.projection)
    names = scores.ranked
    matrix = cosines(scores, names)
    visible = {
        name: visibility(
            linear,
            base.fit.space,
            base.fit.x,
            scores.every[name],
            taken[name],
            options.detectable,
        )
        for name in names
    }
    test = Test("score", scores.largest, scores.p_largest) if names else None
    adequacy = assess(comparison.judged, comparison.places, score=test)
    return Explanation(
        candidates, left_out, taken, scores, names, matrix, visible, adequacy, context
    )


def worth_checking(scores: Scores, options: Options) -> dict[str, float]:
    """Candidates that may be refitted, with the amplitude that counts of each."""
    chosen = [name for name in scores.ranked if scores.best(name).drop > 0.0]
    chosen = chosen[: 2 * options.refitted]
    return {name: representative(scores, name).rung for name in chosen}
