"""Covariance, flat directions, equally good answers, many questions at once."""

from __future__ import annotations

import numpy as np
import pytest

from inversion.back_analysis.perturbed_answers import Problem, resolve, walk
from inversion.estimation.misfit import (
    Objective,
    direction_in_words,
    interval,
    moved_by_noise,
    posterior,
    root_mean_square,
    simple_basis,
)
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import Prior
from tests.inversion.analytic import Formula, angle, strength, targets


def test_covariance_in_closed_form():
    specs = [strength("a", prior=Prior(mean=20, std=4)), angle("b", prior=Prior(mean=32, std=2))]
    objective = Objective(Parameters(specs), targets(12.0, 5.0, std=2.0), "misfit", 0.1)
    slope = np.array([[-2.5, 1.0], [0.5, -2.0]])  # m per kPa, m per degree
    values = np.array([25.0, 31.0])
    prior = np.diag([1 / (0.2 * 25) ** 2, 1 / 2**2])  # 20 % of the value, 2 degrees
    expected = np.linalg.inv(slope.T @ slope / 2.0**2 + prior)
    spread = posterior(objective, slope, values)
    np.testing.assert_allclose(spread.std, np.sqrt(np.diag(expected)), rtol=1e-9)
    correlation = expected[0, 1] / np.sqrt(expected[0, 0] * expected[1, 1])
    assert spread.correlation[0, 1] == pytest.approx(correlation)
    assert not len(spread.flat)


@pytest.mark.parametrize("loss", ["runout", "misfit"])
def test_covariance_is_the_spread_of_answers_over_surveys_and_priors(loss):
    specs = [strength("a", prior=Prior(mean=20, std=4)), angle("b", prior=Prior(mean=32, std=2))]
    objective = Objective(Parameters(specs), targets(12.0, std=0.6), loss, 0.1)
    values, slope = np.array([20.0, 32.0]), np.array([[-0.4, 0.2]])
    spread = posterior(objective, slope, values)
    # The linear search on 40,000 surveys and priors drawn around the truth, in scaled parameters.
    random = np.random.default_rng(5)
    weights, scaled = objective.whitener, objective.fitted_derivative(slope, values)
    survey = random.normal(0.0, 0.6, (40_000, 1))
    prior = random.normal(0.0, 1.0, (40_000, 2))
    matrix = np.concatenate([weights @ scaled, np.eye(2)])
    answers = np.concatenate([survey @ weights.T, prior], axis=1) @ np.linalg.pinv(matrix).T
    np.testing.assert_allclose(np.cov(answers.T), spread.scaled, rtol=0.05, atol=0.02)


def test_the_noise_of_the_numbers_moves_the_answer_as_it_moves_fits_of_noisy_ones():
    specs = [strength("a", prior=Prior(mean=20, std=4)), angle("b", prior=Prior(mean=32, std=2))]
    objective = Objective(Parameters(specs), targets(12.0, 5.0, std=0.6), "misfit", 0.1)
    values, slope = np.array([20.0, 32.0]), np.array([[-0.4, 0.2], [-0.1, -0.3]])
    noise = np.array([0.5, 0.2])
    scaled = slope * objective.parameters.value_per_fitted(values) / 0.6
    normal = scaled.T @ scaled + np.eye(2)
    draws = np.random.default_rng(5).standard_normal((20_000, 2)) * noise / 0.6
    found = draws @ scaled @ np.linalg.inv(normal) * objective.parameters.value_per_fitted(values)
    expected = moved_by_noise(objective, slope, values, noise)
    np.testing.assert_allclose(found.std(axis=0), expected, rtol=0.02)


def test_what_the_toe_does_not_feel_is_as_wide_as_before_and_named():
    parameters = Parameters([strength("a"), angle("6", high=33.0), angle("7")])
    objective = Objective(parameters, targets(53.0, std=5.75), "runout", 0.1)
    slope = np.array([[-105 / 27.5, -0.1, 0.01]])
    values = np.array([27.5, 30.0, 30.0])
    spread = posterior(objective, slope, values)
    assert spread.std[0] == pytest.approx(5.75 / 105 * 27.5, rel=0.01)
    assert spread.std[2] == pytest.approx(10 / np.sqrt(12), rel=1e-3)
    assert list(spread.determined) == [True, False, False]
    words = [direction_in_words(parameters, direction) for direction in spread.flat]
    assert sorted(words) == [
        "phi of zone 6: the data say nothing of it",
        "phi of zone 7: the data say nothing of it",
    ]
    assert np.all(spread.remaining > 0.99)


def test_an_exchange_of_two_strengths_is_named():
    parameters = Parameters([strength("1"), strength("2"), strength("6")])
    objective = Objective(parameters, targets(11.0, 6.5), "runout", 0.1)
    slope = np.array([[-2.0, 0.0, -2.0], [0.0, -3.0, 0.0]])
    spread = posterior(objective, slope, np.array([5.0, 5.0, 5.0]))
    assert len(spread.flat) == 1
    assert "S_r of zone 1" in (words := direction_in_words(parameters, spread.flat[0]))
    assert "up" in words and "down" in words and "zone 2" not in words


def test_a_basis_lies_along_the_axes_where_it_can():
    mixed = np.array([[0.0, 1.0, 1.0], [0.0, 1.0, -1.0]]) / np.sqrt(2)
    np.testing.assert_allclose(np.abs(simple_basis(mixed)).sum(axis=0), [0, 1, 1], atol=1e-12)
    assert simple_basis(np.zeros((0, 3))).shape == (0, 3)


def test_intervals_are_those_of_the_logarithm_and_end_at_bounds():
    parameters = Parameters([strength("a"), angle("b")])
    (low, high), friction = interval(parameters, np.array([20.0, 30.0]), np.array([2.0, 5.0]))
    assert low == pytest.approx(20 * np.exp(-0.196)) and high == pytest.approx(20 * np.exp(0.196))
    assert friction == (27.0, 37.0)


def test_root_mean_square_of_two_sides():
    assert root_mean_square([{"a": 3.0}, {"a": -1.0}], "a") == pytest.approx(np.sqrt(5))


def test_many_questions_are_answered_with_the_derivative_of_one():
    parameters = Parameters([strength("a"), angle("b")])

    def toe(shift):
        return lambda v: np.array([shift + 53 - 105 * np.log(v[0] / 27.5) - 0.3 * (v[1] - 30)])

    objective = Objective(parameters, targets(53.0), "runout", 0.1)
    values = np.array([27.5, 30.0])
    # The derivative of the answer, deliberately a fifth too flat: Broyden's update mends it.
    slope = 0.8 * np.array([[-105 / 27.5, -0.3]]) * parameters.value_per_fitted(values)
    problems = [
        Problem(Formula(toe(shift), ["toe 0"]), objective, values, slope)
        for shift in (-8.0, 0.0, 3.0, 12.0)
    ]
    engine = problems[0].setup
    resolve(engine, problems)
    for problem, shift in zip(problems, (-8.0, 0.0, 3.0, 12.0), strict=True):
        assert problem.reached
        assert problem.refined[0] == pytest.approx(27.5 * np.exp(shift / 105), rel=2e-3)
        assert problem.before.values[0] == pytest.approx(53 + shift)
    assert engine.runs <= 4 * len(problems)


def test_a_question_whose_run_fails_is_given_up():
    parameters = Parameters([strength("a")])
    objective = Objective(parameters, targets(53.0), "runout", 0.1)
    problem = Problem(
        Formula(lambda v: np.array([np.nan]), ["toe 0"]), objective, np.array([27.5]),
        np.array([[-80.0]]),
    )  # fmt: skip
    resolve(problem.setup, [problem])
    assert not problem.reached and problem.setup.runs == 1


def test_equally_good_answers_fit_and_span_the_flat_direction():
    specs = [strength(name, start=4.0, low=0.5, high=40.0) for name in ("1", "2", "6")]
    parameters = Parameters(specs)

    def toes_of(values):
        one, two, six = values
        return np.array([40 / (one * six) ** 0.5 - 2, 30 / two])

    objective = Objective(parameters, targets(11.0, 6.5), "runout", 0.1)
    values = np.array([40 / 13, 30 / 6.5, 40 / 13])
    engine = Formula(toes_of, ["toe 0", "toe 1"])
    steps = -0.01 * values
    _, derivative, _ = engine.derivative(engine.at(values), steps)
    slope = objective.fitted_derivative(derivative, values)
    spread = posterior(objective, derivative, values)
    assert len(spread.flat) == 1
    stops = walk(engine, engine, objective, values, slope, spread.flat, 0.0)
    assert len(stops) == 6
    ones = [stop.values[0] for stop in stops]
    assert max(ones) / min(ones) > 3, "the segment is long"
    for stop in stops:
        assert stop.loss < 0.1
        one, two, six = stop.values
        assert one * six == pytest.approx((40 / 13) ** 2, rel=0.06)
        assert two == pytest.approx(30 / 6.5, rel=0.06)
    assert engine.runs < 60
