"""Which runs a model learns from, which choose it, and which judge it.

By run, never by frame: neighbouring frames are nearly copies. Stratified by template: within each
template every split gets its share, to within one run. A run's split follows from the seed, its
template and how many runs of that template came before it, failed ones and those left out among
them, so that neither more scenes later nor a run that fails move another: a model is never judged
on what it has learned from.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from math import floor

from gns.data.shard import SPLITS
from pipeline.random_numbers import Stream, number_of


def split_runs(
    templates: Mapping[int, str],
    *,
    valid_share: float,
    test_share: float,
    seed: int,
    without: Collection[int] = (),
) -> dict[str, list[int]]:
    """Deal out runs.

    Systematic sampling with a random start: the test set takes a run each time the template's
    count passes a multiple of 1 / share; the validation set does so among those left.

    Args:
        templates: template of each run by its number; "" for a scene made by hand.
        valid_share: share of the runs that choose among checkpoints.
        test_share: share of the runs that judge the model; the two together are below 1.
        seed: decides the starts.
        without: runs that count, but are in no split: they failed or are left out.

    Returns:
        numbers of the runs of each split, ascending.
    """
    of_template: dict[str, list[int]] = defaultdict(list)
    for run in sorted(templates):
        of_template[templates[run]].append(run)
    splits: dict[str, list[int]] = {split: [] for split in SPLITS}
    for template, runs in of_template.items():
        stream = Stream(seed, number_of("splits"), number_of(template))
        test, rest = _every(runs, test_share, stream.unit())
        valid, train = _every(rest, valid_share / (1.0 - test_share), stream.unit())
        for split, chosen in (("train", train), ("valid", valid), ("test", test)):
            splits[split] += [run for run in chosen if run not in without]
    _leave_none_empty(splits, {"valid": valid_share, "test": test_share})
    return {split: sorted(runs) for split, runs in splits.items()}


def _every(runs: list[int], share: float, start: float) -> tuple[list[int], list[int]]:
    """Those runs at which start + count x share passes a whole number, and the others."""
    chosen, others = [], []
    for count, run in enumerate(runs):
        passes = floor(start + (count + 1) * share) > floor(start + count * share)
        (chosen if passes else others).append(run)
    return chosen, others


def _leave_none_empty(splits: dict[str, list[int]], shares: dict[str, float]) -> None:
    """In a handful of runs a split may come out empty: it then gets the last run of the largest."""
    for split in ("train", "test", "valid"):
        if splits[split] or (split in shares and shares[split] == 0.0):
            continue
        largest = max(splits.values(), key=len)
        if len(largest) > 1:
            splits[split].append(largest.pop())
