"""What the cells take from every prediction is found and added; the rest of it is doubted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.adequacy.compare import compare
from diagnosis.options import Options
from tests.diagnosis.straight import Straight, errors, signatures, slopes, straight, truth

OPTIONS = Options(draws=400, replicates=3)
#: What a slide has that cells of the judge's size cannot show: no strength imitates it.
CELLS = 6.0 * signatures()["step"] - 4.0 * signatures()["late"]


def coarse(seed: int) -> Straight:
    return Straight(truth({}) + CELLS + errors(seed), cells=CELLS)


def test_a_slide_without_cells_is_met_by_a_model_with_cells():
    found = [compare(coarse(seed), OPTIONS) for seed in range(6)]
    assert all(np.allclose(one.base.cells.missing, CELLS) for one in found)
    exact = [compare(straight(seed, {}), OPTIONS) for seed in range(6)]
    for one, other in zip(found, exact, strict=True):
        std = np.sqrt(one.judged.system.posterior[0, 0])
        assert abs(one.base.fit.x[0] - other.base.fit.x[0]) < 1.5 * std
    assert sum(one.adequacy.p_combined < OPTIONS.alarm for one in found) <= 1
    # Not corrected, the same slides have something that the model lacks.
    plain = replace(OPTIONS, finer_share=0.0, finer_share_std=0.0)
    misread = [compare(coarse(seed), plain).adequacy.p_combined for seed in range(6)]
    assert sum(p < OPTIONS.alarm for p in misread) >= 5


def test_half_of_the_correction_is_doubted():
    found = compare(coarse(3), OPTIONS).base
    expected = 0.25 * (0.7 * np.outer(CELLS, CELLS) + 0.3 * np.diag(CELLS**2))
    assert np.allclose(found.covariance.resolution, expected, atol=1e-9)


def test_all_predictions_are_corrected_those_made_before_as_well():
    base = compare(coarse(3), OPTIONS).base
    state = base.fit.space.state(base.surface.x)
    raw = base.runs.model.predict([state])[0]
    assert np.allclose(base.runs.predict([state])[0], raw + CELLS)
    assert all(np.allclose(row, base.runs.predict([one])[0]) for one, row in base.runs.every)
    assert np.allclose(base.surface.prediction, raw + CELLS)


def test_without_the_models_error_nothing_is_corrected():
    plain = compare(coarse(3), replace(OPTIONS, numerical_covariance=False)).base
    assert not plain.cells.missing.any()


def test_what_an_engine_says_that_it_errs_by_is_in_the_covariance():
    sure = compare(Straight(truth({}) + errors(2)), OPTIONS)
    unsure = compare(Straight(truth({}) + errors(2), engine_std=2.0), OPTIONS)
    added = unsure.base.covariance.total - sure.base.covariance.total
    np.testing.assert_allclose(added, 4.0 * np.eye(len(added)), atol=1e-9)
    before, after = (one.judged.system.posterior[0, 0] for one in (sure, unsure))
    assert after > 1.5 * before and unsure.base.fit.total < sure.base.fit.total


def test_the_correction_is_found_again_where_it_has_moved_the_fit():
    """Cells that hold the slide back look like strength: the first fit is far from the last."""
    held_back = 0.5 * slopes()[:, 0]
    model = Straight(truth({}) + held_back + errors(2), cells=held_back)
    found = compare(model, OPTIONS).base
    asked = {s.values for s, _ in found.runs.every if s.numerics == "fine"}
    assert len(asked) == 2
    assert found.fit.space.values(found.fit.x)[0] == pytest.approx(15.0, rel=0.1)


def test_as_many_runs_have_finer_cells_as_are_asked_for():
    """Their mean is the correction, whose noise enters the covariance: the less, the more runs."""
    noise = {}
    for number in (1, 4):
        model = Straight(truth({}) + errors(3), noise=0.5)
        base = compare(model, replace(OPTIONS, finer_runs=number)).base
        fine = {s.seed for s, _ in base.runs.every if s.numerics == "fine"}
        assert fine == set(range(number))
        noise[number] = np.trace(base.covariance.resolution)
    assert noise[4] < noise[1]
