"""Is it true? Slides by the device's schedule against those by the CPU's.

The runs of one device differ from those of another in the order of sums. What may differ by that is
what moves when the points of the CPU's runs are jittered by a hundredth of their spacing.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.dam_section import dam_section
from benchmarks.gpu.record import row
from benchmarks.gpu.stages import Context, Measurement
from benchmarks.verification.collapse import column_scene
from geometry.scenes.scene import Scene
from geometry.survey.columns import toe
from mpm_taichi import simulate as simulation
from mpm_taichi.simulate import simulate
from mpm_taichi.trajectory import Run
from pipeline.config import SimulationSettings

ROOT = Path(__file__).resolve().parents[2]
EFFECTS = {"strain_softening": 1.0, "weak_base": 0.3, "shaking": 0.2}
JITTER = {"jitter": 0.01}
SEEDS = (1, 2)
UNITS = {"toe": "m", "highest point": "m", "volume": "m2", "peak kinetic energy": "kJ/m"}


def by_device(scenes: list[Scene], settings: SimulationSettings, device: str) -> list[Run]:
    """Runs by the schedule that a GPU has, on either device."""
    with patch.dict(simulation.SCHEDULES, {device: "point"}):
        return simulate(scenes, settings, device=device)


def readings(run: Run) -> dict[str, float]:
    """What is compared of a run."""
    last, spacing = run.positions[-1], run.scene.spacing
    side = "left" if run.scene.name.startswith("lower") else "right"
    return {
        "toe": float(toe(last, run.volume, spacing=spacing, side=side)),
        "highest point": float(np.quantile(last[:, 1], 0.999)),
        "volume": float(run.volume.sum()),
        "peak kinetic energy": float(run.energy["kinetic"].max()) / 1e3,
    }


def scenes_of(context: Context, effects: dict[str, float]) -> list[Scene]:
    """A slump, a column, Lower San Fernando with its pool; with effects the dam alone."""
    coarser = 2.0 if context.rehearse else 1.0
    dam = dam_section().changed(spacing=2.0 * coarser, effects=effects)
    if effects:
        return [dam]
    clay = {"friction_deg": 0.0, "cohesion_kpa": 5.0}
    sand = {"friction_deg": 30.0, "cohesion_kpa": 0.0}
    slump = column_scene(width=20, height=8, spacing=0.5 * coarser, reach=60, material=clay)
    column = column_scene(width=5, height=10, spacing=0.25 * coarser, reach=30, material=sand)
    return [slump.changed(name="slump"), column.changed(name="column"), dam]


def slides(context: Context, effects: dict[str, float] | None = None) -> Iterator[dict[str, Any]]:
    """Differences of the readings, and whether the device repeats itself."""
    scenes = scenes_of(context, effects or {})
    settings = SimulationSettings(duration_s=2.0 if context.rehearse else 40.0)
    settings = settings.model_copy(update={"water": "pore_pressure"})
    jittered = [one.changed(**JITTER, seed=seed) for seed in SEEDS for one in scenes]
    runs = simulate([*scenes, *jittered], settings)
    count = len(scenes)
    first = by_device(scenes, settings, context.device)
    second = by_device(scenes, settings, context.device)
    for place, (scene, one, again) in enumerate(zip(scenes, first, second, strict=True)):
        name = f"{scene.name}{' with effects' if effects else ''}"
        yield from _compared(name, one, runs[place], runs[place + count :: count])
        same = np.array_equal(one.positions, again.positions)
        apart = 0.0 if same else _apart(one, again)
        yield row(f"{name}: repeated, points apart", apart, "m", "to the bit" if same else "mean")


def _compared(name: str, one: Run, cpu: Run, jittered: list[Run]) -> Iterator[dict[str, Any]]:
    if one.status != "finished":
        raise AssertionError(f"{name}: {one.status}: {one.reason}")
    found, wanted, others = readings(one), readings(cpu), [readings(run) for run in jittered]
    for what, unit in UNITS.items():
        off = found[what] - wanted[what]
        moved = max(abs(other[what] - wanted[what]) for other in others)
        verdict = "within" if abs(off) <= moved + 1e-6 * abs(wanted[what]) else "MORE THAN"
        beside = f"CPU {wanted[what]:.4g}, device {off:+.2g}; {verdict} jitter, {moved:.2g}"
        yield row(f"{name}: {what}", found[what], unit, beside)


def _apart(one: Run, other: Run) -> float:
    """Mean distance of the points of two runs at the last frame that both have [m]."""
    last = min(len(one.positions), len(other.positions)) - 1
    return float(np.linalg.norm(one.positions[last] - other.positions[last], axis=1).mean())


def with_effects(context: Context) -> Iterator[dict[str, Any]]:
    """The dam with three effects."""
    return slides(context, EFFECTS)


def three_dimensions(context: Context) -> Iterator[dict[str, Any]]:
    """There is nothing to compare yet."""
    yield row("three dimensions", beside="run on the CPU alone; no schedule for a GPU")


def tests(context: Context) -> Iterator[dict[str, Any]]:
    """The tests that need a GPU."""
    files = [
        str(path)
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        if "@pytest.mark.cuda" in path.read_text()
    ]
    command = [sys.executable, "-m", "pytest", "-q", "-m", "cuda", *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    line = (done.stdout.strip().splitlines() or ["no output"])[-1]
    if done.returncode:
        raise AssertionError(f"tests marked cuda: {line} {done.stderr[-200:]}")
    passed = re.search(r"(\d+) passed", line)
    yield row("tests marked cuda", float(passed[1]) if passed else 0.0, "passed", line)


MEASUREMENTS: dict[str, Measurement] = {
    "slides": slides,
    "slides with effects": with_effects,
    "three dimensions": three_dimensions,
    "tests": tests,
}
