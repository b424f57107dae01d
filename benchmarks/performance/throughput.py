"""What whole jobs take: the Lower San Fernando section, and samples of the scales.

    python -m benchmarks.performance throughput [--scales NAME ...] [--sample 50] [--threads 2]

`lsfd`: 40 s of motion at 1 m spacing on one thread, without early stop. A sample spreads evenly
over the scenes of a scale and goes through `mpm_taichi.batch`, files included; the whole scale is
extrapolated from it (`coarse` runs whole). Bytes: trajectories on disk as written, and packed data
of 8 bytes per point and frame. Kernels are compiled beforehand.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.dam_section import dam_section
from benchmarks.performance import PROGRAM
from geometry.random_scenes.templates import draw_scene
from pipeline.config import Config, SimulationSettings, load_config

ROOT = Path(__file__).parents[2]


def lsfd_seconds() -> tuple[float, int, int]:
    """Wall time [s] of 40 s of motion on one thread, points, steps."""
    from mpm_taichi.simulate import simulate

    scene = dam_section()
    simulate([scene.changed(spacing=4.0)], SimulationSettings(duration_s=1.0), threads=1)
    began = time.perf_counter()
    run = simulate([scene], SimulationSettings(duration_s=40.0, early_stop=False), threads=1)[0]
    return time.perf_counter() - began, run.points, run.steps


def sample_of(config: Config, scale: str, wanted: int, threads: int) -> dict:
    """Run a sample of a scale as its job would; figures of the sample and of the whole scale."""
    from mpm_taichi.batch import run_batch
    from mpm_taichi.simulate import simulate
    from mpm_taichi.trajectory import list_runs

    total = config.scale(scale).number_of_scenes
    number = min(wanted, total)
    settings = config.simulation_for(scale)
    indices = np.linspace(0, total - 1, number).round().astype(int)
    scenes = {int(i): draw_scene(config, scale, int(i)) for i in indices}
    short = settings.model_copy(update={"duration_s": 0.2})
    simulate([next(iter(scenes.values()))], short, threads=threads)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "batch_000.h5"
        began = time.perf_counter()
        run_batch(scenes, settings, path, threads=threads)
        seconds = time.perf_counter() - began
        size = path.stat().st_size
        runs = list_runs(path)
    packed = sum(8.0 * run.points * run.frames for run in runs)
    return {
        "runs": number,
        "seconds": seconds,
        "scale_minutes": seconds / number * total / 60.0,
        "speed": sum(run.points * run.steps for run in runs) / seconds / 1e6,
        "failed": sum(run.status == "failed" for run in runs),
        "trajectories_gb": size / number * total / 1e9,
        "packed_gb": packed / number * total / 1e9,
    }


def main(argv: Sequence[str]) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog=f"{PROGRAM} throughput", description=__doc__)
    parser.add_argument("--scales", nargs="*", default=["coarse", "large", "small"])
    parser.add_argument("--sample", type=int, default=50)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args(argv)
    config = load_config(None)
    seconds, points, steps = lsfd_seconds()
    print(
        f"lsfd, one thread: {seconds:.1f} s for 40 s of motion, {points} points, {steps} steps, "
        f"{points * steps / seconds / 1e6:.1f} M point-steps/s, files apart",
        flush=True,
    )
    for scale in options.scales:
        wanted = config.scale(scale).number_of_scenes if scale == "coarse" else options.sample
        found = sample_of(config, scale, wanted, options.threads)
        print(
            f"{scale}: {found['runs']} runs in {found['seconds']:.0f} s "
            f"({found['speed']:.1f} M point-steps/s, {found['failed']} failed); the scale: "
            f"{found['scale_minutes']:.0f} min, {found['trajectories_gb']:.1f} GB of trajectories "
            f"+ {found['packed_gb']:.1f} GB packed",
            flush=True,
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak:.0f} MiB")
