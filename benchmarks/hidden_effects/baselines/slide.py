"""A judged slide near the fit of its base model: all that a baseline sees of it.

In: what a diagnosis found. Out: a `Slide`, a small document with the residual, its covariance, the
derivative, the signatures of all candidates and the models that were refitted. Of the measurements
it has the fitted numbers alone, k of them; what the method holds out, nobody sees.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from pydantic import Field

from diagnosis.adequacy.adequacy import fitted_rows
from diagnosis.diagnose import Diagnosis
from diagnosis.hypotheses.model import Candidate, Family
from diagnosis.options import Options
from diagnosis.selection.refit import FittedModel
from diagnosis.selection.selection import Selection
from diagnosis.signatures.signatures import Score, Signature
from inversion.estimation.data import Axis, Data, Places
from inversion.estimation.misfit import System, augmented_residual, system
from inversion.estimation.response_surface import Ladder
from inversion.problem.unknown import Scale
from pipeline.documents import StrictDocument

Vector = list[float]


class Series(StrictDocument):
    """Fitted numbers of one measurement."""

    name: str = Field(description="of the measurement")
    axis: Axis = Field(description="what `place` is")
    place: Vector = Field(description="where or when; empty: they lie along nothing")
    rows: list[int] = Field(description="their places among the fitted numbers")


class Suspect(StrictDocument):
    """A candidate with its signature at the fit of the base model."""

    name: str = Field(description="of the candidate")
    family: Family = Field(description="what it doubts")
    switch: bool = Field(description="on or off")
    unit: float = Field(description="amplitude that counts as 1")
    decades: bool = Field(description="each count more is ten times the amplitude")
    prior: tuple[float, float] | None = Field(description="mean and std in counts; null: none")
    amplitudes: Vector = Field(description="that were run, ascending")
    changes: list[Vector] = Field(description="of the fitted numbers by each of them")
    drop: float = Field(description="fall of chi2 by the score, amplitude within its bounds")
    rung: float = Field(description="amplitude of the signature with that score")
    share: float = Field(description="of that signature which lowers chi2 most")

    @property
    def ladder(self) -> Ladder:
        """Changes over the amplitude."""
        changes = dict(zip(self.amplitudes, self.changes, strict=True))
        changes[0.0] = [0.0] * len(self.changes[0])
        rungs = sorted(changes)
        scale = Scale(self.unit, "decades" if self.decades else "plain")
        return Ladder(np.array(rungs), np.array([changes[a] for a in rungs]), scale)

    @property
    def signature(self) -> np.ndarray:
        """Change by the rung of the best score, (k,)."""
        return np.array(self.changes[self.amplitudes.index(self.rung)])


class Refitted(StrictDocument):
    """A model that was calibrated by runs of its own."""

    names: list[str] = Field(description="its effects; empty: the base model")
    deviance: float = Field(description="-2 ln of its likelihood with priors, less a constant")
    free: int = Field(description="unknowns that were fitted")
    ln_strength: float = Field(description="ln of the first parameter")
    ln_std: float = Field(description="its standard deviation")


class Slide(StrictDocument):
    """What is known of a slide near the fit of its base model."""

    name: str = Field(description="of the case")
    seed: int = Field(description="that follows from the name")
    ln_strength: float = Field(description="ln of the first parameter at the fit")
    per_unit: float = Field(description="its derivative by the first unknown")
    strength_error: float = Field(description="std of ln S_r by which the slide's code may differ")
    effects_error: float = Field(description="share by which what an effect does may differ")
    residual: Vector = Field(description="measured less predicted, (k,)")
    covariance: list[Vector] = Field(description="of survey and model, (k, k)")
    derivative: list[Vector] = Field(description="of the predictions by the parameters, (k, p)")
    prior_rows: list[Vector] = Field(description="of what is known beforehand, (r, p)")
    prior_residual: Vector = Field(description="left of it at the fit, (r,)")
    moving: list[bool] = Field(description="parameters that do not rest on a bound, (p,)")
    series: list[Series] = Field(description="the measurements")
    suspects: list[Suspect] = Field(description="candidates")
    refitted: list[Refitted] = Field(description="models, the base model among them")

    @cached_property
    def system(self) -> System:
        """The linear system of the base model."""
        return self.system_with(np.zeros((len(self.residual), 0)), np.zeros(0))

    def system_with(self, columns: np.ndarray, rows: np.ndarray) -> System:
        """The same with n more unknowns.

        Args:
            columns: change of the fitted numbers by each, (k, n).
            rows: 1 over the standard deviation of each beforehand, 0: nothing is known, (n,).
        """
        k, n = columns.shape
        own = np.array(self.prior_rows).reshape(-1, len(self.moving))
        padded = np.zeros((len(own) + n, own.shape[1] + n))
        padded[: len(own), : own.shape[1]] = own
        padded[len(own) :, own.shape[1] :] = np.diag(rows)
        none = np.array([], dtype=int)
        data = Data(np.array(self.residual), np.array(self.covariance), np.arange(k), none)
        derivative = np.column_stack([np.array(self.derivative), columns])
        moving = np.append(np.array(self.moving), np.ones(n, bool))
        return System(data, derivative, padded, moving, np.zeros(len(moving)))

    @cached_property
    def augmented(self) -> np.ndarray:
        """The residual of data and priors, whitened, (k + r,)."""
        data = self.system.data
        return np.concatenate([data.whitener @ data.measured, self.prior_residual])

    def strength(self, step: float, variance: float) -> tuple[float, float]:
        """Ln of the strength and its standard deviation.

        Args:
            step: of the first unknown from the fit.
            variance: of it.
        """
        spread = math.hypot(self.per_unit * math.sqrt(max(variance, 0.0)), self.strength_error)
        return self.ln_strength + self.per_unit * step, spread

    def family_of(self, names: list[str]) -> list[Family]:
        """Families of some candidates, each once."""
        known = {one.name: one.family for one in self.suspects}
        return sorted({known[name] for name in names})


def slide_of(name: str, found: Diagnosis) -> Slide:
    """Keep what the baselines need of a diagnosis.

    Args:
        name: of the case.
        found: its diagnosis; the best candidates are refitted if that has not been done, so that
            information criteria have a choice where the tests have found nothing.
    """
    base, options = found.comparison.base, found.options
    data, fit = base.data, base.fit
    linear = system(data, fit.space, fit.derivative, fit.x)
    left = augmented_residual(data, fit.space, fit.prediction, fit.x)
    value, k = fit.space.values(fit.x)[0], len(data.fitted)
    explanation = found.explanation
    known = explanation.known
    return Slide(
        name=name,
        seed=options.seed,
        ln_strength=math.log(value),
        per_unit=float(fit.space.per_unit(fit.x)[0] / value),
        strength_error=data.strength_error,
        effects_error=options.source_effects,
        residual=_short((data.measured - fit.prediction)[data.fitted]),
        covariance=_short(data.fitted_covariance),
        derivative=_short(fit.derivative[data.fitted]),
        prior_rows=_short(linear.rows),
        prior_residual=_short(left[k:]),
        moving=linear.moving.tolist(),
        series=[_series(data, one) for one in found.comparison.places],
        suspects=[
            _suspect(known[one], explanation.signatures[one], explanation.scores.best(one), data)
            for one in explanation.names
        ],
        refitted=[_refitted(found, one) for one in _models(found)],
    )


def _models(found: Diagnosis) -> list[FittedModel]:
    """All models with refits of the best scores among them; those alone whose runs can be read."""
    selection = Selection(found.comparison, found.explanation, found.options)
    selection.tried = found.tried_models
    for key in _best(found, found.options):
        if selection.refitted([key]):
            selection.judged(key)
    return [model for model in selection.tried.models.values() if not model.unread]


def _best(found: Diagnosis, options: Options) -> list[tuple[str, ...]]:
    scores = found.explanation.scores
    promising = [name for name in found.explanation.names if scores.best(name).drop > 0.0]
    return [(name,) for name in promising[: options.refitted]]


def _refitted(found: Diagnosis, model: FittedModel) -> Refitted:
    """A model by the covariance that the method grants it."""
    context, fit = found.explanation.context.of(model), model.fit
    data = context.data_for(fit)
    left = augmented_residual(data, fit.space, fit.prediction, fit.x)
    std = system(data, fit.space, fit.derivative, fit.x).spread_with(None)[0]
    value = fit.space.values(fit.x)[0]
    return Refitted(
        names=list(model.names),
        deviance=float(left @ left) - 2.0 * data.ln_density_at_best,
        free=int(np.count_nonzero(fit.space.free)),
        ln_strength=math.log(value),
        ln_std=float(std * fit.space.per_unit(fit.x)[0] / value),
    )


def _series(data: Data, place: Places) -> Series:
    rows = fitted_rows(data, place)
    own = np.isin(place.index, data.fitted[rows])
    where = _short(place.place[own]) if place.series else []
    return Series(name=place.name, axis=place.axis, place=where, rows=rows.tolist())


def _suspect(candidate: Candidate, signature: Signature, best: Score, data: Data) -> Suspect:
    scale = candidate.scale
    return Suspect(
        name=candidate.name,
        family=candidate.family,
        switch=candidate.switch,
        unit=scale.unit,
        decades=scale.form == "decades",
        prior=candidate.counted_prior,
        amplitudes=signature.amplitudes,
        changes=[_short(signature.changes[a][data.fitted]) for a in signature.amplitudes],
        drop=best.drop,
        rung=best.rung,
        share=scale.count(best.amplitude) / scale.count(best.rung),
    )


def _short(numbers: np.ndarray) -> list:
    """Numbers of seven digits."""
    rounded = [float(f"{number:.7g}") for number in np.ravel(numbers)]
    return np.reshape(rounded, np.shape(numbers)).tolist()
