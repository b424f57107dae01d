"""Searches that would end in the wrong valley, and steps where many numbers are fitted together."""

from __future__ import annotations

import numpy as np
import pytest

from inversion.estimation.calibrate import calibrate
from inversion.estimation.derivatives import FiniteSteps
from inversion.estimation.unknowns import Parameters
from tests.inversion.analytic import angle, problem, strength, targets


def gone(values):
    """Below 22 kPa the slope has gone: weaker soil only ripples. Measured: 36 and 6.5 m at 33."""
    a = values[0]
    if a < 22.0:
        return np.array([62.0 + np.sin(3.0 * a), 12.0 + np.cos(3.0 * a)])
    return np.array([62.0 - 2.3636 * (a - 22.0), 12.0 - 0.5 * (a - 22.0)])


@pytest.mark.parametrize("method", ["gauss_newton", "lbfgsb"])
@pytest.mark.parametrize("start", [8.0, 20.0, 60.0])
def test_a_search_that_ends_far_from_the_data_looks_around(start, method):
    goal = targets(36.0, 6.5, loss="misfit")
    search = problem([strength("a", low=2.0)], gone, goal, loss="misfit", tolerance=0.01)
    found = calibrate(search, np.array([start]), method=method, least_m=0.5)
    assert found.values[0] == pytest.approx(33.0, rel=0.01)
    assert np.all(np.diff([look.runs for look in found.evaluations]) >= 0)


@pytest.mark.parametrize("method", ["gauss_newton", "lbfgsb"])
def test_a_slide_that_reaches_the_wall_at_the_start_is_sought_among_stronger_soil(method):
    """Weaker soil changes nothing there, which is not a slope that stands."""

    def to_the_wall(values):
        return np.array([min(70.0, 150.0 - 2.0 * values[0])])

    search = problem([strength("a", low=2.0)], to_the_wall, targets(40.0), tolerance=0.1)
    found = calibrate(search, np.array([20.0]), method=method, least_m=6.0)
    assert found.values[0] == pytest.approx(55.0, rel=0.01)


@pytest.mark.parametrize("method", ["gauss_newton", "lbfgsb"])
@pytest.mark.parametrize("seed", range(12))
def test_the_answer_does_not_depend_on_the_last_bit(seed, method):
    """Processors round exp and log differently; in ripples that sends a search elsewhere."""
    draw = np.random.default_rng(seed)

    def rounded(values):
        return gone(values) * (1.0 + 2.2e-16 * draw.integers(-2, 3, 2))

    goal = targets(36.0, 6.5, loss="misfit")
    search = problem([strength("a", low=2.0)], rounded, goal, loss="misfit", tolerance=0.01)
    found = calibrate(search, np.array([8.0]), method=method, least_m=0.5)
    assert found.values[0] == pytest.approx(33.0, rel=0.01)


def test_a_search_that_fits_does_not_look_around():
    search = problem(
        [strength("a")], lambda v: np.array([80.0 - v[0]]), targets(53.0), tolerance=0.1
    )
    found = calibrate(search, np.array([30.0]), method="gauss_newton", least_m=0.5)
    assert found.reached and not [look for look in found.evaluations if look.kind == "scan"]


def test_without_a_better_place_the_answer_stays():
    """Two toes that cannot both be had: the least of the sum of squares is the answer."""
    search = problem(
        [strength("a")], lambda v: np.array([80.0 - v[0], 80.0 - v[0]]), targets(40.0, 60.0),
    )  # fmt: skip
    found = calibrate(search, np.array([30.0]), method="gauss_newton", least_m=0.5)
    assert found.values[0] == pytest.approx(30.0, rel=0.01) and not found.reached


def test_with_many_numbers_the_step_must_stand_out_of_the_noise_of_all():
    """One number moves by 10 per log unit and twenty do not; all have noise 0.05."""
    parameters = Parameters([strength("a")])
    numbers, value = 21, np.array([20.0])
    slope = np.zeros((numbers, 1))
    slope[0] = 10.0 / value[0]
    noise = np.full(numbers, 0.05)
    alone = FiniteSteps(parameters, noise)
    together = FiniteSteps(parameters, noise, whitener=np.eye(numbers))
    taken = []
    for steps in (alone, together):
        steps.learn(slope, value)
        taken.append(abs(np.log1p(steps.steps(value)[0] / value[0])))
    assert taken[0] == pytest.approx(5 * 0.05 / 10.0, rel=1e-6)
    assert taken[1] == pytest.approx(np.sqrt(numbers) * taken[0], rel=1e-6)
    change = np.full(1, -0.03 * value[0])
    assert alone.resolved(slope, change).all()
    assert not together.resolved(slope, change).any()


def test_signs_do_not_cancel_where_errors_are_correlated():
    parameters = Parameters([strength("a"), angle("b")])
    whitener = np.linalg.inv(np.linalg.cholesky(np.array([[1.0, 0.9], [0.9, 1.0]])))
    steps = FiniteSteps(parameters, np.full(2, 0.1), whitener=whitener)
    here = np.array([20.0, 30.0])
    steps.learn(np.array([[0.05, 0.1], [-0.05, 0.1]]), here)
    against, along = (np.linalg.norm(whitener @ column) for column in ([1, -1], [1, 1]))
    assert against > 3 * along, "what goes against the correlation is known better"
    assert np.all(np.isfinite(steps.steps(here)))


def test_noise_does_not_pass_for_knowledge():
    """Differences of pure noise hold sqrt(2) of it; differences far outside it stay as they are."""
    steps = FiniteSteps(Parameters([strength("a")]), np.array([0.5]))
    change = np.array([-1.0])
    shares = [steps.signal(np.array([[0.5 * size]]), change)[0] for size in (1.0, 1.42, 2.0, 10.0)]
    np.testing.assert_allclose(shares, [0.0, 0.09, np.sqrt(0.5), 0.99], atol=0.01)
    assert steps.signal(np.array([[1e-9]]), np.zeros(1))[0] == 1.0, "an exact derivative"
    assert FiniteSteps(Parameters([strength("a")]), np.zeros(1)).signal(
        np.array([[1e-9]]), change
    )[0] == 1.0  # fmt: skip
