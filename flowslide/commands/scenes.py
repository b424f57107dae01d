"""Commands about scenes: `python -m geometry sample|show|check|import`.

Each command is one `_add_...` function, which describes its options, and one handler.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from geometry.random_scenes.sketch import signed_area
from geometry.random_scenes.templates import draw_scene
from geometry.scenes.fill import fill
from geometry.scenes.polygon_checks import gaps
from geometry.scenes.scene import Scene, load_scene, save_scene, scene_text
from geometry.survey.measurements import FILE_NAME, Measurements, load_measurements
from pipeline.cli import InputError, add_common, base_parser
from pipeline.config import Config, load_config
from pipeline.files import make_folder
from pipeline.progress import Progress

GALLERY_SIZE = 40


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run one of the commands."""
    parser = base_parser("python -m geometry", "Draw, look at, check and import scenes.")
    commands = parser.add_subparsers(dest="command", required=True)
    for add in (_add_sample, _add_show, _add_check, _add_import):
        add(commands)
    arguments = parser.parse_args(argv)
    return arguments.handler(arguments)


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


# --- sample ---


def _add_sample(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "sample",
        help="draw scenes of a scale into a folder",
        description="Draw random scenes into DIR/NNNNN.json. A file that already holds the scene "
        "is left alone, so the command can be stopped and started again.",
    )
    parser.add_argument("--scale", required=True, help="name of a scale, for instance large")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the scene files")
    parser.add_argument("--indices", metavar="I-J", help="such as 0-99 or 0,5,7-9; default: all")
    add_common(parser)
    parser.set_defaults(handler=_sample)


def _sample(arguments: argparse.Namespace) -> None:
    config = load_config(arguments.config, arguments.overrides)
    indices = _indices(config, arguments.scale, arguments.indices)
    folder = make_folder(arguments.out)
    written, draws = 0, Counter()
    with Progress(len(indices), f"drawing {arguments.scale}", quiet=arguments.quiet) as progress:
        for index in indices:
            scene = draw_scene(config, arguments.scale, index)
            path = folder / f"{index:05d}.json"
            if not _holds(path, scene):
                save_scene(scene, path)
                written += 1
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


def _indices(config: Config, scale: str, text: str | None) -> list[int]:
    number = config.scale(scale).number_of_scenes
    indices = list(range(number)) if text is None else parse_indices(text)
    if indices[-1] >= number:
        raise InputError(f"--indices {indices[-1]}: scale {scale} has scenes 0 to {number - 1}")
    return indices


def _holds(path: Path, scene: Scene) -> bool:
    """Tell whether a file already is this scene, byte by byte."""
    try:
        return path.read_text(encoding="utf-8") == scene_text(scene, path.suffix)
    except (OSError, UnicodeDecodeError):
        return False


# --- show ---


def _add_show(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "show",
        help="draw a scene, or a gallery of many",
        description="Draw scene files or generated scenes into a picture: one scene with its "
        "materials, several as a gallery.",
    )
    _add_scene_files(parser, "?*")
    parser.add_argument("--scale", help="show generated scenes of this scale instead of files")
    parser.add_argument(
        "--indices", metavar="I-J", help=f"with --scale; default: the first {GALLERY_SIZE}"
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="png, svg or pdf")
    parser.add_argument(
        "--points", action="store_true", help="draw the material points (one scene)"
    )
    parser.add_argument("--columns", type=int, default=5, help="of the gallery; default: 5")
    add_common(parser)
    parser.set_defaults(handler=_show)


def _show(arguments: argparse.Namespace) -> None:
    from report.pictures.scene import save_gallery, save_scene_picture  # matplotlib takes its time

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


def _chosen_scenes(arguments: argparse.Namespace) -> list[Scene]:
    if bool(arguments.scenes) == bool(arguments.scale):
        raise InputError("give scene files, or --scale with --indices, but not both")
    if arguments.scenes:
        return [load_scene(path) for path in scene_files(arguments.scenes)]
    config = load_config(arguments.config, arguments.overrides)
    last = min(GALLERY_SIZE, config.scale(arguments.scale).number_of_scenes) - 1
    chosen = _indices(config, arguments.scale, arguments.indices or f"0-{last}")
    return [draw_scene(config, arguments.scale, index) for index in chosen]


# --- check ---


def _add_check(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "check",
        help="check scene files, or cases, and print what they hold",
        description="Check scene files, and in the folder of a case its measurements as well. The "
        "first one that is not valid ends the command with one line and exit code 2.",
    )
    _add_scene_files(parser, "+")
    parser.add_argument("--quiet", action="store_true", help="print the sum only")
    parser.set_defaults(handler=_check)


def _check(arguments: argparse.Namespace) -> None:
    paths = scene_files(arguments.scenes)
    points_in_all, draws, worst = 0, 0, 0.0
    for number, path in enumerate(paths):
        scene = load_scene(path)
        measurements = _measurements_beside(path, scene)
        points = fill(scene)
        area = sum(abs(signed_area(zone.polygon)) for zone in scene.zones)
        missed = len(points) * points.volume / area - 1.0
        worst = max(worst, abs(missed))
        points_in_all += len(points)
        draws += scene.origin.draws if scene.origin else 0
        if arguments.quiet:
            continue
        if number == 0:
            print(f"{'scene':<24}{'zones':>6}{'points':>8}{'area m2':>10}{'filled':>9}{'draws':>7}")
        drawn = scene.origin.draws if scene.origin else "-"
        filled = f"{100.0 * (1.0 + missed):.2f} %"
        print(
            f"{scene.name:<24}{len(scene.zones):>6}{len(points):>8}{area:>10.1f}{filled:>9}{drawn:>7}"
        )
        _print_gaps(scene)
        if measurements is not None:
            _print_measurements(measurements)
    print(
        f"{len(paths)} valid, {points_in_all} points, filled to within {100.0 * worst:.2f} % of "
        "the area" + (f", {draws} draws" if draws else "")
    )


def _measurements_beside(path: Path, scene: Scene) -> Measurements | None:
    """The measurements of the case whose scene this is, checked against it; None: no case."""
    if path.name != "scene.yaml" or not (path.parent / FILE_NAME).is_file():
        return None
    return load_measurements(path.parent, scene)


def _print_measurements(measurements: Measurements) -> None:
    for name, entries in measurements.sets.items():
        numbers = sum(len(entry.values) for entry in entries)
        held = sum(int(entry.held_out_values.sum()) for entry in entries)
        drawn = sum(len(entry.values) for entry in entries if entry.constructed)
        kinds = ", ".join(f"{entry.name} ({entry.type})" for entry in entries)
        print(
            f"  measurements {name!r}: {numbers} values, {held} held out, {drawn} constructed: "
            f"{kinds}"
        )


def _print_gaps(scene: Scene) -> None:
    found = gaps({zone.name: zone.polygon for zone in scene.zones}, scene.spacing)
    for area, (x, y) in found[:5]:
        print(f"  gap of {area:.3g} m2 between zones at ({x:.2f}, {y:.2f})")
    if len(found) > 5:
        print(f"  and {len(found) - 5} smaller gaps")


# --- import ---


def _add_import(commands: argparse._SubParsersAction) -> None:
    from geometry.scenes.drawings import FORMATS, UNITS

    parser = commands.add_parser(
        "import",
        help="make a scene of a drawn section",
        description=f"Make a scene of a section ({', '.join(FORMATS)}). Zones are closed outlines, "
        "named by the column zone, the property name or the layer; the names ground and water mark "
        "the base and the water table.",
    )
    parser.add_argument("section", metavar="SECTION", help="the drawing")
    parser.add_argument("--out", required=True, metavar="FILE", help="scene file, .yaml or .json")
    parser.add_argument("--materials", metavar="FILE", help="YAML with the fields of each material")
    parser.add_argument(
        "--spacing", type=float, default=1.0, help="of material points, m; default 1"
    )
    parser.add_argument("--name", help="of the scene; default: the name of the drawing")
    parser.add_argument(
        "--unit", choices=tuple(UNITS), help="of the drawing; default: its own, or m"
    )
    parser.add_argument(
        "--snap", type=float, default=0.0, metavar="M", help="make one of vertices nearer than M m"
    )
    parser.set_defaults(handler=_import)


def _import(arguments: argparse.Namespace) -> None:
    from geometry.scenes.drawings import read_materials, read_section, section_scene

    if not arguments.spacing > 0:
        raise InputError(f"--spacing {arguments.spacing:g}: must be greater than 0")
    if not arguments.snap >= 0:
        raise InputError(f"--snap {arguments.snap:g}: must be at least 0")
    _check_scene_suffix(arguments.out)
    scene = section_scene(
        read_section(arguments.section),
        source=arguments.section,
        name=arguments.name or Path(arguments.section).stem,
        spacing=arguments.spacing,
        unit=arguments.unit,
        materials=read_materials(arguments.materials) if arguments.materials else None,
        snap=arguments.snap,
    )
    save_scene(scene, arguments.out)
    print(f"wrote {arguments.out}: {len(scene.zones)} zones, {len(fill(scene))} points")
    _print_gaps(scene)


def _check_scene_suffix(path: str) -> None:
    if Path(path).suffix.lower() not in (".json", ".yaml", ".yml"):
        raise InputError(f"--out {path}: scene files end in .yaml or .json")


# --- shared ---


def _add_scene_files(parser: argparse.ArgumentParser, number: str) -> None:
    parser.add_argument(
        "scenes",
        nargs="*" if number == "?*" else number,
        metavar="SCENE",
        help="scene files, or folders with a scene.yaml or with NNNNN.json files",
    )


def scene_files(paths: Iterable[str]) -> list[Path]:
    """Files of scenes: those given, and those in given folders."""
    found: list[Path] = []
    for text in paths:
        path = Path(text)
        if not path.is_dir():
            found.append(path)
        elif (path / "scene.yaml").is_file():
            found.append(path / "scene.yaml")
        else:
            inside = sorted(path.glob("*.json"))
            if not inside:
                raise InputError(
                    f"{path}: the folder holds no scene.yaml and no scene file (.json)"
                )
            found.extend(inside)
    return found
