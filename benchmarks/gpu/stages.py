"""The stages in order of worth, and the processes that they run in.

Each stage has a process of its own: what ends one (a CUDA error, no memory, a time limit) is a row,
and the rest go on in another. A measurement that is there is not done again.
"""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.gpu.record import Record

FAILED = 3
"""Exit code of a process whose measurement failed: it may have left the card unusable for it."""
REHEARSE = "--rehearse"
LEAST_S = 1.0
"""A process is not started for less."""


@dataclass(frozen=True)
class Context:
    """What a measurement may ask.

    Attributes:
        device: "cuda" or "cpu".
        rehearse: everything in miniature.
        record: of what is measured before.
        until: when the stage has to end, by `time.monotonic` [s].
    """

    device: str
    rehearse: bool
    record: Record
    until: float

    @property
    def left(self) -> float:
        """Time of the stage that is left [s]."""
        return self.until - time.monotonic()

    @property
    def folder(self) -> Path:
        """For files that measurements share."""
        return self.record.path.with_suffix(".work")


Measurement = Callable[[Context], Iterable[dict[str, Any]]]


@dataclass(frozen=True)
class Stage:
    """Attributes: `seconds` is its budget, `module` has a dictionary MEASUREMENTS by name."""

    name: str
    seconds: float
    module: str

    def measurements(self) -> dict[str, Measurement]:
        """By name, in their order."""
        return importlib.import_module(self.module).MEASUREMENTS


STAGES = {
    stage.name: stage
    for stage in (
        Stage("card", 20.0, "benchmarks.gpu.card"),
        Stage("true", 110.0, "benchmarks.gpu.true"),
        Stage("fast", 110.0, "benchmarks.gpu.fast"),
        Stage("network", 90.0, "benchmarks.gpu.network"),
        Stage("training", 90.0, "benchmarks.gpu.training"),
        Stage("learning", float("inf"), "benchmarks.gpu.learning"),
    )
}
"""`learning` takes what is left."""

ORDER = {
    "card": ("limits",),
    "true": ("slides", "slides with effects", "three dimensions", "tests"),
    "fast": (
        "1 scene", "8 scenes", "132 scenes", "1,056 scenes", "1 M points",
        "Lower San Fernando, 2 m", "Lower San Fernando, 1 m", "three dimensions",
    ),
    "network": (
        "forward", "training step", "bf16", "tf32", "CUDA graph", "compiled", "slide",
    ),
    "training": ("data", "train_large", "train_coarse", "train_direct", "processes"),
    "learning": ("resumed",),
}  # fmt: skip
"""Names of the measurements, so that the first process need not load torch or Taichi."""


def run_stage(
    stage: Stage, record: Callable[[], Record], seconds: float, options: Sequence[str]
) -> None:
    """Run what is not tried of a stage, in processes of at most so many seconds together.

    Args:
        stage: what to run.
        record: reads what is there.
        seconds: that it may take; in earnest no more than its budget, while a rehearsal, which
            judges no speed, has as long as it needs.
        options: of the process, without stage and time.
    """
    until = time.monotonic() + (seconds if REHEARSE in options else min(seconds, stage.seconds))
    while waiting := [one for one in ORDER[stage.name] if not record().tried(stage.name, one)]:
        left = until - time.monotonic()
        if left < LEAST_S:
            for one in waiting:
                record().fail(stage.name, one, "not reached in the time of the stage")
            return
        began = time.monotonic()
        why = _in_a_process([*options, "--stage", stage.name, "--seconds", f"{left:.1f}"], left)
        lost = [one for one in waiting if not record().tried(stage.name, one)]
        if why and lost:  # the first that is not there is the one that was running
            took = time.monotonic() - began
            record().fail(stage.name, lost[0], f"{why} after {took:.0f} s")


def _in_a_process(options: Sequence[str], seconds: float) -> str:
    """How a process ended; empty: by itself, with everything that it tried in the record."""
    with tempfile.TemporaryFile("w+") as said:
        command = [sys.executable, "-m", "benchmarks.gpu", *options]
        # Threads of torch spin between operations this small.
        threads = {"OMP_NUM_THREADS": "1"} if REHEARSE in options else {}
        process = subprocess.Popen(
            command, stderr=said, start_new_session=True, env={**os.environ, **threads}
        )
        try:
            code = process.wait(seconds)
        except subprocess.TimeoutExpired:
            _kill(process)
            return "killed"
        if code in (0, FAILED):
            return ""
        said.seek(0)
        lines = said.read().strip().splitlines() or [""]
        return f"ended with code {code}: {lines[-1][-300:]}"


def _kill(process: subprocess.Popen) -> None:
    """A process and those that it started, which are of its session."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def work(stage: Stage, context: Context, measurements: dict[str, Measurement]) -> int:
    """Measure in this process, until something fails; the exit code."""
    for name in ORDER[stage.name]:
        if context.record.tried(stage.name, name):
            continue
        if context.left < LEAST_S:
            return 0
        try:
            rows = list(measurements[name](context))
        except Exception as error:
            text = " ".join(str(error).split())[-300:]
            context.record.fail(stage.name, name, f"{type(error).__name__}: {text}")
            return FAILED
        context.record.add(stage.name, name, rows)
    return 0
