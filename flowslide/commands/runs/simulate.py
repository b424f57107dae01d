"""`flowslide scenes simulate`: scenes into one trajectory file."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError, WorkFailed, add_common

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene
    from mpm_taichi.batch import BatchResult, RunSummary
    from pipeline.config import Config, SimulationSettings

DESCRIPTION = (
    "Simulate scenes into one trajectory file. Started again after a kill, it keeps the runs that "
    "were finished."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help="scene files, or folders with a scene.yaml"
    )
    options.add_scale(parser, "simulate generated scenes of this scale instead")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--batch", type=int, metavar="B", help="number of the batch of --scale")
    which.add_argument("--index", type=int, metavar="N", help="one scene of --scale alone")
    parser.add_argument(
        "--scenes",
        dest="scene_folder",
        metavar="DIR",
        help="read the scenes of --scale from DIR/NNNNN.json; without it they are drawn afresh",
    )
    options.add_out(parser, "folder of the trajectory file", required=True)
    options.add_device(parser)
    parser.add_argument(
        "--group",
        type=options.positive,
        metavar="N",
        help="scenes in memory at once (not in the results)",
    )
    options.add_effects(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, write, print."""
    from flowslide.commands.runs.status import failure_line
    from mpm_taichi.batch import run_batch
    from pipeline.config import load_config
    from pipeline.progress import Progress

    config = load_config(arguments.config, arguments.overrides)
    scenes, settings, name = _chosen_scenes(arguments, config)
    with Progress(len(scenes), f"simulating {name}", quiet=arguments.quiet) as progress:

        def on_run(run: RunSummary) -> None:
            progress.advance(note=run.scene)
            if run.status == "failed":
                print(failure_line(run), file=sys.stderr, flush=True)

        result = run_batch(
            scenes,
            settings,
            Path(arguments.out) / f"{name}.h5",
            device=arguments.device,
            threads=arguments.threads,
            group_size=arguments.group,
            on_run=on_run,
        )
    print(_report(result))
    if len(result.failures) == len(result.runs):
        raise WorkFailed(f"{result.path}: every run failed; the first: {result.runs[0].reason}")


def _chosen_scenes(
    arguments: argparse.Namespace, config: Config
) -> tuple[dict[int, Scene], SimulationSettings, str]:
    """Scenes by number, the settings, and the name of the trajectory file."""
    if arguments.scale is None:
        for option in ("batch", "index", "scene_folder"):
            if getattr(arguments, option) is not None:
                raise InputError(f"--{option.replace('scene_folder', 'scenes')}: needs --scale")
        if not arguments.scenes:
            raise InputError("nothing to simulate: give scene files, or --scale with --batch")
        scenes = dict(enumerate(_load(Path(path)) for path in arguments.scenes))
        name = scenes[0].name if len(scenes) == 1 else "runs"
        return scenes, config.simulation, re.sub(r"[^\w.-]+", "_", name)
    if arguments.scenes:
        raise InputError("--scale: cannot be combined with scene files")
    scale = config.scale(arguments.scale)
    if arguments.index is not None:
        if not 0 <= arguments.index < scale.number_of_scenes:
            raise InputError(
                f"--index {arguments.index}: allowed are 0 to {scale.number_of_scenes - 1}"
            )
        numbers: Sequence[int] = [arguments.index]
        name = f"{arguments.scale}_{arguments.index:05d}"
    elif arguments.batch is not None:
        numbers, name = scale.batch_indices(arguments.batch), f"batch_{arguments.batch:03d}"
    else:
        raise InputError(
            f"--scale {arguments.scale}: needs --batch (0 to {scale.number_of_batches - 1}) or "
            f"--index (0 to {scale.number_of_scenes - 1})"
        )
    settings = config.simulation_for(arguments.scale)
    return {n: _generated(arguments, config, n) for n in numbers}, settings, name


def _generated(arguments: argparse.Namespace, config: Config, index: int) -> Scene:
    if arguments.scene_folder is not None:
        return _load(Path(arguments.scene_folder) / f"{index:05d}.json")
    from geometry.random_scenes.templates import draw_scene

    return draw_scene(config, arguments.scale, index)


def _load(path: Path) -> Scene:
    from geometry.scenes.scene import load_scene

    return load_scene(path / "scene.yaml" if path.is_dir() else path)


def _report(result: BatchResult) -> str:
    from flowslide.commands.runs.status import totals

    size = result.path.stat().st_size
    lines = [f"{result.path}: {totals(result.runs)}, {size / len(result.runs) / 1e6:.2f} MB a run"]
    if result.reused:
        lines.append(f"{result.reused} of the runs were there already")
    return "\n".join(lines)
