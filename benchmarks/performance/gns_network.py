"""The learned simulator's network against the textbook's form: time, memory, neighbour search.

    python -m benchmarks.performance gns_network [--threads 2] [--rounds 5] [--sizes paper shipped]

`paper`: 6,000 points on a lattice, a radius of 3 spacings (161,000 edges), width 128, 10 steps of
message passing. `shipped`: 900 points, a radius of 2 spacings, width 48 and 4 steps, as the model
that is trained on two cores (without its grid, which the textbook has not). Both forms have the
same weights and inputs and are measured in turn, round by round, in one process, so that a busy
machine slows both alike; ratios are medians of the rounds, times the best round. A training step is
forward, backward and Adam on one graph. Memory is the growth of the highest resident size of a
fresh process over one training step.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch

from benchmarks.performance import PROGRAM
from benchmarks.performance.gns_textbook import TextbookNetwork, textbook_of
from benchmarks.performance.resident import highest_resident
from gns.network.edge_gradient import KEEP_BYTES
from gns.network.features import EDGE_FEATURES, point_feature_names
from gns.network.graph import Graph, radius_graph
from gns.network.network import Network
from pipeline.cli import CommandParser, base_parser

POINT_FEATURES = len(point_feature_names(6))


@dataclass(frozen=True)
class Size:
    """The measured quantity."""

    columns: int
    rows: int
    radius: float
    width: int
    steps: int
    wanted_forward: float
    wanted_training: float


SIZES = {
    "paper": Size(120, 50, 3.0, 128, 10, 3.0, 2.5),
    "shipped": Size(36, 25, 2.0, 48, 4, 1.5, 1.5),
}


@dataclass(frozen=True)
class Case:
    """Inputs and wanted outputs on one graph."""

    places: torch.Tensor
    graph: Graph
    points: torch.Tensor
    edges: torch.Tensor
    wanted: torch.Tensor


def parser() -> CommandParser:
    """The command line."""
    result = base_parser(f"{PROGRAM} gns_network", __doc__.splitlines()[0])
    result.add_argument("--threads", type=int, default=2, help="CPU threads; default 2")
    result.add_argument("--rounds", type=int, default=5, help="rounds; default 5")
    result.add_argument(
        "--sizes", nargs="+", choices=SIZES, default=list(SIZES), help="which sizes"
    )
    result.add_argument("--memory-of", choices=("textbook", "production"), help="one training step")
    return result


def main(argv: Sequence[str]) -> None:
    """Measure and print."""
    options = parser().parse_args(argv)
    torch.set_num_threads(options.threads)
    if options.memory_of:
        print(training_memory(SIZES[options.sizes[0]], options.memory_of))
        return
    for name in options.sizes:
        report(name, options.threads, options.rounds)
    print(f"limit: {matrix_speed(options.threads):.0f} GFLOP/s, product of matrices in the cache")


def make_case(size: Size, device: str = "cpu") -> Case:
    """A full lattice, nearly at rest."""
    torch.manual_seed(0)
    column, row = torch.meshgrid(
        torch.arange(float(size.columns)), torch.arange(float(size.rows)), indexing="xy"
    )
    places = torch.stack([column.ravel(), row.ravel()], 1)
    places += 1e-5 * torch.randn_like(places)
    places = places.to(device)
    graph = radius_graph(places, size.radius)
    count = len(places)
    points = torch.randn(count, POINT_FEATURES)
    edges = torch.randn(graph.edges, EDGE_FEATURES)
    return Case(
        places, graph, points.to(device), edges.to(device), torch.randn(count, 2).to(device)
    )


def networks(size: Size) -> tuple[TextbookNetwork, Network]:
    """The same network in both forms."""
    network = Network(
        point_features=POINT_FEATURES, width=size.width, message_passing_steps=size.steps
    )
    return textbook_of(network), network


def forward(network: torch.nn.Module, case: Case) -> torch.Tensor:
    """Without a gradient."""
    with torch.no_grad():
        return network(case.points, case.edges, case.graph)


def training(network: torch.nn.Module, case: Case) -> Callable[[], None]:
    """A training step."""
    optimizer = torch.optim.Adam(network.parameters(), lr=0.0)

    def step() -> None:
        loss = (network(case.points, case.edges, case.graph) - case.wanted).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    return step


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Wall time and processor time of all threads [s]."""
    wall, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - processor


def report(name: str, threads: int, rounds: int) -> None:
    """Measure one size and print its table."""
    size, case = SIZES[name], make_case(SIZES[name])
    textbook, production = networks(size)
    difference = forward(production, case) - forward(textbook, case)
    relative = float(difference.abs().max() / forward(textbook, case).abs().max())
    print(
        f"\n{name}: {case.graph.points} points, {case.graph.edges} edges, width {size.width}, ",
        end="",
    )
    print(f"{size.steps} steps, {threads} threads; relative difference {relative:.1e}")
    search = min(
        timed(lambda: radius_graph(case.places, size.radius))[0] for _ in range(10 * rounds)
    )
    work = {
        "forward": (lambda: forward(textbook, case), lambda: forward(production, case)),
        "training step": (training(textbook, case), training(production, case)),
    }
    inner = 1 if case.graph.edges > 50_000 else 10
    wanted = {"forward": size.wanted_forward, "training step": size.wanted_training}
    kept = 3 * case.graph.edges * size.width * 4 <= KEEP_BYTES
    flops = {"forward": 1, "training step": 3 if kept else 4}
    for what, (old, new) in work.items():
        new()
        times = [
            tuple(timed(lambda one=one: [one() for _ in range(inner)]) for one in (old, new))
            for _ in range(rounds)
        ]
        wall = [statistics.median(a[0] / b[0] for a, b in times)]
        wall += [min(t[place][0] for t in times) / inner for place in (0, 1)]
        cpu = [statistics.median(a[1] / b[1] for a, b in times)]
        cpu += [min(t[place][1] for t in times) / inner for place in (0, 1)]
        rate = flops[what] * production_flops(size, case.graph) / wall[2] / 1e9
        print(
            f"  {what}: {1e3 * wall[1]:.1f} -> {1e3 * wall[2]:.1f} ms ({rate:.0f} GFLOP/s), "
            f"ratio {wall[0]:.2f}, wanted {wanted[what]}; processor time {1e3 * cpu[1]:.1f} -> "
            f"{1e3 * cpu[2]:.1f} ms, ratio {cpu[0]:.2f}"
        )
        if what == "forward":
            print(
                f"  neighbour search: {1e3 * search:.2f} ms, {100 * search / wall[2]:.1f} % of it"
            )
    print(
        f"  flops of a forward: textbook {textbook_flops(size, case.graph) / 1e9:.1f} G, "
        f"production {production_flops(size, case.graph) / 1e9:.1f} G"
    )
    memory = {kind: in_fresh_process(name, kind) for kind in ("textbook", "production")}
    print(
        f"  memory of a training step: {memory['textbook']:.2f} -> {memory['production']:.2f} GiB, "
        f"1 / {memory['textbook'] / memory['production']:.1f}"
    )


def textbook_flops(size: Size, graph: Graph) -> float:
    """Multiplications and additions of the matrix products of a forward."""
    c = size.width
    edge = (3 * c + 2 * c) * c * size.steps + (EDGE_FEATURES + 2 * c) * c
    point = (2 * c + 2 * c) * c * size.steps + (POINT_FEATURES + 2 * c) * c + (2 * c + 2) * c
    return 2.0 * (graph.edges * edge + graph.points * point)


def production_flops(size: Size, graph: Graph) -> float:
    """The same with the first layer of the messages split."""
    c = size.width
    saved = 2 * c * c * size.steps
    return textbook_flops(size, graph) - 2.0 * (graph.edges - graph.points) * saved


def matrix_speed(threads: int) -> float:
    """Speed of the products that the chunks are made of [GFLOP/s], of all threads together."""
    inputs, matrix, out = torch.randn(2048, 128), torch.randn(128, 128), torch.empty(2048, 128)
    torch.set_num_threads(1)

    def products() -> None:
        for _ in range(20):
            torch.mm(inputs, matrix, out=out)

    best = min(timed(products)[0] for _ in range(20))
    return threads * 20 * 2 * 2048 * 128 * 128 / best / 1e9


def training_memory(size: Size, kind: str) -> float:
    """Growth of this process over one training step [GiB]."""
    case = make_case(size)
    textbook, production = networks(size)
    before = highest_resident()
    training(textbook if kind == "textbook" else production, case)()
    return highest_resident() - before


def in_fresh_process(name: str, kind: str) -> float:
    """`training_memory` in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.performance", "gns_network", "--sizes", name]
    done = subprocess.run(
        [*command, "--memory-of", kind], capture_output=True, text=True, check=True
    )
    return float(done.stdout)
