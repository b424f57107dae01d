"""The validation case: does the answer hold on a second section or event of the same site?

In: the verdict's models and another case. Out: the misfit there by the base model and by
that of the answer. Nothing is fitted: parameters of the same name take the values that were found,
others keep what the other case knows of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.diagnose import Diagnosis
from diagnosis.hypotheses.engine_model import EngineModel
from diagnosis.options import Options
from diagnosis.verdict.verdict import ValidationCase
from inversion.estimation.covariance import covariance, known, mean_of, source_covariance
from inversion.estimation.surface_search import Fit
from inversion.problem.state import State, state

if TYPE_CHECKING:
    from diagnosis.session import Session

#: Change of a strength for its derivative: near the shortest step that is taken anywhere
#: (`derivatives.SHORTEST`), so that no curvature shows.
STRONGER = 1.1
#: Jitters whose mean is the prediction, and whose spread its noise: as many as judge a refit.
SEEDS = 4


def validated(session: Session, found: Diagnosis) -> ValidationCase | None:
    """Judge the answer on the case that `validation_case` names; None where there is none."""
    other = session.case.validation_case
    if other is None:
        return None
    model = other.model(session.store, session.engine)
    options = other.options(model)
    base = found.comparison.base.fit
    final = found.decision.final.model.fit
    fixed = {} if session.hypothesis is None else session.hypothesis.effects
    adopted = {name: one.amplitude for name, one in fixed.items()}
    chi2 = []
    for fit in (base, final):
        states = [_there(model, fit, adopted, seed) for seed in range(SEEDS)]
        rows = model.predict(states)
        fine = _finer(model, states[0], options) - mean_of(rows)
        own = model.error_std(states[0])
        slope = _slope(model, states[0], options)
        chi2.append(misfit(model, rows, options, fine=fine, slope=slope, engine_std=own))
    used = _used(model)
    return ValidationCase(case=other.name, n=int(used.sum()), chi2_base=chi2[0], chi2_final=chi2[1])


def misfit(
    model: EngineModel,
    rows: np.ndarray,
    options: Options | None = None,
    *,
    fine: np.ndarray | None = None,
    slope: np.ndarray | None = None,
    engine_std: np.ndarray | None = None,
) -> float:
    """chi2 of all measured numbers, predicted by the mean of replicates; nothing is fitted.

    Args:
        model: of the other case.
        rows: replicates (n, m).
        options: of the other case: errors of its source, and the share of `fine` that is added.
        fine: what finer cells change, (m,); None: nothing is added.
        slope: derivative by ln of the strengths that are found, (m, k): their source is not that of
            the first case. None: it is.
        engine_std: that the engine states of its own predictions, (m,); None: none.
    """
    options = Options() if options is None else options
    targets, used = model.targets, _used(model)
    found = covariance(
        targets.covariance,
        replicates=rows,
        finer=fine,
        factor=options.finer_share_std,
        finer_noise=0.0 if fine is None else options.finer_noise,
        source=source_covariance(targets.entries, options.source),
        engine_std=engine_std,
    ).total
    if slope is not None:
        found = found + options.source_strength**2 * slope @ slope.T
    prediction = mean_of(rows[:, used])
    if not np.all(np.isfinite(prediction)):
        return float("inf")
    if fine is not None:
        prediction = prediction + options.finer_share * known(fine)[used]
    off = targets.measured[used] - prediction
    return float(off @ np.linalg.solve(found[np.ix_(used, used)], off))


def _finer(model: EngineModel, there: State, options: Options) -> np.ndarray:
    """Mean prediction with finer cells (m,); NaN where none is asked for."""
    if not options.wants_finer:
        return np.full(len(model.targets.names), np.nan)
    states = [replace(there, seed=seed, numerics="fine") for seed in range(options.finer_runs)]
    return mean_of(model.predict(states))


def _slope(model: EngineModel, there: State, options: Options) -> np.ndarray | None:
    """Derivative by ln of each strength that is found, (m, k); None where none is asked for."""
    if not options.source_strength:
        return None
    strengths = np.flatnonzero(model.parameters.strengths & ~model.parameters.has_prior)
    columns = []
    for place in strengths:
        ends = []
        for factor in (STRONGER, 1.0 / STRONGER):
            values = list(there.values)
            values[place] *= factor
            ends.append(replace(there, values=tuple(values)))
        high, low = model.predict(ends)
        columns.append((high - low) / (2.0 * np.log(STRONGER)))
    return np.nan_to_num(np.column_stack(columns)) if columns else None


def _used(model: EngineModel) -> np.ndarray:
    """(m,) bool: measured and not constructed; what the other case holds out counts too."""
    return np.array([role in ("fitted", "held out") for role in model.targets.roles])


def _there(model: EngineModel, fit: Fit, adopted: Mapping[str, float], seed: int) -> State:
    """A fit as a state of the other case.

    Args:
        model: of that case.
        fit: of the first.
        adopted: effects of the hypothesis that the fit stands on, and their amplitudes.
        seed: of the jitter.
    """
    found = fit.space.parameters.as_mapping(fit.space.values(fit.x))
    own = model.parameters.as_mapping(model.parameters.prior_mean)
    values = [found.get(name, own[name]) for name in model.parameters.names]
    # Changes of the section and errors of the survey belong to the first case.
    acting = {c.name for c in model.candidates if c.family not in ("section", "survey")}
    found_there = {**adopted, **fit.space.amplitudes(fit.x)}
    effects = {name: size for name, size in found_there.items() if name in acting}
    return state(values, effects, seed=seed)
