"""Derivatives of a back-analysis by both engines: time for 1, 3 and 10 parameters; memory.

    python -m benchmarks.performance diff_gns --model DIR [--spacing 1] [--frames 20] [--threads 2]

The Lower San Fernando section. Learned simulator: one rollout, and one with its derivative, by the
way the engine chooses; the frames given stand for all, since each frame costs the same, and the
times are those of a whole duration. Material point method: one run, and one batch of perturbed
runs, whole. Memory: growth of the highest resident size of a fresh process over one derivative by
three parameters of 10, 20 and 40 frames, and of every frame with `--whole`. The paper: 237 s for an
iteration of its learned simulator, 3,867 s for a run of its material point method.
"""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.performance import PROGRAM
from benchmarks.performance.resident import highest_resident
from geometry.case import load_case
from inversion.back_analysis.case import inversion_case
from inversion.engines.mpm_engine import MPMEngine
from inversion.engines.run_store import RunStore
from inversion.estimation.forward import SectionSetup
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import ParameterSpec
from pipeline.cli import CommandParser, base_parser
from pipeline.table import aligned

CASE = Path("case_histories/lower_san_fernando")
NUMBERS = (1, 3, 10)
FRAMES = (10, 20, 40)
WAYS = ("forward", "reverse")


def main(argv: Sequence[str]) -> int:
    """Print the tables."""
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.memory_of:
        print(_memory_here(arguments))
        return 0
    rows = [["derivative of the toe, s", "one run", *(f"{n} parameters" for n in NUMBERS)]]
    rows.append(["learned simulator", *_times(arguments, learned=True)])
    rows.append(["material point method", *_times(arguments, learned=False)])
    print(aligned(rows))
    asked = [*FRAMES, *([-1] if arguments.whole else [])]
    rows = [["memory of a derivative by 3 parameters, MiB", "forward", "reverse"]]
    for frames in asked:
        label = "every frame" if frames < 0 else f"{frames} frames"
        rows.append([label, *(f"{_memory(arguments, frames, way):.0f}" for way in WAYS)])
    print(aligned(rows))
    return 0


def setup_of(arguments, count: int, frames: int | None = None) -> SectionSetup:
    """The question with this many parameters; the fit is of the toe alone, as asked."""
    case = inversion_case(load_case(CASE), spacing_m=arguments.spacing)
    setup = dataclasses.replace(case.setup, parameters=Parameters(_specs(case, count)))
    if frames is None or frames < 0:
        return setup
    duration = (frames - 1) * setup.settings.frame_interval * np.sqrt(arguments.spacing / 9.81)
    settings = setup.settings.model_copy(update={"duration_s": duration, "early_stop": False})
    return dataclasses.replace(setup, settings=settings)


def _specs(case, count: int) -> list[ParameterSpec]:
    """The question's own parameters, then densities of zones."""
    specs = list(case.question.parameters)
    for zone in case.scene.zones:
        value = case.scene.materials[zone.material].density
        specs.append(
            ParameterSpec(
                name=f"density_{zone.name}", zones=[zone.name], property="density", start=value,
                low=0.8 * value, high=1.2 * value,
            )
        )  # fmt: skip
    return specs[:count]


def _times(arguments, *, learned: bool) -> list[str]:
    frames = arguments.frames if learned else None
    setups = [setup_of(arguments, count, frames) for count in NUMBERS]
    make = _engine(arguments, learned)
    starts = [setup.parameters.start for setup in setups]
    # Kernels are compiled, and what torch makes ready at its first derivative is ready.
    for setup, start in zip(setups, starts, strict=True):
        if learned:
            make().derivative(setup.at(0.99 * start), -0.03 * start)
        else:
            make().predict([setup.at(start)])
    scale = 1.0
    if learned:
        whole = setup_of(arguments, 1).settings.duration_s
        scale = whole / setups[0].settings.duration_s
    seconds = [_seconds(lambda: make().predict([setups[0].at(starts[0])]))]
    for setup, start in zip(setups, starts, strict=True):
        asked = setup.at(start)
        work = lambda asked=asked: make().derivative(asked, -0.03 * asked.values)  # noqa: E731
        seconds.append(_seconds(work))
    return [f"{scale * one:.1f}" for one in seconds]


def _engine(arguments, learned: bool) -> Callable[[], object]:
    """Makes an engine that has nothing in store."""
    if not learned:
        return lambda: MPMEngine(RunStore(None, threads=arguments.threads))
    from inversion.engines.gns_engine import GNSEngine, prepare
    from inversion.engines.rollout_store import RolloutStore
    from inversion.engines.trained_model import load_model

    prepare("cpu", arguments.threads)
    model = load_model(arguments.model)
    return lambda: GNSEngine(RolloutStore(None), model)


def _seconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def _memory(arguments, frames: int, way: str) -> float:
    """Of a fresh process [MiB]."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.performance", "diff_gns", "--model", arguments.model,
         "--spacing",
         str(arguments.spacing), "--threads", str(arguments.threads), "--memory-of", way,
         "--frames", str(frames)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return float(done.stdout.split()[-1])


def _memory_here(arguments) -> float:
    """Growth of this process over one derivative [MiB]."""
    setup = setup_of(arguments, 3, arguments.frames)
    engine = _engine(arguments, learned=True)()
    engine.mode = arguments.memory_of
    start = setup.parameters.start
    before = highest_resident()
    engine.derivative(setup.at(start), start)
    return 1024.0 * (highest_resident() - before)


def _parser() -> CommandParser:
    parser = base_parser(f"{PROGRAM} diff_gns", "Time and memory of derivatives.")
    parser.add_argument("--model", required=True, metavar="DIR", help="folder of a model")
    parser.add_argument("--spacing", type=float, default=1.0, help="m; default: 1")
    parser.add_argument("--frames", type=int, default=20, help="that are timed; default: 20")
    parser.add_argument("--threads", type=int, default=2, help="default: 2")
    parser.add_argument("--whole", action="store_true", help="memory of a whole rollout too")
    parser.add_argument("--memory-of", choices=WAYS, help=argparse.SUPPRESS)
    return parser
