"""The validation case: does the answer hold on a second section or event of the same site?

In: the verdict's models and another case. Out: the misfit there by the base model and by
that of the answer. Nothing is fitted: parameters of the same name take the values that were found,
others keep what the other case knows of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.diagnose import Diagnosis
from diagnosis.hypotheses.engine_model import EngineModel
from diagnosis.verdict.verdict import ValidationCase
from inversion.estimation.covariance import SourceError, covariance, source_covariance
from inversion.estimation.surface_search import Fit
from inversion.problem.forward import State, state

if TYPE_CHECKING:
    from diagnosis.session import Session

#: Jitters whose mean is the prediction, and whose spread its noise.
SEEDS = 4


def validated(session: Session, found: Diagnosis) -> ValidationCase | None:
    """Judge the answer on the case that `validation_case` names; None where there is none."""
    other = session.case.validation_case
    if other is None:
        return None
    model = other.model(session.store, session.engine)
    base = found.comparison.base.fit
    final = found.decision.final.model.fit
    chi2 = []
    for fit in (base, final):
        rows = model.predict([_there(model, fit, seed) for seed in range(SEEDS)])
        chi2.append(misfit(model, rows, other.question.source_errors))
    used = _used(model)
    return ValidationCase(case=other.name, n=int(used.sum()), chi2_base=chi2[0], chi2_final=chi2[1])


def misfit(
    model: EngineModel, rows: np.ndarray, source: Mapping[str, SourceError] | None = None
) -> float:
    """chi2 of all measured numbers, predicted by the mean of replicates (n, m); nothing fitted."""
    targets, used = model.targets, _used(model)
    found = covariance(
        targets.covariance, replicates=rows, source=source_covariance(targets.entries, source or {})
    )
    total = found.total[np.ix_(used, used)]
    good = rows[np.all(np.isfinite(rows[:, used]), axis=1)]
    if not len(good):
        return float("inf")
    off = (targets.measured - good.mean(axis=0))[used]
    return float(off @ np.linalg.solve(total, off))


def _used(model: EngineModel) -> np.ndarray:
    """(m,) bool: measured and not constructed; what the other case holds out counts too."""
    return np.array([role in ("fitted", "held out") for role in model.targets.roles])


def _there(model: EngineModel, fit: Fit, seed: int) -> State:
    """A fit as a state of the other case."""
    found = fit.space.parameters.as_mapping(fit.space.values(fit.x))
    own = model.parameters.as_mapping(model.parameters.prior_mean)
    values = [found.get(name, own[name]) for name in model.parameters.names]
    # Where the section is drawn otherwise and what the survey errs belong to the first case.
    acting = {c.name for c in model.candidates if c.family not in ("section", "survey")}
    effects = {n: a for n, a in fit.space.amplitudes(fit.x).items() if n in acting}
    return state(values, effects, seed=seed)
