"""The network of the paper, 6,256 points: forward, training step, a slide and its gradient."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch

from benchmarks.gpu.record import row
from benchmarks.gpu.stages import Context, Measurement
from benchmarks.gpu.torch_timing import peak_gib, seconds, wait
from benchmarks.performance import gns_network
from benchmarks.performance.diff_gns import setup_of
from gns.network.network import Network
from gns.network.simulator import Simulator
from inversion.engines.gns_engine import GNSEngine
from inversion.engines.rollout_store import RolloutStore
from inversion.engines.trained_model import TrainedModel, load_model

PAPER = dataclasses.replace(gns_network.SIZES["paper"], columns=136, rows=46)
SMALL = dataclasses.replace(PAPER, columns=12, rows=8, width=16, steps=2)
CPU = {"forward": "1.17 s", "training step": "5.12 s, 1.3 GiB"}
"""Of two cores at 6,000 points (docs/records/performance.md)."""
PAPER_S = 237.0
"""An iteration of the paper: forward and gradient (docs/records/performance.md)."""


def _prepared(
    context: Context, *, bf16: bool = False, tf32: bool = False
) -> tuple[Network, gns_network.Case]:
    """The network and its case on the device."""
    torch.backends.cuda.matmul.allow_tf32 = tf32
    size = SMALL if context.rehearse else PAPER
    case = gns_network.make_case(size, context.device)
    network = gns_network.networks(size)[1].to(context.device)
    network.edge_precision = torch.bfloat16 if bf16 else None
    return network, case


def _beside(what: str, case: gns_network.Case) -> str:
    graph = case.graph
    size = f"{graph.points} points, {graph.edges} edges"
    return f"{size}; two cores, 6,000 points: {CPU[what]}"


def forward(context: Context) -> Iterator[dict[str, Any]]:
    """In single precision."""
    network, case = _prepared(context)
    took = seconds(lambda: gns_network.forward(network, case), context.device)
    yield row("forward, f32", 1e3 * took, "ms", _beside("forward", case))


def _step(context: Context, name: str, **precision: bool) -> Iterator[dict[str, Any]]:
    """Time, memory and, where the precision is not single, the difference of a forward."""
    network, case = _prepared(context, **precision)
    step = gns_network.training(network, case)
    took = seconds(step, context.device)
    yield row(f"training step, {name}", 1e3 * took, "ms", _beside("training step", case))
    yield row(f"training step, {name}: memory", peak_gib(step, context.device), "GiB")
    if any(precision.values()):
        rough = gns_network.forward(network, case)
        network.edge_precision = None
        torch.backends.cuda.matmul.allow_tf32 = False
        fine = gns_network.forward(network, case)
        off = float((rough - fine).abs().max() / fine.abs().max())
        yield row(f"forward, {name}: error", off, "", "largest over largest of f32")


def single(context: Context) -> Iterator[dict[str, Any]]:
    """In single precision."""
    return _step(context, "f32")


def bf16(context: Context) -> Iterator[dict[str, Any]]:
    """The work on edges in bfloat16."""
    return _step(context, "bf16", bf16=True)


def tf32(context: Context) -> Iterator[dict[str, Any]]:
    """Products in tf32."""
    return _step(context, "tf32", tf32=True)


def graph(context: Context) -> Iterator[dict[str, Any]]:
    """Forward and backward, captured once and replayed."""
    if context.device != "cuda":
        yield row("forward and backward, CUDA graph", beside="a CPU has none")
        return
    network, case = _prepared(context, bf16=True)
    work = _both_ways(network, case)
    side = torch.cuda.Stream()
    with torch.cuda.stream(side):
        for _ in range(3):
            work()
    wait("cuda")
    network.zero_grad(set_to_none=True)
    captured = torch.cuda.CUDAGraph()
    with torch.cuda.graph(captured):
        work()
    took = seconds(captured.replay, "cuda")
    yield row("forward and backward, CUDA graph, bf16", 1e3 * took, "ms")


def _both_ways(network: torch.nn.Module, case: gns_network.Case) -> Callable[[], None]:
    def work() -> None:
        loss = (network(case.points, case.edges, case.graph) - case.wanted).square().mean()
        loss.backward()

    return work


def compiled(context: Context) -> Iterator[dict[str, Any]]:
    """By torch.compile; in a rehearsal traced alone, as its compiler takes minutes."""
    network, case = _prepared(context, bf16=True)
    backend = "eager" if context.rehearse else "inductor"
    fast = torch.compile(network, backend=backend)
    took = seconds(gns_network.training(fast, case), context.device)
    yield row("training step, compiled, bf16", 1e3 * took, "ms", backend)


def slide(context: Context) -> Iterator[dict[str, Any]]:
    """Lower San Fernando by a network of the paper's size that leaves every point where it is.

    Its weights are random and its last layer is zero: time does not depend on them.
    """
    spacing, frames = (2.0, 4) if context.rehearse else (1.0, 20)
    arguments = SimpleNamespace(spacing=spacing)
    whole = setup_of(arguments, 3).settings.duration_s
    setup = setup_of(arguments, 3, frames)
    scale = whole / setup.settings.duration_s
    values = setup.parameters.start
    request = setup.at(values)

    def engine() -> GNSEngine:
        return GNSEngine(RolloutStore(None), _model(context))

    steps = -0.03 * np.asarray(values)
    forward_s = seconds(lambda: engine().predict([request]), context.device, rounds=1)
    beside = f"{spacing:g} m; {frames} frames, scaled to the {whole:g} s of the slide"
    yield row("rollout", scale * forward_s, "s", beside)
    both = seconds(lambda: engine().derivative(request, steps), context.device, rounds=1)
    yield row("rollout and gradient by 3 parameters", scale * both, "s", f"the paper {PAPER_S:g} s")
    memory = peak_gib(lambda: engine().derivative(request, steps), context.device)
    yield row("rollout and gradient: memory", memory, "GiB")


def _model(context: Context) -> TrainedModel:
    shipped = load_model("models/thrust").simulator.config
    small = {"width": 16, "message_passing_steps": 2} if context.rehearse else {}
    config = shipped.model_copy(
        update={"width": 128, "message_passing_steps": 10, "radius": 3.0, "grid_cell": 0.0,
                "grid_everywhere": False, "symmetric": False, "history": 6, "cutoff": "sharp",
                "velocity_mean": (0.0, 0.0), "acceleration_mean": (0.0, 0.0), **small}
    )  # fmt: skip
    torch.manual_seed(0)
    simulator = Simulator(copy.deepcopy(config)).to(context.device).requires_grad_(False)
    for value in simulator.network.decoder.third.parameters():
        value.zero_()
    return TrainedModel(simulator, "paper", "0" * 64)


MEASUREMENTS: dict[str, Measurement] = {
    "forward": forward,
    "training step": single,
    "bf16": bf16,
    "tf32": tf32,
    "CUDA graph": graph,
    "compiled": compiled,
    "slide": slide,
}
