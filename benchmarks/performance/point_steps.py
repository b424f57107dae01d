"""Material point-steps per second of the solver, and its ratio to a plain kernel with atomics.

    python -m benchmarks.performance point_steps [--threads 2] [--rounds 15]

The scene: 6,000 Mohr-Coulomb points in three zones, in full collapse. Measured in turn, round by
round, in one process, so that a busy machine slows all of them alike; the ratios are medians of the
rounds, the speeds the best round. `plain` is the point schedule of this package on one CPU thread:
a loop over points with atomic adds, as public Taichi codes have it. Compilation is not counted.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from benchmarks.performance import PROGRAM
from geometry.scenes.scene import Scene, scene_from_mapping
from pipeline.config import SimulationSettings

FRAMES = 4


def collapse(spacing: float = 1.0) -> Scene:
    """A 120 m x 50 m block of three soils on rough ground, 6,000 points at 1 m."""
    soils = {"liquefied": (0, 30), "silt": (30, 1), "sand": (35, 0)}
    levels = [2, 17, 34, 52]
    zones = [
        {
            "name": name,
            "material": name,
            "polygon": [[0, low], [120, low], [120, high], [0, high]],
        }
        for name, low, high in zip(soils, levels, levels[1:], strict=False)
    ]
    return scene_from_mapping(
        {
            "name": "collapse",
            "domain": {"x_min": 0, "x_max": 240, "y_max": 62},
            "ground": {"points": [[0, 2], [240, 2]]},
            "zones": zones,
            "materials": {
                name: {"friction_deg": phi, "cohesion_kpa": c} for name, (phi, c) in soils.items()
            },
            "spacing": spacing,
        }
    )


def build(scenes: int, *, plain: bool = False, device: str = "cpu", spacing: float = 1.0):
    """Slots with `scenes` copies of the collapse, settled and set in motion."""
    from mpm_taichi.solver.initial_state import prepare
    from mpm_taichi.solver.kernels import build_kernels
    from mpm_taichi.solver.runtime import DeviceSlots, Slots

    kernels = build_kernels(affine=True, averaged=True, corrected=True)
    prepared = prepare(collapse(spacing), SimulationSettings())
    kind = DeviceSlots if plain else Slots
    slots = kind(
        scenes,
        len(prepared.order),
        prepared.grid.nodes,
        FRAMES,
        device=device,
        kernels=kernels,
    )
    for slot in range(scenes):
        slots.admit(slot, prepared)
    slots.run()
    return slots, len(prepared.order)


def speed(slots, points: int) -> float:
    """Million point-steps per second of one chunk of frames."""
    from mpm_taichi import layout

    before = int(slots.integers[:, layout.STEPS].sum())
    start = time.perf_counter()
    slots.run()
    elapsed = time.perf_counter() - start
    return (int(slots.integers[:, layout.STEPS].sum()) - before) * points / elapsed / 1e6


def measure(threads: int, rounds: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Speeds of each contestant in each round [million point-steps per second]."""
    from mpm_taichi.solver.runtime import start

    start("cpu", threads)
    makers = {
        "plain": lambda: build(1, plain=True),
        "one scene": lambda: build(1),
        "batch": lambda: build(4 * threads),
    }
    field = {name: makers[name]() for name in names}
    found: dict[str, list[float]] = {name: [] for name in names}
    for _ in range(rounds):
        for name, (slots, points) in field.items():
            found[name].append(speed(slots, points))
    return {name: np.array(values) for name, values in found.items()}


def main(argv: Sequence[str]) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog=f"{PROGRAM} point_steps", description=__doc__)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args(argv)
    one = measure(1, options.rounds, ("plain", "one scene", "batch"))
    print("one thread, 6,000 points      best    median   [M point-steps/s]")
    for name, values in one.items():
        print(f"  {name:<25} {values.max():8.1f} {np.median(values):8.1f}")
    ratio = np.median(one["one scene"] / one["plain"])
    print(f"  one scene / plain         {ratio:8.2f}")
    if options.threads > 1:
        many = measure(options.threads, options.rounds, ("one scene", "batch"))
        best = many["batch"].max() / many["one scene"].max()
        median = np.median(many["batch"] / many["one scene"])
        print(
            f"{options.threads} threads: batch {many['batch'].max():.1f} best; batch / one scene, "
            f"which one thread runs: {best:.2f} of the best, {median:.2f} median"
        )
