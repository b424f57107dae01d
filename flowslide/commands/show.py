"""`flowslide show`: a scene, or a gallery of many, as a picture."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError, add_common

if TYPE_CHECKING:
    from geometry.scenes.scene import Scene

GALLERY_SIZE = 40
DESCRIPTION = (
    "Draw scene files or generated scenes into a picture: one scene with its materials, several "
    "as a gallery."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "scenes",
        nargs="*",
        metavar="SCENE",
        help="scene files, folders with a scene.yaml or with NNNNN.json files, or names of cases",
    )
    options.add_scale(parser, "show generated scenes of this scale instead of files")
    parser.add_argument(
        "--indices", metavar="I-J", help=f"with --scale; default: the first {GALLERY_SIZE}"
    )
    options.add_out(parser, options.PICTURE, metavar="FILE", required=True)
    parser.add_argument(
        "--points", action="store_true", help="draw the material points (one scene)"
    )
    parser.add_argument("--columns", type=int, default=5, help="of the gallery; default: 5")
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Draw."""
    from geometry.scenes3d.scene3d import is_body
    from report.pictures.scene import save_gallery, save_scene_picture

    if any(is_body(text) for text in arguments.scenes):
        _show_3d(arguments)
        return
    scenes = _chosen_scenes(arguments)
    if arguments.columns < 1:
        raise InputError(f"--columns {arguments.columns}: at least 1")
    if len(scenes) == 1:
        save_scene_picture(scenes[0], arguments.out, points=arguments.points)
    elif arguments.points:
        raise InputError(f"--points: for one scene, but there are {len(scenes)}")
    else:
        save_gallery(scenes, arguments.out, columns=arguments.columns)
    print(f"wrote {arguments.out}")


def _show_3d(arguments: argparse.Namespace) -> None:
    from geometry.scenes3d.scene3d import load_scene_3d
    from mpm_taichi.readings3d import maps_of
    from mpm_taichi.solver3d.problem import problem_of
    from report.simulation3d import draw_scene_3d

    if len(arguments.scenes) > 1 or arguments.points:
        raise InputError("scene3d.yaml: one scene at a time, and without --points")
    scene = load_scene_3d(arguments.scenes[0])
    draw_scene_3d(scene, maps_of(scene, problem_of(scene)), arguments.out)
    print(f"wrote {arguments.out}")


def _chosen_scenes(arguments: argparse.Namespace) -> list[Scene]:
    from flowslide.commands.runs.sample import chosen_indices
    from geometry.random_scenes.templates import draw_scene
    from geometry.scenes.scene import load_scene, scene_files
    from pipeline.config import load_config

    if bool(arguments.scenes) == bool(arguments.scale):
        raise InputError("give scene files, or --scale with --indices, but not both")
    if arguments.scenes:
        return [load_scene(path) for path in scene_files(arguments.scenes)]
    config = load_config(arguments.config, arguments.overrides)
    last = min(GALLERY_SIZE, config.scale(arguments.scale).number_of_scenes) - 1
    chosen = chosen_indices(config, arguments.scale, arguments.indices or f"0-{last}")
    return [draw_scene(config, arguments.scale, index) for index in chosen]
