"""What no fit may see lies where the numbers move, and the measured values do not choose it."""

from __future__ import annotations

import numpy as np
import pytest

from inversion.estimation.hold_out import mobility, split
from tests.diagnosis.straight import SIZE, X, measured

PROFILE = slice(1, 1 + len(X))


def held(predictions: np.ndarray | None) -> np.ndarray:
    targets = measured(np.arange(SIZE, dtype=float))
    return np.flatnonzero(split(targets, None, predictions).held_out)


def moving(*places: int) -> np.ndarray:
    """Predictions of which only these numbers of the profile move."""
    rows = np.zeros((3, SIZE))
    rows[:, np.array(places) + PROFILE.start] = [[-1.0], [0.0], [2.0]]
    return rows


def test_nothing_is_known_of_the_numbers_and_the_block_lies_past_the_middle():
    block = held(None)
    assert list(block) == list(range(block[0], block[0] + 5))
    assert block[0] - PROFILE.start == round(0.6 * len(X))
    assert np.array_equal(held(np.full((4, SIZE), np.nan)), block), "no run could be read"
    assert np.array_equal(held(np.random.default_rng(1).normal(size=(9, SIZE))), block)


@pytest.mark.parametrize("near", [2, 9, 20])
def test_the_block_goes_where_the_numbers_move(near):
    block = held(moving(near - 1, near, near + 1)) - PROFILE.start
    assert {near - 1, near, near + 1} & set(block), "it moves"
    assert 0 < block[0] and block[-1] < len(X) - 1, "both ends are fitted"
    # Of the blocks that move enough it is the one nearest to the usual place.
    usual = round(0.6 * len(X))
    assert abs(block[0] - usual) <= abs(near - 2 - usual)


def test_mobility_is_in_standard_deviations_of_the_survey():
    targets = measured(np.zeros(SIZE))
    rows = np.array([np.zeros(SIZE), np.ones(SIZE)])
    assert mobility(targets, rows)[0] == pytest.approx(0.5 / 1.0)
    assert mobility(targets, rows)[5] == pytest.approx(0.5 / 0.5)
    assert np.all(mobility(targets, None) == 1.0) and np.all(mobility(targets, rows[:1]) == 1.0)
