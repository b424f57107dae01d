"""The error of a model with effects, found at its own fit (steps 1 and 8).

C and the correction for the cells are those of the base model at its fit. An effect changes both: a
slide that runs on strengths that vanish somewhere is noisier than one of even strength, and finer
cells move it otherwise. A model that is compared with others is therefore measured as the base
model was: runs with other jitters, with the second transfer scheme and with finer cells, at its fit
(`with_own_error`). Its predictions are then corrected by what its own cells take, and its misfit
weighed by its own C, which grants it no less than the base model is granted. ln det C enters the
evidence: a noisier model fits more easily and is penalised for it.

A model that was not measured so is judged with the change of these differences against the base
model as error, the whole of it doubted (`doubting`):

    C' = C + b_t b_t' + (k_0^2 + s^2) (0.7 b b' + 0.3 diag b^2)

k_0 and s are the share of b by which predictions are corrected and its standard deviation
(`inversion.estimation.covariance`).

A further effect has to be worth having with the error of those before. In C it would be asked for
by what the cells make of the first, as softening was with a large pore pressure.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis.adequacy.calibration import Base, errors_at, paired, replicates_at
from diagnosis.options import Options
from diagnosis.selection.refit import FittedModel, RefitContext, around, judge, weighed
from inversion.estimation.covariance import covariance, mean_of, not_less
from inversion.estimation.misfit import total_of
from inversion.estimation.response_surface import Surface, Surrogate, spreads
from inversion.estimation.surface_search import SEEN, settled


def with_own_error(
    context: RefitContext, base: Base, model: FittedModel, options: Options
) -> FittedModel:
    """A model with its own error and its own correction for the cells, settled and judged again.

    As it is where it has none of its own (errors of the survey), where it is known already, and
    where the allowance does not cover the runs or none can be read.

    Args:
        context: with C.
        base: the base model; its `cells` learn.
        model: with effects, judged by fresh jitters.
        options: which parts of the model's own error there are.
    """
    fit = model.fit
    acting = set(model.names) - context.exact
    if model.own is not None or model.unread or not acting or not options.numerical_covariance:
        return model
    state = fit.space.state(fit.x)
    seeds = range(options.replicates + 1)
    finer = paired(state, options).get("fine")
    wanted = [
        *(replace(state, seed=seed) for seed in seeds),
        *paired(state, options).values(),
        *(replace(finer, seed=seed) for seed in range(options.finer_runs) if finer is not None),
    ]
    if not context.runs.affords(wanted, f"the error of {' + '.join(model.names)}"):
        return model
    context.runs.predict(wanted)  # in one batch
    replicates = replicates_at(context.runs, fit.space, fit.x, options)
    if np.count_nonzero(np.all(np.isfinite(replicates), axis=1)) < 3:
        return model
    cov, missing = errors_at(context.runs, base.cells.targets, state, replicates, options)
    amplitudes = {name: a for name, a in state.effects if name in acting}
    base.cells.models[tuple(sorted(amplitudes))] = (amplitudes, missing - base.cells.missing)
    granted = not_less(cov, base.covariance)
    own = replace(context, data=replace(context.data, covariance=granted))
    own = replace(context, data=own.data_for(fit), share=0.0)
    anchored = mean_of(replicates_at(context.runs, fit.space, fit.x, options))
    surface = Surface(fit.space, fit.x, anchored, fit.derivative)
    known = spreads(own.data, surface, fit.space, context.jitter, anchored_by=len(replicates))
    surrogate = Surrogate(surface, fit.space, known)
    surrogate.recall(context.runs)
    found = settled(own.data, surrogate, [fit.x])
    weighed_own = weighed(own, found, around(found), surrogate)
    moved = np.max(np.abs(found.x - fit.x)) >= SEEN
    settled_own = replace(weighed_own, judged=not moved, own=own.data)
    return judge(own, settled_own) if moved else settled_own


def doubting(
    context: RefitContext, base: Base, model: FittedModel, options: Options
) -> RefitContext | None:
    """The context at which what is added to a model is judged: with its errors in place of C.

    Args:
        context: with C.
        base: the base model; its paired runs are known.
        model: the adopted model, with effects.
        options: which parts of the model's own error there are.

    Returns:
        the context with the model's own errors, or with C'; with C where nothing is asked; None
        where the allowance does not cover the runs.
    """
    if model.own is not None:
        return context.of(model)
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
    """A model with its misfit and evidence at another context; its unknowns stay.

    One whose own errors are known stays as it is.
    """
    if model.own is not None:
        return model
    fit = model.fit
    total = total_of(context.data, fit.space, fit.prediction, fit.x)
    found = weighed(context, replace(fit, total=total), model.surface, model.surrogate)
    return replace(
        found,
        judged=model.judged,
        sloped=model.sloped,
        unread=model.unread,
        explains=model.explains,
    )
