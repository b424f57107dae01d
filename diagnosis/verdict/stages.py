"""Fits, tests and measured numbers as parts of a document.

In: what `compare`, `explain` and the rounds found. Out: the parts of `diagnosis.verdict.verdict`;
nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.adequacy.adequacy import Adequacy, HeldOutMisfit
from diagnosis.adequacy.calibration import Base
from diagnosis.adequacy.windows import WorstWindow
from diagnosis.verdict import verdict
from inversion.back_analysis.result import FittedTo, fitted_to
from inversion.estimation.budget import Runs
from inversion.estimation.data import Data, Places, Targets
from inversion.estimation.misfit import System, system
from inversion.estimation.surface_search import Fit
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import RESIDUAL_STRENGTH

#: Standard deviations to either side of a 95 % interval.
WIDE = 1.96


def parameter_words(parameters: Parameters) -> list[verdict.ParameterWords]:
    """What is calibrated, in words."""
    return [
        verdict.ParameterWords(
            name=spec.name, words=spec.words, unit=spec.unit,
            strength=spec.property == RESIDUAL_STRENGTH, low=spec.low, high=spec.high,
        )
        for spec in parameters.specs
    ]  # fmt: skip


def fitted_to_part(base: Base, targets: Targets) -> FittedTo:
    """What every model was fitted to, and which errors are in C."""
    cov = base.covariance
    parts = {
        "the survey's errors": cov.survey,
        "the place of the material points": cov.jitter,
        "the transfer scheme": cov.transfer,
        "the size of the cells": cov.resolution,
    }
    errors = [name for name, matrix in parts.items() if np.any(matrix)]
    return fitted_to(targets, base.split.fitted, errors)


def spread(fit: Fit, linear: System) -> np.ndarray:
    """Standard deviations of x (q,) at a fit, those held at a bound by what the prior leaves."""
    return np.sqrt(np.maximum(np.diag(linear.posterior), 0.0))


def stage(
    data: Data, fit: Fit, adequacy: Adequacy, window: WorstWindow | None, targets: Targets
) -> verdict.FittedModelSummary:
    """One model, calibrated and judged."""
    space, x = fit.space, fit.x
    std = spread(fit, system(data, fit.space, fit.derivative, fit.x))
    low = space.clipped(x - WIDE * std)
    high = space.clipped(x + WIDE * std)
    names = space.parameters.names
    values, lows, highs = (space.values(at) for at in (x, low, high))
    outside = (std * space.per_unit(x))[: space.p]
    return verdict.FittedModelSummary(
        effects=space.amplitudes(x),
        values=_mapping(names, values),
        std=_mapping(names, outside),
        interval_95={
            name: (float(a), float(b)) for name, a, b in zip(names, lows, highs, strict=True)
        },
        chi2=adequacy.chi2,
        dof=adequacy.dof,
        p_combined=adequacy.p_combined,
        tests=[verdict.Check(name=t.name, statistic=t.statistic, p=t.p) for t in adequacy.tests],
        groups=[
            verdict.Group(name=g.name, z=g.z, chi2=g.chi2, expected=g.expected, n=g.n)
            for g in adequacy.groups
        ],
        window=None if window is None else window_part(window, targets),
        held_out=held_out_part(adequacy.held_out),
    )


def effect_answers(
    data: Data, fit: Fit, words: dict[str, tuple[str, str]]
) -> list[verdict.EffectAnswer]:
    """Effects of a fit with their amplitudes; `words`: name -> (unit, words)."""
    space, x = fit.space, fit.x
    std = spread(fit, system(data, fit.space, fit.derivative, fit.x))
    low = space.amplitudes(space.clipped(x - WIDE * std))
    high = space.amplitudes(space.clipped(x + WIDE * std))
    answers = []
    for place, effect in enumerate(space.effects):
        unit, told = words[effect.name]
        answers.append(
            verdict.EffectAnswer(
                name=effect.name,
                amplitude=space.amplitudes(x)[effect.name],
                std=float(std[space.p + place] * effect.unit),
                interval_95=(low[effect.name], high[effect.name]),
                unit=unit,
                words=told,
            )
        )
    return answers


def window_part(window: WorstWindow, targets: Targets) -> verdict.Window:
    """The worst stretch."""
    return verdict.Window(
        measurement=window.measurement,
        axis=window.axis,
        first=targets.names[window.index[0]],
        last=targets.names[window.index[-1]],
        x_from=_number(window.begin),
        x_to=_number(window.end),
        n=len(window.index),
        chi2=window.chi2,
        p=window.p,
    )


def held_out_part(misfit: HeldOutMisfit) -> verdict.HeldOut:
    """Misfit of the held-out numbers."""
    return verdict.HeldOut(chi2=misfit.chi2, n=misfit.n, p=misfit.p)


def measurement_lines(
    targets: Targets,
    places: Sequence[Places],
    data: Data,
    survey: np.ndarray,
    base: np.ndarray,
    final: np.ndarray | None,
) -> list[verdict.MeasurementVerdict]:
    """Number by number.

    Args:
        targets: what was measured.
        places: of it.
        data: with C, and which numbers are held out.
        survey: covariance of the survey, (m, m).
        base: prediction of the base model, (m,).
        final: prediction of the final model, (m,); None: there is none.
    """
    total, own = np.sqrt(np.diag(data.covariance)), np.sqrt(np.diag(survey))
    roles = list(targets.roles)
    for place in data.held_out:
        roles[place] = "held out"
    lines = []
    for group in places:
        entry = targets.entries[targets.groups[group.index[0]]]
        for number, where in zip(group.index, group.place, strict=True):
            measured = float(targets.measured[number])
            predicted = [None if row is None else _number(row[number]) for row in (base, final)]
            residual = [
                None if value is None else float((measured - value) / total[number])
                for value in predicted
            ]
            lines.append(
                verdict.MeasurementVerdict(
                    name=targets.names[number],
                    measurement=group.name,
                    axis=group.axis,
                    place=_number(where),
                    unit=entry.unit,
                    measured=measured,
                    std_total=float(total[number]),
                    std_survey=float(own[number]),
                    predicted_base=predicted[0],
                    predicted_final=predicted[1],
                    residual_base=residual[0],
                    residual_final=residual[1],
                    role=roles[number],
                )
            )
    return lines


def runs_part(runs: Runs) -> verdict.Runs:
    """Forward runs so far. How many of them were simulated now depends on what was kept before."""
    return verdict.Runs(
        asked=runs.asked,
        computed=runs.computed,
        allowed=runs.allowance,
        cut_short=list(runs.cut_short),
    )


def _mapping(names: Sequence[str], values: np.ndarray) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _number(value: float) -> float | None:
    """A finite number, or None."""
    return float(value) if np.isfinite(value) else None
