"""What each way of naming answers: nearest signature, information criteria, the method itself.

In: a `Slide`, or the digest of a verdict. Out: an `Answer`: a name or nothing, how sure, and S_r.

*Nearest signature*: the candidate whose signature takes most off chi2, the parameters refitted in
a line; below 3.84, which noise passes once in twenty with one signature, nothing. *AIC* and *BIC*:
-2 ln L + 2 q and + q ln k over the models that were refitted, q unknowns, k numbers; S_r is the
mean over the models by their weights (Burnham and Anderson 2002).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field
from scipy.special import logsumexp

from benchmarks.hidden_effects.baselines.slide import Slide
from benchmarks.hidden_effects.foreign.hidden import THINGS
from benchmarks.hidden_effects.scoring.by_other_codes import gives_name, right_for
from benchmarks.hidden_effects.scoring.score import Judged
from benchmarks.studies.deserved_names import explains, figures_of
from diagnosis.hypotheses.model import Family
from diagnosis.track_record import name_record
from pipeline.documents import StrictDocument
from pipeline.ties import largest, largest_place

#: Fall of chi2 by one signature from which something is named: 95 % with one degree of freedom.
SEEN = 3.84
#: Standard deviations to either side of a 95 % interval.
WIDE = 1.96


class Answer(StrictDocument):
    """What is said of a slide."""

    names: list[str] = Field(description="effects; empty: no name")
    families: list[Family] = Field(description="of the names, or given in their place")
    members: list[str] = Field(default_factory=list, description="that would do as well")
    given: bool = Field(description="by the rule of who answers, the name is given")
    alarm: bool = Field(description="something is missing, whatever it is")
    confidence: float = Field(description="the higher, the surer; each method has its own scale")
    ln_strength: float = Field(description="ln of S_r")
    ln_std: float = Field(description="its standard deviation")

    def right(self, truth: Mapping[str, Any]) -> bool:
        """The names stand for what was hidden, and for nothing else."""
        hidden = truth["effects"]
        if "source" not in truth:
            return bool(hidden) and set(self.names) == set(hidden)
        if not hidden or not self.names:
            return False
        # Several names are right one by one, unless they are one answer of a family.
        one = len(self.names) == 1 or bool(self.members)
        families = frozenset[str](self.families if one else [])
        thing = THINGS[next(iter(hidden))]
        return right_for(thing, set(self.names), families, set(self.members))

    def strength_error(self, truth: Mapping[str, Any]) -> float:
        """Ln of S_r over its truth."""
        return self.ln_strength - math.log(next(iter(truth["parameters"].values())))

    def holds(self, truth: Mapping[str, Any]) -> bool:
        """Its 95 % interval of S_r holds the truth."""
        return abs(self.strength_error(truth)) <= WIDE * self.ln_std


def answer_of(
    slide: Slide, names: list[str], confidence: float, strength: tuple[float, float]
) -> Answer:
    """An answer that gives what it names.

    Args:
        slide: of which it is said.
        names: effects; empty: nothing is missing.
        confidence: that of the method.
        strength: ln S_r and its standard deviation.
    """
    return Answer(
        names=names,
        families=slide.family_of(names),
        given=bool(names),
        alarm=bool(names),
        confidence=round(confidence, 4),
        ln_strength=round(strength[0], 5),
        ln_std=round(strength[1], 5),
    )


def nearest_signature(slide: Slide) -> Answer:
    """The candidate that promises most."""
    linear, left = slide.system, slide.augmented
    best = largest(slide.suspects, lambda one: one.drop)
    if best.drop < SEEN:
        step, variance = linear.imitating(left)[0], linear.posterior[0, 0]
        return answer_of(slide, [], best.drop, slide.strength(step, variance))
    change = best.signature
    step = linear.imitating(left - best.share * linear.augmented(change))[0]
    if not best.switch:
        prior = best.ladder.scale.count(best.rung) / best.prior[1] if best.prior else 0.0
        linear = slide.system_with(change[:, None], np.array([prior]))
    strength = slide.strength(step, linear.posterior[0, 0])
    return answer_of(slide, [best.name], best.drop, strength)


def by_criterion(slide: Slide, per_unknown: float) -> Answer:
    """The refitted model with the least -2 ln L + `per_unknown` times its unknowns."""
    models = slide.refitted
    half = np.array([-0.5 * (one.deviance + per_unknown * one.free) for one in models])
    ln_weights = half - logsumexp(half)
    first, weights = largest_place(ln_weights), np.exp(ln_weights)
    rest = np.delete(ln_weights, first)
    odds = ln_weights[first] - logsumexp(rest) if len(rest) else math.inf
    means, stds = (
        np.array([getattr(one, key) for one in models]) for key in ("ln_strength", "ln_std")
    )
    mean = float(weights @ means)
    std = math.sqrt(weights @ (stds**2 + (means - mean) ** 2))
    return answer_of(slide, models[first].names, min(odds, 1e3), (mean, std))


def aic(slide: Slide) -> Answer:
    """Akaike's criterion; its confidence is ln of the odds by the weights."""
    return by_criterion(slide, 2.0)


def bic(slide: Slide) -> Answer:
    """Schwarz's criterion."""
    return by_criterion(slide, math.log(len(slide.residual)))


def own_answer(one: Judged) -> Answer:
    """What the diagnosis has said; the explanation it has, given or not, with its chance."""
    digest = one.digest
    names = (list(digest.effects) or digest.set_90[0]) if explains(one) else []
    strength = next(iter(one.truth["parameters"]))
    low, high = map(math.log, digest.quoted[strength]["95%"])
    families = digest.families or sorted({digest.family_of.get(name, "") for name in names} - {""})
    return Answer(
        names=names,
        families=families,
        members=digest.members,
        given=gives_name(one),
        alarm=one.alarmed,
        confidence=round(name_record().chance(figures_of(one)), 4) if names else 0.0,
        ln_strength=round(0.5 * (low + high), 5),
        ln_std=round(0.5 * (high - low) / WIDE, 5),
    )
