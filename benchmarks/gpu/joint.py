"""A short training by one or several processes on one device, whose weights are compared.

`python -m benchmarks.gpu.joint DATASET DEVICE BACKEND FILE` is one of the processes.
"""

from __future__ import annotations

import os
import sys
import tempfile
from datetime import timedelta
from pathlib import Path

import torch
from torch import Tensor, distributed, nn

from flowslide.commands.gns.train import open_windows
from gns.training.checkpoints import ModelFolder
from gns.training.distributed import ProcessGroup
from gns.training.processes import in_processes
from gns.training.train import train
from pipeline.cli import WorkFailed
from pipeline.config import TrainSettings, load_config

STEPS, BATCH = 5, 2
PATIENCE = timedelta(seconds=40.0)
"""With a process that does not come; without a loopback device none does."""


class AlwaysAveraged(ProcessGroup):
    """A group that averages gradients also where it is one process."""

    def wrapped(self, module: nn.Module) -> nn.Module:
        """As `ProcessGroup.wrapped`, for any size."""
        ids = [self.device] if self.device.type == "cuda" else None
        return nn.parallel.DistributedDataParallel(module, device_ids=ids, broadcast_buffers=False)


def final_weights(dataset: Path, device: str, backend: str, number: int) -> dict[str, Tensor]:
    """Weights after `STEPS` steps with `BATCH` windows, shared out among some processes.

    Args:
        dataset: packed data.
        device: "cpu" or "cuda": its first.
        backend: of torch.distributed; "none": the processes are one, by itself.
        number: of processes.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "weights.pt"
        arguments = ["benchmarks.gpu.joint", str(dataset), device, backend, str(file)]
        if in_processes(number, arguments):
            raise WorkFailed(f"{backend}, {number} processes: ended with an error")
        return torch.load(file, weights_only=True)


def main() -> None:
    """Be one of the processes."""
    dataset, device, backend, file = sys.argv[1:]
    rank, size = int(os.environ["RANK"]), int(os.environ["WORLD_SIZE"])
    place = torch.device(device, 0) if device == "cuda" else torch.device(device)
    if backend != "none":
        distributed.init_process_group(backend, timeout=PATIENCE)
    group = (ProcessGroup if backend == "none" else AlwaysAveraged)(rank, size, place)
    settings = _settings(BATCH // size)
    folder = ModelFolder(Path(file).parent / "model")
    learned, held_out = open_windows(dataset, settings)
    train(folder, learned, held_out, settings, group)
    if group.leads:
        document = torch.load(folder.state, map_location="cpu", weights_only=True)
        torch.save(document["weights"], file)
    if backend != "none":
        distributed.destroy_process_group()


def _settings(batch: int) -> TrainSettings:
    settings = load_config(None).training_for("coarse")
    return settings.model_copy(
        update={"steps": STEPS, "batch_size": batch, "width": 16, "restart_at": [],
                "warmup_steps": 1, "validate_runs": 1, "validate_every": STEPS,
                "message_passing_steps": 2, "optimizer": "adam", "unroll": 2}
    )  # fmt: skip


if __name__ == "__main__":
    main()
