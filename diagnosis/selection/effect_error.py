"""What a model errs more once it has an effect (steps 1 and 8).

C holds the model's own error where the base model fits. An effect that has been adopted brings an
error in proportion to its size: what it does depends on the cells and the transfer scheme, too. At
the fit with the effect the paired runs of step 1 are made once more, and by what their differences
have changed, b_t and b, the covariance grows:

    C' = C + b_t b_t' + (k_0^2 + s^2) (0.7 b b' + 0.3 diag b^2)

k_0 and s are the share of b by which predictions are corrected and its standard deviation
(`inversion.estimation.covariance`): the correction is that of the base model, so all of b is doubt.

A further effect has to be worth having in C'. In C it would be asked for by what the cells make of
the first, as softening was with a large pore pressure.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis.adequacy.calibration import Base, paired
from diagnosis.options import Options
from diagnosis.selection.refit import FittedModel, RefitContext, weighed
from inversion.estimation.covariance import covariance
from inversion.estimation.misfit import total_of


def doubting(
    context: RefitContext, base: Base, model: FittedModel, options: Options
) -> RefitContext | None:
    """The context at which what is added to a model is judged: with C' in place of C.

    Args:
        context: with C.
        base: the base model; its paired runs are known.
        model: the adopted model, with effects.
        options: which parts of the model's own error there are.

    Returns:
        the context with C'; with C where nothing is asked; None where the allowance does not cover
        the runs.
    """
    ends = (model.fit.space.state(model.fit.x), base.fit.space.state(base.surface.x))
    kinds = list(paired(ends[0], options))
    if not options.numerical_covariance or not kinds:
        return context
    states = [state for own in ends for state in (own, *paired(own, options).values())]
    if not context.runs.affords(states, f"the error of {' + '.join(model.names)}"):
        return None
    with_effects, without = np.split(context.runs.predict(states), 2)
    grown = (with_effects - with_effects[0]) - (without - without[0])
    change = dict(zip(kinds, grown[1:], strict=True))
    covered = covariance(
        context.data.covariance,
        transfer=change.get("transfer"),
        finer=change.get("fine"),
        factor=float(np.hypot(options.finer_share, options.finer_share_std)),
    )
    return replace(context, data=replace(context.data, covariance=covered.total))


def weighed_again(context: RefitContext, model: FittedModel) -> FittedModel:
    """A model with its misfit and evidence at another context; its unknowns stay."""
    fit = model.fit
    total = total_of(context.data, fit.space, fit.prediction, fit.x)
    found = weighed(context, replace(fit, total=total), model.surface, model.surrogate)
    return replace(found, judged=model.judged, sloped=model.sloped, unread=model.unread)
