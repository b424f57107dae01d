"""Training: steps per second of what the workflow trains, and several processes that learn as one.

The data are a few short runs of the scale: what a step costs follows from the size of its scenes.
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import torch

from benchmarks.gpu.joint import final_weights
from benchmarks.gpu.record import row
from benchmarks.gpu.stages import Context, Measurement
from benchmarks.gpu.torch_timing import seconds
from flowslide.commands.gns.train import open_windows
from gns.direct import network as direct
from gns.direct.train import TrainingPlan, loss_of, optimiser_of
from gns.training.checkpoints import ModelFolder
from gns.training.distributed import ProcessGroup
from gns.training.train import train
from pipeline.cli import WorkFailed
from pipeline.config import Config, load_config

SCALES = ("large", "coarse")
SCENES = 10
"""Drawn for the runs of a scale, one batch."""
UNCOUNTED = 3
"""Steps until times are taken."""
CONFIG = {True: "config/test.yaml", False: None}
SAME = 1e-4
"""Largest difference of weights, over their largest, that is rounding."""


def _changes(scale: str) -> list[str]:
    return [
        f"scales.{scale}.number_of_scenes={SCENES}",
        f"scales.{scale}.runs_per_batch={SCENES}",
        f"scales.{scale}.duration_s=2.0",
        "gns.pack.valid_share=0.2",
        "gns.pack.test_share=0.1",
    ]


def _flowslide(context: Context, scale: str, *arguments: object) -> None:
    """A command of this project in a process of its own, with short runs of a scale."""
    command = [sys.executable, "-m", "flowslide", *map(str, arguments), "--quiet"]
    for change in _changes(scale):
        command += ["--set", change]
    if CONFIG[context.rehearse]:
        command += ["--config", str(CONFIG[context.rehearse])]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise WorkFailed(f"{' '.join(map(str, arguments[:3]))}: {done.stderr[-300:]}")


def data(context: Context) -> Iterator[dict[str, Any]]:
    """Simulate on the CPU of this machine and pack."""
    for scale in SCALES:
        runs, packed = context.folder / scale / "runs", context.folder / scale / "dataset"
        began = time.perf_counter()
        _flowslide(context, scale, "scenes", "simulate", "--scale", scale, "--batch", 0,
                   "--out", runs)  # fmt: skip
        files = sorted(runs.glob("*.h5"))
        _flowslide(context, scale, "gns", "pack", *files, "--scale", scale, "--out", packed)
        took = time.perf_counter() - began
        yield row(f"data of {scale}", took, "s", f"{SCENES} runs of 2 s, packed")


def _config(context: Context) -> Config:
    return load_config(CONFIG[context.rehearse])


def steps(context: Context, *, scale: str) -> Iterator[dict[str, Any]]:
    """Steps per second of `train_<scale>`, in both precisions."""
    for precision in ("float32", "bfloat16"):
        settings = _config(context).training_for(scale)
        counted = 2 if context.rehearse else 40
        never = {"validate_every": 10**6, "checkpoint_every": 10**6}
        settings = settings.model_copy(
            update={"precision": precision, "unroll_ramp": 0.0, "restart_at": [], **never}
        )
        times: list[float] = []
        train(
            ModelFolder(_fresh(context.folder / f"{scale}_{precision}")),
            *open_windows(context.folder / scale / "dataset", settings),
            settings,
            ProcessGroup(0, 1, torch.device(context.device)),
            stop=_After(UNCOUNTED + counted),  # type: ignore[arg-type]
            on_step=lambda step, loss, times=times: times.append(time.perf_counter()),
        )
        gaps = [late - early for early, late in zip(times[UNCOUNTED:], times[UNCOUNTED + 1 :],
                                                    strict=False)]  # fmt: skip
        took = statistics.median(gaps)
        beside = f"{settings.steps} steps would take {settings.steps * took / 3600.0:.1f} h"
        yield row(f"train_{scale}, {precision}", 1.0 / took, "steps/s", beside)


class _After:
    """Stops a training after some steps; see `gns.training.stopping.StopRequest`."""

    cut_short = False

    def __init__(self, count: int) -> None:
        self.count = count

    @property
    def wanted(self) -> bool:
        """Asked once in each step."""
        self.count -= 1
        return self.count < 1


def _fresh(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    return folder


def train_direct(context: Context) -> Iterator[dict[str, Any]]:
    """A step of the direct model, by its parts: its command trains on the CPU alone."""
    widths = (8, 8, 8, 8) if context.rehearse else direct.DirectConfig().widths
    config, plan = direct.DirectConfig(widths=widths), TrainingPlan()
    network = direct.DirectNetwork(config).to(context.device).train()
    optimiser = optimiser_of(network, plan)
    channels = direct.PER_COLUMN + direct.LAYERS * direct.PER_LAYER
    columns, batch = len(direct.places()), 2 if context.rehearse else plan.batch

    def drawn(*shape: int) -> torch.Tensor:
        return torch.rand(batch, *shape, device=context.device)

    seen = drawn(channels, columns)
    truth = drawn(2), drawn(columns), 0.1 + drawn(3, len(direct.SHARES))

    def step() -> None:
        loss = loss_of(network(seen), *truth)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    took = seconds(step, context.device, rounds=3 if context.rehearse else 20)
    beside = f"{plan.steps} steps would take {plan.steps * took / 60.0:.0f} min; no --device yet"
    yield row("train_direct", 1.0 / took, "steps/s", beside)


def processes(context: Context) -> Iterator[dict[str, Any]]:
    """One process that averages with itself, two on one device, against one."""
    dataset = context.folder / "coarse" / "dataset"
    alone = final_weights(dataset, context.device, "none", 1)
    nccl = "nccl" if context.device == "cuda" else "gloo"
    for backend, number in ((nccl, 1), ("gloo", 2)):
        found = final_weights(dataset, context.device, backend, number)
        off = max(float((found[name] - value).abs().max()) for name, value in alone.items())
        largest = max(float(value.abs().max()) for value in alone.values())
        verdict = "equal to one process" if off <= SAME * largest else "NOT EQUAL TO ONE PROCESS"
        yield row(f"{backend}, {number} processes: weights", off, "", verdict)


MEASUREMENTS: dict[str, Measurement] = {
    "data": data,
    "train_large": partial(steps, scale="large"),
    "train_coarse": partial(steps, scale="coarse"),
    "train_direct": train_direct,
    "processes": processes,
}
