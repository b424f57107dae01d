"""`flowslide scenes sample`: random scenes of a scale."""

from __future__ import annotations

import argparse
from collections import Counter
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError, add_common

if TYPE_CHECKING:
    from pathlib import Path

    from geometry.scenes.scene import Scene
    from pipeline.config import Config

DESCRIPTION = (
    "Draw random scenes into DIR/NNNNN.json. A file that already holds the scene is left alone, "
    "so the command can be stopped and started again."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    options.add_scale(parser, "name of a scale, for instance large", required=True)
    options.add_out(parser, "folder of the scene files", required=True)
    parser.add_argument("--indices", metavar="I-J", help="such as 0-99 or 0,5,7-9; default: all")
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Draw those that are not there yet."""
    from geometry.random_scenes.templates import draw_scene
    from geometry.scenes.scene import save_scene
    from pipeline.config import load_config
    from pipeline.files import make_folder
    from pipeline.progress import Progress

    config = load_config(arguments.config, arguments.overrides)
    indices = chosen_indices(config, arguments.scale, arguments.indices)
    folder = make_folder(arguments.out)
    written, draws = 0, Counter[str]()
    with Progress(len(indices), f"drawing {arguments.scale}", quiet=arguments.quiet) as progress:
        for index in indices:
            scene = draw_scene(config, arguments.scale, index)
            path = folder / f"{index:05d}.json"
            if not _holds(path, scene):
                save_scene(scene, path)
                written += 1
            if scene.origin is not None:
                draws[scene.origin.template] += scene.origin.draws - 1
            progress.advance()
    again = sum(draws.values())
    by_template = ", ".join(
        f"({letter}) {count}" for letter, count in sorted(draws.items()) if count
    )
    print(
        f"{len(indices)} scenes in {folder}: {written} written, {len(indices) - written} already "
        f"there; {again} draws given up as not valid{f': {by_template}' if by_template else ''}"
    )


def parse_indices(text: str) -> list[int]:
    """Turn "0-3,7" into [0, 1, 2, 3, 7]."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdigit() or (dash and not last.isdigit()):
            raise InputError(f"--indices {text}: must look like 0-99 or 0,5,7-9")
        low, high = int(first), int(last or first)
        if high < low:
            raise InputError(f"--indices {text}: {part.strip()} runs backwards")
        found.extend(range(low, high + 1))
    return sorted(set(found))


def chosen_indices(config: Config, scale: str, text: str | None) -> list[int]:
    """The scenes of a scale that `--indices` names; None: all."""
    number = config.scale(scale).number_of_scenes
    indices = list(range(number)) if text is None else parse_indices(text)
    if indices[-1] >= number:
        raise InputError(f"--indices {indices[-1]}: scale {scale} has scenes 0 to {number - 1}")
    return indices


def _holds(path: Path, scene: Scene) -> bool:
    """Whether a file already is this scene, byte by byte."""
    from geometry.scenes.scene import scene_text

    try:
        return path.read_text(encoding="utf-8") == scene_text(scene, path.suffix)
    except (OSError, UnicodeDecodeError):
        return False
