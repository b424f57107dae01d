"""A model's own error, found at its fit: other cells, other noise, other evidence."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.adequacy.calibration import CellCorrection
from diagnosis.diagnose import diagnose
from diagnosis.options import Options
from diagnosis.verdict.verdict_builder import verdict_document
from inversion.estimation.covariance import Covariance, covariance, not_less
from inversion.problem.state import State
from tests.diagnosis.straight import SIZE, Straight, errors, noise_of, signatures, truth

ASKED = Options(draws=400, replicates=4)
LATE = ("late",)


def slide_without_cells(seed: int, share: float) -> Straight:
    """A slide by `late`, whose cells hide `share` of it of what `step` does; the survey sees it."""
    readings = truth({"late": 2.0}) + 2.0 * share * signatures()["step"] + errors(seed)
    return Straight(readings, skewed={"late": ("step", share)}, noise=0.05)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_the_cells_make_of_an_effect_is_corrected_where_that_effect_fits(seed):
    found = diagnose(slide_without_cells(seed, 1.0), ASKED)
    assert found.decision.verdict == "identified"
    assert found.decision.final.model.names == LATE, "`step` is what its cells take"
    model = found.tried_models.models[LATE]
    assert model.own is not None
    (amplitude,) = found.decision.final.model.fit.space.amplitudes(model.fit.x).values()
    assert amplitude == pytest.approx(2.0, abs=0.6)
    missing = found.comparison.base.cells.models[LATE]
    assert missing[1] == pytest.approx(missing[0]["late"] * signatures()["step"], abs=0.3)


def test_the_document_has_the_errors_of_the_models_own():
    found = diagnose(slide_without_cells(1, 1.0), ASKED)
    told = verdict_document(found, case="c", title="t")
    assert told.final.chi2 == told.steps[-1].chi2 == pytest.approx(
        found.decision.final.model.fit.total
    )  # fmt: skip
    step = np.array([line.predicted_final for line in told.measurements])[1:25]
    base = np.array([line.predicted_base for line in told.measurements])[1:25]
    assert (step - base)[20] - (step - base)[15] > 0.8, "the prediction is corrected as well"


class Noisy(Straight):
    """Runs with `step` scatter by its amplitude where it acts."""

    def _run(self, state: State) -> np.ndarray:
        found = super()._run(state)
        amplitude = dict(state.effects).get("step", 0.0)
        scatter = noise_of(state, 7).standard_normal(SIZE)
        return found + 0.8 * amplitude * (signatures()["step"] > 0.0) * scatter


@pytest.mark.slow
def test_an_effect_that_makes_the_slide_noisy_is_granted_its_noise_and_pays_for_it():
    state = State((15.0, 32.0)).with_effects({"step": 2.0})
    slide = Noisy(np.ones(SIZE), noise=0.05)
    readings = slide.predict([state])[0] + errors(5)
    found = diagnose(Noisy(readings, noise=0.05), ASKED)
    model = found.tried_models.models[("step",)]
    plain, own = found.comparison.base.data, model.own
    acts = signatures()["step"] > 0.0
    grown = np.diag(own.covariance) / np.diag(plain.covariance)
    assert grown[acts].mean() > 2.0 and grown[~acts].mean() < 1.6
    assert own.ln_density_at_best < plain.ln_density_at_best, "what forgives more is believed less"
    assert found.decision.final.model.names == ("step",)


def test_no_number_is_granted_less_than_the_base_model_is():
    draw = np.random.default_rng(3)
    survey = np.diag(draw.uniform(0.5, 2.0, 6))

    def error(size: float) -> Covariance:
        runs = size * draw.standard_normal((5, 6)) * np.array([3.0, 1.0, 1.0, 0.2, 0.2, 0.2])
        return covariance(survey, replicates=runs, finer=0.1 * runs[0])

    for sizes in ((1.0, 1.0), (0.1, 1.0), (4.0, 1.0)):
        own, base = map(error, sizes)
        granted = not_less(own, base)
        assert np.all(np.linalg.eigvalsh(granted - survey) > -1e-12)
        assert np.diag(granted) == pytest.approx(
            np.maximum(np.diag(own.total), np.diag(base.total))
        )
    assert not_less(base, base) == pytest.approx(base.total)
    nothing = covariance(survey)
    assert not_less(nothing, nothing) == pytest.approx(survey)


def test_cells_of_the_largest_model_in_proportion_to_its_amplitudes():
    model = Straight(np.ones(SIZE))
    one, both = np.full(SIZE, 1.0), np.full(SIZE, 8.0)
    cells = CellCorrection(model.targets, np.full(SIZE, 0.5))
    cells.models[LATE] = ({"late": 2.0}, one)
    cells.models[("late", "step")] = ({"late": 2.0, "step": -1.0}, both)

    def of(**effects: float) -> float:
        return float(cells.of(State((15.0, 32.0)).with_effects(effects))[0])

    assert of() == of(bend=1.0) == 0.5
    assert of(late=1.0) == 1.0 and of(late=2.0, bend=1.0) == 1.5
    assert of(late=-1.0) == 0.5, "the other sign was not measured"
    assert of(late=20.0) == 2.0, "and no amplitude far beyond"
    assert of(late=2.0, step=-1.0) == 8.5 and of(late=2.0, step=-0.5) == 4.5
