"""Splits: by run, stratified, and unmoved by scenes that come later."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gns.data.splits import split_runs
from tests.budget import examples

SHARES = {"valid_share": 0.1, "test_share": 0.15, "seed": 3}


def templates(count: int, seed: int = 0) -> dict[int, str]:
    letters = np.random.default_rng(seed).choice(
        list("abcde"), size=count, p=[0.4, 0.3, 0.15, 0.1, 0.05]
    )
    return dict(enumerate(map(str, letters)))


@settings(max_examples=examples(50), deadline=None)
@given(count=st.integers(3, 400), seed=st.integers(0, 99))
def test_every_run_is_in_one_split_and_every_template_has_its_share(count, seed):
    of_run = templates(count, seed)
    splits = split_runs(of_run, **{**SHARES, "seed": seed})
    assert sorted(run for runs in splits.values() for run in runs) == list(of_run)
    assert all(runs == sorted(runs) for runs in splits.values())
    assert all(splits.values()), "no split is empty"
    for letter, total in Counter(of_run.values()).items():
        for split, share in (("valid", 0.1), ("test", 0.15)):
            found = sum(of_run[run] == letter for run in splits[split])
            # One more for the handful of runs in which a split would be empty.
            assert abs(found - share * total) < (1.3 if count > 60 else 2.3)


def test_more_scenes_leave_the_others_where_they_are():
    old = split_runs(templates(200), **SHARES)
    new = split_runs(templates(350), **SHARES)
    for split, runs in old.items():
        assert runs == [run for run in new[split] if run < 200]


@settings(max_examples=examples(20), deadline=None)
@given(lost=st.sets(st.integers(0, 199), max_size=40))
def test_a_run_that_fails_leaves_the_others_where_they_are(lost):
    whole = split_runs(templates(200), **SHARES)
    left = split_runs(templates(200), **SHARES, without=lost)
    for split, runs in whole.items():
        assert left[split] == [run for run in runs if run not in lost]


def test_the_seed_decides():
    first = split_runs(templates(300), **SHARES)
    assert first == split_runs(dict(reversed(templates(300).items())), **SHARES)
    other = split_runs(templates(300), **{**SHARES, "seed": 4})
    assert first["test"] != other["test"]


def test_held_out_runs_are_not_bunched():
    """They come from all of the numbers, not from the last batch alone."""
    test = split_runs(templates(400), **SHARES)["test"]
    thirds = np.histogram(test, bins=[0, 133, 266, 400])[0]
    assert thirds.min() > 0.2 * len(test)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_a_handful(count):
    splits = split_runs({run: "abcde"[run] for run in range(count)}, **SHARES)
    assert len(splits["train"]) >= 1
    if count >= 3:
        assert splits["valid"] and splits["test"]


def test_no_share_is_no_run():
    splits = split_runs(templates(50), valid_share=0.0, test_share=0.0, seed=0)
    assert splits["valid"] == splits["test"] == [] and len(splits["train"]) == 50
