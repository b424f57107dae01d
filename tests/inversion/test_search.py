"""Searches on formulas with known answers: both methods, the scan, steps, failures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inversion.back_analysis.result_builder import unknown_derivatives
from inversion.estimation.calibrate import between, calibrate, further_starts
from inversion.estimation.data import make_targets
from inversion.estimation.derivatives import FiniteSteps, noise_of
from inversion.estimation.forward import Prediction
from inversion.estimation.gauss_newton import NOISE, gauss_newton
from inversion.estimation.lbfgsb import lbfgsb, value_and_gradient
from inversion.estimation.misfit import Objective
from inversion.estimation.search import Search, SearchResult
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import Prior
from pipeline.cli import WorkFailed
from tests.inversion.analytic import Formula, angle, problem, strength, targets, toes

METHODS = ["gauss_newton", "lbfgsb"]


def dam(values: np.ndarray) -> np.ndarray:
    """Like the Lower San Fernando dam: 53 m at 27.5 kPa, hardly a degree's worth of friction."""
    return np.array([53 - 105 * np.log(values[0] / 27.5) - 0.3 * (values[1] - 30)])


def two_toes(values: np.ndarray) -> np.ndarray:
    """Two toes from three strengths: the upstream one by a product of the first and the third."""
    one, two, six = values
    return np.array([40 / (one * six) ** 0.5 - 2, 30 / two])


def stands_above_20(values: np.ndarray) -> np.ndarray:
    return np.array([max(0.0, 60 * np.log(20 / values[0]))])


@pytest.mark.parametrize("loss", ["runout", "misfit"])
def test_gradient_and_jacobian_against_finite_differences(loss):
    search = problem([strength("a"), angle("b")], dam, targets(53.0, std=3.0), loss=loss)
    values = np.array([22.0, 33.0])
    search.steps = FiniteSteps(search.objective.parameters, np.zeros(1))
    look = search.evaluate(values, "start", 0)
    exact = np.array([[-105 / 22.0, -0.3]])
    look = type(look)(**{**vars(look), "derivative": exact})
    objective, parameters = search.objective, search.objective.parameters
    here = parameters.to_fitted(values)

    def function(fitted):
        return value_and_gradient(objective, at(fitted))[0]

    def residuals(fitted):
        return objective.residuals(at(fitted).prediction, fitted)

    def at(fitted):
        there = parameters.to_values(fitted)
        prediction = search.predict([there])[0]
        return type(look)(**{**vars(look), "values": there, "prediction": prediction})

    value, gradient = value_and_gradient(objective, look)
    jacobian = objective.jacobian(exact, values)
    assert value == pytest.approx(function(here))
    for place in range(2):
        step = np.zeros(2)
        step[place] = 1e-6
        slope = (function(here + step) - function(here - step)) / 2e-6
        assert gradient[place] == pytest.approx(slope, rel=1e-4, abs=1e-6)
        column = (residuals(here + step) - residuals(here - step)) / 2e-6
        np.testing.assert_allclose(jacobian[:, place], column, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_the_known_answer_is_found_as_the_paper_asks(method):
    search = problem([strength("a"), angle("b"), angle("c")], dam, targets(53.0))
    found = calibrate(search, np.array([30.0, 30.0, 30.0]), method=method, least_m=2.0)
    assert found.reached and found.best.loss < 0.1
    assert found.iterations <= 6 and found.runs <= 30
    runout_alone = 27.5 * np.exp(-0.3 * (found.values[1] - 30) / 105)
    assert found.values[0] == pytest.approx(runout_alone, rel=0.01)


def test_the_first_step_of_lbfgsb_is_a_tenth_of_a_strength():
    search = problem([strength("a"), angle("b")], dam, targets(53.0))
    found = calibrate(search, np.array([50.0, 30.0]), method="lbfgsb", least_m=2.0)
    first, second = found.evaluations[:2]
    assert second.values[0] / first.values[0] == pytest.approx(np.exp(-0.1), rel=0.01)


@pytest.mark.parametrize("start", [10.0, 30.0, 80.0])
def test_three_starts_give_one_answer(start):
    search = problem([strength("a"), angle("b")], dam, targets(53.0))
    found = calibrate(search, np.array([start, 35.0]), method="gauss_newton", least_m=2.0)
    assert found.values[0] == pytest.approx(27.5, rel=0.005)
    assert found.values[1] == pytest.approx(30.0, abs=0.3), "friction stays at its first guess"


@pytest.mark.parametrize("method", METHODS)
def test_a_bound_holds_and_is_reported(method):
    search = problem([strength("a", low=29.0)], lambda v: dam([v[0], 30]), targets(53.0))
    found = calibrate(search, np.array([40.0]), method=method, least_m=2.0)
    assert not found.reached
    assert found.values[0] == pytest.approx(29.0, rel=1e-6)
    if method == "gauss_newton":
        assert "at a bound" in found.words


def test_gauss_newton_finds_the_weighted_least_squares_answer():
    """Linear in the fitted numbers, so the answer and its covariance are known in closed form."""
    specs = [strength("a", prior=Prior(mean=20, std=4)), angle("b", prior=Prior(mean=32, std=2))]
    slope = np.array([[-50.0, 1.0], [10.0, -2.0], [0.0, 3.0]])
    centre = np.array([np.log(20.0), 32.0])
    measured, std = np.array([12.0, -5.0, 4.0]), 2.0

    def formula(values):
        return slope @ (np.array([np.log(values[0]), values[1]]) - centre)

    search = problem(
        specs, formula, targets(*measured, std=std, loss="misfit"), loss="misfit", tolerance=1e-6
    )
    search.steps = FiniteSteps(search.objective.parameters, np.zeros(3))
    found = calibrate(search, np.array([30.0, 30.0]), method="gauss_newton", least_m=2.0)
    prior = np.diag([1 / (4 / 20) ** 2, 1 / 2**2])
    covariance = np.linalg.inv(slope.T @ slope / std**2 + prior)
    change = covariance @ slope.T @ measured / std**2
    assert np.log(found.values[0]) - centre[0] == pytest.approx(change[0], abs=1e-3)
    assert found.values[1] - centre[1] == pytest.approx(change[1], abs=1e-2)
    assert found.reached


def test_a_derivative_of_the_wrong_sign_is_taught_better_by_the_runs_it_led_to():
    """As the derivative of a long learned rollout may be."""
    search = problem([strength("a"), angle("b")], dam, targets(53.0), tolerance=0.1)
    right = search.engine.derivative

    def wrong(values, steps):
        prediction, derivative, taken = right(values, steps)
        return prediction, derivative * [[-0.4, 1.0]], taken

    search.engine.derivative = wrong
    first = search.evaluate(np.array([45.0, 30.0]), "start", 0)
    found = gauss_newton(search, first)
    assert found.reached and found.best.values[0] == pytest.approx(27.5, rel=0.01)
    rejected = [look for look in found.evaluations if not look.accepted]
    assert 0 < len(rejected) < 20


def test_strengths_that_the_toes_leave_open_keep_the_ratios_of_their_first_guesses():
    specs = [
        strength(name, start=start, low=0.5)
        for name, start in zip("abc", (11, 12, 10.5), strict=True)
    ]
    answers = []
    for factor in (0.6, 1.0, 1.5):
        search = problem(specs, two_toes, targets(11.0, 6.5), tolerance=0.01)
        start = factor * np.array([11, 12, 10.5])
        found = calibrate(search, start, method="gauss_newton", least_m=0.5)
        assert found.reached
        answers.append(found.values)
    one, two, six = answers[1]
    assert two == pytest.approx(30 / 6.5, rel=0.02)
    assert one * six == pytest.approx((40 / 13) ** 2, rel=0.02)
    np.testing.assert_allclose(answers[0], answers[1], rtol=0.02)
    np.testing.assert_allclose(answers[2], answers[1], rtol=0.02)


def test_where_nothing_moves_the_strengths_are_scanned_first():
    search = problem([strength("a", start=60.0)], stands_above_20, targets(25.0))
    found = calibrate(search, np.array([60.0]), method="gauss_newton", least_m=2.0)
    assert found.values[0] == pytest.approx(20 * np.exp(-25 / 60), rel=0.01)
    scanned = [look for look in found.evaluations if look.kind == "scan"]
    assert scanned and all(look.iteration == 0 for look in scanned)
    assert found.reached


def test_where_nothing_ever_moves_the_work_fails():
    search = problem([strength("a")], lambda v: np.zeros(1), targets(25.0))
    with pytest.raises(WorkFailed, match="nothing moves by 2 m in what is fitted, not even at a 5"):
        calibrate(search, np.array([60.0]), method="gauss_newton", least_m=2.0)
    search = problem([angle("b")], lambda v: np.zeros(1), targets(25.0))
    with pytest.raises(WorkFailed, match="no strength"):
        calibrate(search, np.array([30.0]), method="gauss_newton", least_m=2.0)


@pytest.mark.parametrize("method", METHODS)
def test_runs_that_fail_turn_the_search_back(method):
    """Below 24 kPa the runs fail, and the first step would go there."""

    def formula(values):
        return np.array([np.nan]) if values[0] < 24 else np.array([53 - 60 * (values[0] / 27 - 1)])

    search = problem([strength("a")], formula, targets(53.0))
    first = search.evaluate(np.array([88.0]), "start", 0)
    found = {"gauss_newton": gauss_newton, "lbfgsb": lbfgsb}[method](search, first)
    assert found.best.loss < first.loss
    assert search.runs < 150


def test_a_failed_start_says_why():
    search = problem([strength("a")], lambda v: np.array([np.nan]), targets(53.0))
    with pytest.raises(WorkFailed, match="the simulation at the start failed: test"):
        calibrate(search, np.array([30.0]), method="gauss_newton", least_m=2.0)


@pytest.mark.parametrize(("std", "fits"), [(10.0, True), (1.0, False)])
def test_noise_well_below_the_errors_of_the_data_is_no_misfit(std, fits):
    """A toe that jumps by 2.5 m, as of a far, thin flow, about one that was measured between."""

    def jumping(values):
        return np.round(dam([values[0], 30.0]) / 2.5) * 2.5

    search = problem([strength("a")], jumping, targets(53.75, std=std))
    smooth = FiniteSteps(search.objective.parameters, np.array([2.5]))
    search.steps = smooth
    first = search.evaluate(np.array([40.0]), "start", 0)
    found = gauss_newton(search, first)
    assert found.reached is fits and abs(found.best.prediction.values[0] - 53.75) < 2.5
    assert found.words.startswith("the data are met within 0.1") is fits


def test_a_derivative_of_the_wrong_sign_does_not_end_a_search_between_two_runs():
    """A toe with ripples as steep as its slope, as of a far, thin flow; 97 m lie between two."""

    def rippled(values):
        log = np.log(values[0])
        return np.array([100.0 - 60.0 * (log - np.log(1.7)) + 10.0 * np.sin(15.0 * log + 1.5)])

    search = problem(
        [strength("a", start=4.5, low=0.2, high=90.0)], rippled, targets(97.0, std=1.5)
    )
    here = search.evaluate(np.array([2.27]), "start", 0)
    ended = SearchResult(here, False, NOISE, search.evaluations, search.runs)
    assert between(search, ended) == ended  # no run on the other side
    search.evaluate(np.array([1.5]), "gauss_newton", 1)
    found = between(search, ended)
    assert found.reached and abs(found.best.prediction.values[0] - 97.0) < 0.75
    assert found.words.startswith("loss 0.0") and found.runs - ended.runs < 15
    # Of all runs around it: of two near ones it would be -123 m per kPa, or of the wrong sign.
    assert found.best.derivative == pytest.approx(np.array([[-60.0 / 1.72]]), rel=0.3)


@pytest.mark.parametrize("method", METHODS)
def test_no_search_goes_on_for_ever(method):
    """A formula of pure noise: nothing to be found, and yet an end."""
    search = problem(
        [strength("a"), angle("b")], lambda v: np.array([20.0]), targets(53.0), noise=5.0,
        max_iterations=8, max_runs=60,
    )  # fmt: skip
    first = search.evaluate(np.array([30.0, 30.0]), "start", 0)
    found = {"gauss_newton": gauss_newton, "lbfgsb": lbfgsb}[method](search, first)
    assert not found.reached and found.runs <= 63 and found.words


def test_the_allowance_of_runs_ends_looking_around_too():
    search = problem([strength("a"), angle("b")], dam, targets(200.0), max_runs=6)
    found = calibrate(search, np.array([30.0, 30.0]), method="gauss_newton", least_m=2.0)
    assert not found.reached and found.words.startswith("stopped after")
    assert all(look.kind != "scan" for look in found.evaluations)
    assert found.runs <= 6 + 3


def test_steps_stand_out_of_the_noise():
    parameters = Parameters([strength("a"), angle("b")])
    steps = FiniteSteps(parameters, np.array([0.5]), factor=5.0)
    values = np.array([27.5, 30.0])
    exact = np.array([[-105 / 27.5, -0.3]])
    steps.learn(exact, values)
    taken = steps.steps(values)
    effect = np.abs(exact[0] * taken)
    assert effect[0] == pytest.approx(2.5, rel=0.05), "wide enough, and no wider"
    assert taken[1] == pytest.approx(0.45 * 10), "the widest step there is: half a degree a metre"
    assert list(steps.resolved(exact, taken)) == [bool(effect[0] >= 2.5 - 1e-6), False]


def test_steps_stay_within_the_bounds():
    parameters = Parameters([strength("a"), angle("b")])
    steps = FiniteSteps(parameters, np.zeros(1))
    for values in (parameters.low, parameters.high, parameters.start):
        there = values + steps.steps(values)
        assert np.all(there >= parameters.low - 1e-9) and np.all(there <= parameters.high + 1e-9)
        assert np.all(steps.steps(values) != 0)


@pytest.mark.parametrize("place", [29.5, 29.8, 30.0])
def test_steps_go_where_narrow_bounds_leave_room(place):
    steps = FiniteSteps(Parameters([strength("a", start=30.0, low=29.5, high=30.0)]), np.zeros(1))
    (taken,) = steps.steps(np.array([place]))
    assert 29.5 - 1e-9 <= place + taken <= 30.0 + 1e-9
    assert abs(taken) == pytest.approx(max(place - 29.5, 30.0 - place))


def test_without_noise_any_effect_is_resolved():
    steps = FiniteSteps(Parameters([strength("a"), strength("b")]), np.zeros(1))
    derivative, taken = np.array([[-3.0, 0.0]]), np.array([1.0, 1.0])
    assert list(steps.resolved(derivative, taken)) == [True, False]
    assert list(steps.resolved(derivative, -taken)) == [True, False]


def test_a_number_that_is_not_fitted_and_not_read_stops_nothing():
    goal = make_targets(toes(53.0, 10.0), fit=["toe 0"], loss="runout", source="test")
    parameters = Parameters([strength("a")])

    class Half(Formula):
        def _one(self, values):
            return replace(super()._one(values), status="finished")

    def numbers(values):
        return np.array([dam([values[0], 30.0])[0], np.nan])

    engines = [Half(numbers, goal.names, noise=0.1, seed=seed) for seed in (1, 2, 3)]
    engine = Half(numbers, goal.names)
    search = Search(
        engine, engine, Objective(parameters, goal, "runout", 0.1),
        FiniteSteps(parameters, np.zeros(1)), seeds=engines,
    )  # fmt: skip
    found = calibrate(search, np.array([30.0]), method="gauss_newton", least_m=2.0)
    assert found.reached and found.values[0] == pytest.approx(27.5, rel=0.01)
    assert search.steps.noise[0] > 0.0


def test_noise_is_measured_over_seeds_before_the_second_derivative():
    specs = [strength("a")]
    goal = targets(53.0)
    parameters = Parameters(specs)

    def toe(values):
        return dam([values[0], 30.0])

    engines = [Formula(toe, goal.names, noise=0.4, seed=seed) for seed in range(1, 9)]
    engine = Formula(toe, goal.names)
    search = Search(
        engine, engine, Objective(parameters, goal, "runout", 0.1),
        FiniteSteps(parameters, np.zeros(1)), seeds=engines,
    )  # fmt: skip
    found = calibrate(search, np.array([30.0]), method="gauss_newton", least_m=2.0)
    assert 0.15 < search.steps.noise[0] < 0.8
    second = found.evaluations[1]
    assert abs(second.derivative[0, 0] * second.steps[0]) >= 4.5 * search.steps.noise[0]
    assert (
        found.runs
        == engine.runs
        == len(engines) + sum(1 if one.derivative is None else 2 for one in found.evaluations)
    )


def test_failed_seeds_are_left_out_of_the_noise():
    runs = [Prediction(np.array([value]), np.zeros(1)) for value in (1.0, 3.0, np.nan)]
    assert noise_of(runs, np.array([True]))[0] == pytest.approx(np.sqrt(2))
    assert noise_of(runs[2:], np.array([True]))[0] == 0


def test_a_failed_run_next_to_the_point_is_tried_again_nearer():
    engine = Formula(lambda v: np.array([np.nan if v[0] < 29.3 else 2 * v[0]]), ["toe 0"])
    here = engine.at(np.array([30.0, 30.0]))
    _, derivative, steps = engine.derivative(here, np.array([-1.0, 1.0]))
    assert derivative[0, 0] == pytest.approx(2.0) and steps.tolist() == [-0.5, 1.0]
    assert engine.runs == 4


def test_what_could_not_be_simulated_is_reported_as_not_known():
    parameters = Parameters([strength("a"), angle("b")])
    known = np.array([[1.0, 0.0], [2.0, 0.0]])
    assert unknown_derivatives(parameters, known) == []
    known[:, 1] = np.nan
    (line,) = unknown_derivatives(parameters, known)
    assert line.startswith("phi of zone b: ") and "failed" in line


def test_a_failed_column_is_no_number_and_counts_as_nothing():
    engine = Formula(lambda v: np.array([np.nan if v[0] < 29.9 else v[1]]), ["toe 0"])
    _, derivative, _ = engine.derivative(engine.at(np.array([30.0, 30.0])), np.array([-1.0, 1.0]))
    assert np.isnan(derivative[0, 0]) and derivative[0, 1] == 1.0
    objective = Objective(Parameters([strength("a"), angle("b")]), targets(53.0), "runout", 0.1)
    assert np.all(np.isfinite(objective.jacobian(derivative, np.array([30.0, 30.0]))))


def test_further_starts_lie_within_the_bounds_and_differ():
    parameters = Parameters([strength("a"), angle("b")])
    starts = further_starts(parameters, 2)
    assert len(starts) == 2
    for start in starts:
        assert np.all(start >= parameters.low) and np.all(start <= parameters.high)
    assert starts[0][0] < parameters.start[0] < starts[1][0]
