"""Coarse runs for what changes the answer: as exact as the fine ones they stand for, and fewer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.case import load_case
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.changed_answers import Here, Solved, largest
from inversion.back_analysis.perturbed_answers import Problem
from inversion.engines import registry
from inversion.engines.run_store import RunStore
from inversion.engines.two_spacings import KnownDerivative, Move, Moved
from inversion.estimation.calibrate import calibrate, refine
from inversion.estimation.derivatives import FiniteSteps
from inversion.estimation.forward import Forward, Prediction
from inversion.estimation.search import Search
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import TimeStep
from pipeline.config import load_config
from tests.dams import dam_with_pool
from tests.inversion.analytic import Formula, angle, problem, strength, targets
from tests.inversion.conftest import QUESTION

PARAMETERS = Parameters([strength("a"), angle("b", start=31.0)])


def coarse(values: np.ndarray) -> np.ndarray:
    """Runs less far than the fine one."""
    return np.array([48 - 100 * np.log(values[0] / 27.5) - 0.3 * (values[1] - 30)])


def fine(values: np.ndarray) -> np.ndarray:
    """53 m at 27.5 kPa; steeper by a tenth than the coarse one."""
    return np.array([53 - 110 * np.log(values[0] / 27.5) - 0.3 * (values[1] - 30)])


def engine(formula) -> Formula:
    return Formula(formula, ["toe 0"], parameters=PARAMETERS)


def answered(formula):
    """The search that answers a question by itself."""
    search = problem(PARAMETERS.specs, formula, targets(53.0))
    return search, calibrate(search, PARAMETERS.start, method="gauss_newton", least_m=2.0)


def test_the_fine_answer_is_found_by_few_runs_with_the_coarse_derivative():
    search, found = answered(coarse)
    slope = found.best.derivative * PARAMETERS.value_per_fitted(found.values)[None, :]
    known = KnownDerivative(engine(fine), slope)
    steps = FiniteSteps(PARAMETERS, np.zeros(1))
    again = refine(
        Search(known, known.engine, search.objective, steps),
        found.values,
        method="gauss_newton",
        sampled=lambda evaluation: known,
    )
    assert again.reached and known.runs <= 3
    assert fine(again.values)[0] == pytest.approx(53.0, abs=0.32)
    together = again.after(found, "gauss_newton")
    assert together.best is together.evaluations[-1] and together.runs == found.runs + known.runs
    assert [one.iteration for one in together.evaluations] == list(range(len(together.evaluations)))


def test_moved_coarse_runs_agree_with_the_fine_one_and_carry_its_changes():
    here, there = np.array([27.5, 31.0]), np.array([26.2, 31.5])
    move = Move(
        PARAMETERS.to_fitted(there) - PARAMETERS.to_fitted(here),
        {"toe 0": float((fine(here) - coarse(there))[0])},
        -3.0,
    )
    question, other = engine(fine), engine(fine)
    moved = Moved(other, move, lambda setup: engine(coarse) if setup is question else None)
    assert moved.predict([question.at(here)])[0].values == pytest.approx(fine(here))
    # A strength higher by a tenth has the coarse effect, whatever the strengths themselves.
    weaker = np.array([1.1 * 27.5, 31.0])
    before, after = moved.predict([question.at(here), question.at(weaker)])
    change = after.values - before.values
    assert change == pytest.approx([-100 * np.log(1.1)])
    # What has no coarse runs is run as it is.
    (plain,) = moved.predict([other.at(weaker)])
    assert plain.values == pytest.approx(fine(weaker))
    both = moved.predict([question.at(here), other.at(here)])
    assert both[0].values == pytest.approx(both[1].values)


def solved(name: str, change: float) -> Solved:
    """A sensitivity that multiplies the first parameter."""
    objective = problem(PARAMETERS.specs, fine, targets(53.0)).objective
    values = np.array([27.5 * change, 31.0])
    one = Problem(engine(fine), objective, values, np.zeros((1, 2)))
    (found,) = one.setup.predict([one.setup.at(values)])
    one.receive(replace(found, values=np.array([53.0])))
    return Solved(TimeStep(name=name, kind="time_step", factor=2.0), None, one)


def test_the_largest_sensitivities_are_checked_until_little_is_left():
    here = Here(np.array([27.5, 31.0]), None)
    entries = [solved("large", 1.2), solved("large", 0.85), solved("middle", 1.08),
               solved("small", 1.01)]  # fmt: skip
    std = np.array([1.0, 2.0])
    assert largest(entries, here, std, 0.0) == set()
    # Changes of 5.5 and -4.1, 2.2 and 0.3 kPa; the survey has 1 kPa of the variance of 29.5 kPa^2.
    assert largest(entries, here, std, 0.8) == {"large"}
    assert largest(entries, here, std, 0.98) == {"large", "middle"}
    assert largest(entries, here, std, 1.0) >= {"large", "middle", "small"}


def test_where_there_is_no_coarse_spacing_everything_is_at_one(lsfd):
    def case(*changes: str, **more):
        settings = load_config(None, ["inversion.coarse_points=50", *changes])
        return inversion_case(load_case(lsfd, settings), **more)

    found = case("inversion.coarse_factor=1.25")  # of 4 m in the question
    assert found.coarse_spacing_m == found.coarsened(found.setup).scene.spacing == 5.0
    assert case("inversion.coarse_factor=1.25", spacing_m=2.0).coarse_spacing_m == 5.0
    assert case("inversion.coarse_factor=1.25", spacing_m=5.0).coarse_spacing_m is None
    assert case("inversion.coarse_factor=1").coarse_spacing_m is None
    assert (
        case("inversion.coarse_factor=1.25", "inversion.coarse_points=400").coarse_spacing_m is None
    )
    assert case("inversion.coarse_factor=2").coarse_spacing_m is None  # a zone is too thin
    of_its_own = replace(found.setup, scene=found.setup.scene.changed(spacing=3.0))
    assert found.coarsened(of_its_own) is None


class Blind(Forward):
    """A toe of 53 m at 18 kPa, which runs with points 4 m apart see; coarser ones see another."""

    coarse_toe = staticmethod(lambda kpa: 40.0 - 4.0 * np.log(kpa))

    def predict(self, requests):
        self.runs += len(requests)
        return [self._one(request) for request in requests]

    def _one(self, request) -> Prediction:
        kpa, spacing = request.values[0], request.setup.scene.spacing
        toe = 53.0 - 60.0 * np.log(kpa / 18.0) if spacing <= 4.0 else self.coarse_toe(kpa)
        stress = np.full(len(request.values), 100.0)
        values = np.full(len(request.setup.targets.names), toe)
        before = np.zeros(len(values))
        return Prediction(values, before, sigma_v0_kpa=stress, sigma_v0_std_kpa=0.0 * stress,
                          spacing_m=spacing)  # fmt: skip


class Still(Blind):
    """Coarse runs in which nothing moves."""

    coarse_toe = staticmethod(lambda kpa: 0.0)


class Misled(Blind):
    """Coarse runs that fit where fine ones go the other way with the strength."""

    coarse_toe = staticmethod(lambda kpa: 53.0 - 60.0 * np.log(kpa / 5.6))

    def _one(self, request) -> Prediction:
        found = super()._one(request)
        fine = request.setup.scene.spacing <= 4.0
        toe = 20.0 + request.values[0] if request.values[0] < 9.0 else found.values[0]
        return replace(found, values=np.full(len(found.values), toe)) if fine else found


@pytest.mark.parametrize(
    ("engine", "words"),
    [(Blind, "rests on a bound"), (Still, "nothing moves"), (Misled, "far from a fit")],
)
def test_coarse_runs_that_are_no_guide_are_given_up(lsfd, monkeypatch, engine, words):
    monkeypatch.setattr(registry, "_engines", dict(registry.engines()))
    registry.register_engine(
        registry.Engine(
            "blind", "blind", "a formula", "blind", "inversion_blind", lambda s: engine()
        )
    )
    settings = [
        "inversion.coarse_factor=1.25", "inversion.coarse_points=50", "inversion.starts=1",
        "inversion.noise_seeds=0", "inversion.variants=false", "inversion.sensitivities=false",
    ]  # fmt: skip
    case = inversion_case(load_case(lsfd, load_config(None, settings)))
    said: list[str] = []
    analysis = BackAnalysis(case, RunStore(None), said.append, engine_name="blind")
    assert analysis.coarse_spacing_m == 5.0
    analysis.search()
    assert any(words in line for line in said), said
    assert analysis.coarse_spacing_m is None and analysis.found.reached
    assert analysis.found.values[0] == pytest.approx(18.0, rel=0.02)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """One question with and without coarse runs, and once more from the kept runs."""
    folder = dam_with_pool(tmp_path_factory.mktemp("two") / "small_dam")
    (folder / "inversion.yaml").write_text(
        QUESTION.replace("spacing_m: 4", "spacing_m: 2.5")
        + "  - {name: cells, kind: cell_size, factor: 1.6}\n"
    )

    def solve(factor: float, store: RunStore):
        settings = load_config(
            None,
            [f"inversion.coarse_factor={factor}", "inversion.coarse_points=300",
             "inversion.check_share=0.95", "inversion.starts=2", "inversion.noise_seeds=2",
             "inversion.step_seeds=2"],
        )  # fmt: skip
        analysis = BackAnalysis(inversion_case(load_case(folder, settings)), store)
        return analysis.run()

    stores = [RunStore(folder / name, threads=1) for name in ("fast", "slow")]
    found = [solve(factor, store) for factor, store in zip((1.6, 1.0), stores, strict=True)]
    again = RunStore(folder / "fast", threads=1)
    return *found, solve(1.6, again), again, stores


@pytest.mark.slow
def test_coarse_runs_give_what_fine_ones_give(both):
    fast, slow, *_ = both
    std = slow.answer.parameters[0].std_total
    for mine, own in zip(fast.answer.parameters, slow.answer.parameters, strict=True):
        assert abs(mine.value - own.value) < own.std_total / 3
        assert abs(mine.std_total - own.std_total) < own.std_total / 3
    for mine, own in zip(fast.sensitivities, slow.sensitivities, strict=True):
        assert abs(mine.change["residual_strength_1"] - own.change["residual_strength_1"]) < std / 3
    for mine, own in zip(fast.variants, slow.variants, strict=True):
        name = "residual_strength_1"
        assert mine.reached and abs(mine.values[name] - own.values[name]) < std / 3


@pytest.mark.slow
def test_a_result_says_at_which_spacing_each_number_was_made(both):
    fast, slow, again, store, stores = both
    assert (fast.spacing_m, fast.coarse_spacing_m) == (2.5, 4.0)
    assert [one.spacing_m for one in fast.iterations][0] == 4.0
    assert fast.iterations[-1].spacing_m == 2.5
    assert fast.noise.spacing_m == fast.starts[1].spacing_m == 4.0
    sides = [side for one in fast.sensitivities for side in one.sides]
    checked = [side for side in sides if side.coarse_change is not None]
    assert checked and all(side.spacing_m == 2.5 for side in checked)
    assert {side.spacing_m for side in sides if side.coarse_change is None} == {4.0}
    assert all(one.coarse_values and one.spacing_m == 2.5 for one in fast.variants)
    assert slow.coarse_spacing_m is None
    assert all(one.coarse_values is None for one in slow.variants)
    # Most of the runs are coarse; asked again, nothing is computed and nothing changes.
    assert store.computed == 0
    for one in (fast, again):
        one.manifest.clear()
        one.timings.clear()
        one.iterations.clear()
    assert fast == again
