"""`python -m benchmarks.performance NAME`: one of the measurements; without a name, their list."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

from benchmarks.performance import PROGRAM
from pipeline.cli import InputError, main_exit

MEASUREMENTS = {
    "point_steps": "material point-steps per second, over a plain kernel with atomics",
    "point_steps_3d": "the same in three dimensions, and the distance to the processor's limits",
    "throughput": "whole jobs: Lower San Fernando, and samples of the scales",
    "back_analysis": "a back-analysis in several processes, over one with as many threads",
    "effects_cost": "a run with an effect, over one of the base model",
    "gns_network": "the learned simulator's network, over the textbook's form",
    "diff_gns": "derivatives of a back-analysis by both engines",
    "direct_request": "a whole prediction by the direct model",
    "windows": "reading windows of packed data at random",
}
"""Each is a module of this package that has `main(argv)`."""


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, or list what can be measured."""
    name, *rest = (sys.argv[1:] if argv is None else argv) or ["--help"]
    if name in ("-h", "--help"):
        print(f"usage: {PROGRAM} NAME ...\n")
        print("\n".join(f"  {one:<16}{words}" for one, words in MEASUREMENTS.items()))
        return 0
    if name not in MEASUREMENTS:
        raise InputError(f"{name}: no such measurement; there are {', '.join(MEASUREMENTS)}")
    return import_module(f"benchmarks.performance.{name}").main(rest) or 0


if __name__ == "__main__":
    main_exit(main)
