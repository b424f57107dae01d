"""A slope that did not flow: its loss, its likelihood, and the limit of flow it leads to."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from flowslide import api
from geometry.survey.no_flow import NoFlow
from inversion.back_analysis.perturbed_answers import Problem, resolve
from inversion.estimation.calibrate import calibrate
from inversion.estimation.data import Targets, make_targets
from inversion.estimation.derivatives import FiniteSteps
from inversion.estimation.forward import Prediction
from inversion.estimation.misfit import Objective, lower_bound, posterior
from inversion.estimation.search import Search
from inversion.estimation.unknowns import Parameters
from inversion.posterior import likelihood
from pipeline.cli import WorkFailed
from report.back_analysis import summary, write_report
from report.data.back_analysis import load_back_analysis
from tests.budget import examples
from tests.inversion.analytic import Formula, strength, toes
from tests.inversion.test_relations import SURVEY, write_case

LIMIT, STD = 1.5, 0.5


def stood(name: str = "no flow", **more) -> NoFlow:
    return NoFlow(
        type="no_flow", name=name, side="right", limit_m=LIMIT, std_m=STD, confidence="assumed",
        source="test", **more,
    )  # fmt: skip


def targets_of(*entries, loss: str = "runout") -> Targets:
    return make_targets(list(entries), fit=None, loss=loss, source="test")


def objective_of(goal: Targets, loss: str = "runout", *, limit: bool = False) -> Objective:
    return Objective(Parameters([strength("a")]), goal, loss, 0.1, limit=limit)


def read(*values: float) -> Prediction:
    return Prediction(np.array(values), np.zeros(len(values)))


# --- the loss ---


@settings(max_examples=examples(60), deadline=None)
@given(moved=st.floats(-5.0, 60.0), loss=st.sampled_from(["runout", "misfit"]))
def test_the_loss_is_one_sided(moved, loss):
    objective = objective_of(targets_of(stood(), loss=loss), loss)
    excess = max(moved - LIMIT, 0.0) / (1.0 if loss == "runout" else STD)
    assert objective.value(read(moved)) == pytest.approx(excess**2)
    assert objective.value(read(np.nan)) == np.inf


def test_next_to_a_toe_it_counts_only_where_it_is_broken():
    goal = targets_of(*toes(10.0), stood())
    objective = objective_of(goal)
    assert objective.value(read(12.0, 0.3)) == pytest.approx(4.0)
    assert objective.value(read(12.0, 4.5)) == pytest.approx(4.0 + 9.0)
    assert objective.silent(read(12.0, 0.3)).tolist() == [False, True]
    assert objective.silent(read(8.0, 4.5)).tolist() == [False, False]
    np.testing.assert_array_equal(
        goal.counted(np.array([[12.0, 0.3], [8.0, 4.5]])), [[12.0, LIMIT], [8.0, 4.5]]
    )


@pytest.mark.parametrize("value", [18.0, 26.0])
def test_the_derivative_of_the_loss_is_that_of_finite_differences(value):
    """Below 22 kPa the second toe runs beyond its limit, above it does not."""

    def formula(values):
        return np.array([60.0 - values[0], 1.5 + 0.3 * (22.0 - values[0])])

    goal = targets_of(*toes(35.0), stood(), loss="misfit")
    objective = objective_of(goal, "misfit")
    engine = Formula(formula, goal.names)
    search = Search(engine, engine, objective, FiniteSteps(objective.parameters, np.zeros(2)))
    evaluation = search.evaluate(np.array([value]), "start", 0)
    residual = objective.whitener @ objective.difference(evaluation.prediction)
    slope = 2.0 * residual @ (objective.whitener @ evaluation.derivative)
    around = [objective.value(read(*formula([value + step]))) for step in (1e-4, -1e-4)]
    assert slope[0] == pytest.approx((around[0] - around[1]) / 2e-4, rel=1e-6)
    assert (evaluation.derivative[1, 0] == 0.0) == (value > 22.0)


# --- the likelihood ---


def log_likelihood(goal: Targets, x: np.ndarray, *, emulated: float = 0.0, other=()) -> np.ndarray:
    """Of predictions (n, m); `emulated` their own error, `other` what another method predicts."""
    m = len(goal.names)
    alternatives = np.reshape(other, (-1, m))
    errors = goal.covariance + emulated**2 * np.eye(m) + alternatives.T @ alternatives
    return likelihood.log_likelihood(goal, x, errors)


@settings(max_examples=examples(60), deadline=None)
@given(
    moved=st.floats(-50.0, 60.0),
    more=st.floats(0.01, 20.0),
    model=st.floats(0.0, 3.0),
    emulated=st.floats(0.0, 2.0),
    other=st.floats(-2.0, 2.0),
)
def test_the_likelihood_is_that_of_a_censored_number(moved, more, model, emulated, other):
    goal = targets_of(stood(model_std_m=model))
    total = np.sqrt(STD**2 + model**2 + emulated**2 + other**2)
    x = np.array([[moved], [moved + more]])
    here, farther = log_likelihood(goal, x, emulated=emulated, other=[other])
    assert here == pytest.approx(norm.logcdf((LIMIT - moved) / total), rel=1e-9, abs=1e-12)
    assert farther <= here <= 0.0


def test_limits_of_the_likelihood():
    goal = targets_of(stood())
    far_below, at_limit = log_likelihood(goal, np.array([[-100.0], [LIMIT]]))
    assert far_below == 0.0 and at_limit == pytest.approx(np.log(0.5))
    # Far beyond the limit it falls as a Gaussian does, without underflow.
    beyond = log_likelihood(goal, np.array([[LIMIT + 40.0 * STD]]))[0]
    assert -0.5 * 40.0**2 - 6.0 < beyond < -0.5 * 40.0**2


def test_with_toes_it_is_the_product_of_their_densities_and_its_probability():
    goal = targets_of(*toes(10.0, std=2.0), stood(), stood("other side"))
    x = np.array([[11.0, 1.0, 0.2], [8.0, 3.0, 0.0]])
    expected = norm.logpdf(10.0, x[:, 0], 2.0) + norm.logcdf((LIMIT - x[:, 1:]) / STD).sum(axis=1)
    np.testing.assert_allclose(log_likelihood(goal, x), expected)
    assert log_likelihood(targets_of(*toes(10.0, std=2.0)), x[:, :1]) == pytest.approx(
        norm.logpdf(10.0, x[:, 0], 2.0)
    )


# --- the limit of flow ---


def runout(values: np.ndarray) -> np.ndarray:
    """20 m at 10 kPa, nothing from 30 kPa on."""
    return np.array([0.05 * max(30.0 - values[0], 0.0) ** 2])


def leap(values: np.ndarray) -> np.ndarray:
    return np.array([0.0 if values[0] >= 33.0 else 25.0])


def search_of(formula, goal: Targets, noise: float = 0.0, **more) -> Search:
    objective = objective_of(goal, limit=True)
    k = int(goal.fitted.sum())
    engine = Formula(formula, goal.names, noise=noise)
    return Search(
        engine,
        engine,
        objective,
        FiniteSteps(objective.parameters, np.zeros(k)),
        **more,
    )


@pytest.mark.parametrize("start", [8.0, 29.0, 80.0])
def test_the_limit_is_found_from_either_side(start):
    search = search_of(runout, targets_of(stood()), max_runs=60)
    found = calibrate(search, np.array([start]), method="gauss_newton", least_m=2.0)
    exact = 30.0 - np.sqrt(LIMIT / 0.05)
    assert found.reached and found.words == "the limit of flow"
    assert found.best.loss < 0.1 and found.values[0] == pytest.approx(exact, rel=0.02)
    assert search.objective.excess(found.best.prediction) <= 0.0, "nothing runs at the answer"
    # With one step along the slope it is the limit itself.
    slope = search.objective.fitted_derivative(found.best.derivative, found.values)
    own = Problem(search.setup, search.objective, found.values, slope, found.best.prediction)
    assert own.refined[0] == pytest.approx(exact, rel=3e-3)
    assert search.runs < 16
    kinds = {evaluation.kind for evaluation in search.evaluations}
    assert kinds <= {"start", "scan", "limit"}


def test_a_leap_over_the_limit_ends_on_the_side_that_stands():
    search = search_of(leap, targets_of(stood()))
    found = calibrate(search, np.array([20.0]), method="gauss_newton", least_m=2.0)
    assert 33.0 <= found.values[0] < 33.0 * 1.005
    assert found.reached and "nothing runs here" in found.words


def test_of_two_sides_the_weaker_decides():
    def both(values):
        return np.array([0.5 * (20.0 - values[0]), 0.5 * (40.0 - values[0])])

    search = search_of(both, targets_of(stood(), stood("other side")))
    found = calibrate(search, np.array([15.0]), method="gauss_newton", least_m=2.0)
    assert found.values[0] == pytest.approx(37.0, rel=0.02)
    assert search.objective.silent(found.best.prediction).tolist() == [True, False]


@pytest.mark.parametrize(
    ("formula", "complaint"),
    [
        (lambda values: np.zeros(1), "nothing runs, not even at a 5"),
        (lambda values: np.full(1, 30.0), "it runs even at a 90, where no flow was measured"),
        (lambda values: np.full(1, np.nan), "the simulation at the start failed"),
    ],
)
def test_a_limit_beyond_the_bounds_is_an_error_of_one_line(formula, complaint):
    with pytest.raises(WorkFailed, match=complaint) as caught:
        calibrate(
            search_of(formula, targets_of(stood())), np.array([30.0]), method="gauss_newton",
            least_m=2.0,
        )  # fmt: skip
    assert "\n" not in str(caught.value)


def test_a_changed_assumption_moves_the_limit():
    goal = targets_of(stood())
    search = search_of(runout, goal)
    found = calibrate(search, np.array([30.0]), method="gauss_newton", least_m=2.0)
    slope = search.objective.fitted_derivative(found.best.derivative, found.values)
    weaker = Formula(lambda values: 1.0 + runout(values), goal.names)
    problem = Problem(weaker, search.objective, found.values, slope)
    resolve(weaker, [problem])
    assert problem.reached
    assert problem.refined[0] == pytest.approx(30.0 - np.sqrt(0.5 / 0.05), rel=0.02)


def test_the_bound_covers_the_truth_in_95_of_100_surveys():
    """Slopes of one strength whose limit varies as the model says: at the bound 95 % would run."""
    random = np.random.default_rng(3)
    limits = 25.0 * np.exp(0.12 * random.standard_normal(20_000))
    bound = lower_bound(25.0, 0.12 * 25.0)
    assert np.mean(limits > bound) == pytest.approx(0.95, abs=0.005)


def test_the_standard_deviation_of_the_limit_is_that_of_the_survey():
    search = search_of(lambda values: np.array([0.5 * (40.0 - values[0])]), targets_of(stood()))
    found = calibrate(search, np.array([30.0]), method="gauss_newton", least_m=2.0)
    spread = posterior(search.objective, found.best.derivative, found.values)
    assert spread.std[0] == pytest.approx(STD / 0.5, rel=0.02)


# --- the whole way ---


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    """A block that stood: its back-analysis, on 240 points."""
    folder = write_case(tmp_path_factory.mktemp("case") / "block", start=40.0, high=80.0)
    sides = [
        {"name": f"no flow to the {side}", "type": "no_flow", "side": side, "limit_m": LIMIT,
         "std_m": STD, "confidence": "assumed", "source": "a test"}
        for side in ("left", "right")
    ]  # fmt: skip
    survey = {**SURVEY, "sets": {"field": sides}}
    (folder / "measurements.yaml").write_text(yaml.safe_dump(survey))
    question = yaml.safe_load((folder / "inversion.yaml").read_text())
    question["sensitivities"] = [
        {"name": "density", "kind": "property", "zones": ["high"], "property": "density",
         "std": 100.0}
    ]  # fmt: skip
    (folder / "inversion.yaml").write_text(yaml.safe_dump(question))
    out = tmp_path_factory.mktemp("out")
    return folder, out, api.back_analyse(folder, out=out, threads=1)


@pytest.mark.slow
def test_a_back_analysis_of_what_stood_is_a_lower_bound(answered):
    folder, out, result = answered
    (answer,) = result.answer.parameters
    assert result.answer.reached and result.answer.words.startswith("the limit of flow")
    share = answer.std_total / answer.value
    assert answer.lower_bound_95 == pytest.approx(answer.value * np.exp(-1.645 * share))
    assert answer.interval_95 == (answer.lower_bound_95, 80.0)
    assert answer.ratio_lower_bound_95 < answer.ratio
    (density,) = result.sensitivities
    assert all(side.reached for side in density.sides)
    heavier, lighter = (side.change["S_r"] for side in density.sides)
    assert lighter < 0.0 < heavier, "a heavier block needs more strength to stand"
    assert all(m.censored and m.measured == LIMIT for m in result.measurements)
    assert max(m.predicted for m in result.measurements) <= LIMIT
    assert len(result.starts) > 1
    for one in result.starts:
        assert one.answer["S_r"] == pytest.approx(answer.value, rel=0.05)
    # Half the strength: something runs, by the same simulations.
    run = api.simulate(folder, strengths_kpa={"sand": 0.5 * answer.value}, threads=1)
    assert max(reading.simulated for reading in run.readings if reading.measured) > LIMIT


@pytest.mark.slow
def test_its_page_and_terminal_say_at_least(answered):
    folder, out, result = answered
    data = load_back_analysis(out, folder)
    bound = result.answer.parameters[0].lower_bound_95
    text = summary(data)
    assert f"≥ {bound:.1f}" in text and "< 1.5 m" in text and "a lower bound alone" in text
    assert "limit of flow: " in text and "The data determine every unknown" not in text
    page = write_report(data, film=False).read_text()
    assert "only a lower bound is known" in page and "(95\N{NO-BREAK SPACE}%)" in page
