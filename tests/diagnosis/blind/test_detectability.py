"""Lambda by closed form, and the search for an amplitude."""

import math

import numpy as np
import pytest

from diagnosis.blind.detectability import BINS, bin_of, detectability, find_amplitude, middle_of

NO_PRIOR = np.zeros((0, 1))


def test_what_no_parameter_imitates_counts_whole():
    change = np.array([3.0, 0.0, 4.0])
    slope = np.array([[0.0], [1.0], [0.0]])
    assert detectability(change, slope, np.eye(3), NO_PRIOR) == pytest.approx(25.0)


def test_what_a_parameter_imitates_is_not_seen():
    slope = np.array([[1.0], [2.0], [-1.0]])
    assert detectability(3.0 * slope[:, 0], slope, np.eye(3), NO_PRIOR) == pytest.approx(0.0)


def test_a_prior_holds_a_parameter_back():
    """One number, one parameter with prior 1: chi2 d^2 / (1 + J^2) is left."""
    found = detectability(np.array([2.0]), np.array([[3.0]]), np.eye(1), np.eye(1))
    assert found == pytest.approx(4.0 / 10.0)


def test_lambda_falls_with_the_variance():
    change, slope = np.array([1.0, -1.0]), np.array([[1.0], [1.0]])
    one = detectability(change, slope, np.eye(2), NO_PRIOR)
    assert detectability(change, slope, 4.0 * np.eye(2), NO_PRIOR) == pytest.approx(one / 4.0)


def test_bins():
    assert [bin_of(v) for v in (2.9, 3.0, 9.9, 10.0, 59.9, 199.0, 200.0)] == [
        None, 0, 0, 1, 2, 3, None]  # fmt: skip
    assert all(bin_of(middle_of(number)) == number for number in range(len(BINS) - 1))


@pytest.mark.parametrize("power", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("wanted", [5.0, 40.0, 110.0])
def test_the_search_finds_a_power_law(power, wanted):
    asked = []

    def lambdas(amplitudes):
        asked.extend(amplitudes)
        return [30.0 * a**power for a in amplitudes]

    amplitude, seen = find_amplitude(lambdas, (0.3, 1.0, 3.0), 10.0, wanted)
    assert abs(math.log(seen / wanted)) < 0.35
    assert seen == pytest.approx(30.0 * amplitude**power)
    assert len(asked) <= 7


def test_the_search_stays_below_the_highest():
    amplitude, seen = find_amplitude(
        lambda sizes: [a**2 for a in sizes], (0.1, 0.2, 0.4), 2.0, 100.0
    )
    assert amplitude == 2.0
    assert seen == 4.0


def test_the_search_avoids_what_fails():
    """Runs above 0.5 fail; the best below is taken."""
    amplitude, _ = find_amplitude(
        lambda sizes: [100.0 * a**2 if a <= 0.5 else math.nan for a in sizes],
        (0.2, 1.0, 5.0), 10.0, 16.0,
    )  # fmt: skip
    assert 0.3 < amplitude <= 0.5


def test_nothing_to_be_seen():
    assert find_amplitude(lambda sizes: [0.0] * len(sizes), (1.0, 2.0, 3.0), 4.0, 10.0) == (
        0.0,
        0.0,
    )
