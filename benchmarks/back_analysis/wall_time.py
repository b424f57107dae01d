"""Wall time of forward and gradient.

One batch with the base run and one run for each parameter, side by side on two threads, beside
one run alone on the same machine; nothing is kept between repetitions. The smallest of several
times counts, because other work on the machine can only add to it. The paper: 237 s for an
iteration of the learned simulator on a GPU, 3,867 s for one run of the material point method on
56 cores.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure, at_most
from inversion.mpm_engine import MPMEngine
from inversion.parameters import Parameters
from inversion.run_store import RunStore

TITLE = "Wall time of forward and gradient"

REPEATS = (5, 2)
LIMIT = 2.3


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Time one run, and base run with gradient, in turn."""
    case = lab.loaded(lab.LSFD, quick=quick)
    values = np.array([27.0, 30.0, 30.0])
    steps = np.array([-1.0, 1.0, 1.0])
    _engine(case.setup).predict([values])  # compiles the kernels
    one, every, alone = [], [], []
    strength_alone = Parameters(case.parameters.specs[:1])
    single = _replaced(case.setup, strength_alone)
    for _ in range(REPEATS[quick]):
        one.append(_seconds(lambda: _engine(case.setup).predict([values])))
        every.append(_seconds(lambda: _engine(case.setup).derivative(values, steps)))
        alone.append(_seconds(lambda: _engine(single).derivative(values[:1], steps[:1])))
    base = min(one)
    load = os.getloadavg()[0]
    return [
        Figure("one run", f"{base:.2f} s", note=f"{case.scene.spacing:g} m spacing, "
               f"{lab.THREADS} threads; load of the machine {load:.1f}"),
        at_most("forward + gradient by 3 parameters (4 runs) / one run", min(every) / base, LIMIT,
                note=f"{min(every):.2f} s; on an idle pair of cores 2 is the least"),
        Figure("forward + gradient by S_r alone (2 runs) / one run", f"{min(alone) / base:.2f}",
               note=f"{min(alone):.2f} s"),
    ]  # fmt: skip


def _engine(setup) -> MPMEngine:
    return MPMEngine(setup, RunStore(None, threads=lab.THREADS))


def _replaced(setup, parameters: Parameters):
    from dataclasses import replace

    return replace(setup, parameters=parameters)


def _seconds(work) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began
