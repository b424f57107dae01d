"""Time of a whole prediction by the direct model: Lower San Fernando at 2 m on one core.

    python -m benchmarks.performance direct_request

A first request cuts the section into columns, fills it and reads the measurements on it; those
that differ from it in strengths alone take that over. Both in turn, medians.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from benchmarks.performance import PROGRAM
from geometry.case import load_case
from inversion.back_analysis.case import inversion_case
from inversion.engines.direct_engine import DirectEngine, shipped
from inversion.engines.run_store import RunStore
from inversion.estimation.forward import Request

CASE = Path("case_histories/lower_san_fernando")
PAIRS = 40


def seconds(engine: DirectEngine, request: Request) -> float:
    """Of one request [s]."""
    began = time.perf_counter()
    engine.predict([request])
    return time.perf_counter() - began


def medians() -> tuple[float, float, float]:
    """Of a first request, of one that differs in strengths alone, and of its network [ms]."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    case = inversion_case(load_case(CASE))
    setup = case.setup.with_scene(case.setup.scene.changed(spacing=2.0))
    store, found = RunStore(None, threads=1), []
    shipped("direct", store).predict([setup.at(case.parameters.start)])
    for strength in np.linspace(0.8, 1.2, PAIRS):
        engine, request = shipped("direct", store), setup.at(strength * case.parameters.start)
        pair = [seconds(engine, request) for _ in range(2)]
        (asked,) = engine._asked([request])
        found.append([*pair, engine.forecast(asked)[1]])
    torch.set_num_threads(threads)
    return tuple(1000.0 * np.median(found, axis=0))


def main(argv: Sequence[str]) -> None:
    """Print the medians and their ratio."""
    argparse.ArgumentParser(prog=f"{PROGRAM} direct_request", description=__doc__).parse_args(argv)
    first, later, network = medians()
    print(f"first {first:.1f} ms, later {later:.1f} ms, of it the network {network:.1f} ms")
    print(f"ratio {first / later:.2f}")
