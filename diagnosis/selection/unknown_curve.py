"""Step 11: the strength curve that would explain a misfit which no candidate explains.

    S = S_r exp(sum_j c_j phi_j(u)),    phi_j: hat functions over 4 to 7 knots in one variable u

The calibrated strengths stay where they are: level and shape are the curve's. Each coefficient is
run once; the variables are ranked by what their curves promise, linear in the coefficients; the
best two are calibrated like any model with effects. A coefficient that the measurements do not see
stays at its prior, multiplier 1 within a factor of exp(0.6), and its band says so. The curve is a
clue to what is missing. No strength is ever reported from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypotheses.model import Curve
from diagnosis.selection.refit import ANCHORED, FittedModel, RefitContext, judge, refit, weighed
from diagnosis.signatures.signatures import run_moved
from inversion.estimation.misfit import system
from inversion.estimation.response_surface import Ladder, Surface, Surrogate, anchor_of, spreads
from inversion.estimation.surface_search import settled
from inversion.estimation.unknowns import Unknowns
from inversion.problem.unknown import Scale, Unknown
from pipeline.ties import largest, ranked

#: Standard deviation of a coefficient beforehand, in the logarithm of the strength. By judgement: a
#: factor of 1.8, about that of parts of one soil (`hypotheses.strength.CONTRAST_STD`).
PRIOR_STD = 0.6
#: Variables whose curves are calibrated, the others are only estimated. By judgement: an estimate
#: is linear, so that the second may be the best; each takes about 12 runs.
CALIBRATED = 2


@dataclass(frozen=True)
class FoundCurve:
    """The best curve, and how the others did.

    Attributes:
        curve: variable and knots.
        coefficients: ln multiplier at the knots, (k,).
        std: of the same, (k,).
        chi2: variable -> sum of squares with its curve.
        ln_evidence: variable -> gain over the model before, without prior odds.
        calibrated: variables whose curve was calibrated by runs; the others are linear estimates.
        model: the calibrated model with the curve.
    """

    curve: Curve
    coefficients: np.ndarray
    std: np.ndarray
    chi2: dict[str, float]
    ln_evidence: dict[str, float]
    calibrated: tuple[str, ...]
    model: FittedModel

    @property
    def multiplier(self) -> np.ndarray:
        """Of the calibrated strength at the knots, (k,)."""
        return np.exp(self.coefficients)

    @property
    def band(self) -> tuple[np.ndarray, np.ndarray]:
        """16 % and 84 % limits of the multiplier, (k,) each."""
        return np.exp(self.coefficients - self.std), np.exp(self.coefficients + self.std)


def runs_wanted(curves: Sequence[Curve]) -> int:
    """Forward runs that seeking a curve takes about."""
    return sum(len(curve.knots) for curve in curves) + 1 + 12 * CALIBRATED


def find_curve(
    context: RefitContext, before: FittedModel, curves: Sequence[Curve]
) -> FoundCurve | None:
    """Seek the variable whose strength curve explains the misfit best.

    Args:
        context: the model and its measurements.
        before: the model that still fails; its effects stay in.
        curves: variables that may be tried.

    Returns:
        the best curve; None where no strength is calibrated, no run succeeded or none was allowed.
    """
    strengths = tuple(int(place) for place in np.flatnonzero(context.base.parameters.strengths))
    if not strengths:
        return None
    base = Unknowns(context.base.parameters, (), strengths)
    amplitudes = {
        name: Unknown(
            name, -curve.limit, curve.limit, Scale(curve.step), (0.0, PRIOR_STD / curve.step)
        )
        for curve in curves
        for name in curve.names
    }
    # One curve is one hypothesis, however many coefficients it has: no odds for each.
    context = replace(context, base=base, amplitudes={**context.amplitudes, **amplitudes}, count=1)
    own = weighed(context, before.fit, before.surface)
    surface = _with_coefficients(context, before, curves)
    estimates = {}
    for curve in curves:
        if all(name in surface.ladders for name in curve.names):
            names = (*before.names, *curve.names)
            found = _estimated(context, surface, names)
            estimates[curve.variable] = (curve, names, found)
    order = ranked(estimates, lambda variable: estimates[variable][2].ln_evidence)
    fits = {variable: estimates[variable][2] for variable in order}
    calibrated = []
    for variable in order[:CALIBRATED]:
        refitted = refit(context, surface, estimates[variable][1], seeds=ANCHORED)
        if refitted is not None:
            fits[variable] = judge(context, refitted)
            calibrated.append(variable)
    if not calibrated:
        return None
    best = largest(calibrated, lambda variable: fits[variable].ln_evidence)
    fit, curve = fits[best].fit, estimates[best][0]
    places = [fit.space.p + fit.space.names.index(name) for name in curve.names]
    linear = system(context.data, fit.space, fit.derivative, fit.x)
    # Of the strength as calibrated before; the fit holds the strengths where its first guess, a
    # run, had them.
    moved = fit.x[list(strengths)] - before.fit.x[list(strengths)]
    level = float(np.mean(moved * context.base.parameters.prior_std[list(strengths)]))
    return FoundCurve(
        curve=curve,
        coefficients=level + fit.x[places] * curve.step,
        std=np.sqrt(np.diag(linear.posterior)[places]) * curve.step,
        chi2={variable: fits[variable].fit.total for variable in order},
        ln_evidence={v: fits[v].ln_evidence - own.ln_evidence for v in order},
        calibrated=tuple(calibrated),
        model=fits[best],
    )


def _with_coefficients(
    context: RefitContext, before: FittedModel, curves: Sequence[Curve]
) -> Surface:
    """The surface of the model before, with a run of every coefficient, all in one batch."""
    surface = before.surface
    stay = np.zeros(surface.space.size)
    wanted = [(name, curve.step, stay) for curve in curves for name in curve.names]
    changes = run_moved(context.runs, surface, wanted)
    ladders = {
        name: Ladder(np.array([0.0, step]), np.stack([np.zeros_like(change), change]))
        for (name, step, _), change in zip(wanted, changes, strict=True)
        if change is not None
    }
    return surface.with_ladders(ladders)


def _estimated(context: RefitContext, surface: Surface, names: Sequence[str]) -> FittedModel:
    """A model as the surface expects it, without a run."""
    space = context.space(names)
    known = spreads(context.data, surface, space, context.jitter, anchored_by=ANCHORED)
    fit = settled(context.data, Surrogate(surface, space, known), [anchor_of(surface, space)])
    return weighed(context, fit, surface)
