"""Tests of adequacy, held-out data, windows and scores on data whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from diagnosis.adequacy.adequacy import (
    Test as Check,
)
from diagnosis.adequacy.adequacy import (
    assess,
    autocorrelation,
    exceedance,
    held_out_misfit,
    judged,
    neighbour_pairs,
    standardised_sum,
)
from diagnosis.adequacy.windows import worst_window
from diagnosis.signatures.signatures import Signature, score_all
from inversion.estimation.data import places_of
from inversion.estimation.hold_out import HoldOut
from inversion.estimation.misfit import System, augmented_residual, system
from inversion.estimation.surface_search import Fit
from inversion.problem.unknown import Scale, Unknown
from tests.diagnosis.straight import X, signatures, straight

CASES = 300
HELD = HoldOut(groups=("history",), blocks={"profile": (28.0, 38.0)})


def best(case, effects=()) -> Fit:
    """The exact least of a linear model."""
    space, data = case.space(effects), case.data
    slope = case.slope(space)
    rows, constants = space.prior
    matrix = np.vstack([data.whitened(slope), rows])
    right = np.concatenate([data.whitened(data.measured - case.level), constants])
    x = np.linalg.lstsq(matrix, right, rcond=None)[0]
    return Fit(space, x, case.level + slope @ x, slope, float(np.sum((matrix @ x - right) ** 2)))


@pytest.fixture(scope="module")
def nulls():
    """ProjectedFit fits of data without a hidden effect."""
    found = []
    for seed in range(CASES):
        case = straight(seed, {}, hold_out=HELD)
        found.append((case, judged(case.data, best(case), draws=400, seed=1)))
    return found


@pytest.mark.parametrize("name", ["chi2", "autocorrelation", "group", "held_out"])
def test_p_values_of_noise_are_uniform(nulls, name):
    p = []
    for case, found in nulls:
        adequacy = assess(found, places_of(case.targets))
        p += [test.p for test in adequacy.tests if test.name.startswith(name)]
    assert len(p) == CASES
    assert stats.kstest(p, "uniform").pvalue > 0.005


def test_combined_p_raises_no_more_alarms_than_it_says(nulls):
    p = [assess(f, places_of(c.targets)).p_combined for c, f in nulls]
    assert np.mean(np.array(p) < 0.05) <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / CASES)


def test_window_p_is_uniform_although_the_worst_of_many_is_looked_for(nulls):
    p = [worst_window(f, places_of(c.targets)).p for c, f in nulls]
    assert stats.kstest(p, "uniform").pvalue > 0.005


def test_family_wise_level_over_all_effects_and_amplitudes(nulls):
    every = {
        name: Signature(name, {a: a * d for a in (-1.0, 0.5, 1.0, 2.0)}, {}, (1.0, d))
        for name, d in signatures().items()
    }
    candidates = nulls[0][0].candidates
    p = [score_all(f, every, candidates).p_largest for _, f in nulls]
    assert stats.kstest(p, "uniform").pvalue > 0.005
    # A family-wise p is not smaller than that of a candidate which is tried alone.
    found = nulls[0][1]
    whole = score_all(found, every, candidates)
    for name in every:
        alone = score_all(found, {name: every[name]}, candidates)
        assert whole.p_family[name] >= alone.p_family[name]


def test_a_hidden_bend_is_found_where_it_is():
    case = straight(3, {"bend": 1.5})
    found = judged(case.data, best(case), draws=1000, seed=1)
    adequacy = assess(found, places_of(case.targets))
    assert adequacy.p_combined < 0.01
    worst = max(adequacy.groups, key=lambda group: group.z)
    assert worst.name == "profile" and worst.chi2 > 2 * worst.expected
    step = straight(3, {"step": 2.5})
    found = judged(step.data, best(step), draws=1000, seed=1)
    window = worst_window(found, places_of(step.targets))
    assert window.p < 0.05
    # It lies around the step, at x = 30 m.
    assert window.begin <= 34.0 and window.end >= 28.0


def test_score_gives_amplitude_and_drop_of_an_exact_refit():
    case = straight(4, {"bend": 1.2})
    fit = best(case)
    found = judged(case.data, fit, draws=200, seed=1)
    d = signatures()["bend"]
    every = {"bend": Signature("bend", {1.0: d}, {}, (1.0, d))}
    score = score_all(found, every, case.candidates).best("bend")
    exact = best(case, [Unknown("bend", -9.0, 9.0, Scale())])
    assert score.drop == pytest.approx(fit.total - exact.total, rel=1e-6)
    assert score.amplitude == pytest.approx(exact.x[-1], rel=1e-6)
    assert score.z == pytest.approx(np.sqrt(score.drop), rel=1e-6)


def test_score_keeps_to_the_bounds_of_the_amplitude():
    case = straight(4, {"bend": 2.5})
    case.candidates[0] = case.candidates[0].__class__("bend", "physics", "", "", 0.0, 0.5, (0.5,))
    found = judged(case.data, best(case), draws=200, seed=1)
    d = signatures()["bend"]
    bounded = score_all(found, {"bend": Signature("bend", {0.5: 0.5 * d}, {}, (0.5, d))},
                        case.candidates).best("bend")  # fmt: skip
    assert bounded.amplitude == pytest.approx(0.5)
    assert bounded.drop < bounded.z**2
    # A negative amplitude is not allowed, so a residual the other way scores nothing.
    other = straight(4, {"bend": -2.5})
    other.candidates[0] = case.candidates[0]
    found = judged(other.data, best(other), draws=200, seed=1)
    nothing = score_all(found, {"bend": Signature("bend", {0.5: 0.5 * d}, {}, (0.5, d))},
                        other.candidates).best("bend")  # fmt: skip
    assert nothing.drop == 0.0 and nothing.z < 0.0


def test_what_a_parameter_does_is_invisible():
    case = straight(2, {"like_strength": 2.0})
    found = judged(case.data, best(case), draws=200, seed=1)
    d = signatures()["like_strength"]
    score = score_all(found, {"like_strength": Signature("like_strength", {1.0: d}, {}, (1.0, d))},
                      case.candidates).best("like_strength")  # fmt: skip
    assert score.visible < 1e-6 * score.whole
    assert assess(found, places_of(case.targets)).p_combined > 0.05


def test_held_out_misfit_is_that_of_the_joint_gaussian():
    # chi2 of all data = chi2 of the fitted + chi2 of the held-out given them (chain rule).
    case = straight(8, {}, hold_out=HELD)
    data, fit = case.data, best(case)
    linear = system(data, fit.space, fit.derivative, fit.x)
    whole = straight(8, {}, hold_out=HoldOut())
    total = best(whole).total
    assert held_out_misfit(fit, linear).chi2 == pytest.approx(total - fit.total, rel=1e-9)
    assert held_out_misfit(fit, linear).n == 4 + np.count_nonzero((X >= 28) & (X <= 38))


def test_pairs_of_neighbours_do_not_reach_over_what_is_held_out():
    case = straight(1, {}, hold_out=HELD)
    pairs = neighbour_pairs(case.data, places_of(case.targets))
    numbers = case.data.fitted[pairs]
    assert np.all(np.diff(numbers, axis=1) == 1)
    gap = np.flatnonzero(np.diff(case.data.fitted) > 1)
    assert not any(set(gap) & {pair[0]} for pair in pairs)


def test_autocorrelation_of_a_run_and_of_a_saw():
    run, saw = np.ones((6, 1)), np.array([1.0, -1, 1, -1, 1, -1])[:, None]
    pairs = np.array([[i, i + 1] for i in range(5)])
    assert autocorrelation(run, pairs)[0] == pytest.approx(1.0)
    assert autocorrelation(saw, pairs)[0] == pytest.approx(-1.0)


def test_standardised_sums_are_about_normal():
    draw = np.random.default_rng(0)
    basis = np.linalg.qr(draw.standard_normal((9, 3)))[0]
    covariance = np.eye(9) - basis @ basis.T
    noise = draw.standard_normal((9, 20000))
    z = standardised_sum(np.sum((covariance @ noise) ** 2, axis=0), covariance)
    assert abs(np.mean(z)) < 0.03 and abs(np.std(z) - 1.0) < 0.03


def test_exceedance_is_never_zero():
    assert exceedance(np.zeros(99), 1.0) == pytest.approx(0.01)
    assert exceedance(np.ones(99), 1.0) == 1.0


def test_score_joins_the_tests():
    case = straight(1, {})
    found = judged(case.data, best(case), draws=200, seed=1)
    adequacy = assess(found, places_of(case.targets), score=Check("score", 5.0, 0.002))
    assert adequacy.p_combined == pytest.approx(0.002 * len(adequacy.tests))


def test_parameters_at_a_bound_do_not_move():
    case = straight(1, {})
    fit = best(case)
    at_bound = fit.x.copy()
    at_bound[1] = fit.space.high[1]
    free = system(case.data, fit.space, fit.derivative, fit.x)
    held = system(case.data, fit.space, fit.derivative, at_bound)
    assert held.dof == free.dof + 1
    assert held.posterior[1, 1] == 0.0 and free.posterior[1, 1] > 0.0


def test_a_limit_that_is_kept_is_no_degree_of_freedom():
    case = straight(1, {})
    fit = best(case)
    kept = int(case.data.fitted[2])  # it is the same as if nobody had asked for it
    slope, prediction = fit.derivative.copy(), fit.prediction.copy()
    slope[kept], prediction[kept] = 0.0, case.data.measured[kept]
    censored = np.arange(len(prediction)) == kept
    limited = replace(case.data, censored=censored)
    without = replace(case.data, fitted=case.data.fitted[case.data.fitted != kept])
    for moves in (False, True):
        fit = replace(fit, derivative=slope if not moves else slope + censored[:, None])
        here, there = (
            system(data, fit.space, fit.derivative, fit.x) for data in (limited, without)
        )
        assert here.dof == there.dof + moves
        assert np.allclose(here.posterior, there.posterior) != moves
    fit = replace(fit, derivative=slope, prediction=prediction)
    found = [judged(data, fit, draws=200, seed=1) for data in (limited, without)]
    own, other = (assess(one, places_of(case.targets)) for one in found)
    assert own.dof == other.dof
    assert np.sum(found[0].residual ** 2) == pytest.approx(np.sum(found[1].residual ** 2))
    assert np.all(np.isfinite(found[0].noise)) and own.groups[0].expected == pytest.approx(
        other.groups[0].expected
    )


def test_nothing_but_kept_limits_is_no_misfit():
    assert np.array_equal(standardised_sum(np.array([0.0, 1e-30]), np.zeros((1, 1))), [0.0, 0.0])


def test_system_projects_what_the_unknowns_imitate():
    case = straight(1, {})
    fit = best(case)
    linear = system(case.data, fit.space, fit.derivative, fit.x)
    assert isinstance(linear, System)
    residual = augmented_residual(case.data, fit.space, fit.prediction, fit.x)
    assert np.allclose(linear.project(residual), residual, atol=1e-8)
    change = fit.derivative @ np.array([0.3, 0.0])
    moved = linear.imitating(np.concatenate([case.data.whitened(change), np.zeros(1)]))
    assert moved[0] == pytest.approx(0.3, abs=0.02)
    v = np.linalg.inv(linear.matrix.T @ linear.matrix)
    assert np.allclose(linear.posterior, v)
