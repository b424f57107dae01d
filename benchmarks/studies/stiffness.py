"""How far the elastic stiffness moves the runout: what a simulator leaves out that is blind to it.

    python -m benchmarks.studies.stiffness [--scenes 60] [--factors 0.4 3]

Every second scene of `coarse` from templates (a) to (d), E / (rho g d) = 849, is simulated with
other stiffnesses; printed is by how much the toe moves on the side that travels the farther.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geometry import draw_scene
from geometry.scenes.scene import Scene, scene_text
from gns.evaluation.card import FAR
from pipeline.cli import CommandParser, base_parser, main_exit
from pipeline.config import load_config
from pipeline.files import write_text
from pipeline.table import aligned


def parser() -> CommandParser:
    """The command line."""
    result = base_parser("python -m benchmarks.studies.stiffness", __doc__.splitlines()[0])
    result.add_argument("--scenes", type=int, default=60)
    result.add_argument("--factors", type=float, nargs="+", default=[0.4, 3.0])
    result.add_argument("--threads", type=int, default=1)
    return result


def main(argv: Sequence[str] | None = None) -> None:
    """Simulate and compare."""
    options = parser().parse_args(argv)
    config = load_config(None)
    drawn = [draw_scene(config, "coarse", 2 * place) for place in range(options.scenes)]
    scenes = [scene for scene in drawn if scene.origin.template != "e"]
    spacing = config.scale("coarse").spacing_m
    with tempfile.TemporaryDirectory() as folder:
        travel = {
            factor: travels(scenes, factor, Path(folder) / f"{factor:g}", options.threads) / spacing
            for factor in [1.0, *options.factors]
        }
    rows = np.arange(len(scenes))
    side = travel[1.0].argmax(axis=1)
    base = travel[1.0][rows, side]
    table = [["E x", "scenes", "toe moves, d: median", "90 %", "mean", "% of travel beyond 10 d"]]
    for factor in options.factors:
        moved = travel[factor][rows, side] - base
        size, far = np.abs(moved), base > FAR
        table.append(
            [
                f"{factor:g}",
                str(len(scenes)),
                f"{np.median(size):.2f}",
                f"{np.quantile(size, 0.9):.2f}",
                f"{moved.mean():+.2f}",
                f"{100 * np.median(size[far] / base[far]):.2f}",
            ]
        )
    print(aligned(table))


def travels(scenes: Sequence[Scene], factor: float, folder: Path, threads: int) -> np.ndarray:
    """Runouts to the left and right (scenes, 2) [m] with the stiffness times a factor."""
    folder.mkdir()
    paths = []
    for place, scene in enumerate(scenes):
        materials = {
            name: {
                **material.model_dump(),
                "youngs_modulus_mpa": factor * material.youngs_modulus_mpa,
            }
            for name, material in scene.materials.items()
        }
        paths.append(folder / f"{place:03d}.json")
        write_text(paths[-1], scene_text(scene.changed(materials=materials)))
    call("mpm_taichi", "run", *paths, "--out", folder, "--threads", threads, "--quiet")
    call("mpm_taichi", "status", *folder.glob("*.h5"), "--csv", folder / "runs.csv")
    with (folder / "runs.csv").open() as file:
        rows = sorted(csv.DictReader(file), key=lambda row: int(row["index"]))
    return np.array(
        [[float(row[f"travel_{side}_m"]) for side in ("left", "right")] for row in rows]
    )


def call(*words: object) -> None:
    """A command of ours; its errors end this one."""
    command = [sys.executable, "-m", *map(str, words)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main_exit(main)
