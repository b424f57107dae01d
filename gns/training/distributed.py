"""One or several processes that learn together (torchrun), seen through one small interface.

`group()` reads what torchrun has put into the environment: without it there is one process, and
everything here does nothing. Gradients are averaged by torch's DistributedDataParallel around the
whole loss (`objective.Objective`), never by a call past it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, distributed, nn

from pipeline.cli import InputError


@dataclass(frozen=True)
class ProcessGroup:
    """The processes that learn together.

    Attributes:
        rank: number of this process.
        size: how many there are.
        device: on which this one computes.
    """

    rank: int
    size: int
    device: torch.device

    @property
    def leads(self) -> bool:
        """True in the one process that writes files and prints."""
        return self.rank == 0

    def wrapped(self, module: nn.Module) -> nn.Module:
        """The module whose call averages gradients over the processes."""
        if self.size == 1:
            return module
        ids = [self.device] if self.device.type == "cuda" else None
        # Buffers are constants of the simulator.
        return nn.parallel.DistributedDataParallel(module, device_ids=ids, broadcast_buffers=False)

    def summed(self, values: Tensor) -> Tensor:
        """The sum of the values of all processes, in each of them."""
        if self.size > 1:
            values = values.to(self.device)
            distributed.all_reduce(values)
        return values

    def gathered(self, value: Any) -> list[Any]:
        """The (plain) values of all processes in the order of their ranks, in each of them."""
        if self.size == 1:
            return [value]
        values: list[Any] = [None] * self.size
        distributed.all_gather_object(values, value)
        return values

    def wait(self) -> None:
        """Until all processes are here."""
        if self.size > 1:
            distributed.barrier()


@contextmanager
def group(device: str = "auto") -> Iterator[ProcessGroup]:
    """The group of this process, for as long as the context lasts.

    Args:
        device: "cpu", "cuda", or "auto": a GPU where there is one for each process.

    Raises:
        InputError: a GPU is asked for and there is none.
    """
    rank, size = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    local = int(os.environ.get("LOCAL_RANK", 0))
    here, gpus = int(os.environ.get("LOCAL_WORLD_SIZE", size)), torch.cuda.device_count()
    if device == "cuda" and gpus < here:
        raise InputError(f"--device cuda: {here} processes on this machine, and {gpus} GPUs")
    on_gpu = device == "cuda" or (device == "auto" and gpus >= here)
    chosen = torch.device("cuda", local) if on_gpu else torch.device("cpu")
    if on_gpu:
        torch.cuda.set_device(chosen)
    if size > 1:
        distributed.init_process_group("nccl" if on_gpu else "gloo")
    try:
        yield ProcessGroup(rank, size, chosen)
    finally:
        if size > 1:
            distributed.destroy_process_group()
