"""Evidence: Laplace's integral against quadrature, shares within bounds, credible sets."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.optimize import lsq_linear

from diagnosis.selection.evidence import (
    credible_set,
    ln_choices,
    ln_evidence,
    probabilities,
    share_within,
)
from inversion.estimation.data import Data
from inversion.estimation.surface_search import Fit
from inversion.estimation.unknowns import Unknowns
from inversion.problem.unknown import Scale, Unknown
from tests.budget import examples
from tests.diagnosis.straight import Straight, errors, straight, truth


def fitted(case: Straight, space: Unknowns) -> Fit:
    """The bounded least of a model that is linear in all its unknowns."""
    data, slope = case.data, case.slope(space)
    rows, constants = space.prior
    matrix = np.vstack([data.whitened(slope), rows])
    right = np.concatenate([data.whitened(data.measured - case.level), constants])
    x = lsq_linear(matrix, right, bounds=(space.low, space.high), tol=1e-14).x
    prediction = case.level + slope @ x
    total = float(np.sum((matrix @ x - right) ** 2))
    return Fit(space, x, prediction, slope, total)


def by_quadrature(case: Straight, space: Unknowns) -> float:
    """ln of the integral of likelihood times prior over all unknowns, on a grid of Gauss nodes."""
    data, slope = case.data, case.slope(space)
    rows, constants = space.prior
    matrix = np.vstack([data.whitened(slope), rows])
    right = np.concatenate([data.whitened(data.measured - case.level), constants])
    fit = fitted(case, space)
    # Where two unknowns do the same the matrix is singular: the bounds alone limit the integral.
    values, vectors = np.linalg.eigh(matrix.T @ matrix)
    std = np.sqrt(np.sum(vectors**2 / np.maximum(values, 1e-12 * values[-1]), axis=1))
    nodes, weights = np.polynomial.legendre.leggauss(32)
    grids, volumes = [], []
    for low, high, at, s in zip(space.low, space.high, fit.x, std, strict=True):
        begin, end = max(low, at - 6.5 * s), min(high, at + 6.5 * s)
        grids.append(0.5 * (end + begin) + 0.5 * (end - begin) * nodes)
        volumes.append(0.5 * (end - begin) * weights)
    points = np.stack([g.ravel() for g in np.meshgrid(*grids, indexing="ij")])
    weight = np.prod(np.meshgrid(*volumes, indexing="ij"), axis=0).ravel()
    # |A x - b|^2 by its parts: the points are millions.
    square = np.einsum("in,ij,jn->n", points, matrix.T @ matrix, points, optimize=True)
    total = square - 2.0 * (matrix.T @ right) @ points + right @ right
    least = total.min()
    value = np.sum(weight * np.exp(-0.5 * (total - least)))
    return float(np.log(value) - 0.5 * least - space.ln_prior_width)


@pytest.mark.parametrize("bounds", [(-50.0, 50.0), (0.0, 0.8), (0.0, 50.0)])
def test_laplace_is_exact_where_the_model_is_linear(bounds):
    case = straight(seed=3, effects={"bend": 0.6})
    free = Unknown("bend", *bounds, Scale())
    with_effect, without = case.space([free]), case.space([])
    gain = ln_evidence(case.data, fitted(case, with_effect), 1) - ln_evidence(
        case.data, fitted(case, without), 1
    )
    exact = by_quadrature(case, with_effect) - by_quadrature(case, without)
    assert gain == pytest.approx(exact, abs=0.02)


@pytest.mark.parametrize(
    ("name", "amplitude", "strength"),
    [("like_strength", 1.0, 190.0), ("like_strength", 1.0, 215.0), ("bend", 1.0, 260.0),
     ("bend", -1.0, 1.5)],
)  # fmt: skip
def test_laplace_is_exact_where_a_parameter_rests_on_its_bound(name, amplitude, strength):
    """The strength of the base model is at 2 or 200 kPa; one of the effects brings it back."""
    case = Straight(truth({name: amplitude}, strength=strength) + errors(3))
    without = case.space([])
    with_effect = case.space([Unknown(name, -3.0, 3.0, Scale())])
    fits = [fitted(case, space) for space in (without, with_effect)]
    ends = without.low[0], without.high[0]
    assert min(abs(fits[0].x[0] - end) for end in ends) < 1e-6
    gain = ln_evidence(case.data, fits[1], 1) - ln_evidence(case.data, fits[0], 1)
    exact = by_quadrature(case, with_effect) - by_quadrature(case, without)
    assert gain == pytest.approx(exact, abs=0.15)


def test_laplace_with_a_prior_and_with_two_amplitudes():
    case = straight(seed=5, effects={"bend": 0.6, "step": 1.0})
    step = Unknown("step", 0.0, 1.5, Scale())
    two = case.space([Unknown("bend", -3.0, 3.0, Scale(), (0.5, 0.3)), step])
    one = case.space([step])
    gain = ln_evidence(case.data, fitted(case, two), 1) - ln_evidence(
        case.data, fitted(case, one), 1
    )
    assert gain == pytest.approx(by_quadrature(case, two) - by_quadrature(case, one), abs=0.03)


def test_odds_are_one_in_k_for_an_effect_and_one_in_all_pairs_for_two():
    case = straight(seed=1, effects={})
    fit = fitted(case, case.space([Unknown("bend", -2.0, 2.0, Scale())]))
    lost = ln_evidence(case.data, fit, 1) - ln_evidence(case.data, fit, 12)
    assert lost == pytest.approx(math.log(12))
    two = case.space([Unknown(name, -2.0, 2.0, Scale()) for name in ("bend", "step")])
    lost = ln_evidence(case.data, fitted(case, two), 2) - ln_evidence(
        case.data, fitted(case, two), 12
    )
    assert lost == pytest.approx(math.log(66))


def test_evidence_does_not_hang_on_the_unit_of_the_amplitude():
    case = straight(seed=2, effects={"bend": 0.6})
    found = []
    for unit in (0.1, 1.0, 25.0):
        space = case.space([Unknown("bend", -3.0, 3.0, Scale(unit))])
        found.append(ln_evidence(case.data, fitted(case, space), 5))
    assert np.ptp(found) < 1e-6


@settings(max_examples=examples(30), deadline=None)
@given(
    st.floats(-2, 2), st.floats(-2, 2), st.floats(0.2, 3), st.floats(0.2, 3), st.floats(-0.95, 0.95)
)
def test_share_of_a_gaussian_within_a_box(first, second, s1, s2, correlation):
    mean = np.array([first, second])
    cross = correlation * s1 * s2
    covariance = np.array([[s1**2, cross], [cross, s2**2]])
    low, high = np.array([-1.0, 0.0]), np.array([1.5, 2.0])
    exact = stats.multivariate_normal(mean, covariance).cdf(high, lower_limit=low)
    assert share_within(mean, covariance, low, high) == pytest.approx(exact, abs=2e-4)


def test_probabilities_and_their_credible_set():
    share = probabilities({("a",): -3.0, ("b",): -3.0 + math.log(3.0), (): -50.0})
    assert share[("b",)] == pytest.approx(0.75) and share[("a",)] == pytest.approx(0.25)
    assert list(share) == [("b",), ("a",), ()]
    assert list(credible_set(share, 0.7)) == [("b",)]
    assert list(credible_set(share, 0.9)) == [("b",), ("a",)]


def test_data_weighs_by_the_inverse_covariance():
    covariance = np.array([[4.0, 1.0], [1.0, 9.0]])
    data = Data(np.array([1.0, 2.0]), covariance, np.array([0, 1]), np.array([], dtype=int))
    residual = data.residual(np.zeros(2))
    expected = data.measured @ np.linalg.solve(covariance, data.measured)
    assert residual @ residual == pytest.approx(expected)


@given(st.integers(1, 30), st.integers(0, 4))
def test_prior_odds_share_one_among_all_models_of_a_size(candidates, effects):
    """As many as there are ways to choose; the order of two effects makes no other model."""
    models = sum(1 for _ in combinations(range(candidates), effects))
    if models:
        assert math.exp(-ln_choices(candidates, effects)) * models == pytest.approx(1.0)
    else:
        assert ln_choices(candidates, effects) == 0.0


@settings(max_examples=examples(60))
@given(
    unit=st.floats(1e-6, 1e6),
    share=st.floats(0.11, 1e4),
    decades=st.booleans(),
)
def test_an_amplitude_is_its_count_on_either_scale(unit, share, decades):
    scale, amplitude = Scale(unit, "decades" if decades else "plain"), unit * share
    count = scale.count(amplitude)
    assert scale.value(count) == pytest.approx(amplitude)
    assert scale.count(0.0) == scale.value(0.0) == 0.0
    step = 1e-5
    slope = (scale.value(count + step) - scale.value(count - step)) / (2.0 * step)
    assert scale.slope(count) == pytest.approx(slope, rel=1e-6)
    assert scale.count(10.0 * amplitude) - count == pytest.approx(1.0 if decades else 9.0 * share)
    assert scale.spread(amplitude, 0.1 * amplitude) == pytest.approx(
        0.1 / math.log(10.0) if decades else 0.1 * share
    )
    many = np.array([0.0, amplitude])
    assert scale.count(many).tolist() == [0.0, count]
    assert scale.value(scale.count(many)) == pytest.approx(many)


@settings(max_examples=examples(60))
@given(unit=st.floats(0.01, 10.0), value=st.floats(1e-3, 1e4))
def test_a_logarithm_counts_in_its_unit(unit, value):
    scale = Scale(unit, "logarithm")
    count = scale.count(value)
    assert scale.value(count) == pytest.approx(value)
    assert scale.count(value * math.exp(unit)) - count == pytest.approx(1.0)
    assert scale.slope(count) == pytest.approx(unit * value)
    assert scale.spread(value, 0.1 * value) == pytest.approx(0.1 / unit)


def test_a_gaussian_in_decades_has_the_volume_of_one_in_counts():
    spread = 0.5 * math.log(10.0)
    scale = Scale(0.1, "decades")
    decades = Unknown("k", 1e-9, 1e9, scale, (scale.count(1.0), scale.spread(1.0, spread)))
    plain = Unknown("count", 0.0, 11.0, Scale(), (2.0, 0.5))
    assert decades.normal == pytest.approx(plain.normal)
    assert decades.ln_prior_width == pytest.approx(plain.ln_prior_width, abs=1e-4)
