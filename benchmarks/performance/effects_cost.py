"""What an effect costs: processor time of a run with it, over that of the base model.

    python -m benchmarks.performance effects_cost [--spacing M] [--seconds S] [--repeats N]

The Lower San Fernando section, one thread, processor time per step of a point (so that other work
on the machine counts little), the best of some repeats in turn. Compiling is not counted; it is
printed first: how long the kernels without and with effects take the first time on a machine, and
how long when they come from Taichi's cache on the disk.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.dam_section import dam_section
from benchmarks.performance import PROGRAM
from geometry.scenes.scene import Scene
from mpm_taichi.effects import effects
from pipeline.config import SimulationSettings
from pipeline.table import aligned

PERMEABILITY = 1e-4
"""Of the sand of the section [m/s]: the greatest of hydraulic fills, which takes longest."""

ROOT = Path(__file__).parents[2]

COMPILE = """
import time
from mpm_taichi.solver import kernels, runtime
from mpm_taichi.effects.framework.registry import library
runtime.start("cpu", 1)
for effects in ((), tuple(one for one in library() if one.on_device)):
    built = kernels.build_kernels(affine=True, averaged=True, corrected=True, effects=effects)
    slots = runtime.Slots(1, 10, 10, 8, device="cpu", kernels=built)
    began = time.process_time()
    slots.compile()
    print(time.process_time() - began)
"""


def main(argv: Sequence[str]) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog=f"{PROGRAM} effects_cost", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--spacing", type=float, default=2.0, help="of points [m]; default: 2")
    parser.add_argument("--seconds", type=float, default=8.0, help="of motion; default: 8")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args(argv)
    for cache, words in (("0", "compiled again"), ("1", "from the disk")):
        base, with_effects = compile_times(cache)
        print(f"kernels {words}: {base:.1f} s without effects, {with_effects:.1f} s with")
    section = dam_section().changed(spacing=arguments.spacing)
    settings = SimulationSettings(duration_s=arguments.seconds, early_stop=False)
    # The smallest amplitudes: the same motion, so that the time of a step alone is compared.
    scenes = {"base model": section}
    for one in effects().values():
        if not one.applies(section):
            scenes[one.name] = section.changed(effects={one.name: one.amplitude.ladder[0]})
    scenes["pore_water"] = with_pore_water(section)
    five = {name: effects()[name].amplitude.ladder[0] for name in list(effects())[:5]}
    scenes["five effects of strength"] = section.changed(effects=five)
    best = dict.fromkeys(scenes, float("inf"))
    for _ in range(arguments.repeats + 1):  # the first also compiles
        for name, scene in scenes.items():
            best[name] = min(best[name], time_of_a_step(scene, settings))
    rows = [["", "ns a step and point", "over base"]]
    for name, seconds in best.items():
        rows.append([name, f"{1e9 * seconds:.1f}", f"{seconds / best['base model']:.2f}"])
    print(aligned(rows, left={0}))


def with_pore_water(section: Scene) -> Scene:
    """The section with pore water that flows through its sand."""
    soils = section.model_dump()["materials"]
    for soil in soils.values():
        if soil["liquefied"] or soil["friction_deg"] > 0.0:
            soil["permeability_m_per_s"] = PERMEABILITY
    return section.changed(materials=soils)


def compile_times(cache: str) -> list[float]:
    """Processor seconds until the kernels without and with effects can run."""
    done = subprocess.run(
        [sys.executable, "-c", COMPILE],
        cwd=ROOT, env={**os.environ, "TI_OFFLINE_CACHE": cache},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [float(line) for line in done.stdout.split()]


def time_of_a_step(scene: Scene, settings: SimulationSettings) -> float:
    """Processor seconds of a step of one point; settling is part of it."""
    from mpm_taichi.simulate import simulate

    began = time.process_time()
    (run,) = simulate([scene], settings, threads=1)
    return (time.process_time() - began) / (run.points * run.steps)
