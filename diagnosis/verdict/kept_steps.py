"""The error of each model of a diagnosis, kept beside its file, so that `track` can tell the way.

`hypotheses/NN_name.json` belongs to `hypotheses/NN_name.yaml`. Misfits can be compared only
with one covariance, so every model is judged with that of the base model. What a step was made
from is kept as a hash: a step of another survey, section or setting is reported as outdated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import Field

from diagnosis.adequacy.adequacy import held_out_misfit
from diagnosis.hypotheses.hypothesis_file import FOLDER, Hypothesis, save_hypothesis
from diagnosis.verdict.stages import spread
from diagnosis.verdict.verdict import WaterfallStep
from inversion.estimation.data import Data
from inversion.estimation.misfit import augmented_residual, system
from inversion.estimation.surface_search import Fit
from pipeline.config import validate_settings
from pipeline.documents import StrictDocument
from pipeline.files import read_json, write_json


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
    std = (spread(fit, linear) * space.per_unit(fit.x))[: space.p]
    misfit = held_out_misfit(fit, linear)
    return Judgement(fit, std, linear.dof, (misfit.chi2, misfit.n))


def judge_anew(data: Data, fit: Fit) -> Judgement:
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
        note: what was done.
        effects: that are on and not sought, beside those of the fit.
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
