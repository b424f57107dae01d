"""Models that were tried on the way to an answer, and when one of them is accepted (step 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.adequacy.adequacy import Adequacy, ProjectedFit
from diagnosis.options import Options
from diagnosis.reason import Reason
from diagnosis.selection.effect_error import weighed_again
from diagnosis.selection.refit import FittedModel, RefitContext
from diagnosis.signatures.signatures import Scores
from pipeline.ties import ranked


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
        untried: requested models that were not fitted, or not to the end: too few runs were left,
            or all failed.
        context: at which models are compared; once effects were adopted, with the error they bring.
        doubted: tests of the current model with the error that its effects bring, C'; None: it has
            no effects, or the runs for it were not allowed.
        error: what these effects add to C, C' - C (m, m); None as above.
    """

    models: dict[tuple[str, ...], FittedModel] = field(default_factory=dict)
    way: list[AdoptedModel] = field(default_factory=list)
    first: dict[str, tuple[FittedModel, Reason | None]] = field(default_factory=dict)
    untried: list[tuple[str, ...]] = field(default_factory=list)
    context: RefitContext | None = None
    doubted: Adequacy | None = None
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
) -> Reason | None:
    """The condition for acceptance that fails; None if none does.

    Args:
        before: the model so far.
        after: the one with an effect more.
        options: settings of the diagnosis.
        together: ln evidence of all that were tried, in place of that of this model alone.
    """
    if after.unread:
        return Reason(kind="unread")
    gain = after.ln_evidence - before.ln_evidence
    drop = before.fit.total - after.fit.total
    if drop <= options.least_drop:
        return Reason(kind="small_fall", numbers=[drop, options.least_drop])
    if (gain if together is None else together - before.ln_evidence) <= options.least_gain:
        return Reason(kind="small_gain", numbers=[gain, options.least_gain])
    if parameter := at_new_bound(before, after):
        return Reason(kind="at_bound", of=parameter)
    held_out = after.held_out
    worse = before.held_out.ln_density - held_out.ln_density
    failing = held_out.p is not None and held_out.p < options.suspect
    if failing and worse > options.worse_held_out * gain:
        return Reason(kind="held_out_rises", numbers=[before.held_out.chi2, held_out.chi2])
    return None


def at_new_bound(before: FittedModel, after: FittedModel) -> str:
    """A parameter or an amplitude that ends on a bound of what is believed; empty: none does."""
    resting = set(before.fit.space.at_bound(before.fit.x))
    return next((n for n in after.fit.space.at_bound(after.fit.x) if n not in resting), "")


def compared(models: Sequence[FittedModel]) -> dict[tuple[str, ...], float]:
    """Ln evidence by which models are compared with each other, by their effects.

    Those that explain have together what their evidence says, and each has its share by what it
    explains down to the noise. Where C is generous, or holds an error that is the same all along a
    series, a flexible effect fits that error as well: a misfit below noise is no evidence for it
    and against a model that leaves what noise leaves.
    """
    found = {model.names: model.ln_evidence for model in models}
    equal = [model for model in models if model.explains]
    if len(equal) < 2:
        return found
    credit = np.array([model.ln_credit for model in equal])
    whole = np.logaddexp.reduce([model.ln_evidence for model in equal])
    shares = credit - np.logaddexp.reduce(credit) + whole
    return found | {model.names: float(s) for model, s in zip(equal, shares, strict=True)}


def accepted(
    now: FittedModel, tried: Sequence[FittedModel], options: Options
) -> FittedModel | None:
    """The model that is adopted: the best by itself, or the best for all that were tried.

    Explanations that look alike share the evidence among them: each by itself may have too little
    although together they leave no doubt that something is missing. Then the question "is there
    anything?" is put to their sum, and "what is it?" has several answers.
    """
    read = [model for model in tried if not model.unread]
    evidence = compared(read)
    order = ranked(read, lambda after: evidence[after.names])
    for after in order:
        if not why_not(now, after, options):
            return after
    if not order:
        return None
    together = float(np.logaddexp.reduce([after.ln_evidence for after in order]))
    return None if why_not(now, order[0], options, together=together) else order[0]


def accepted_here(
    tried_models: TriedModels, before: FittedModel, tried: Sequence[FittedModel], options: Options
) -> FittedModel | None:
    """The model that is adopted, by the context at which models are compared now.

    It must be worth having without the error of the effects so far, too: where they err much, that
    error forgives everything.
    """
    left = list(tried)
    while True:
        best = accepted(
            tried_models.weighed(before), [tried_models.weighed(model) for model in left], options
        )
        if best is None:
            return None
        model = tried_models.models[best.names]
        if model.ln_evidence > before.ln_evidence:
            return model
        left = [other for other in left if other.names != best.names]
