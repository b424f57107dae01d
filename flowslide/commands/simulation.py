"""Commands: `python -m mpm_taichi run|case|show|export|status|effects`.

Each command is one `_add_...` function, which describes its options, and one handler, which does
the work; `COMMANDS` lists them.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path

from mpm_taichi.batch import BatchResult, run_batch
from mpm_taichi.effects import add_effects_command, add_effects_option, load_given_effects
from mpm_taichi.trajectory import RunSummary, group_name, list_runs, read_run
from pipeline.cli import InputError, WorkFailed, add_common, base_parser
from pipeline.config import Config, SimulationSettings, load_config
from pipeline.files import atomic_path
from pipeline.out_folder import ready_folder
from pipeline.progress import Progress
from pipeline.table import aligned

SHOW_FIELDS = ("positions", "time", "material", "velocity", "plastic_shear_strain")


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run one of the commands; the exit code is None or 0 for success."""
    parser = base_parser(
        "python -m mpm_taichi", "Simulate scenes by the material point method, look at the results."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    for add in COMMANDS:
        add(commands)
    arguments = parser.parse_args(argv)
    return arguments.handler(arguments)


# --- run ---


def _add_run(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "run",
        help="simulate scenes into a trajectory file",
        description="Simulate scenes into one trajectory file. Started again after a kill, it "
        "keeps the runs that were finished.",
    )
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help="scene files, or folders with a scene.yaml"
    )
    parser.add_argument("--scale", help="simulate generated scenes of this scale instead")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--batch", type=int, metavar="B", help="number of the batch of --scale")
    which.add_argument("--index", type=int, metavar="N", help="one scene of --scale alone")
    parser.add_argument(
        "--scenes",
        dest="scene_folder",
        metavar="DIR",
        help="read the scenes of --scale from DIR/NNNNN.json; without it they are drawn afresh",
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the trajectory file")
    add_solver_options(parser)
    add_common(parser)
    parser.set_defaults(handler=_run)


def add_solver_options(parser: argparse.ArgumentParser) -> None:
    """Add `--device`, `--threads` and `--group`, the options of every command that simulates."""
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="default: cpu")
    parser.add_argument("--threads", type=_positive, help="CPU threads; default: all")
    parser.add_argument(
        "--group", type=_positive, metavar="N", help="scenes in memory at once (not in the results)"
    )
    add_effects_option(parser)


def _run(arguments: argparse.Namespace) -> None:
    load_given_effects(arguments)
    config = load_config(arguments.config, arguments.overrides)
    scenes, settings, name = _chosen_scenes(arguments, config)
    label = f"simulating {name}"
    with Progress(len(scenes), label, quiet=arguments.quiet) as progress:

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
) -> tuple[dict, SimulationSettings, str]:
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
        numbers, name = [arguments.index], f"{arguments.scale}_{arguments.index:05d}"
    elif arguments.batch is not None:
        numbers, name = scale.batch_indices(arguments.batch), f"batch_{arguments.batch:03d}"
    else:
        raise InputError(
            f"--scale {arguments.scale}: needs --batch (0 to {scale.number_of_batches - 1}) or "
            f"--index (0 to {scale.number_of_scenes - 1})"
        )
    settings = config.simulation_for(arguments.scale)
    return {n: _generated(arguments, config, n) for n in numbers}, settings, name


def _generated(arguments: argparse.Namespace, config: Config, index: int):  # noqa: ANN202
    if arguments.scene_folder is not None:
        return _load(Path(arguments.scene_folder) / f"{index:05d}.json")
    from geometry.random_scenes.templates import draw_scene

    return draw_scene(config, arguments.scale, index)


def _load(path: Path):  # noqa: ANN202
    from geometry.scenes.scene import load_scene

    return load_scene(path / "scene.yaml" if path.is_dir() else path)


def failure_line(run: RunSummary) -> str:
    """One line that names a failed run: number, scene, seed, time, reason."""
    return (
        f"failed: run {run.index} ({run.scene}, seed {run.seed}) at {run.duration_s:.3g} s: "
        f"{run.reason}"
    )


def _report(result: BatchResult) -> str:
    size = result.path.stat().st_size
    lines = [f"{result.path}: {totals(result.runs)}, {size / len(result.runs) / 1e6:.2f} MB a run"]
    if result.reused:
        lines.append(f"{result.reused} of the runs were there already")
    return "\n".join(lines)


def totals(runs: Sequence[RunSummary]) -> str:
    """Runs, failures, speed, in a few words."""
    failed = sum(run.status == "failed" for run in runs)
    work = sum(run.points * run.steps for run in runs)
    seconds = sum(run.wall_time_s for run in runs)
    rate = f", {work / seconds / 1e6:.1f} million point-steps/s" if seconds > 0 else ""
    return f"{len(runs)} runs, {failed} failed{rate}"


# --- case ---


def _add_case(commands: argparse._SubParsersAction) -> None:
    from mpm_taichi.case import FILMS

    parser = commands.add_parser(
        "case",
        help="simulate a case history and compare it with what was measured",
        description="Simulate the section of a case history, write runout.png, a film and "
        "observables.csv, and print what was measured beside what was simulated.",
    )
    parser.add_argument(
        "folder", metavar="FOLDER", help="folder with scene.yaml and measurements.yaml"
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the results")
    parser.add_argument("--no-water", action="store_true", help="without reservoir and groundwater")
    parser.add_argument(
        "--spacing", type=float, metavar="M", help="distance between material points [m]"
    )
    parser.add_argument(
        "--strength",
        type=_strength,
        action="append",
        default=[],
        metavar="MATERIAL=KPA",
        help="cohesion of a material, which is S_r where it liquefied; may be repeated",
    )
    parser.add_argument(
        "--set-of-measurements", metavar="NAME", help="of measurements.yaml; default: as it says"
    )
    parser.add_argument("--film", choices=FILMS, default="mp4", help="default: mp4")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="default: cpu")
    parser.add_argument("--threads", type=_positive, help="CPU threads; default: all")
    add_effects_option(parser)
    add_common(parser)
    parser.set_defaults(handler=_case)


def _case(arguments: argparse.Namespace) -> None:
    from mpm_taichi import case as history
    from report.pictures.video import check_video

    load_given_effects(arguments)
    settings = load_config(arguments.config, arguments.overrides).simulation
    case = history.load_case(
        arguments.folder,
        water=not arguments.no_water,
        spacing=arguments.spacing,
        strengths=dict(arguments.strength),
        measurement_set=arguments.set_of_measurements,
    )
    out = Path(arguments.out)
    film = None if arguments.film == "none" else out / f"runout.{arguments.film}"
    if film is not None:
        check_video(film)
    files = ["runout.png", "observables.csv"]
    ready_folder(out, files if film is None else [*files, film.name])
    seconds = max(round(settings.duration_s), 1)
    with Progress(
        seconds, f"simulating {case.title}, s of motion", quiet=arguments.quiet
    ) as progress:
        run = history.simulate_case(
            case,
            settings,
            device=arguments.device,
            threads=arguments.threads,
            on_time=lambda time: progress.advance(max(min(int(time), seconds) - progress.done, 0)),
        )
        progress.advance(seconds - progress.done, note=f"ended at {run.time[-1]:.1f} s")
    readings = history.read_deposit(case, run)
    _write_case(case, run, readings, out, film)
    print(history.heading(case, run), history.table(case, readings), sep="\n\n")
    print(history.energy_line(run))
    print(f"Picture: {out / 'runout.png'}; numbers: {out / 'observables.csv'}", end="")
    print(f"; film: {film}" if film else "")


def _write_case(case, run, readings, out: Path, film: Path | None) -> None:  # noqa: ANN001
    from mpm_taichi.case import write_observables
    from report.pictures.case_history import save_case_film, save_case_picture

    save_case_picture(case, run, readings, out / "runout.png")
    if film is not None:
        save_case_film(case, run, film)
    write_observables(out / "observables.csv", readings)


def _strength(text: str) -> tuple[str, float]:
    """`clay_core=30` -> ("clay_core", 30.0)."""
    name, separator, value = text.partition("=")
    try:
        cohesion = float(value)
    except ValueError:
        cohesion = -1.0
    if not separator or not name or not 0.0 <= cohesion < float("inf"):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not MATERIAL=KPA with a cohesion of at least 0, such as clay_core=30"
        )
    return name, cohesion


# --- show ---


def _add_show(commands: argparse._SubParsersAction) -> None:
    from report.pictures.colouring import COLOURS

    parser = commands.add_parser("show", help="draw a run: picture (png, svg, pdf) or mp4, gif")
    parser.add_argument("file", metavar="FILE[:RUN]", help="trajectory file and number of the run")
    parser.add_argument("--out", required=True, help="file to write; its suffix says what")
    parser.add_argument("--colour", choices=COLOURS, default="displacement")
    parser.add_argument(
        "--times", type=_numbers, metavar="S,S,...", help="moments of a picture [s]; default: end"
    )
    parser.add_argument(
        "--frames", type=_positive, default=150, help="most frames of an animation; default: 150"
    )
    parser.set_defaults(handler=_show)


def _show(arguments: argparse.Namespace) -> None:
    from report.pictures import simulated_run  # matplotlib takes its time

    path, index = _one_run(arguments.file)
    run = read_run(path, index, SHOW_FIELDS)
    out = Path(arguments.out)
    if out.suffix in simulated_run.VIDEO_SUFFIXES:
        if arguments.times is not None:
            raise InputError(f"--times: is for pictures, and {out} is an animation")
        simulated_run.save_animation(run, out, colour=arguments.colour, frames=arguments.frames)
    else:
        simulated_run.save_picture(run, out, colour=arguments.colour, times=arguments.times)
    print(f"wrote {out}")


# --- export ---


def _add_export(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "export", help="write runs for ParaView (vtkhdf) or as tables (csv)"
    )
    parser.add_argument(
        "file", metavar="FILE[:RUN]", help="trajectory file; with several runs, --out is a folder"
    )
    parser.add_argument("--format", choices=("vtkhdf", "csv"), required=True)
    parser.add_argument("--out", required=True, help="file to write, or folder for several runs")
    parser.add_argument(
        "--times",
        type=_numbers,
        metavar="S,S,...",
        help="csv only: positions at these moments [s] instead of the whole state at the end",
    )
    parser.set_defaults(handler=_export)


def _export(arguments: argparse.Namespace) -> None:
    from mpm_taichi.export import export_csv, export_vtkhdf

    if arguments.format == "vtkhdf" and arguments.times is not None:
        raise InputError("--times: is for --format csv; a vtkhdf file holds every frame")
    path, index = _split(arguments.file)
    indices = [run.index for run in list_runs(path)] if index is None else [index]
    for number in indices:
        out = Path(arguments.out)
        if len(indices) > 1:
            out = out / f"{group_name(number)}.{arguments.format}"
        run = read_run(path, number)
        if len(indices) > 1 and run.frames == 0:
            print(f"{group_name(number)}: no frames ({run.reason})", file=sys.stderr)
            continue
        if arguments.format == "vtkhdf":
            export_vtkhdf(run, out)
        else:
            export_csv(run, out, times=arguments.times)
        print(f"wrote {out}")


# --- status ---


def _add_status(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser("status", help="list the runs of trajectory files and failures")
    parser.add_argument("files", nargs="+", metavar="FILE")
    parser.add_argument(
        "--csv", metavar="FILE", help="write the list there; then only the failures are printed"
    )
    parser.set_defaults(handler=_status)


def _status(arguments: argparse.Namespace) -> None:
    listed = [(path, run) for path in arguments.files for run in list_runs(path)]
    runs = [run for _, run in listed]
    if arguments.csv is not None:
        write_runs_table(Path(arguments.csv), listed)
    else:
        print(_table(runs))
    for run in runs:
        if run.status == "failed":
            print(failure_line(run))
    print(totals(runs))


def write_runs_table(path: Path, runs: Sequence[tuple[str, RunSummary]]) -> None:
    """Write (trajectory file, run) rows as CSV, one column a field of `RunSummary`."""
    names = [field.name for field in fields(RunSummary) if field.name != "key"]
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["file", *names])
        for source, run in runs:
            values = (getattr(run, name) for name in names)
            texts = [f"{value:.6g}" if isinstance(value, float) else value for value in values]
            writer.writerow([source, *texts])


def _table(runs: Sequence[RunSummary]) -> str:
    """The runs as text, columns aligned."""
    heading = [
        "run",
        "scene",
        "points",
        "steps",
        "motion s",
        "wall s",
        "Mps/s",
        "left m",
        "right m",
    ]
    rows = [
        [
            str(run.index),
            run.scene,
            str(run.points),
            str(run.steps),
            f"{run.duration_s:.1f}",
            f"{run.wall_time_s:.2f}",
            f"{run.point_steps_per_s / 1e6:.1f}",
            f"{run.travel_left_m:.1f}",
            f"{run.travel_right_m:.1f}",
            f"{run.status} {'(wall ' + run.wall_contact + ')' if run.wall_contact else ''}".strip(),
        ]
        for run in runs
    ]
    return aligned([[*heading, "status"], *rows], left={1, len(heading)})


# --- arguments ---


def _split(text: str) -> tuple[str, int | None]:
    """`FILE:12` -> ("FILE", 12); `FILE` -> ("FILE", None)."""
    found = re.fullmatch(r"(.+):(?:run_)?(\d+)", text)
    return (found[1], int(found[2])) if found else (text, None)


def _one_run(text: str) -> tuple[str, int]:
    """The run that `FILE[:RUN]` names; the number may be left out if there is one run only."""
    path, index = _split(text)
    if index is not None:
        return path, index
    indices = [run.index for run in list_runs(path)]
    if len(indices) > 1:
        raise InputError(
            f"{path}: holds {len(indices)} runs; name one of {indices[0]} to {indices[-1]}, "
            f"for instance {path}:{indices[0]}"
        )
    return path, indices[0]


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: numbers with commas between, 0,5,20") from None


COMMANDS: tuple[Callable[[argparse._SubParsersAction], None], ...] = (
    _add_run,
    _add_case,
    _add_show,
    _add_export,
    _add_status,
    add_effects_command,
)
