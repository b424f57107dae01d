"""The error of a learned simulator: pairs, correction, covariance, the loop with formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inversion.engines.model_error import (
    Corrected,
    Pairs,
    Settling,
    paired,
    states_around,
    with_error,
)
from inversion.estimation.derivatives import FiniteSteps
from inversion.estimation.forward import SectionSetup
from inversion.estimation.gauss_newton import gauss_newton
from inversion.estimation.misfit import Objective, posterior
from inversion.estimation.search import Search
from inversion.estimation.unknowns import Parameters
from pipeline.cli import WorkFailed
from tests.inversion.analytic import Formula, angle, strength, targets

PARAMETERS = Parameters([strength("a"), angle("b")])
NAMES = ["toe 0", "toe 1"]
HERE = np.array([30.0, 30.0])


def truth(values):
    return np.array([1500.0 / values[0], 800.0 / values[0] - 0.2 * (values[1] - 30.0)])


def surrogate(values):
    """Too far by 3 m and by 1 m, and not quite as steep."""
    return truth(values) + np.array([3.0 + 0.1 * (values[0] - 30.0), 1.0])


def pairs_of(wrong=surrogate, right=truth, count: int = 5) -> Pairs:
    states, width = states_around(PARAMETERS, HERE, np.array([0.2, 0.2]), count)
    return asked_both(wrong, right, targets(50.0, 26.0), states, width)


def asked_both(wrong, right, goal, states, width) -> Pairs:
    """The pairs of two formulas; the question is one and the same, so each answers with its own."""
    setup = SectionSetup(None, None, PARAMETERS, goal, {})
    return paired(Answering(wrong, goal.names), Answering(right, goal.names), setup, states, width)[
        0
    ]


class Answering(Formula):
    """Answers every question by its own formula."""

    def predict(self, requests):
        return super().predict([self.at(request.values) for request in requests])


def test_states_surround_the_answer_within_the_bounds():
    states, width = states_around(PARAMETERS, HERE, np.array([10.0, 1e-9]), 9)
    assert states.shape == (9, 2) and np.array_equal(states[0], HERE)
    away = np.log(states[:, 0] / 30.0)
    assert 0.1 < np.abs(away).max() <= 0.2 + 1e-9  # however wide the standard deviation is
    scaled = np.array([PARAMETERS.to_fitted(one) for one in states])
    assert np.all(np.abs(scaled - scaled[0]) <= width + 1e-9)
    assert np.abs(scaled - scaled[0])[:, 1].max() > 0.05  # however narrow
    again, _ = states_around(PARAMETERS, HERE, np.array([10.0, 1e-9]), 9)
    assert np.array_equal(states, again)
    corner, _ = states_around(PARAMETERS, np.array([90.0, 37.0]), np.array([1.0, 1.0]), 9)
    assert np.all(corner <= PARAMETERS.high) and len(np.unique(corner[:, 0])) > 3


def test_mean_and_covariance_of_the_pairs():
    pairs = pairs_of()
    own = np.array([truth(one) - surrogate(one) for one in pairs.states])
    assert np.allclose(pairs.differences, own)
    assert np.allclose(pairs.mean, own.mean(axis=0)) and pairs.mean[1] == pytest.approx(-1.0)
    sample = np.cov(own, rowvar=False)
    assert np.allclose(pairs.covariance, 1.2 * sample + 0.1 * np.diag(np.diag(sample)))
    assert pairs.covariance[0, 0] > 0.01 and pairs.covariance[1, 1] < 1e-12


def test_the_error_enters_the_covariance_by_the_name_of_a_number():
    pairs = pairs_of()
    goal = targets(50.0, 26.0, std=0.5)
    found = with_error(goal, pairs)
    assert np.allclose(found.covariance, 0.25 * np.eye(2) + pairs.covariance)
    assert np.allclose(goal.covariance, 0.25 * np.eye(2))
    swapped = replace(goal, names=["toe 1", "other"])
    found = with_error(swapped, pairs)
    expected = 0.25 + np.array([pairs.covariance[1, 1], 0.0])
    assert np.allclose(np.diag(found.covariance), expected)


def test_corrected_predictions():
    engine = Corrected(Formula(surrogate, NAMES), {"toe 0": -3.0, "elsewhere": 9.0})
    here = engine.engine.at(HERE)
    (prediction,) = engine.predict([here])
    assert np.allclose(prediction.values, [50.0, surrogate(HERE)[1]])
    base, derivative, steps = engine.derivative(here, np.array([0.1, 0.1]))
    plain = Formula(surrogate, NAMES).derivative(here, np.array([0.1, 0.1]))
    assert np.allclose(base.values, prediction.values)
    assert np.array_equal(derivative, plain[1]) and np.array_equal(steps, plain[2])
    other = Formula(surrogate, ["elsewhere", "toe 0"])  # corrected by the names of its question
    first, second = engine.predict([here, other.at(HERE)])
    assert np.allclose(first.values, prediction.values)
    assert np.allclose(second.values, surrogate(HERE) + np.array([9.0, -3.0]))
    assert engine.runs == 6


def test_pairs_that_failed_are_left_out_and_too_few_are_no_measure():
    def fails_above(limit):
        return lambda values: truth(values) * (1.0 if values[0] < limit else np.nan)

    states, width = states_around(PARAMETERS, HERE, np.array([0.2, 0.2]), 5)
    limit = np.sort(states[:, 0])[-1]
    assert len(pairs_of(right=fails_above(limit)).states) == 4
    with pytest.raises(WorkFailed, match="of 5 runs next to the material point method"):
        pairs_of(right=fails_above(np.sort(states[:, 0])[2]))
    with pytest.raises(WorkFailed):  # none at the answer itself
        pairs_of(right=lambda values: truth(values) * (np.nan if values[0] == 30.0 else 1.0))


def test_a_number_that_cannot_be_read_is_no_pair_but_does_no_harm():
    goal = targets(50.0, 26.0)
    goal = replace(goal, roles=["fitted", "compared"])
    states, width = states_around(PARAMETERS, HERE, np.array([0.2, 0.2]), 5)
    pairs = asked_both(
        surrogate, lambda values: truth(values) * np.array([1.0, np.nan]), goal, states, width
    )
    assert np.isnan(pairs.mean[1]) and np.all(pairs.covariance[1] == 0.0)
    assert np.isfinite(pairs.mean[0]) and pairs.covariance[0, 0] > 0.0


def test_a_constant_error_is_taken_off_and_the_rest_is_counted():
    """One strength, one toe: alone the answer is wrong; corrected it is right and less sure."""
    one = Parameters([strength("a")])
    goal = targets(50.0, std=0.5)

    def right(values):
        return np.array([1500.0 / values[0]])

    def wrong(values):
        return right(values) + 5.0 + 0.3 * np.sin(40.0 * values[0])

    def fit(engine, setup, goal, start):
        objective = Objective(one, goal, "runout", 1e-4)
        search = Search(engine, setup, objective, FiniteSteps(one, np.zeros(1)))
        return objective, gauss_newton(search, search.evaluate(start, "start", 0))

    smooth = Formula(lambda values: right(values) + 5.0, ["toe 0"])
    _, alone = fit(smooth, smooth, goal, np.array([40.0]))
    assert alone.values[0] == pytest.approx(1500.0 / 45.0, rel=1e-3)
    states, width = states_around(one, alone.values, np.array([0.1]), 6)
    pairs = asked_both(smooth.formula, right, goal, states, width)
    corrected = Corrected(smooth, dict(zip(pairs.names, pairs.mean, strict=True)))
    objective, found = fit(corrected, smooth, with_error(goal, pairs), alone.values)
    assert found.values[0] == pytest.approx(30.0, rel=1e-3)
    assert np.allclose(objective.covariance, 0.25)  # a constant is known exactly

    rippled = asked_both(wrong, right, goal, states, width)
    objective = Objective(one, with_error(goal, rippled), "runout", 1e-4)
    slope = np.array([[-1500.0 / 30.0**2]])
    whole = posterior(objective, slope, np.array([30.0]))
    survey = posterior(objective, slope, np.array([30.0]), errors=goal.covariance)
    plain = posterior(Objective(one, goal, "runout", 1e-4), slope, np.array([30.0]))
    assert np.allclose(survey.std, plain.std)
    added = np.sqrt(whole.std**2 - survey.std**2)
    expected = np.sqrt(rippled.covariance[0, 0]) / abs(slope[0, 0])
    assert 0.05 < added[0] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("steepness", [0.5, 1.0, 2.5])
def test_a_correction_settles_however_steep_the_truth_is(steepness):
    """One strength z, two toes: the surrogate is off by a constant and by its slope."""
    slope, wanted = np.array([3.0, -1.0]), np.array([10.0, 4.0])
    constant = np.array([2.0, -5.0])
    weight = np.array([1.0, 2.0])

    def tried(correction):
        """The least-squares answer of the corrected surrogate slope z, and what is left there."""
        z = (weight * slope) @ (weight * (wanted - correction)) / np.sum((weight * slope) ** 2)
        left = constant + steepness * slope * z - (slope * z + correction)
        return Settling(correction, left, float(np.max(np.abs(left * weight))), weight)

    first = tried(np.zeros(2))
    found, before = tried(first.following(None)), first
    for _ in range(2):
        found, before = tried(found.following(before)), found
    assert found.off < 1e-6 * first.off
    assert first.off > 1.0
