"""Wilson's interval against published values and its defining equation."""

import math

import pytest

from benchmarks.hidden_effects.scoring.intervals import NORMAL_95, Share, wilson


@pytest.mark.parametrize(
    ("hits", "n", "low", "high"),
    # Newcombe (1998), Statistics in Medicine 17, 857, table I, method 3.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611),
     (1, 29, 0.0061, 0.1718)],
)  # fmt: skip
def test_published_intervals(hits, n, low, high):
    assert wilson(hits, n) == pytest.approx((low, high), abs=5e-5)


def test_ends_are_where_the_score_test_just_refuses():
    low, high = wilson(7, 40)
    for end in (low, high):
        z = (7 / 40 - end) / math.sqrt(end * (1 - end) / 40)
        assert abs(z) == pytest.approx(NORMAL_95)


def test_nothing_is_known_of_nothing():
    share = Share.of([])
    assert share.interval == (0.0, 1.0)
    assert share.value is None
    assert share.words == "none"


def test_more_hits_than_trials_are_refused():
    with pytest.raises(ValueError, match="3 hits of 2"):
        wilson(3, 2)


def test_words():
    assert Share(5, 6).words == "83 % (44-97), 5 of 6"
