"""The smoothed end of a fit to many numbers: less noise, one answer from several starts."""

from __future__ import annotations

import numpy as np
import pytest

from inversion.estimation.calibrate import calibrate
from inversion.estimation.derivatives import FiniteSteps
from tests.inversion.analytic import angle, problem, strength, targets

GOAL = np.array([40.0, 30.0, 22.0, 15.0, 9.0, 5.0])


def valley(values):
    """Six numbers; all as measured at 25 kPa."""
    return GOAL * (values[0] / 25.0) ** -0.8


def noisy(start: float, seed: int, *, specs=None, formula=valley, noise=0.5):
    search = problem(
        specs or [strength("a")], formula, targets(*GOAL, std=1.0, loss="misfit"),
        loss="misfit", tolerance=0.01, noise=noise,
    )  # fmt: skip
    search.engine.seed = seed
    search.steps = FiniteSteps(
        search.objective.parameters, np.full(6, noise),
        whitener=search.objective.survey_whitener,
    )  # fmt: skip
    return search


def answers(seed: int) -> np.ndarray:
    found = []
    for start in (17.0, 25.0, 38.0):
        search = noisy(start, seed)
        found.append(calibrate(search, np.array([start]), method="gauss_newton", least_m=0.1))
    return np.array([one.values[0] for one in found])


def test_three_starts_end_nearer_to_each_other_and_to_the_truth(monkeypatch):
    smoothed = np.array([answers(seed) for seed in range(12)])
    monkeypatch.setattr(
        "inversion.estimation.calibrate.smoothed", lambda search, look, engine: None
    )
    plain = np.array([answers(seed) for seed in range(12)])
    apart = [np.median(np.ptp(np.log(kind), axis=1)) for kind in (plain, smoothed)]
    away = [np.sqrt(np.mean(np.log(kind / 25.0) ** 2)) for kind in (plain, smoothed)]
    assert apart[1] < 0.5 * apart[0]
    assert away[1] < 0.8 * away[0]
    assert away[1] < 0.02


def test_two_parameters_are_smoothed_together():
    def formula(values):
        return valley(values) + 0.8 * (values[1] - 31.0) * np.array([1, -1, 1, -1, 1, -1])

    search = noisy(20.0, 0, specs=[strength("a"), angle("b")], formula=formula, noise=0.2)
    found = calibrate(search, np.array([20.0, 28.0]), method="gauss_newton", least_m=0.1)
    assert "smoothed" in found.words
    assert found.values[0] == pytest.approx(25.0, rel=0.02)
    assert found.values[1] == pytest.approx(31.0, abs=0.5)


def test_without_noise_nothing_is_smoothed():
    search = noisy(20.0, 0, noise=0.0)
    found = calibrate(search, np.array([20.0]), method="gauss_newton", least_m=0.1)
    assert "smoothed" not in found.words
    assert found.values[0] == pytest.approx(25.0, rel=2e-3)


def test_a_bottom_at_the_rim_or_worse_than_the_ripple_is_not_taken():
    """Beyond 25 kPa the runs fail; on the other side the valley falls all the way to it."""
    search = noisy(20.0, 1, formula=lambda v: valley(v) if v[0] < 22.0 else np.full(6, np.nan))
    found = calibrate(search, np.array([18.0]), method="gauss_newton", least_m=0.1)
    assert found.values[0] < 22.0 and np.isfinite(found.best.loss)
