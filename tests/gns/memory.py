"""Prints how much memory reading windows of a data set takes: `python memory.py FOLDER WINDOWS`."""

from __future__ import annotations

import sys

import numpy as np

from gns.dataset import Windows


def resident_mb() -> float:
    """Memory of this process that is in use now."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def main(folder: str, count: int) -> None:
    """Read windows at random and print the growth in MB, now and at its highest."""
    windows = Windows(folder, "train")
    places = np.random.default_rng(0).integers(0, len(windows), count)
    windows[0]
    before = resident_mb()
    most, total = before, 0.0
    for place in places:
        total += float(windows[place].positions[-1].sum())
        most = max(most, resident_mb())
    print(f"{len(windows.runs)} {before:.2f} {most:.2f}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
