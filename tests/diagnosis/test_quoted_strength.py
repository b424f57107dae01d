"""What is quoted of a strength: mixtures, the error of the effects, wide where nothing explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.options import Options
from diagnosis.selection.quoted_strength import equal_weights, quoted, unexplained
from diagnosis.selection.refit import FittedModel, RefitContext
from diagnosis.track_record import beyond_list
from diagnosis.verdict.fitted_models import INTERVALS
from diagnosis.verdict.verdict_builder import verdict_document
from inversion.estimation.misfit import system
from inversion.problem.unknown import Scale, Unknown
from tests.diagnosis.straight import SIZE, Straight, signatures, straight
from tests.diagnosis.test_evidence import fitted

ASKED = Options(draws=400, replicates=3)


def test_spread_with_an_error_that_the_weights_do_not_know():
    """Against the scatter of fits to simulated data."""
    case = Straight(np.zeros(SIZE))
    space = case.space([])
    data = case.data
    linear = system(data, space, case.slope(space), space.parameters.to_fitted([15.0, 32.0]))
    grown = 3.0 * signatures()["bend"]
    error = np.outer(grown, grown)
    draw = np.random.default_rng(0)
    factor = np.linalg.cholesky(data.covariance)
    noise = factor @ draw.standard_normal((SIZE, 4000))
    noise += np.outer(grown, draw.standard_normal(4000))
    # What a prior leaves open is no scatter of the data: the strength has none.
    found = np.array([linear.imitating(linear.augmented(column)) for column in noise.T])
    std = linear.spread_with(error)
    assert std[0] == pytest.approx(found[:, 0].std(), rel=0.06)
    assert np.all(std >= linear.spread_with(None))
    assert linear.spread_with(None)[0] == pytest.approx(np.sqrt(linear.posterior[0, 0]))


def models(seed: int = 0):
    case = straight(seed, {"late": 2.0})
    spaces = [
        case.space([Unknown(n, -3.0, 3.0, Scale())] if n else []) for n in ("", "late", "bend")
    ]
    fits = [fitted(case, space) for space in spaces]
    return case, {fit.names: FittedModel(fit, 0.0, None, None) for fit in fits}


def context(case: Straight) -> RefitContext:
    return RefitContext(None, case.data, None, {}, np.zeros((SIZE, SIZE)), 1)


def with_total(model: FittedModel, total: float) -> FittedModel:
    return replace(model, fit=replace(model.fit, total=total))


def test_one_explanation_is_quoted_as_it_is():
    case, fits = models()
    found = quoted(context(case), fits, {("late",): 0.4}, error=None, widened=False)
    fit = fits[("late",)].fit
    std = system(case.data, fit.space, fit.derivative, fit.x).spread_with(None)
    assert np.allclose(found.x, fit.x[:2]) and np.allclose(found.std, std[:2])
    assert found.models == {("late",): 1.0}


def test_a_mixture_has_the_variance_of_its_members_and_between_them():
    case, fits = models()
    weights = {("late",): 0.75, ("bend",): 0.25}
    found = quoted(context(case), fits, weights, error=None, widened=False)
    alone = [quoted(context(case), fits, {n: 1.0}, error=None, widened=False) for n in weights]
    w = np.array([0.75, 0.25])
    x, s = np.array([a.x for a in alone]), np.array([a.std for a in alone])
    assert np.allclose(found.x, w @ x)
    assert np.allclose(found.std**2, w @ (s**2 + x**2) - (w @ x) ** 2)


def test_what_does_not_explain_cannot_sharpen_a_strength():
    case, fits = models()
    fits[()] = with_total(fits[()], 180.0)
    fits[("late",)] = with_total(fits[("late",)], 100.0)
    fits[("bend",)] = with_total(fits[("bend",)], 175.0)
    weights = unexplained(fits, 6.0)
    assert weights == {(): 1.0, ("late",): 1.0}, "the other lowers chi2 by 5 only"
    unread = {**fits, ("late",): replace(fits[("late",)], unread=True)}
    assert unexplained(unread, 6.0) == {(): 1.0}, "a fit that no run bears out"
    found = quoted(context(case), fits, weights, error=None, widened=True)
    for names in weights:
        narrow = quoted(context(case), fits, {names: 1.0}, error=None, widened=False)
        assert found.std[0] > 1.5 * narrow.std[0]


def test_causes_that_no_list_holds_widen_strengths_alone():
    case, fits = models()
    known, beyond = (
        quoted(context(case), fits, {(): 1.0}, error=None, widened=False, beyond=std)
        for std in (0.0, 0.3)
    )
    unit = case.parameters.value_per_fitted(np.array([1.0, 1.0]))[0]  # ln S_r
    assert unit * beyond.std[0] == pytest.approx(np.hypot(unit * known.std[0], 0.3))
    assert beyond.std[1] == known.std[1] and np.all(beyond.x == known.x)


def test_a_verdict_says_what_it_holds_for_causes_on_no_list():
    found = diagnose(straight(1, {"late": 2.0}), replace(ASKED, deserved=1.0))
    told = verdict_document(found, case="c", title="t")
    used = told.quoted["S_r"]
    assert told.verdict == "unknown_effect" and told.quoted["phi"].beyond == 0.0
    assert used.beyond == beyond_list("unknown_effect") > 0.1
    assert used.std / used.value > used.beyond


def test_the_error_of_the_effects_is_in_the_standard_deviations_of_the_answer():
    """With finer cells the effect does something of the strength's own, too."""
    quiet = verdict_document(diagnose(straight(1, {"late": 2.0}), ASKED), case="c", title="t")
    skewed = {"late": ("like_strength", 0.8)}
    found = diagnose(straight(1, {"late": 2.0}, skewed=skewed), ASKED)
    told = verdict_document(found, case="c", title="t")
    assert found.tried_models.error is not None and told.verdict == "identified"
    grown = told.final.std["S_r"] / told.final.values["S_r"]
    assert grown > 1.2 * quiet.final.std["S_r"] / quiet.final.values["S_r"]
    used = told.quoted["S_r"]
    assert used.value == pytest.approx(told.final.values["S_r"])
    assert used.std / used.value == pytest.approx(np.hypot(grown, used.beyond), rel=1e-3)
    (inner, outer) = used.intervals["50%"], used.intervals["95%"]
    assert outer[0] < inner[0] < used.value < inner[1] < outer[1]


@pytest.mark.slow
@pytest.mark.long
def test_intervals_hold_the_strength_as_often_as_they_say():
    hits: dict[str, list[bool]] = {"50%": [], "80%": [], "95%": []}
    for seed in range(100, 160):
        effects = [{}, {"late": 2.0}, {"bend": 1.5}, {"step": 1.2}][seed % 4]
        found = diagnose(straight(seed, effects), replace(ASKED, seed=seed))
        used = verdict_document(found, case="c", title="t").quoted["S_r"]
        for share, (low, high) in used.intervals.items():
            # Here the list holds all that can be missing.
            wide = INTERVALS[float(share[:-1]) / 100.0]
            own = np.sqrt((0.5 * np.log(high / low)) ** 2 - (wide * used.beyond) ** 2)
            hits[share].append(abs(np.log(15.0 / np.sqrt(low * high))) <= own)
    for share, level in (("50%", 0.5), ("80%", 0.8), ("95%", 0.95)):
        width = 2.6 * np.sqrt(level * (1.0 - level) / 60)
        assert abs(np.mean(hits[share]) - level) < width, share


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_two_standard_deviations_reach_the_value_by_each_explanation(count):
    """Also by the farthest of them, however certain each is of itself and the others are."""
    case, fits = models()
    fit = fits[()].fit
    every = {(str(k),): FittedModel(replace(fit, x=fit.x + (k == 0) * 1.0), 0.0, None, None)
             for k in range(count)}  # fmt: skip
    found = quoted(context(case), every, equal_weights(every), error=None, widened=False)
    for one in every.values():
        assert np.all(np.abs(one.fit.x[:2] - found.x) <= 2.0 * found.std)
