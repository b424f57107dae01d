"""Lambda against closed forms and against scipy, and the search for an amplitude."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.hidden_effects.making.detectability import (
    BINS,
    Curve,
    bin_of,
    find_amplitude,
    middle_of,
    refit,
)

PLACES = np.linspace(0.0, 1.0, 12)
SURVEY = 0.05**2 * np.exp(-np.abs(PLACES[:, None] - PLACES) / 0.2)


def reading(u, held=0.0):
    """A response that bends with the strength: the front of a slide at exp(-u)."""
    depth = np.log1p(np.exp(8.0 * (0.3 + np.exp(-u) - PLACES))) / 8.0
    return np.sqrt(depth) + 0.1 * held * PLACES**2


def curve_of(function, survey=SURVEY, levels=60, error=None, ends=(-1.0, 3.0)):
    u = np.linspace(*ends, levels)
    halves = np.array([[function(one) for one in u]] * 2)
    slopes = np.array([(function(one, 1.0) - function(one, -1.0)) / 2.0 for one in u])[..., None]
    none = np.zeros((levels, len(survey), len(survey)))
    missing = np.zeros_like(halves[0])
    return Curve(u, halves, slopes, none if error is None else error, survey, missing)


def by_scipy(slide, survey, u, held):
    """The definition, minimised from many starts."""
    whiten = np.linalg.inv(np.linalg.cholesky(survey))

    def residual(x):
        return np.append(whiten @ (slide - reading(*x)), x[1] - held)

    found = [
        least_squares(residual, [start, held], bounds=([-1.0, -9.0], [3.0, 9.0]))
        for start in np.linspace(-0.9, 2.9, 12)
    ]
    return min(2.0 * one.cost for one in found)


def by_projection(slide, survey, u, held):
    """What a derivative at the truth says of it."""
    step = 1e-4
    slope = np.column_stack([
        (reading(u + step, held) - reading(u - step, held)) / (2 * step),
        (reading(u, held + step) - reading(u, held - step)) / (2 * step),
    ])  # fmt: skip
    whitened = np.linalg.solve(
        np.linalg.cholesky(survey), np.column_stack([slide - reading(u, held), slope])
    )
    basis, _ = np.linalg.qr(np.vstack([whitened[:, 1:], [[0.0, 1.0]]]))
    left = np.append(whitened[:, 0], 0.0)
    left = left - basis @ (basis.T @ left)
    return left @ left


@pytest.mark.parametrize("size", [0.2, 0.6, 1.5])
def test_lambda_is_what_is_left_after_a_real_refit(size):
    """Stronger soil in the front half alone: mostly a strength, which moves far."""
    u, held = 0.2, 0.7
    slide = np.where(PLACES < 0.6, reading(u + size, held), reading(u + 0.7 * size, held))
    found = refit(np.array([slide, slide]), curve_of(reading), u, np.array([held]))
    assert found.seen == pytest.approx(by_scipy(slide, SURVEY, u, held), rel=0.02, abs=0.02)
    assert found.u > u + 0.5 * size


def test_a_projection_overstates_what_a_large_effect_leaves():
    u, held, size = 0.2, 0.7, 1.5
    slide = np.where(PLACES < 0.6, reading(u + size, held), reading(u + 0.7 * size, held))
    found = refit(np.array([slide, slide]), curve_of(reading), u, np.array([held]))
    assert found.seen < 0.5 * by_projection(slide, SURVEY, u, held)


def test_a_small_effect_leaves_what_its_projection_says():
    u, held = 0.9, -0.4
    slide = reading(u, held) + 0.01 * np.sin(9.0 * PLACES)
    found = refit(np.array([slide, slide]), curve_of(reading), u, np.array([held]))
    assert found.seen == pytest.approx(by_projection(slide, SURVEY, u, held), rel=0.02)


def test_the_better_of_two_valleys_is_found():
    """Two strengths look nearly the same; the one far from the truth is the better."""

    def wave(u, held=0.0):
        return np.array([np.cos(2.0 * u), np.sin(2.0 * u) + 0.1 * u, 0.01 * held])

    far = 0.1 + np.pi
    slide = wave(far) + np.array([0.0, 0.01, 0.0])
    curve = curve_of(wave, survey=1e-4 * np.eye(3), levels=120, ends=(0.0, 4.0))
    found = refit(np.array([slide, slide]), curve, 0.1, np.zeros(1))
    assert found.u == pytest.approx(far, abs=0.05)
    assert found.seen < 2.0


def test_a_strength_is_not_seen():
    slide = reading(1.4, 0.3)
    found = refit(np.array([slide, slide]), curve_of(reading), 0.2, np.array([0.3]))
    assert found.seen == pytest.approx(0.0, abs=0.01)
    assert found.u == pytest.approx(1.4, abs=0.01)


def test_a_prior_holds_a_parameter_back():
    """The other parameter has moved by d: of d^2 c^2 / (c^2 + 1) its prior leaves the share."""

    def straight(u, held=0.0):
        return np.array([u, 3.0 * held])

    slide = straight(0.5) + np.array([0.0, 2.0])
    found = refit(
        np.array([slide, slide]), curve_of(straight, survey=np.eye(2), levels=41), 0.5, np.zeros(1)
    )
    assert found.seen == pytest.approx(4.0 / 10.0)


def test_the_noise_of_the_runs_is_not_taken_for_an_effect():
    """Two noisy halves of nothing: their own chi2 would be about the number of measurements."""
    draw = np.random.default_rng(4)
    lower = np.linalg.cholesky(SURVEY)
    curve = curve_of(reading)
    seen = [
        refit(reading(0.5) + draw.normal(size=(2, 12)) @ lower.T, curve, 0.5, np.zeros(1)).seen
        for _ in range(40)
    ]
    assert np.mean(seen) < 3.0


def test_the_covariance_is_that_of_the_refitted_state():
    """The model errs more where it is strong; a strength that has moved there is judged by that."""
    error = np.array([np.eye(12) * 0.05 * (u > 0.8) for u in np.linspace(-1.0, 3.0, 60)])
    slide = reading(1.6) + 0.05 * np.sin(9.0 * PLACES)
    halves = np.array([slide, slide])
    sharp = refit(halves, curve_of(reading), 0.2, np.zeros(1))
    blurred = refit(halves, curve_of(reading, error=error), 0.2, np.zeros(1))
    assert blurred.u == pytest.approx(1.6, abs=0.3)
    assert blurred.seen < 0.2 * sharp.seen


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


def test_where_nothing_was_seen_more_is_tried():
    """At first the noise of the runs hides the effect whole."""
    amplitude, seen = find_amplitude(
        lambda sizes: [max(a**2 - 4.0, 0.0) for a in sizes], (0.5, 1.0, 2.0), 6.0, 20.0
    )
    assert seen == pytest.approx(20.0, rel=0.35)
    assert amplitude == pytest.approx(math.sqrt(4.0 + seen))


def test_nothing_to_be_seen():
    _, seen = find_amplitude(lambda sizes: [0.0] * len(sizes), (1.0, 2.0, 3.0), 4.0, 10.0)
    assert seen < 1.0
    assert find_amplitude(lambda sizes: [math.nan], (1.0, 2.0, 3.0), 4.0, 10.0) == (0.0, 0.0)
