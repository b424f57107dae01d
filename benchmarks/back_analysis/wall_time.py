"""Wall time of forward and gradient.

One batch with the base run and one run for each parameter, side by side on two threads, against
one run alone on the same machine; the smallest of several times counts. The paper: 237 s for an
iteration of the learned simulator on a GPU, 3,867 s for one run of the material point method on
56 cores.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure, at_most
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.estimation.unknowns import Parameters

TITLE = "Wall time of forward and gradient"

REPEATS = (8, 2)
LIMIT = 2.3


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Time one run, and base run with gradient, in turn."""
    case = lab.loaded(lab.PAPER, quick=quick)
    values = np.array([50.0, 30.0, 30.0])
    steps = np.array([-1.0, 1.0, 1.0])
    asked = case.setup.at(values)
    _engine().predict([asked])  # compiles the kernels
    one, every, alone = [], [], []
    single = dataclasses.replace(case.setup, parameters=Parameters(case.parameters.specs[:1]))
    for _ in range(REPEATS[quick]):
        one.append(_seconds(lambda: _engine().predict([asked])))
        every.append(_seconds(lambda: _engine().derivative(asked, steps)))
        alone.append(_seconds(lambda: _engine().derivative(single.at(values[:1]), steps[:1])))
    base, both, strength = (np.min(times, axis=0) for times in (one, every, alone))
    load = os.getloadavg()[0]
    return [
        Figure("one run", f"{base[0]:.2f} s", note=f"{case.scene.spacing:g} m spacing, "
               f"{lab.THREADS} threads; load of the machine {load:.1f}"),
        at_most("forward + gradient by 3 parameters (4 runs) / one run", both[0] / base[0], LIMIT,
                note=f"{both[0]:.2f} s"),
        Figure("the same by computing time, spread over 2 cores",
               f"{both[1] / base[1] / lab.THREADS:.2f}",
               note="what two cores without other work would come to, at best"),
        Figure("forward + gradient by S_r alone (2 runs) / one run",
               f"{strength[0] / base[0]:.2f}", note=f"{strength[0]:.2f} s"),
    ]  # fmt: skip


def _engine() -> MPMEngine:
    return MPMEngine(RunStore(None, threads=lab.THREADS))


def _seconds(work: Callable[[], object]) -> tuple[float, float]:
    """Wall time and computing time of all threads [s]."""
    began = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - began[0], time.process_time() - began[1]
