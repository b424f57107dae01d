"""Fitted models as parts of a document, and the error of each kept next to its hypothesis.

In: what `compare`, `explain` and the rounds found. Out: the parts of `diagnosis.verdict.verdict`;
nothing is decided here. `hypotheses/NN_name.json` belongs to `hypotheses/NN_name.yaml`. A model is
judged with the covariance that its fit was made with: that of the base model, or its own where the
loop has found it. What a step was made from is kept as a hash: a step of another survey, section or
setting is reported as outdated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from diagnosis.adequacy.adequacy import Adequacy, HeldOutMisfit, held_out_misfit
from diagnosis.adequacy.calibration import Base
from diagnosis.adequacy.windows import WorstWindow
from diagnosis.hypotheses.hypothesis_file import FOLDER, Hypothesis, save_hypothesis
from diagnosis.selection.quoted_strength import Quoted
from diagnosis.verdict import verdict
from diagnosis.verdict.verdict import WaterfallStep
from inversion.back_analysis.implied_strengths import NOTICED
from inversion.back_analysis.result import FittedTo, fitted_to
from inversion.estimation.budget import Runs
from inversion.estimation.data import Data, Places, Targets
from inversion.estimation.misfit import System, augmented_residual, system
from inversion.estimation.surface_search import Fit
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import RESIDUAL_STRENGTH
from pipeline.config import validate_settings
from pipeline.documents import StrictDocument
from pipeline.files import read_json, write_json

#: Standard deviations to either side of a 95 % interval.
WIDE = 1.96
#: Shares of the probability whose intervals are given, and their half widths.
INTERVALS = {0.50: 0.6745, 0.80: 1.2816, 0.95: WIDE}


def parameter_words(parameters: Parameters) -> list[verdict.ParameterWords]:
    """The calibrated parameters, in words."""
    return [
        verdict.ParameterWords(
            name=spec.name,
            words=spec.words,
            unit=spec.unit,
            strength=spec.property == RESIDUAL_STRENGTH,
            low=spec.low,
            high=spec.high,
        )
        for spec in parameters.specs
    ]


def fitted_to_part(base: Base, targets: Targets) -> FittedTo:
    """What every model was fitted to, and which errors are in C."""
    cov = base.covariance
    parts = {
        "the survey's errors": cov.survey,
        **dict(zip(verdict.SOLVER_ERRORS, (cov.jitter, cov.transfer, cov.resolution), strict=True)),
        "the code that made the slide": cov.source,
        "the engine's own error": cov.engine,
    }
    parts = {name: matrix for name, matrix in parts.items() if np.any(matrix)}
    fitted = base.split.fitted
    own = np.ix_(fitted, fitted)
    weight = np.linalg.inv(base.data.covariance[own])
    shares = {
        name: round(float(np.sum(weight * matrix[own])) / int(fitted.sum()), 3)
        for name, matrix in parts.items()
    }
    return fitted_to(targets, fitted, list(parts), shares)


def stage(
    data: Data,
    fit: Fit,
    adequacy: Adequacy,
    window: WorstWindow | None,
    targets: Targets,
    assumed: Mapping[str, np.ndarray] | None = None,
    error: np.ndarray | None = None,
) -> verdict.FittedModelSummary:
    """One model, calibrated and judged.

    Args:
        data: the measurements.
        fit: the model at its fit.
        adequacy: its tests.
        window: where it fails worst.
        targets: the measurements by their names.
        assumed: change of all predictions (m,) by a standard deviation of each assumption of which
            one is stated; None: not known.
        error: that its effects bring, C' - C (m, m); None: none is known.
    """
    space, x = fit.space, fit.x
    linear = system(data, fit.space, fit.derivative, fit.x)
    free = [change for name, change in (assumed or {}).items() if name not in fit.names]
    wider = linear.with_assumed(free).spread_with(error)[: space.size]
    names = space.parameters.names
    values, interval = fitted_values(data, fit, error)
    outside = (linear.spread_with(error) * space.per_unit(x))[: space.p]
    return verdict.FittedModelSummary(
        effects=space.amplitudes(x),
        values=values,
        std=_mapping(names, outside),
        std_assumed=_mapping(names, (wider * space.per_unit(x))[: space.p]) if free else {},
        interval_95=interval,
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
        asked=asked_strengths(data, fit, targets),
    )


def fitted_values(
    data: Data, fit: Fit, error: np.ndarray | None
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Parameters of a fit by name, and their 95 % intervals, cut at the bounds."""
    names = fit.space.parameters.names
    value, low, high = _ends(fit, fit.x, system(data, fit.space, fit.derivative, fit.x), error)
    ends = zip(low, high, strict=True)
    return dict(zip(names, value, strict=True)), dict(zip(names, ends, strict=True))


def _ends(fit: Fit, x: np.ndarray, linear: System, error: np.ndarray | None) -> list[list[float]]:
    """Parameters (p,) at x, and the ends of their 95 % intervals."""
    std, space = linear.spread_with(error), fit.space
    return [space.values(space.clipped(x + far * std)).tolist() for far in (0.0, -WIDE, WIDE)]


def asked_strengths(data: Data, fit: Fit, targets: Targets) -> list[verdict.AskedStrength]:
    """What the numbers of each measurement ask for without all others, linear at a fit.

    Other parameters give way within what is known of them beforehand; amplitudes stay.
    """
    known = np.isfinite(fit.prediction) & np.isfinite(fit.derivative).all(axis=1)
    found: list[verdict.AskedStrength] = []
    for place, entry in enumerate(targets.entries):
        own = known & (np.array(targets.groups) == place)
        for role, chosen in (("fitted", data.fitted), ("held out", data.held_out)):
            alone = replace(data, fitted=chosen[own[chosen]])
            if len(alone.fitted):
                found += _asked(alone, fit, {"measurement": entry.name, "role": role})
    return found


def _asked(alone: Data, fit: Fit, of: dict[str, Any]) -> list[verdict.AskedStrength]:
    """What one measurement asks of every strength that it notices."""
    space, p = fit.space, fit.space.p
    linear = system(alone, space, fit.derivative, fit.x)
    linear = replace(linear, moving=space.free & (np.arange(space.size) < p))
    x = fit.x + linear.imitating(augmented_residual(alone, space, fit.prediction, fit.x))
    halved = np.log(2.0) / space.parameters.prior_std
    moved = np.linalg.norm(alone.whitened(fit.derivative)[:, :p], axis=0) * halved
    found = zip(space.parameters.specs, moved, *_ends(fit, x, linear, None), strict=True)
    return [
        verdict.AskedStrength(parameter=spec.name, value=value, interval_95=(low, high), **of)
        for spec, much, value, low, high in found
        if spec.property == RESIDUAL_STRENGTH and much >= NOTICED
    ]


def effect_answers(
    data: Data,
    fit: Fit,
    words: dict[str, tuple[str, str]],
    error: np.ndarray | None = None,
) -> list[verdict.EffectAnswer]:
    """Effects of a fit with their amplitudes.

    Args:
        data: measurements with C.
        fit: the model.
        words: name -> (unit, words).
        error: that the effects bring, C' - C (m, m); None: none is known.
    """
    space, x = fit.space, fit.x
    std = system(data, fit.space, fit.derivative, fit.x).spread_with(error)
    low = space.amplitudes(space.clipped(x - WIDE * std))
    high = space.amplitudes(space.clipped(x + WIDE * std))
    answers = []
    for place, effect in enumerate(space.effects):
        unit, description = words[effect.name]
        answers.append(
            verdict.EffectAnswer(
                name=effect.name,
                amplitude=space.amplitudes(x)[effect.name],
                std=float((std * space.per_unit(x))[space.p + place]),
                interval_95=(low[effect.name], high[effect.name]),
                unit=unit,
                words=description,
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
        targets: the measurements.
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
                    censored=entry.censored,
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


def quoted_part(
    found: Quoted, fit: Fit, beyond: float, models: list[verdict.NamedSet]
) -> dict[str, verdict.QuotedValue]:
    """What to use of each parameter; `fit`: of any of the `models`, `beyond`: as in `quoted`."""
    space, p = fit.space, fit.space.p
    rest = fit.x[p:]

    def outside(x: np.ndarray) -> np.ndarray:
        return space.values(space.clipped(np.concatenate([x, rest])))

    middle = np.concatenate([found.x, rest])
    std = found.std * space.per_unit(middle)[:p]
    ends = {
        f"{share:.0%}": [outside(found.x + sign * wide * found.std) for sign in (-1.0, 1.0)]
        for share, wide in INTERVALS.items()
    }
    return {
        name: verdict.QuotedValue(
            value=float(outside(found.x)[k]),
            std=float(std[k]),
            intervals={key: (float(low[k]), float(high[k])) for key, (low, high) in ends.items()},
            models=models,
            beyond=beyond if strength else 0.0,
        )
        for k, (name, strength) in enumerate(
            zip(space.parameters.names, space.parameters.strengths, strict=True)
        )
    }


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


class KeptStep(StrictDocument):
    """A step and what it was made from."""

    made_from: str = Field(description="hash of case, settings and model")
    step: WaterfallStep = Field(description="the error of the model")


@dataclass(frozen=True)
class Judgement:
    """A fit under a given covariance.

    Attributes:
        fit: settled under it, linear around where it was.
        std: of the parameters, outside units (p,).
        dof: degrees of freedom.
        held_out: chi2 and number of the held-out numbers.
    """

    fit: Fit
    std: np.ndarray
    dof: int
    held_out: tuple[float, int]


def judge(data: Data, fit: Fit) -> Judgement:
    """A fit under the covariance that it was made with."""
    space = fit.space
    linear = system(data, space, fit.derivative, fit.x)
    std = (linear.spread_with(None) * space.per_unit(fit.x))[: space.p]
    misfit = held_out_misfit(fit, linear)
    return Judgement(fit, std, linear.dof, (misfit.chi2, misfit.n))


def judge_again(data: Data, fit: Fit) -> Judgement:
    """A fit under another covariance than that it was made with: one linear step settles it."""
    space = fit.space
    linear = system(data, space, fit.derivative, fit.x)
    residual = augmented_residual(data, space, fit.prediction, fit.x)
    x = space.clipped(fit.x + linear.imitating(residual))
    prediction = fit.prediction + fit.derivative @ (x - fit.x)
    left = augmented_residual(data, space, prediction, x)
    return judge(data, replace(fit, x=x, prediction=prediction, total=float(left @ left)))


def step_of(
    name: str,
    number: int,
    judged: Judgement,
    *,
    note: str,
    effects: dict[str, float] | None = None,
    ln_evidence: float | None = None,
) -> WaterfallStep:
    """The error of a model.

    Args:
        name: of the model.
        number: round of the loop, or how many models were before it.
        judged: its fit under the covariance of the base model.
        note: the step taken.
        effects: that are on with a fixed amplitude, in addition to those of the fit.
        ln_evidence: over the base model, where they can be compared.
    """
    space, x = judged.fit.space, judged.fit.x
    names = space.parameters.names
    chi2, n = judged.held_out
    return WaterfallStep(
        round=number,
        hypothesis=name,
        effects={**(effects or {}), **space.amplitudes(x)},
        values={key: float(value) for key, value in zip(names, space.values(x), strict=True)},
        std={key: float(value) for key, value in zip(names, judged.std, strict=True)},
        chi2=judged.fit.total,
        dof=judged.dof,
        held_out_chi2=chi2 if n else None,
        held_out_n=n,
        ln_evidence=ln_evidence,
        note=note,
    )


def keep(
    folder: Path, name: str, model: Hypothesis | None, step: WaterfallStep, made_from: str
) -> None:
    """Write a step, and its model's file unless a person has written it."""
    path = folder / FOLDER / f"{name}.yaml"
    if model is not None:
        save_hypothesis(model, path)
    kept = KeptStep(made_from=made_from, step=step)
    write_json(path.with_suffix(".json"), kept.model_dump(mode="json"))


def kept_step(folder: Path, name: str) -> KeptStep | None:
    """The step of a model; None where it has not been judged yet."""
    path = folder / FOLDER / f"{name}.json"
    if not path.is_file():
        return None
    return validate_settings(KeptStep, read_json(path), origin=str(path))
