"""How fast? Point-steps and slides per second, memory, and the share of the device's limits."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from functools import partial
from typing import Any
from unittest.mock import patch

from benchmarks.dam_section import dam_section
from benchmarks.gpu.record import row
from benchmarks.gpu.stages import Context, Measurement
from benchmarks.performance import point_steps, point_steps_3d
from benchmarks.performance.resident import highest_resident
from mpm_taichi import simulate as simulation
from mpm_taichi.simulate import simulate
from mpm_taichi.solver.runtime import start
from pipeline.config import SimulationSettings

ROUNDS = 5
BYTES, FLOPS = 200.0, 370.0
"""Of a point-step in two dimensions, nodes in the cache (docs/records/performance.md)."""
ONE_CORE = 23.6
"""Best of one core, scene schedule [M point-steps/s] (docs/records/performance.md)."""
MILLION = 6000.0 / 1.0e6
"""Area of a point of 1 M in the collapse over that of one of 6,000."""


def memory_gib(device: str) -> float:
    """In use on the device, by all of its processes [GiB]; on a CPU the most of this process."""
    if device == "cpu":
        return highest_resident()
    query = ["nvidia-smi", "--query-gpu=memory.used", "--format=csv,noheader,nounits"]
    said = subprocess.run(query, capture_output=True, text=True, check=True).stdout
    return float(said.split()[0]) / 1024.0


def collapse(context: Context, *, scenes: int, area: float = 1.0) -> Iterator[dict[str, Any]]:
    """Speed of many scenes at once, or of points of another area [m2]."""
    if context.rehearse:
        scenes, area = min(scenes, 4), 25.0
    before = 0.0 if context.device == "cpu" else memory_gib(context.device)
    start(context.device, None)
    slots, points = point_steps.build(scenes, plain=True, device=context.device, spacing=area**0.5)
    speed = max(point_steps.speed(slots, points) for _ in range(1 if context.rehearse else ROUNDS))
    name = f"{scenes} x {points} points"
    yield row(name, speed, "M/s", f"{speed / ONE_CORE:.1f} x one core's {ONE_CORE} M/s")
    yield row(f"{name}: memory", memory_gib(context.device) - before, "GiB")
    for what, unit, each, scale in (
        ("copy", "bandwidth", BYTES, 1e9),
        ("product, f32", "flops", FLOPS, 1e12),
    ):
        limit = context.record.value("card", what)
        if limit:
            share = 100.0 * speed * 1e6 * each / (limit * scale)
            yield row(f"{name}: share of {unit}", share, "%", f"{each:.0f} a point-step")


def dams(context: Context, *, spacing: float, count: int) -> Iterator[dict[str, Any]]:
    """Whole slides of Lower San Fernando per second, of strengths that differ."""
    seconds = 40.0
    if context.rehearse:
        spacing, count, seconds = 2.0 + spacing, 2, 1.0
    dam = dam_section().changed(spacing=spacing)
    settings = SimulationSettings(duration_s=seconds, water="pore_pressure")
    weakest = min(dam.materials, key=lambda name: dam.materials[name].friction_deg)
    cohesion = dam.materials[weakest].cohesion_kpa
    scenes = [
        dam.with_strength(weakest, cohesion_kpa=cohesion * (0.8 + 0.4 * place / count))
        for place in range(count)
    ]
    with patch.dict(simulation.SCHEDULES, {context.device: "point"}):
        simulate(scenes[:1], settings.model_copy(update={"duration_s": 0.5}), device=context.device)
        began = time.perf_counter()
        runs = simulate(scenes, settings, device=context.device)
        took = time.perf_counter() - began
    failed = sum(run.failed for run in runs)
    work = sum(run.points * run.steps for run in runs) / took / 1e6
    beside = f"{count} slides of {runs[0].points} points in {took:.1f} s, {failed} failed"
    yield row(f"slides, {spacing:g} m", count / took, "1/s", f"{beside}; {work:.1f} M/s")


def three_dimensions(context: Context) -> Iterator[dict[str, Any]]:
    """One core of this machine: there is no schedule for a GPU."""
    spacing = 2.0 if context.rehearse else 0.5
    points, speed = point_steps_3d.measure(spacing, 1)
    beside = "one core of this machine: no schedule for a GPU, so neither 1 M nor 4 M points"
    yield row(f"3-D, {points} points", speed / 1e6, "M/s", beside)


MEASUREMENTS: dict[str, Measurement] = {
    "1 scene": partial(collapse, scenes=1),
    "8 scenes": partial(collapse, scenes=8),
    "132 scenes": partial(collapse, scenes=132),
    "1,056 scenes": partial(collapse, scenes=1056),
    "1 M points": partial(collapse, scenes=1, area=MILLION),
    "Lower San Fernando, 2 m": partial(dams, spacing=2.0, count=256),
    "Lower San Fernando, 1 m": partial(dams, spacing=1.0, count=64),
    "three dimensions": three_dimensions,
}
