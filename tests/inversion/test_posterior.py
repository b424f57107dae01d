"""The whole posterior: priors, emulator, sampler, shares, and closed forms of all of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import check_grad
from scipy.special import ndtr

from geometry.survey.no_flow import NoFlow
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.deviations import deviating
from inversion.engines.run_store import RunStore
from inversion.engines.small_cells import SmallCells
from inversion.estimation import gaussian_process
from inversion.estimation.data import make_targets
from inversion.posterior.calibration import coverage, rank_of
from inversion.posterior.confirmation import confirmed
from inversion.posterior.draws import Draws, load_draws, save_draws
from inversion.posterior.emulator import Warp, make_emulator
from inversion.posterior.infer import Inference, at_shares, design, sample
from inversion.posterior.likelihood import Likelihood, log_likelihood
from inversion.posterior.runs import CaseModel
from inversion.posterior.sampling import resampled, spread_out, tempered
from inversion.posterior.summary import coarse_remarks, shares
from inversion.posterior.varied_case import varied_case
from inversion.problem.question import FixedProperty, Prior
from inversion.problem.unknown import Unknown, unknown_parameter
from pipeline.cli import InputError, WorkFailed
from pipeline.config import PosteriorSettings
from tests.inversion.analytic import angle, strength, targets, toes

STRENGTH = unknown_parameter(strength("a"))
SCORE = Unknown("z", -3.0, 3.0, normal=(0.0, 1.0), unit="std")
FEW = PosteriorSettings(coarse_runs=64, refined_runs=24, fine_runs=8, live_points=150, draws=2000)


def runout(values: np.ndarray) -> np.ndarray:
    """53 m at 18 kPa, falling with its power 1.5, and 3 m for each score."""
    return 53.0 * (values[:, 0] / 18.0) ** -1.5 + 3.0 * values[:, 1]


@dataclass
class FormulaModel:
    """`inversion.posterior.runs.EmulatedModel` by a formula; fine runs go `beyond` farther."""

    formula: Callable[[np.ndarray], np.ndarray]
    unknowns: tuple[Unknown, ...] = (STRENGTH, SCORE)
    names: list[str] = field(default_factory=lambda: ["toe 0"])
    two_fidelities: bool = False
    beyond: float = 0.0
    otherwise: dict[str, float] = field(default_factory=dict)
    asked: list[tuple[int, bool]] = field(default_factory=list)
    own_std: float = 0.0
    cells: SmallCells | None = None

    def drawable(self, values: np.ndarray) -> np.ndarray:
        return values

    def run(self, values: np.ndarray, *, coarse: bool) -> np.ndarray:
        self.asked.append((len(values), coarse))
        found = self.formula(values).reshape(len(values), -1)
        return found + (self.beyond if self.two_fidelities and not coarse else 0.0)

    def simulated_otherwise(self, values: np.ndarray) -> dict[str, np.ndarray]:
        return {name: np.full(len(self.names), by) for name, by in self.otherwise.items()}

    def error_std(self, values: np.ndarray) -> np.ndarray:
        return np.full(len(self.names), self.own_std)

    def cells_at(self, values: np.ndarray) -> SmallCells | None:
        return self.cells


def by_quadrature(formula, measured: float, std: float) -> tuple[float, float, float]:
    """Mean and std of the strength, and ln Z, by brute force over the prior."""
    share = (np.arange(400) + 0.5) / 400
    grid = np.stack(np.meshgrid(STRENGTH.at(share), SCORE.at(share)), axis=-1).reshape(-1, 2)
    density = np.exp(-0.5 * ((formula(grid) - measured) / std) ** 2) / (std * np.sqrt(2 * np.pi))
    weight = density / density.sum()
    mean = weight @ grid[:, 0]
    return mean, np.sqrt(weight @ (grid[:, 0] - mean) ** 2), np.log(density.mean())


# --- priors ---


@pytest.mark.parametrize(
    "unknown",
    [
        STRENGTH,
        SCORE,
        unknown_parameter(strength("a", prior=Prior(mean=20.0, std=6.0))),
        unknown_parameter(angle("b", prior=Prior(mean=31.0, std=3.0))),
        Unknown("half", 0.0, 3.0, normal=(0.0, 1.0), unit="std"),
    ],
    ids=lambda one: one.name,
)
def test_a_prior_is_one_distribution(unknown):
    share = np.linspace(0.001, 0.999, 4001)
    values = unknown.at(share)
    np.testing.assert_allclose(unknown.share_below(values), share, atol=1e-9)
    whole = unknown.at(np.linspace(0.0, 1.0, 20_001))
    assert trapezoid(unknown.density(whole), whole) == pytest.approx(1.0, abs=2e-3)
    half = whole <= unknown.at(0.5)
    assert trapezoid(unknown.density(whole[half]), whole[half]) == pytest.approx(0.5, abs=2e-3)


def test_bounds_alone_are_equally_likely_as_the_fit_sees_them():
    assert STRENGTH.at(0.5) == pytest.approx(np.sqrt(5.0 * 90.0))
    assert unknown_parameter(angle("b")).at(0.5) == pytest.approx(32.0)


def test_a_lognormal_prior_has_its_median_where_the_fit_has_it():
    unknown = unknown_parameter(strength("a", prior=Prior(mean=20.0, std=3.0)))
    assert unknown.at(0.5) == pytest.approx(20.0, rel=0.01)
    np.testing.assert_allclose(
        unknown.at(ndtr(np.array([-1.0, 1.0]))), 20.0 * np.exp([-0.15, 0.15]), rtol=0.01
    )


# --- the section ---


def test_one_standard_deviation_is_what_a_back_analysis_tries(lsfd):
    from flowslide import load_case

    case = inversion_case(load_case(lsfd))
    section = varied_case(case)
    assert [one.name for one in section.unknowns[2:]] == [
        "top of the liquefied zone", "pool level",
    ]  # fmt: skip
    tried = dict((s.name, sides) for s, sides in case.sensitivities[0])
    for place, nuisance in enumerate(section.nuisances):
        for sense, side in zip((1.0, -1.0), tried[nuisance.name], strict=True):
            scores = np.zeros(len(section.nuisances))
            scores[place] = sense
            found = deviating(case.setup, section.nuisances, scores, case.source)
            assert found.scene == side.setup.scene
            assert found.foot == pytest.approx(side.setup.foot)
    still = deviating(case.setup, section.nuisances, np.zeros(2), case.source)
    assert still.scene == case.setup.scene


def test_what_two_assumptions_say_of_one_soil_adds_up(lsfd):
    from flowslide import load_case

    case = inversion_case(load_case(lsfd))
    zones = [zone.name for zone in case.scene.zones]

    def density(name, where, std):
        return FixedProperty(kind="property", name=name, zones=where, property="density", std=std)

    uncertain = [density("all", zones, 50.0), density("one", zones[:1], 80.0)]
    drawn = case.scene

    def found(scores):
        scene = deviating(case.setup, uncertain, scores, "test").scene
        of = {zone.name: scene.materials[zone.material].density for zone in scene.zones}
        before = {zone.name: drawn.materials[zone.material].density for zone in drawn.zones}
        return [of[name] - before[name] for name in zones[:2]]

    assert found([1.0, 0.0]) == pytest.approx([50.0, 50.0])
    assert found([1.0, 1.0]) == pytest.approx([130.0, 50.0])
    assert found([0.0, -1.0]) == pytest.approx([-80.0, 0.0])


def test_a_prior_is_cut_where_the_section_no_longer_holds_together(lsfd):
    from flowslide import load_case

    text = (lsfd / "inversion.yaml").read_text()
    wide = text.replace("[15.24, 6.0]", "[21.34, 8.4]").replace("[2.93, 6.0]", "[4.1, 8.4]")
    (lsfd / "inversion.yaml").write_text(wide)
    section = varied_case(inversion_case(load_case(lsfd)))
    top = section.unknowns[2]
    assert -3.0 < top.low < -0.9 and 0.9 < top.high < 3.0
    assert any(line.startswith("top of the liquefied zone: ") for line in section.remarks)
    far = np.array([[30.0, 30.0, 1.2 * top.high, 0.5]])
    model = CaseModel(section, RunStore(None))
    assert np.isnan(model.run(far, coarse=False)).all()
    (near,) = model.drawable(far)
    assert 0.5 * top.high < near[2] <= top.high
    assert near[[0, 1, 3]].tolist() == [30.0, 30.0, 0.5]


# --- the emulator ---


def some_runs(n: int = 60):
    points = np.random.default_rng(1).uniform(-1, 1, (n, 3))
    return points, np.sin(2 * points[:, 0]) + 0.5 * points[:, 1] * points[:, 0]


@pytest.mark.parametrize("together", [False, True])
def test_the_gradient_of_the_process_is_right(together):
    points, numbers = some_runs()
    if together:
        numbers = np.stack([numbers, points[:, 2], np.cos(points[:, 0])], axis=1)
    apart = (points[:, None] - points[None]) ** 2
    more = (apart, points @ points.T, numbers / numbers.std())
    at = np.random.default_rng(0).normal(0.0, 0.3, 6)
    error = check_grad(
        lambda logs: gaussian_process._cost(logs, *more)[0],
        lambda logs: gaussian_process._cost(logs, *more)[1],
        at,
    )
    assert error < 1e-4


def test_a_process_predicts_and_knows_its_error():
    points, numbers = some_runs()
    noisy = numbers + 0.05 * np.random.default_rng(2).standard_normal(len(numbers))
    process = gaussian_process.fit(points, noisy)
    there, truth = some_runs(500)
    there = there[100:] * 0.9
    truth = np.sin(2 * there[:, 0]) + 0.5 * there[:, 1] * there[:, 0]
    mean, variance = process.predict(there, with_noise=False)
    assert np.sqrt(np.mean((mean - truth) ** 2)) < 0.05
    assert np.sqrt(np.mean((mean - truth) ** 2 / variance)) < 1.6
    assert process.noise == pytest.approx(0.05, rel=0.5)


def test_numbers_that_belong_together_share_a_process():
    points, first = some_runs()
    both = np.stack([first, 3.0 - 10.0 * first, np.full(len(first), 2.0)], axis=1)
    one, two = gaussian_process.fit(points, first), gaussian_process.fit(points, both)
    there = points[::7] * 0.9
    mean, variance = two.predict(there)
    assert mean.shape == (len(there), 3) and variance.shape == (len(there),)
    np.testing.assert_allclose(mean[:, 0], one.predict(there)[0], atol=0.01)
    np.testing.assert_allclose(mean[:, 1], 3.0 - 10.0 * mean[:, 0], atol=1e-4)
    np.testing.assert_allclose(mean[:, 2], 2.0, atol=1e-9)
    np.testing.assert_allclose(two.left_out[:, 1], -10.0 * two.left_out[:, 0], atol=1e-4)
    np.testing.assert_array_equal(two.mean(there), mean)


def test_leaving_a_run_out_in_closed_form_is_leaving_it_out():
    points, numbers = some_runs(30)
    process = gaussian_process.fit(points, numbers)
    y = (numbers - process.middle) / process.spread
    others = np.arange(30) != 7
    covariance = gaussian_process._covariance(points, points, process.logs)
    covariance += (np.exp(2 * process.logs[-1]) + 1e-10) * np.eye(30)
    inner = np.linalg.inv(covariance[np.ix_(others, others)])
    cross = covariance[7, others]
    expected = process.spread * (cross @ inner @ y[others] - y[7])
    assert process.left_out[7] == pytest.approx(expected, rel=1e-4)
    own = np.sqrt(covariance[7, 7] - cross @ inner @ cross)
    assert process.left_out_std[7] == pytest.approx(process.spread * own, rel=1e-4)


def test_a_warp_is_straight_at_the_measurement():
    warp = Warp(53.0, 25.0)
    y = np.array([-10.0, 50.0, 53.0, 400.0])
    np.testing.assert_allclose(warp.back(warp.of(y)), y)
    assert warp.slope(np.zeros(1))[0] == pytest.approx(25.0)


def test_fine_runs_correct_coarse_ones():
    values = design([STRENGTH, SCORE], 64, 0)
    coarse = runout(values)[:, None]
    fine = np.full_like(coarse, np.nan)
    fine[:10] = coarse[:10] + 4.0 + 0.5 * values[:10, 1:]
    emulator = make_emulator([STRENGTH, SCORE], ["toe"], [Warp()], values, coarse, fine)
    middle = np.array([[20.0, 0.0], [20.0, 1.0]])
    mean, std = emulator.predict(middle)
    expected = runout(middle) + 4.0 + 0.5 * middle[:, 1]
    np.testing.assert_allclose(mean[:, 0], expected, atol=1.0)
    assert np.all(std < 2.0)


def test_too_few_runs_are_no_emulator():
    values = design([STRENGTH, SCORE], 32, 0)
    numbers = np.where(np.arange(32) < 25, np.nan, runout(values))[:, None]
    with pytest.raises(ValueError, match="toe: only 7 runs could be read"):
        make_emulator([STRENGTH, SCORE], ["toe"], [Warp()], values, numbers)


# --- the likelihood ---


def test_a_covariance_for_each_prediction():
    goal = make_targets(
        [*toes(10.0, 12.0), NoFlow(type="no_flow", name="no flow", side="right", limit_m=1.5,
                                   std_m=0.5, confidence="assumed", source="test")],
        fit=None, loss="misfit", source="test",
    )  # fmt: skip
    random = np.random.default_rng(0)
    predictions = np.array([10.0, 12.0, 1.0]) + random.standard_normal((5, 3))
    roots = random.standard_normal((5, 3, 3))
    covariances = roots @ roots.transpose(0, 2, 1) + np.eye(3)
    together = log_likelihood(goal, predictions, covariances)
    alone = [
        log_likelihood(goal, one, covariance)
        for one, covariance in zip(predictions, covariances, strict=True)
    ]
    np.testing.assert_allclose(together, alone)


# --- the sampler ---


def test_draws_by_weight():
    chosen = resampled(np.array([0.0, 1.0, 3.0]), 400, np.random.default_rng(0))
    assert np.bincount(chosen, minlength=3).tolist() == [0, 100, 300]
    flat = tempered(np.array([-np.inf, *np.full(999, -1e6), 0.0]), 500, np.random.default_rng(0))
    assert 0 not in flat


def test_points_that_are_spread_out():
    points = np.random.default_rng(0).uniform(-1, 1, (500, 2))
    chosen = points[spread_out(points, 5)]
    assert np.linalg.norm(chosen[0]) < 0.2
    apart = np.linalg.norm(chosen[:, None] - chosen[None], axis=-1) + 9 * np.eye(5)
    assert apart.min() > 0.7


def exact_likelihood(formula, measured: float, std: float) -> Likelihood:
    """Without an emulator's error: a process of many runs."""
    unknowns = [STRENGTH, SCORE]
    values = design(unknowns, 64, 0)
    goal = targets(measured, std=std)
    emulator = make_emulator(unknowns, ["toe 0"], [Warp(measured, 5 * std)], values,
                             formula(values)[:, None])  # fmt: skip
    return Likelihood(emulator, goal, goal.covariance)


@pytest.mark.slow
def test_a_posterior_and_its_evidence_against_quadrature():
    likelihood = exact_likelihood(runout, 53.0, 6.0)
    sampled = sample(likelihood, draws=2000, live_points=100, seed=1)
    strengths = at_shares([STRENGTH, SCORE], sampled.shares)[:, 0]
    mean, std, log_evidence = by_quadrature(runout, 53.0, 6.0)
    assert strengths.mean() == pytest.approx(mean, abs=0.2 * std)
    assert strengths.std() == pytest.approx(std, rel=0.15)
    assert sampled.log_evidence == pytest.approx(log_evidence, abs=3 * sampled.log_evidence_std)
    again = sample(likelihood, draws=2000, live_points=100, seed=1)
    np.testing.assert_array_equal(again.shares, sampled.shares)


@pytest.mark.slow
def test_two_valleys_are_found_in_proportion():
    """Two strengths run equally far; the second has a prior share that is known."""

    def two(values: np.ndarray) -> np.ndarray:
        t = STRENGTH.share_below(values[:, 0])
        return 60.0 * (t - 0.25) * (t - 0.75)  # 0 at shares 0.25 and 0.75, of equal slope

    likelihood = exact_likelihood(two, 0.0, 0.3)
    sampled = sample(likelihood, draws=4000, live_points=200, seed=0)
    high = np.mean(sampled.shares[:, 0] > 0.5)
    assert 0.35 < high < 0.65
    assert np.mean(np.abs(sampled.shares[:, 0] - 0.5) < 0.15) < 0.02


# --- shares ---


def test_shares_against_the_closed_form():
    random = np.random.default_rng(0)
    x = random.standard_normal((20_000, 3))
    y = 2.0 * x[:, 0] + x[:, 1] + x[:, 0] * x[:, 1]  # variances 4, 1 and 1
    found = {one.name: one for one in shares(y, x, ["a", "b", "idle"])}
    assert found["a"].first == pytest.approx(4 / 6, abs=0.02)
    assert found["a"].total == pytest.approx(5 / 6, abs=0.02)
    assert found["b"].first == pytest.approx(1 / 6, abs=0.02)
    assert found["b"].total == pytest.approx(2 / 6, abs=0.02)
    assert found["idle"].total < 0.01


def test_what_does_not_change_has_no_share():
    x = np.column_stack([np.random.default_rng(0).standard_normal(500), np.ones(500)])
    assert [one.name for one in shares(x[:, 0], x, ["a", "fixed"])] == ["a"]


# --- all of it ---


def infer(model: FormulaModel, goal=None, settings: PosteriorSettings = FEW):
    return Inference(model, targets(53.0, std=6.0) if goal is None else goal, settings).run()


@pytest.mark.slow
def test_the_whole_posterior_of_a_formula_is_that_of_quadrature():
    found = infer(FormulaModel(runout))
    mean, std, log_evidence = by_quadrature(runout, 53.0, 6.0)
    strengths = found.values[:, 0]
    assert strengths.mean() == pytest.approx(mean, abs=0.2 * std)
    assert strengths.std() == pytest.approx(std, rel=0.15)
    assert found.sampled.log_evidence == pytest.approx(log_evidence, abs=0.4)
    assert found.replicated().mean() == pytest.approx(53.0, abs=1.5)


@pytest.mark.slow
def test_the_engines_own_error_is_part_of_the_covariance_and_of_what_is_predicted():
    found = infer(FormulaModel(runout, own_std=8.0))
    np.testing.assert_allclose(found.inference.errors(), [[6.0**2 + 8.0**2]])
    mean, std, log_evidence = by_quadrature(runout, 53.0, 10.0)
    strengths = found.values[:, 0]
    assert strengths.mean() == pytest.approx(mean, abs=0.2 * std)
    assert strengths.std() == pytest.approx(std, rel=0.15)
    assert std > 1.2 * by_quadrature(runout, 53.0, 6.0)[1]
    assert found.sampled.log_evidence == pytest.approx(log_evidence, abs=0.4)
    bare, _ = found.likelihood.emulator.predict(found.prior)
    added = found.replicated(prior=True).var() - bare.var()
    assert added == pytest.approx(8.0**2, rel=0.15)
    # What the survey says of the number itself it says with its own error, whatever the model's.
    assert found.replicated().mean() == pytest.approx(53.0, abs=1.5)
    assert found.replicated().std() < 6.0


@pytest.mark.slow
@pytest.mark.parametrize(("shared", "own"), [(12.0, 0.0), (0.0, 4.0), (5.0, 3.0)])
def test_an_error_that_numbers_share_is_known_from_the_one_that_is_fitted(shared, own):
    """Two toes by the same formula, the first surveyed to 2 m and fitted: in closed form.

    Of the second, mu + e1, the data say: mu + e0 = 53 +- 2, and e1 - e0 has 2 own^2.
    """
    model = FormulaModel(
        lambda values: np.repeat(runout(values)[:, None], 2, axis=1), names=["toe 0", "toe 1"],
        otherwise={"flip": shared}, own_std=own,
    )  # fmt: skip
    goal = make_targets(toes(53.0, 60.0, std=2.0), fit=["toe 0"], loss="misfit", source="test")
    found = infer(model, goal)
    toe = found.replicated()
    assert toe[:, 0].mean() == pytest.approx(53.0, abs=0.7)
    assert toe[:, 0].std() == pytest.approx(2.0, rel=0.15)
    assert toe[:, 1].mean() == pytest.approx(53.0, abs=1.0)
    assert toe[:, 1].std() == pytest.approx(np.sqrt(2.0**2 + 2.0 * own**2), rel=0.15)


@pytest.mark.slow
def test_a_way_to_simulate_that_fails_is_tried_elsewhere_and_then_said():
    tried = []

    @dataclass
    class Failing(FormulaModel):
        failing: int = 1

        def simulated_otherwise(self, values):
            tried.append(values)
            late = np.nan if len(tried) <= self.failing else 3.0
            return {"flip": np.array([late]), "step": np.array([1.0])}

    found = infer(Failing(runout)).inference
    assert len(tried) == 2 and not np.array_equal(*tried) and not found.remarks
    assert {name: list(change) for name, change in found.otherwise.items()} == {
        "flip": [3.0], "step": [1.0]
    }  # fmt: skip
    for one in tried:  # where the posterior is
        assert abs(runout(one[None])[0] - 53.0) < 15.0
    tried.clear()
    found = infer(Failing(runout, failing=9)).inference
    assert list(found.otherwise) == ["step"] and len(tried) == 3
    assert found.remarks == ["flip: could not be compared; its error is not known and left out"]


@pytest.mark.slow
def test_without_refined_runs_the_middle_is_where_the_posterior_is():
    asked = []

    @dataclass
    class Asking(FormulaModel):
        def simulated_otherwise(self, values):
            asked.append(values)
            return {}

    infer(Asking(runout), settings=FEW.model_copy(update={"refined_runs": 0}))
    assert abs(runout(asked[0][None])[0] - 53.0) < 12.0


@pytest.mark.slow
def test_fine_runs_move_the_answer_and_the_numbers_of_runs_are_the_settings():
    model = FormulaModel(runout, two_fidelities=True, beyond=8.0)
    found = infer(model, settings=FEW.model_copy(update={"fine_runs": 16}))
    pairs = [(number, coarse) for number in (6, 5, 5) for coarse in (True, False)]
    assert model.asked == [(64, True), (8, True), (8, True), (8, True), *pairs]
    mean, std, _ = by_quadrature(lambda values: runout(values) + 8.0, 53.0, 6.0)
    assert found.values[:, 0].mean() == pytest.approx(mean, abs=0.25 * std)


@pytest.mark.slow
def test_another_way_to_simulate_is_an_error():
    sure = infer(FormulaModel(runout))
    unsure = infer(FormulaModel(runout, otherwise={"transfer": 12.0}))
    assert unsure.values[:, 0].std() > 1.5 * sure.values[:, 0].std()


@pytest.mark.slow
def test_strengths_are_told_in_small_cells_and_a_prior_is_of_the_soil():
    cells = SmallCells(factor=1.2, log_std=0.08, spacing_m=1.0, other_spacing_m=2.0, words="")
    found = infer(FormulaModel(runout, cells=cells))
    ran, told = np.log(found.values[:, 0]), np.log(found.told[:, 0])
    assert np.mean(told - ran) == pytest.approx(np.log(1.2), abs=0.005)
    assert told.std() == pytest.approx(np.hypot(ran.std(), 0.08), rel=0.03)
    np.testing.assert_array_equal(found.told[:, 1], found.values[:, 1])
    # Data of 500 m say nothing against a prior of 5 %: all that is known is of the soil.
    known = unknown_parameter(strength("a", prior=Prior(mean=18.0, std=0.9)))
    goal = targets(53.0, std=500.0)
    loose = infer(FormulaModel(runout, (known, SCORE), cells=cells), goal)
    assert np.mean(np.log(loose.told / loose.values), axis=0) == pytest.approx([0, 0], abs=0.01)


@pytest.mark.slow
def test_what_fails_is_left_out_until_it_is_too_much():
    def broken(values: np.ndarray, share: float) -> np.ndarray:
        fails = STRENGTH.share_below(values[:, 0]) < share
        return np.where(fails, np.nan, runout(values))

    found = infer(FormulaModel(lambda values: broken(values, 0.15)))
    mean, std, _ = by_quadrature(runout, 53.0, 6.0)
    assert found.values[:, 0].mean() == pytest.approx(mean, abs=0.2 * std)

    def with_unread(values: np.ndarray) -> np.ndarray:
        return np.stack([np.full(len(values), np.nan), runout(values)], axis=1)

    goal = make_targets([*toes(0.0, 53.0, std=6.0)], fit=["toe 1"], loss="runout", source="test")
    two = infer(FormulaModel(with_unread, names=["toe 0", "toe 1"]), goal)
    assert two.inference.unread == ["toe 0"] and two.predicted.shape[1] == 1
    assert two.values[:, 0].mean() == pytest.approx(mean, abs=0.2 * std)
    with pytest.raises(WorkFailed, match="of the runs over the whole prior failed"):
        infer(FormulaModel(lambda values: broken(values, 0.7)))


@pytest.mark.slow
def test_a_slope_that_stood_leaves_the_strong_side():
    goal = make_targets(
        [NoFlow(type="no_flow", name="toe 0", side="left", limit_m=20.0, std_m=2.0,
                confidence="assumed", source="test")],
        fit=None, loss="runout", source="test",
    )  # fmt: skip
    found = infer(FormulaModel(runout), goal)
    limit = 18.0 * (20.0 / 53.0) ** (-1 / 1.5)
    strengths = found.values[:, 0]
    assert np.percentile(strengths, 3) > 0.75 * limit
    assert np.percentile(strengths, 97) > 75.0  # nothing holds it from above
    below = STRENGTH.share_below(np.array([limit]))[0]
    assert found.sampled.log_evidence == pytest.approx(np.log(1 - below), abs=0.3)


@pytest.mark.slow
def test_a_seed_is_a_posterior():
    first, second = (infer(FormulaModel(runout)) for _ in range(2))
    np.testing.assert_array_equal(first.values, second.values)
    other = infer(FormulaModel(runout), settings=FEW.model_copy(update={"seed": 1}))
    assert not np.array_equal(first.values, other.values)
    fewer = infer(
        FormulaModel(runout), settings=FEW.model_copy(update={"draws": 500, "live_points": 60})
    )
    assert len(fewer.values) == 500 and fewer.sampled.calls < first.sampled.calls


@pytest.mark.slow
def test_an_emulator_that_knows_less_than_the_survey_is_reported():
    assert coarse_remarks(infer(FormulaModel(runout))) == []
    (line,) = coarse_remarks(infer(FormulaModel(runout), targets(53.0, std=0.001)))
    assert line.startswith("toe 0: the emulator's error of") and "refined_runs may make" in line
    two = infer(FormulaModel(runout, two_fidelities=True), targets(53.0, std=0.001))
    assert "more posterior.fine_runs, or" in coarse_remarks(two)[0]


# --- files ---


def test_draws_are_read_back(tmp_path):
    random = np.random.default_rng(0)
    draws = Draws(
        unknowns=["a", "top of b/c"], posterior=random.normal(size=(50, 2)),
        prior=random.normal(size=(50, 2)), numbers=["toe"],
        posterior_predictive=random.normal(size=(50, 1)),
        prior_predictive=random.normal(size=(50, 1)), log_likelihood=random.normal(size=50),
        observed={"toe": 53.0}, facts={"case": "dam", "log_evidence": -3.2},
    )  # fmt: skip
    save_draws(draws, tmp_path / "posterior.nc")
    found = load_draws(tmp_path)
    assert found.unknowns == ["a", "top of b|c"] and found.numbers == ["toe"]
    np.testing.assert_array_equal(found.posterior, draws.posterior)
    assert found.observed == {"toe": 53.0} and found.facts["case"] == "dam"
    (tmp_path / "posterior.nc").write_bytes(b"no")
    with pytest.raises(InputError, match="cannot be read as draws"):
        load_draws(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        load_draws(tmp_path / "elsewhere")


def test_a_prediction_takes_strengths_and_ratios_of_a_posterior(tmp_path, monkeypatch):
    from inversion.prediction import known_strength

    kinds = {"r": "strength_ratio", "phi": "friction_deg", "s": "residual_strength_kpa"}
    random = np.random.default_rng(0)
    values = random.lognormal(size=(50, 3), sigma=0.1) * (0.1, 30.0, 20.0)
    numbers = random.normal(size=(50, 1))
    draws = Draws(
        unknowns=list(kinds), posterior=values, prior=values, numbers=["toe"],
        posterior_predictive=numbers, prior_predictive=numbers, log_likelihood=numbers[:, 0],
        observed={"toe": 53.0}, facts={"case": "dam"},
    )  # fmt: skip
    save_draws(draws, tmp_path / "posterior.nc")
    parameters = [SimpleNamespace(name=n, property=p, zones=[n]) for n, p in kinds.items()]
    monkeypatch.setattr(
        known_strength, "load_posterior", lambda folder: SimpleNamespace(parameters=parameters)
    )
    ratio, strength = known_strength.drawn_strengths(tmp_path)
    assert (ratio.zones, ratio.property, ratio.unit) == (("r",), "strength_ratio", "")
    assert (strength.zones, strength.property, strength.unit) == (("s",), kinds["s"], "kPa")
    assert ratio.at(0.0) == pytest.approx(np.median(values[:, 0]), rel=0.02)
    assert strength.mean == pytest.approx(values[:, 2].mean())
    del parameters[0], parameters[1]
    with pytest.raises(InputError, match="a posterior without a residual strength or ratio"):
        known_strength.drawn_strengths(tmp_path)


# --- calibration ---


def test_ranks_and_coverage_of_draws_from_the_truth_are_uniform():
    random = np.random.default_rng(0)
    ranks = np.array(
        [rank_of(random.standard_normal(), random.standard_normal(999)) for _ in range(2000)]
    )
    assert 0.0 < ranks.min() and ranks.max() < 1.0
    for row in coverage(ranks, (0.5, 0.8, 0.95)):
        assert row.low <= row.covered <= row.high
        assert row.covered == pytest.approx(row.nominal, abs=0.04)
    too_sure = 0.5 + 2.0 * (ranks - 0.5)
    assert not coverage(np.clip(too_sure, 0, 1), (0.8,))[0].inside


# --- the command ---


@pytest.mark.slow
def test_the_command_leaves_all_files_and_goes_on_where_it_stopped(lsfd, tmp_path, capsys):
    import arviz

    from flowslide.command_line import main
    from inversion.posterior.document import load_posterior

    out = tmp_path / "posterior"
    few = [
        "coarse_runs=32", "refined_runs=4", "fine_runs=4", "live_points=60", "draws=400",
    ]  # fmt: skip
    asked = ["posterior", str(lsfd), "--out", str(out), "--threads", "1", "--quiet"]
    for setting in (*(f"posterior.{one}" for one in few), "simulation.duration_s=4"):
        asked += ["--set", setting]
    main(asked)
    text = capsys.readouterr().out
    assert "S_r/sigma'_v0" in text and "what moves S_r of the fill" in text
    document = load_posterior(out)
    assert [one.name for one in document.parameters] == ["residual_strength_1", "friction_7"]
    assert list(document.other_ways) == ["time step"]
    assert document.runs.simulated_now >= 36
    page = (out / "report.html").read_text()
    assert page.count("<img") == 4
    data = arviz.from_netcdf(out / "posterior.nc")
    kept = data.posterior["residual_strength_1"].values
    assert kept.shape == (1, 400) and kept.min() > 0.0
    low, high = document.parameters[0].after.interval_95
    assert np.percentile(kept, 2.5) == pytest.approx(low, abs=1e-4)

    main(asked)
    again = load_posterior(out)
    assert again.runs.simulated_now == 0
    assert again.unknowns == document.unknowns and again.numbers == document.numbers


@pytest.mark.slow
def test_the_solver_is_asked_at_draws_of_a_learned_posterior():
    """Where it agrees nothing is said; 30 m farther is more than the model's 3 m allow."""
    found = infer(FormulaModel(runout, own_std=3.0))
    ((one,), lines) = confirmed(found, FormulaModel(runout), 6)
    assert one.runs == 6 and abs(one.difference) < 2.0 and not lines
    assert one.stated_std == pytest.approx(3.0, abs=1.0)
    ((one,), (line,)) = confirmed(found, FormulaModel(lambda v: runout(v) + 30.0), 6)
    assert one.difference == pytest.approx(30.0, abs=2.0) and "ask the engine mpm" in line
    numbers, (line,) = confirmed(found, FormulaModel(lambda v: np.nan * runout(v)), 6)
    assert not numbers and "could be read" in line
