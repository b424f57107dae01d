"""The rest of the time: a training that goes on from its checkpoint and leaves a better model.

In: `build/gpu-learning/dataset` (packed, `flowslide gns pack`), beside it `config.yaml` with what
differs from the settings, and `model/`, where an earlier part of the training stopped. Out:
`model/` in the folder of this benchmark's files, to be brought home.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.gpu.record import row
from benchmarks.gpu.stages import Context, Measurement
from pipeline.cli import WorkFailed

PREPARED = Path("build/gpu-learning")
MARGIN_S = 15.0
"""Kept for the start of the process and for its last state."""


def resumed(context: Context) -> Iterator[dict[str, Any]]:
    """`flowslide gns train` for the time that is left."""
    prepared = context.folder / "coarse" if context.rehearse else PREPARED
    if not (prepared / "dataset").is_dir():
        yield row("training", beside=f"no packed data in {prepared}/dataset")
        return
    model = context.folder / "model"
    if (prepared / "model").is_dir() and not model.is_dir():
        shutil.copytree(prepared / "model", model)
    seconds = 3.0 if context.rehearse else context.left - MARGIN_S
    before = _last(model, "step")
    command = [
        sys.executable, "-m", "flowslide", "gns", "train", "--quiet", "--data",
        prepared / "dataset", "--out", model, "--device", context.device, "--minutes",
        f"{seconds / 60.0:.4f}", "--yes",
    ]  # fmt: skip
    config = Path("config/test.yaml") if context.rehearse else prepared / "config.yaml"
    command += ["--config", config] if config.is_file() else []
    done = subprocess.run([str(one) for one in command], capture_output=True, text=True)
    if done.returncode:
        raise WorkFailed(f"gns train: {done.stderr[-300:]}")
    after = _last(model, "step")
    yield row("training", after - before, "steps", f"to step {after:g} in {seconds:.0f} s, {model}")


def _last(model: Path, name: str) -> float:
    """The last of a metric; 0: there is none yet."""
    file = model / "metrics.jsonl"
    lines = file.read_text().splitlines() if file.is_file() else []
    found = [line[name] for line in map(json.loads, lines) if name in line]
    return found[-1] if found else 0.0


MEASUREMENTS: dict[str, Measurement] = {"resumed": resumed}
