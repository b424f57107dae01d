"""Every stage of a back-analysis with a surrogate, which here is the real engine made wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import inversion.back_analysis.with_learned_simulator as stages
from geometry.case import load_case
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import inversion_case
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.rollout_store import RolloutStore
from inversion.engines.run_store import RunStore
from inversion.engines.trained_model import TrainedModel
from pipeline.cli import InputError
from pipeline.config import load_config
from tests.dams import dam_with_pool

pytestmark = pytest.mark.slow


MEASURED = 53.0
"""The upstream toe [m]."""
TOO_FAR = 12.0
"""What the surrogate is wrong by [m]."""
SETTINGS = [
    "inversion.starts=2",
    "inversion.noise_seeds=2",
    "inversion.step_seeds=0",
    "simulation.water=buoyant",
]
QUESTION = """
parameters:
  - {name: residual_strength_1, zones: ["1"], property: residual_strength_kpa,
     start: 30, low: 5, high: 90}
fit: [upstream toe]
loss: runout
spacing_m: 4.5
variants:
  - {name: dry, water: none}
  - {name: pressure, water: pore_pressure}
  - {name: damped, simulation: {local_damping: 0.05}}
sensitivities:
  - {name: pool level, kind: water_level, std_m: 0.5}
  - {name: transfer, kind: simulation, simulation: {transfer: flip}}
"""


class TooFar(MPMEngine):
    """Stands in for the learned simulator: every toe too far, stress before failure unknown."""

    def __init__(self, store, model, *, on_frame=None) -> None:
        super().__init__(RUNS)

    def outside(self, request) -> list[str]:
        return ["cohesion / (rho g d): 0.9 is outside the training's range, 0.1 to 0.8"]

    def distance(self, request, *, anywhere=False) -> float | None:
        return None

    def predict(self, requests):
        if any(request.setup.settings.water == "pore_pressure" for request in requests):
            raise InputError("simulation.water: pore_pressure; allowed is buoyant")
        return [
            replace(
                found,
                values=found.values + TOO_FAR,
                sigma_v0_kpa=np.full(1, np.nan),
                sigma_v0_std_kpa=np.full(1, np.nan),
            )
            for found in super().predict(requests)
        ]


RUNS = RunStore(None, threads=1)


class TooFlat(TooFar):
    """Its toes change with the strength by three fifths of what they do, and go too far."""

    def predict(self, requests):
        return [
            replace(found, values=MEASURED + 0.6 * (found.values - MEASURED))
            for found in super().predict(requests)
        ]


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    folder = dam_with_pool(tmp_path_factory.mktemp("case") / "small_dam")
    (folder / "inversion.yaml").write_text(QUESTION)
    return inversion_case(load_case(folder, load_config(None, SETTINGS)))


def by_surrogate(case, engine: type[MPMEngine], told: list[str]):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "GNSEngine", engine)
        return stages.SurrogateAnalysis(
            case, RUNS, told.append,
            model=TrainedModel(None, "too_far", "0" * 64), rollouts=RolloutStore(None),
        ).run()  # fmt: skip


@pytest.fixture(scope="module")
def both(case):
    """The results of the surrogate, corrected, and of the real engine."""
    return by_surrogate(case, TooFar, []), BackAnalysis(case, RUNS, lambda line: None).run()


def test_a_surrogate_that_is_wrong_by_a_constant_gives_the_answer_of_the_real_engine(both):
    result, real = both
    (ours,), (own,) = result.answer.parameters, real.answer.parameters
    assert result.surrogate.mean_difference["upstream toe"] == pytest.approx(-TOO_FAR)
    assert result.surrogate.std["upstream toe"] == pytest.approx(0.0, abs=1e-6)
    assert ours.value == pytest.approx(own.value, rel=0.02)
    assert ours.std_data == pytest.approx(own.std_data, rel=0.2)
    assert ours.sigma_v0_kpa == own.sigma_v0_kpa
    alone, judged, corrected, _ = result.engines
    assert judged.predicted["upstream toe"] == pytest.approx(
        alone.predicted["upstream toe"] - TOO_FAR
    )
    assert alone.values["residual_strength_1"] > 1.02 * corrected.values["residual_strength_1"]


def test_other_starts_seeds_variants_and_sensitivities_are_corrected_alike(both):
    result, real = both
    assert len(result.starts) == 2
    assert result.starts[1].answer["residual_strength_1"] == pytest.approx(
        result.answer.parameters[0].value, rel=0.05
    )
    (dry,) = result.variants
    assert dry.name == "dry" and dry.reached
    assert dry.values["residual_strength_1"] == pytest.approx(
        real.variants[0].values["residual_strength_1"], rel=0.05
    )
    assert result.noise.seeds == [1, 2]
    (pool,) = result.sensitivities
    assert pool.name == "pool level" and all(side.reached for side in pool.sides)
    # The ratio's error knows of the sensitivity although the surrogate knows no stress.
    assert any(side.ratio_change for side in pool.sides)


def test_what_could_not_be_had_is_said(both):
    told = "\n".join(both[0].remarks)
    assert "pressure: no answer: simulation.water: pore_pressure" in told
    assert "damped: left out: a learned engine has no settings of the solver" in told
    assert "transfer: left out: a learned engine has no settings of the solver" in told
    assert "outside the training of the model too_far: cohesion" in told


def test_where_the_error_changes_with_the_strength_the_answer_is_settled_by_runs_at_it(case, both):
    told: list[str] = []
    result, real = by_surrogate(case, TooFlat, told), both[1]
    assert result.surrogate.settled and not both[0].surrogate.settled
    assert any("standard deviations of the survey at the corrected answer" in one for one in told)
    (ours,), (own,) = result.answer.parameters, real.answer.parameters
    assert ours.value == pytest.approx(own.value, rel=0.03)
    judged = result.engines[-1].predicted["upstream toe"]
    measured = next(one for one in result.measurements if one.name == "upstream toe")
    assert abs(judged - measured.measured) < 0.2 * measured.std
    assert len(result.surrogate.pairs) > len(both[0].surrogate.pairs)
