"""Times and memory of torch's work on either device."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import torch

from benchmarks.performance.resident import highest_resident


def seconds(work: Callable[[], object], device: str, rounds: int = 5) -> float:
    """Median wall time of some work after a round that is not counted [s]."""
    times = []
    for _ in range(rounds + 1):
        wait(device)
        began = time.perf_counter()
        work()
        wait(device)
        times.append(time.perf_counter() - began)
    return statistics.median(times[1:])


def wait(device: str) -> None:
    """Until the device has done what it was given."""
    if device == "cuda":
        torch.cuda.synchronize()


def peak_gib(work: Callable[[], object], device: str) -> float:
    """Highest memory of the device while some work is done [GiB]; on a CPU of this process."""
    if device == "cuda":
        torch.cuda.reset_peak_memory_stats()
    work()
    wait(device)
    if device == "cuda":
        return torch.cuda.max_memory_allocated() / 2**30
    return highest_resident()
