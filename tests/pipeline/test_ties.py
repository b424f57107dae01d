"""Choices by computed numbers: alike whatever the last bits say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.ties import RELATIVE, largest, largest_place, ranked, smallest
from tests.budget import examples

WHOLE = st.lists(st.integers(-50, 50).map(float), min_size=1, max_size=12)


@settings(max_examples=examples(100), deadline=None)
@given(WHOLE, st.integers(0, 2**32 - 1), st.floats(1.0, 1e6))
def test_last_bits_change_nothing(numbers, seed, scale):
    values = scale * np.array(numbers)
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, len(values))
    noisy = values + 0.1 * RELATIVE * np.maximum(1.0, np.abs(values)) * noise
    places = list(range(len(values)))
    exact = sorted(places, key=lambda place: (-values[place], place))
    assert ranked(places, noisy.__getitem__) == exact
    assert largest(places, noisy.__getitem__) == largest_place(noisy) == exact[0]
    assert smallest(places, noisy.__getitem__) == int(np.argmin(values))


def test_numbers_that_differ_are_told_apart():
    assert largest("ab", {"a": 100.0, "b": 100.001}.__getitem__) == "b"
    assert ranked("abc", {"a": 1.0, "b": 3.0, "c": 2.0}.__getitem__) == ["b", "c", "a"]


def test_a_start_that_is_far_off_makes_no_others_equal():
    totals = {"a": 1e12, "b": 2.0, "c": 1.0}
    assert smallest("abc", totals.__getitem__) == "c"
    assert ranked("abc", lambda name: -totals[name]) == ["c", "b", "a"]


def test_small_probabilities_are_told_apart():
    p = {"a": 1e-12, "b": 1e-40, "c": 1e-40 * (1.0 + 1e-12)}
    assert smallest("acb", p.__getitem__, unit=0.0) == "c"
    assert smallest("acb", p.__getitem__) == "a"


def test_what_failed_is_infinite_or_no_number():
    totals = {"a": np.inf, "b": 2.0, "c": np.nan, "d": np.inf, "e": 1.0}
    assert smallest("abcde", totals.__getitem__) == "e"
    assert ranked("abcde", totals.__getitem__) == ["a", "d", "b", "e", "c"]


def test_nothing_has_no_largest():
    assert largest([], abs, default=3.0) == 3.0
    with pytest.raises(ValueError, match="of nothing"):
        largest([], abs)
