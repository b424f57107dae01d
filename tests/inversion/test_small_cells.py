"""Strengths in small cells: on formulas whose cells cost a known share, and on a small slide."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from inversion.engines.small_cells import (
    FARTHEST,
    NOISE_STD,
    ORDER,
    SHARE_STD,
    UNKNOWN_STD,
    InSmallCells,
    SmallCells,
    factors_of,
    log_of_same_slide,
    small_cells,
)
from inversion.estimation.unknowns import Parameters
from tests.inversion.analytic import Formula, angle, strength, targets

PARAMETERS = Parameters([strength("a"), angle("b")])
VALUES = np.array([20.0, 31.0])


def cells_of(spacing: float, cost: float = 0.04, noise: float = 0.0, toe=None) -> Formula:
    """Two toes of runs whose strength is too low by `cost` times spacing^1.45."""
    loss = np.exp(cost * spacing**ORDER)

    def toes(values: np.ndarray) -> np.ndarray:
        true = values[0] * loss
        first = 50.0 - 60.0 * np.log(true / 20.0) + 12.0 * np.log(true / 20.0) ** 2
        return np.array([first, 30.0 - 25.0 * np.log(true / 20.0) + values[1] - 31.0])

    one = Formula(toes if toe is None else toe, ["0", "1"], parameters=PARAMETERS, noise=noise)
    one.targets, one.scene = targets(50.0, 30.0), SimpleNamespace(spacing=spacing)
    return one


@pytest.mark.parametrize("factor", [0.6, 1.5, 2.0])
def test_the_limit_is_found_from_two_spacings(factor):
    here = cells_of(1.0)
    found = small_cells(here, here, VALUES, [cells_of(factor)])
    assert found.known and found.other_spacing_m == factor
    assert found.factor == pytest.approx(np.exp(0.04), rel=2e-3)
    assert found.log_std == pytest.approx(np.hypot(SHARE_STD * 0.04, NOISE_STD), rel=0.02)
    assert here.runs == 5


def test_the_factor_leaves_the_same_slide_and_angles_alone():
    here, other = cells_of(1.0), cells_of(2.0)
    log = log_of_same_slide(here, here, VALUES, other)
    (left,) = other.predict([other.at(VALUES * [np.exp(log), 1.0])])
    (there,) = here.predict([here.at(VALUES)])
    assert left.values == pytest.approx(there.values, abs=0.1)


def test_noise_of_the_runs_is_averaged_over_four_of_them():
    logs = []
    for seed in range(40):
        here, other = cells_of(1.0), cells_of(2.0, noise=0.5)
        other.seed = seed
        logs.append(log_of_same_slide(here, here, VALUES, other))
    # One toe of 60 m, and one of 25 m, for a unit of the logarithm.
    assert np.std(logs) < 1.2 * 0.5 / np.hypot(60.0, 25.0)
    assert np.mean(logs) == pytest.approx(-0.04 * (2.0**ORDER - 1.0), abs=0.005)


def test_cells_that_lie_too_far_apart_are_asked_at_the_next_spacing():
    here = cells_of(1.0, cost=0.2)
    odd = cells_of(2.0, cost=0.3)
    found = small_cells(here, here, VALUES, [odd, cells_of(0.6, cost=0.2)])
    assert found.other_spacing_m == 0.6
    assert found.factor == pytest.approx(np.exp(0.2), rel=0.02)


def test_where_all_lie_too_far_nothing_is_taken_off_and_the_strength_is_less_certain():
    here = cells_of(1.0, cost=0.4)
    found = small_cells(here, here, VALUES, [cells_of(0.6, cost=0.4)])
    assert not found.known and found.factor == 1.0
    assert found.log_std == pytest.approx(0.4, rel=0.05) and found.log_std > FARTHEST
    assert "a smaller spacing would tell" in found.words


def test_without_another_spacing_the_cells_are_not_known():
    here = cells_of(1.0)
    found = small_cells(here, here, VALUES, [])
    assert found == SmallCells.unknown(1.0, "no other spacing can be run")
    assert (found.factor, found.log_std) == (1.0, UNKNOWN_STD)


def test_runs_that_fail_or_do_not_notice_the_strength_tell_nothing():
    here = cells_of(1.0)
    for toe in (lambda values: np.array([np.nan, np.nan]), lambda values: np.array([48.0, 29.0])):
        assert np.isnan(log_of_same_slide(here, here, VALUES, cells_of(2.0, toe=toe)))
        found = small_cells(here, here, VALUES, [cells_of(2.0, toe=toe), cells_of(1.5)])
        assert found.other_spacing_m == 1.5

    # A number that the coarser run does not have is left out, the others count.
    def one_alone(values):
        return np.array([cells_of(2.0)._one(values).values[0], np.nan])

    log = log_of_same_slide(here, here, VALUES, cells_of(2.0, toe=one_alone))
    assert log == pytest.approx(-0.04 * (2.0**ORDER - 1.0), abs=0.01)


def test_an_engine_in_small_cells_runs_what_its_cells_need():
    here = cells_of(1.0)
    cells = small_cells(here, here, VALUES, [cells_of(2.0)])
    engine, limit = InSmallCells(here, cells), cells_of(0.0)
    (told,), (true,), (ran,) = (
        one.predict([setup.at(VALUES)])
        for one, setup in ((engine, here), (limit, limit), (here, here))
    )
    assert here.asked[-2] == pytest.approx(VALUES / [cells.factor, 1.0])
    assert told.values == pytest.approx(true.values, abs=0.2)
    assert ran.values != pytest.approx(true.values, abs=0.9)
    assert engine.error_std(here.at(VALUES)).tolist() == [0.0, 0.0]


def test_a_prior_is_of_the_soil_and_not_of_the_runs():
    cells = SmallCells(factor=1.21, log_std=0.1, spacing_m=1.0, other_spacing_m=2.0, words="")
    assert factors_of(cells, PARAMETERS) == {"a": pytest.approx(1.21), "b": 1.0}
    half = factors_of(cells, PARAMETERS, {"a": 0.5, "b": 0.5})
    assert half == {"a": pytest.approx(1.1), "b": 1.0}
    assert factors_of(cells, PARAMETERS, {"a": 0.0, "b": 1.0})["a"] == 1.0
