"""Which value of a parameter is quoted, and with which standard deviation.

- Where the measurements are explained: the mixture of the explanations of the 90 % set, all of one
  weight. Of a single one that is its own fit. Probabilities do not weigh: which of them is true
  decides the strength, and with equal weights two standard deviations reach the value by each of up
  to five.
  Where a little of a large misfit is left (`decide.not_enough`), its standard deviation is widened
  as below.
- Where they are not (suspect, unknown effect): nobody knows which model is wrong
  by how much. The mixture is then of the base model and of every model that was tried and lowers
  chi2 by as much as acceptance asks for, all of one weight. Each standard deviation is widened by
  the Birge ratio sqrt(chi2 / dof) where that is above 1. So a false name cannot sharpen a strength.

A strength is widened besides by what such verdicts have left unknown on slides whose truth is known
(`track_record.Worth.beyond`): no list holds all that can be missing.

With weights w, means x and standard deviations s in fitted units (logarithms of strengths),

    x_q = sum w x,     s_q^2 = sum w (s^2 + (x - x_q)^2) + b^2

(law of total variance), b what is beyond the list. s is that of the fit, made by C, under C'
(`System.spread_with`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.selection.refit import FittedModel, RefitContext
from diagnosis.track_record import Verdicts
from inversion.estimation.misfit import system

EXPLAINED: tuple[Verdicts, ...] = ("adequate", "identified", "ambiguous")
"""Verdicts by which the measurements are explained."""


@dataclass(frozen=True)
class Quoted:
    """Values that are quoted.

    Attributes:
        x: of the parameters, fitted units (p,).
        std: in the same units, (p,).
        models: explanations it is made of: effects -> weight.
    """

    x: np.ndarray
    std: np.ndarray
    models: dict[tuple[str, ...], float]


def quoted(
    context: RefitContext,
    models: Mapping[tuple[str, ...], FittedModel],
    weights: Mapping[tuple[str, ...], float],
    *,
    error: np.ndarray | None,
    widened: bool,
    beyond: float = 0.0,
) -> Quoted:
    """Mix models.

    Args:
        context: measurements with C.
        models: every model that is mixed, by its effects.
        weights: of the same; need not add up to 1.
        error: C' - C at the answer, (m, m), for models with effects and no error of their own;
            None: none is known.
        widened: by the Birge ratio.
        beyond: standard deviation of their logarithm that strengths have besides.
    """
    total = sum(weights.values())
    share = {names: weight / total for names, weight in weights.items()}
    means, variances = [], []
    for names in share:
        model = models[names]
        fit, p = model.fit, model.fit.space.p
        linear = system(context.of(model).data, fit.space, fit.derivative, fit.x)
        spread = linear.spread_with(error if names and model.own is None else None)[:p]
        birge = max(fit.total / linear.dof, 1.0) if widened and linear.dof > 0 else 1.0
        means.append(fit.x[:p])
        variances.append(birge * spread**2)
    w, x = np.array(list(share.values())), np.array(means)
    middle = w @ x
    variance = w @ (np.array(variances) + (x - middle) ** 2)
    parameters = models[next(iter(share))].fit.space.parameters
    values = parameters.to_values(middle)
    unlisted = parameters.strengths * beyond * values / parameters.value_per_fitted(values)
    return Quoted(middle, np.sqrt(variance + unlisted**2), share)


def equal_weights(explanations: Iterable[tuple[str, ...]]) -> dict[tuple[str, ...], float]:
    """Weights of explanations of which each may be the true one."""
    return dict.fromkeys(explanations, 1.0)


def unexplained(
    models: Mapping[tuple[str, ...], FittedModel], least_drop: float
) -> dict[tuple[str, ...], float]:
    """Weights where nothing explains: the base model, and all that fit clearly better."""
    base = models[()].fit
    better = [
        names
        for names, model in models.items()
        if base.total - model.fit.total >= least_drop and not model.unread
    ]
    return equal_weights([(), *better])
