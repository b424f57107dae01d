"""Point-steps per second of the three-dimensional solver, and its distance to the processor.

    python -m benchmarks.performance point_steps_3d [--spacing 0.5] [--rounds 8]
    python -m benchmarks.performance point_steps_3d --dam 4

The first form: a bank of clay in full collapse on one thread; the best round counts, by the time
that the process had a core (a busy machine takes that away, too). Bytes and flops per point-step
are counted from the arrays and the text of the kernels: every array of a point is read or written
by each of the two passes that touch it, nodes are shared by the points of a cell. The limits are
measured in the same process: a copy of a large array, and a product of two matrices.

The second form: Lower San Fernando, extruded to 300 m between smooth flanks, to the end of its
motion, on all threads, at the spacing given [m].
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.performance import PROGRAM
from benchmarks.verification.three_dimensions import slab_scene
from geometry.scenes.scene import Scene, load_scene
from mpm_taichi.simulate3d import Flight3d, simulate_3d
from mpm_taichi.solver.runtime import start
from mpm_taichi.solver3d import layout
from mpm_taichi.solver3d.problem import Problem3d, extruded
from pipeline.config import SimulationSettings

POINTS_IN_CELL = 8
FLOPS = {"stress": 600, "scatter": 1000, "gather": 1050}
"""Per point-step, counted in the text of the kernels, of a point that yields, away from edges."""
DAM = Path("case_histories/lower_san_fernando/scene.yaml")
DAM_WIDTH = 300.0


def size_of(group: type) -> int:
    """Bytes of a row of a group of arrays."""
    return sum(4 * getattr(kind.dtype, "n", 1) for kind in group.__annotations__.values())


def bytes_per_step() -> float:
    """Bytes that a point-step moves, if the caches hold nothing from one pass to the next."""
    passes = 3.0  # read and written in part by the scatter, read and written in part by the gather
    return passes * size_of(layout.Points) + 4.0 * size_of(layout.Nodes) / POINTS_IN_CELL


def limits() -> tuple[float, float]:
    """Memory bandwidth [byte/s] and float32 operations [1/s] of one thread of this machine."""
    source = np.ones(1 << 26, np.float32)
    target = np.empty_like(source)
    copied, multiplied = [], []
    matrix = np.ones((1024, 1024), np.float32)
    for _ in range(5):
        began = time.process_time()
        np.copyto(target, source)
        copied.append(time.process_time() - began)
        began = time.process_time()
        matrix @ matrix
        multiplied.append(time.process_time() - began)
    return 2.0 * source.nbytes / min(copied), 2.0 * 1024**3 / min(multiplied)


def measure(spacing: float, rounds: int) -> tuple[int, float]:
    """Points, and point-steps per second of the best round."""
    scene = Scene.model_validate(slab_scene(spacing))
    settings = SimulationSettings(duration_s=1e3, initial_stress="k0", early_stop=False)
    start("cpu", 1)
    flight = Flight3d(extruded(scene, 24.0), settings)
    flight.settle()
    flight.frame()
    best = 0.0
    for _ in range(rounds):
        steps, began = flight.steps, time.process_time()
        flight.frame()
        best = max(best, (flight.steps - steps) / (time.process_time() - began))
    return len(flight.problem.position), best * len(flight.problem.position)


def dam(spacing: float) -> Problem3d:
    """Lower San Fernando at a spacing [m], its domain closed far from the slide."""
    scene = load_scene(DAM).model_copy(update={"spacing": spacing})
    domain = scene.domain.model_copy(update={"x_min": -120.0, "x_max": 420.0, "walls": "closed"})
    (x0, y0), (x1, y1) = scene.ground.points[0], scene.ground.points[-1]
    ground = scene.ground.model_copy(
        update={"points": [(-120.0, y0), *scene.ground.points[1:-1], (420.0, y1)]}
    )
    assert x0 >= -120.0
    assert x1 <= 420.0
    return extruded(scene.model_copy(update={"domain": domain, "ground": ground}), DAM_WIDTH)


def run_dam(spacing: float) -> None:
    """Simulate the dam and print what it took."""
    problem = dam(spacing)
    # Kernels are compiled for a handful of points first.
    settings = SimulationSettings(water_face="fixed")
    simulate_3d(dam(12.0), settings.model_copy(update={"duration_s": 0.5}))
    began = time.perf_counter()
    run = simulate_3d(problem, settings)
    took = time.perf_counter() - began
    memory = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    points = len(problem.position)
    kept = run.positions.nbytes
    print(f"Lower San Fernando, {DAM_WIDTH:g} m wide, {spacing:g} m between points: {run.status}")
    print(f"  {points} points, {run.steps} steps and {run.audit['settle_steps']} of settling,")
    print(
        f"  {run.time[-1]:.1f} s of motion in {took:.1f} s; {run.point_steps_per_s / 1e6:.2f} M/s"
    )
    print(f"  state {state_bytes(problem) / points:.0f} B a point, frames {kept / points:.0f} B,")
    print(f"  process {memory / 1e9:.2f} GB; toe from x = {problem.position[:, 0].min():.1f}")
    print(f"  to {run.positions[-1][:, 0].min():.1f} m")


def state_bytes(problem: Problem3d) -> int:
    """Bytes of the solver's arrays for a problem."""
    flight = Flight3d(problem, SimulationSettings())
    return sum(getattr(flight.state, name).nbytes for name in layout.ARRAYS)


def main(argv: Sequence[str]) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog=f"{PROGRAM} point_steps_3d", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--spacing", type=float, default=0.5, help="of the bank [m]")
    parser.add_argument("--rounds", type=int, default=8, help="frames measured")
    parser.add_argument("--dam", type=float, help="simulate the dam at this spacing [m] instead")
    options = parser.parse_args(argv)
    if options.dam:
        run_dam(options.dam)
        return
    points, speed = measure(options.spacing, options.rounds)
    bandwidth, flops = limits()
    moved, counted = bytes_per_step(), sum(FLOPS.values())
    print(f"{points} points, one thread: {speed / 1e6:.2f} M point-steps/s")
    print(f"{moved:.0f} B per point-step: {moved * speed / 1e9:.1f} of {bandwidth / 1e9:.1f} GB/s,")
    print(f"  limit {bandwidth / moved / 1e6:.1f} M/s")
    print(
        f"{counted} flops per point-step: {counted * speed / 1e9:.1f} of {flops / 1e9:.1f} Gflop/s,"
    )
    print(f"  limit {flops / counted / 1e6:.1f} M/s")
