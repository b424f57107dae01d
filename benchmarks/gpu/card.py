"""The limits of the device: what a large copy and large products of matrices reach."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch

from benchmarks.gpu.record import row
from benchmarks.gpu.stages import Context, Measurement
from benchmarks.gpu.torch_timing import seconds

COPY = {False: 1 << 28, True: 1 << 22}
"""Numbers that are copied, in earnest and in a rehearsal; MATRIX: rows of the product."""
MATRIX = {False: 8192, True: 512}


def limits(context: Context) -> Iterator[dict[str, Any]]:
    """Bandwidth [GB/s] and speeds of products [TFLOP/s]."""
    device, small = context.device, context.rehearse
    name = torch.cuda.get_device_name() if device == "cuda" else "CPU"
    yield row("device", beside=f"{name}; torch {torch.__version__}, CUDA {torch.version.cuda}")
    source = torch.randn(COPY[small], device=device)
    target = torch.empty_like(source)
    took = seconds(lambda: target.copy_(source), device)
    yield row("copy", 2.0 * source.nbytes / took / 1e9, "GB/s", "read and written")
    size = MATRIX[small]
    for kind, dtype, tf32 in (
        ("f32", torch.float32, False),
        ("tf32", torch.float32, True),
        ("bf16", torch.bfloat16, False),
    ):
        torch.backends.cuda.matmul.allow_tf32 = tf32
        matrix = torch.randn(size, size, device=device, dtype=dtype)
        took = seconds(lambda matrix=matrix: matrix @ matrix, device)
        yield row(f"product, {kind}", 2.0 * size**3 / took / 1e12, "TFLOP/s")


MEASUREMENTS: dict[str, Measurement] = {"limits": limits}
