"""`flowslide gns rollout`: simulate a scene by a trained model, from the scene alone."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError, WorkFailed, add_common

if TYPE_CHECKING:
    from gns.rollout.rollout import Rollout

DESCRIPTION = (
    "Simulate a scene by a trained model and write rollout.npz (positions of every "
    "frame) and rollout.png."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "scene", metavar="SCENE", help="scene.yaml, scene.json, or the folder of a case history"
    )
    parser.add_argument(
        "--model", required=True, metavar="DIR", help="folder of a model, or a name in models/"
    )
    options.add_out(parser, "where the files go", required=True)
    options.add_spacing(parser, "the scene's own")
    parser.add_argument("--duration", type=float, help="s; default: simulation.duration_s")
    parser.add_argument(
        "--anywhere", action="store_true", help="roll out also what lies far outside the training"
    )
    options.add_device(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Roll out, write, and print the runouts."""
    from geometry.scenes.scene import load_scene, scene_from_mapping
    from gns.data.scene_facts import start_of, with_known_water
    from pipeline.config import load_config
    from pipeline.files import ready_folder
    from pipeline.progress import Progress

    config = load_config(arguments.config, arguments.overrides)
    path = Path(arguments.scene)
    scene = load_scene(path / "scene.yaml" if path.is_dir() else path)
    if arguments.spacing is not None:
        document = {**scene.model_dump(), "spacing": arguments.spacing}
        scene = scene_from_mapping(document, f"{path} at --spacing {arguments.spacing:g}")
    duration = config.simulation.duration_s if arguments.duration is None else arguments.duration
    if not 0.0 < duration < math.inf:
        raise InputError(f"--duration {duration:g}: must be greater than 0 s, and finite")

    from gns.network.simulator import Simulator
    from gns.rollout.rollout import Rest, frames_of, rollout
    from gns.training.checkpoints import MODEL_FILE
    from gns.training.processes import check_device, use_threads
    from pipeline.places import MODELS, resolve

    check_device(arguments.device)
    use_threads(arguments.threads)
    simulator = Simulator.load(resolve(arguments.model, MODELS) / MODEL_FILE, arguments.device)
    thrust = simulator.config.thrust
    settings, left_out = with_known_water(scene, config.simulation, thrust=thrust)
    if left_out:
        print(f"warning: {left_out}", file=sys.stderr)
    facts, positions = start_of(scene, simulator.settings(settings))
    _say_distance(simulator.distance(positions, facts), arguments.anywhere)
    rest = None
    if settings.early_stop:
        rest = Rest(settings.early_stop_energy_fraction, settings.early_stop_hold_s)
    frames = frames_of(duration, facts)
    out = ready_folder(arguments.out, ["rollout.npz", "rollout.png"])
    with Progress(frames - 1, f"rolling out {scene.name}", quiet=arguments.quiet) as bar:
        result = rollout(
            simulator, facts, positions, frames, rest=rest, on_frame=lambda _: bar.advance()
        )
    for warning in result.outside:
        print(f"warning: {warning}", file=sys.stderr)
    save(result, out, scene.name)
    _print(result)
    if result.failed:
        raise WorkFailed(f"{scene.name}: {result.reason}; the frames before are kept")
    return 0


def _say_distance(away: float | None, anywhere: bool) -> None:
    """State how far the scene lies from the training; refuse it far outside."""
    from gns.data.distance import FARTHEST

    if away is None:
        return
    words = f"distance to the training: {away:.2f} (1: as its outermost scenes from each other)"
    if away > FARTHEST and not anywhere:
        raise InputError(f"{words}; beyond {FARTHEST:g} give --anywhere to roll out all the same")
    print(words)


def save(result: Rollout, folder: Path, name: str) -> None:
    """Write the frames and a picture."""
    import numpy as np

    from pipeline.files import atomic_path
    from report.pictures.packed_data import save_run_picture

    with atomic_path(folder / "rollout.npz") as temporary:
        np.savez(
            temporary,
            positions=result.positions,
            time=result.time,
            type=result.facts.type,
            zone=result.facts.zone,
        )
    if len(result.positions) < 2:
        print(f"wrote {folder / 'rollout.npz'}")
        return
    title = f"{name}, rollout: {len(result.positions)} frames, {result.time[-1]:.1f} s"
    save_run_picture(result, folder / "rollout.png", title)
    print(f"wrote {folder / 'rollout.npz'} and {folder / 'rollout.png'}")


def _print(result: Rollout) -> None:
    from geometry.sides import SIDES
    from gns.evaluation.metrics import runout
    from pipeline.table import aligned

    first, last = result.positions[0], result.positions[-1]
    rows = [["", "at t = 0, m", "at the end, m"]]
    for side in SIDES:
        values = [runout(one, first, result.facts, side) for one in (first, last)]
        rows.append([f"toe runout, {side}", *[f"{value:.2f}" for value in values]])
    print(aligned(rows))
    state = "at rest" if result.at_rest else "cut off in motion"
    print(
        f"{len(result.positions)} frames, {result.time[-1]:.1f} s, {state}; took "
        f"{result.wall_time_s:.1f} s"
    )
