"""The back-analysis of Lower San Fernando: in several processes against one with as many threads.

    python -m benchmarks.performance back_analysis [--rounds 3] [--threads 2]

The two ways alternate, each from nothing but compiled kernels. Times are those of `result.json`, in
all, without the page and its film; the results must be the same but for these times.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

import flowslide
from benchmarks.performance import PROGRAM
from inversion.back_analysis.result import Result
from inversion.engines import run_store

CASE = Path(__file__).parents[2] / "case_histories" / "lower_san_fernando"


def analysed(threads: int, *, in_processes: bool) -> Result:
    """One back-analysis."""
    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(run_store, "has_own_code", lambda: not in_processes),
    ):
        return flowslide.back_analyse(CASE, out=folder, threads=threads)


def without_times(result: Result) -> dict:
    """What must be the same."""
    document = result.model_dump(mode="json", exclude={"manifest", "timings"})
    for iteration in document["iterations"]:
        del iteration["seconds"]
    return document


def main(argv: Sequence[str]) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog=f"{PROGRAM} back_analysis", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)))
    options = parser.parse_args(argv)
    ratios = []
    for _ in range(options.rounds):
        one, several = (
            analysed(options.threads, in_processes=in_processes) for in_processes in (False, True)
        )
        assert without_times(one) == without_times(several)
        pair = one.timings["in all"], several.timings["in all"]
        ratios.append(pair[0] / pair[1])
        print(f"one process {pair[0]:.1f} s, {options.threads} processes {pair[1]:.1f} s, "
              f"ratio {ratios[-1]:.2f}; {several.timings}, {several.runs} simulations")  # fmt: skip
    print(f"median ratio {np.median(ratios):.2f}")
