"""Reading windows of packed data at random: memory and time.

    python -m benchmarks.performance windows results/coarse/dataset [WINDOWS]

Prints the number of runs, their size on the disk, the memory of the process before and at its
highest while it reads, and the processor time a window takes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gns.data.dataset import Windows


def resident_mb() -> float:
    """Memory of this process that is in use now [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def main(arguments: Sequence[str]) -> None:
    """Read windows of the training runs and print what it took."""
    folder, count = arguments[0], int(arguments[1]) if len(arguments) > 1 else 1000
    windows = Windows(folder, "train")
    places = np.random.default_rng(0).integers(0, len(windows), count)
    size = sum(path.stat().st_size for path in Path(folder).glob("train_*.npz")) / 1e6
    before = most = resident_mb()
    started = time.process_time()
    for place in places:
        windows[int(place)]
        most = max(most, resident_mb())
    each = 1e3 * (time.process_time() - started) / count
    print(
        f"{len(windows.runs)} runs, {size:.1f} MB on the disk: {before:.1f} MB in memory, at most "
        f"{most:.1f} MB; {each:.2f} ms a window"
    )
